//! ProtoDeclare, ExternProtoDeclare, and what only instances and bodies of prototypes have.

use super::{
    Reader,
    tree::{Entry, Tree},
};
use crate::import::x3d::{
    limits::MAX_DEPTH,
    literal::shown,
    syntax::{FieldItem, InterfaceItem, Item, ProtoBody, ProtoItem, Span, SyntaxError, Written},
    table::Access,
    value::FieldType,
};
use std::rc::Rc;

impl Reader<'_> {
    /// A declaration of a prototype.
    pub(super) fn proto(&mut self, entry: &Entry<'_>, tree: &Tree<'_>, depth: u16) -> Result<Item, SyntaxError> {
        let place = entry.place;
        if depth >= MAX_DEPTH {
            return Err(SyntaxError { place, message: format!("more than {MAX_DEPTH} nodes and prototypes inside one another") });
        }
        let name = self.required(entry, tree, "@name")?;
        let fields = |tree: &Tree<'_>| tree.get("field").is_some();
        let (interface, body) = if entry.key == "ExternProtoDeclare" {
            let Some(Tree::Text(range)) = tree.get("@url").map(|e| &e.tree) else {
                return Err(SyntaxError { place, message: "`ExternProtoDeclare` has no `@url`".to_owned() });
            };
            let address = FieldItem::new(place, "url", Written::Text(Span::Range(range.clone())));
            (Some(tree).filter(|t| fields(t)), ProtoBody::Extern(address))
        } else {
            let mut items = vec![];
            for part in tree.get("ProtoBody").map_or(&[][..], |b| b.tree.entries()) {
                match part.key.strip_prefix('-') {
                    Some(_) => self.list(&part.tree, &mut items, depth + 1)?,
                    None => self.item(part, &mut items, depth + 1)?,
                }
            }
            (tree.get("ProtoInterface").map(|e| &e.tree).filter(|t| fields(t)), ProtoBody::Items(items))
        };
        let interface = interface.map_or(Ok(vec![]), |tree| self.interface(tree, depth))?;
        Ok(Item::Proto(Rc::new(ProtoItem { place, name, interface, body })))
    }

    fn interface(&mut self, tree: &Tree<'_>, depth: u16) -> Result<Vec<InterfaceItem>, SyntaxError> {
        let Some(entry) = tree.get("field") else { return Ok(vec![]) };
        let mut interface = vec![];
        for field in entry.tree.elements() {
            let place = field.entries().first().map_or(entry.place, |e| e.place);
            let of = |key: &str| self.required(entry, field, key);
            let (name, access, ty) = (of("@name")?, of("@accessType")?, of("@type")?);
            let fail = |message: String| Err(SyntaxError { place, message });
            let Some(access) = Access::parse(&access) else { return fail(format!("`{}` is no access type", shown(&access))) };
            let Some(ty) = FieldType::parse(&ty) else { return fail(format!("`{}` is no type of fields", shown(&ty))) };
            let given = access.has_value() && field.entries().iter().any(|e| e.key == "@value" || e.key.starts_with('-'));
            let value = if given { Some(self.field_value(entry, field, depth)?) } else { None };
            interface.push(InterfaceItem { place, name, access, ty, value });
        }
        Ok(interface)
    }

    /// The name and the value of a `field` or a `fieldValue`.
    pub(super) fn field_value(&mut self, entry: &Entry<'_>, tree: &Tree<'_>, depth: u16) -> Result<FieldItem, SyntaxError> {
        let name = self.required(entry, tree, "@name")?;
        if let Some(Entry { place, tree: Tree::Text(range), .. }) = tree.get("@value") {
            return Ok(FieldItem::new(*place, name, Written::Text(Span::Range(range.clone()))));
        }
        let mut items = vec![];
        for nodes in tree.entries().iter().filter(|e| e.key.starts_with('-')) {
            self.list(&nodes.tree, &mut items, depth + 1)?;
        }
        let place = tree.entries().first().map_or(entry.place, |e| e.place);
        Ok(FieldItem::new(place, name, Written::Nodes(items)))
    }

    /// The connections of an `IS`.
    pub(super) fn connections(&mut self, tree: &Tree<'_>, body: &mut Vec<Item>) -> Result<(), SyntaxError> {
        let Some(entry) = tree.get("connect") else { return Ok(()) };
        for connect in entry.tree.elements() {
            let (field, proto) = (self.required(entry, connect, "@nodeField")?, self.required(entry, connect, "@protoField")?);
            let place = connect.entries().first().map_or(entry.place, |e| e.place);
            body.push(Item::Field(FieldItem::new(place, field, Written::Is(proto))));
        }
        Ok(())
    }
}
