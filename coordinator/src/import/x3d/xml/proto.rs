//! ProtoDeclare, ExternProtoDeclare, and what only instances and bodies of prototypes have.

use super::{Reader, is};
use crate::import::x3d::{
    limits::MAX_DEPTH,
    literal::shown,
    syntax::{FieldItem, InterfaceItem, Item, ProtoBody, ProtoItem, Span, SyntaxError, Written},
    table::Access,
    value::{FieldType, Store},
};
use roxmltree::Node;
use std::rc::Rc;

impl Reader<'_> {
    /// A declaration of a prototype.
    pub(super) fn proto(&mut self, node: Node<'_, '_>, depth: u16) -> Result<Item, SyntaxError> {
        if depth >= MAX_DEPTH {
            return Err(self.error(node, format!("more than {MAX_DEPTH} nodes and prototypes inside one another")));
        }
        let place = self.place(node);
        let name = self.required(node, "name")?;
        let external = node.tag_name().name() == "ExternProtoDeclare";
        let mut interface = vec![];
        let mut items = vec![];
        let address = node.attributes().find(|a| a.name() == "url").map(|a| self.attribute(&a, "url"));
        let body = if external {
            let Some(url) = address else { return Err(self.error(node, "`ExternProtoDeclare` has no attribute `url`".to_owned())) };
            self.interface(node, &mut interface, depth)?;
            ProtoBody::Extern(url)
        } else {
            for child in node.children().filter(Node::is_element) {
                if is(child, "ProtoInterface") {
                    self.interface(child, &mut interface, depth)?;
                } else if is(child, "ProtoBody") {
                    self.items(child, &mut items, depth + 1)?;
                }
            }
            ProtoBody::Items(items)
        };
        Ok(Item::Proto(Rc::new(ProtoItem { place, name, interface, body })))
    }

    fn interface(&mut self, parent: Node<'_, '_>, interface: &mut Vec<InterfaceItem>, depth: u16) -> Result<(), SyntaxError> {
        for field in parent.children().filter(|n| is(*n, "field")) {
            let place = self.place(field);
            let (name, access, ty) = (self.required(field, "name")?, self.required(field, "accessType")?, self.required(field, "type")?);
            let Some(access) = Access::parse(&access) else {
                return Err(self.error(field, format!("`{}` is no access type", shown(&access))));
            };
            let Some(ty) = FieldType::parse(&ty) else {
                return Err(self.error(field, format!("`{}` is no type of fields", shown(&ty))));
            };
            let value =
                if ty.store() == Store::Nodes || field.has_attribute("value") { Some(self.field_value(field, depth)?) } else { None };
            interface.push(InterfaceItem { place, name, access, ty, value: value.filter(|_| access.has_value()) });
        }
        Ok(())
    }

    /// The name and the value of a `field` or a `fieldValue`: an attribute, or nodes inside it.
    pub(super) fn field_value(&mut self, node: Node<'_, '_>, depth: u16) -> Result<FieldItem, SyntaxError> {
        let place = self.place(node);
        let name = self.required(node, "name")?;
        if let Some(value) = node.attributes().find(|a| a.name() == "value") {
            return Ok(self.attribute(&value, &name));
        }
        if !node.children().any(|n| n.is_element()) && node.children().any(|n| n.is_text()) {
            return Ok(FieldItem::new(place, name, Written::Text(Span::Owned(node.text().unwrap_or_default().into()))));
        }
        let mut items = vec![];
        self.items(node, &mut items, depth + 1)?;
        Ok(FieldItem::new(place, name, Written::Nodes(items)))
    }

    /// The `connect` elements of an `IS`.
    pub(super) fn connections(&mut self, node: Node<'_, '_>, body: &mut Vec<Item>) -> Result<(), SyntaxError> {
        for connect in node.children().filter(|n| is(*n, "connect")) {
            let place = self.place(connect);
            let (field, proto) = (self.required(connect, "nodeField")?, self.required(connect, "protoField")?);
            body.push(Item::Field(FieldItem::new(place, field, Written::Is(proto))));
        }
        Ok(())
    }
}
