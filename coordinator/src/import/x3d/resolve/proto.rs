//! Prototypes: declared, found again, brought from other files, instantiated.
//!
//! An instance is its first node: the body is walked anew with the instance's values where it says IS, and what stands beside the first
//! node (interpolators, as a rule) is there for the events only. The alternative, a node that points at a body with holes, would have
//! every reader of the document fill the holes.

use super::{
    Resolver,
    frame::{Argument, Connected, Connections, Frame, Target},
    node::{in_radians, stands_for},
};
use crate::import::x3d::{
    document::{NodeId, Place},
    limits::{INSTANCE_STEPS, MAX_PROTO_DEPTH},
    literal::{shown, shown_addresses},
    syntax::{FieldItem, File, Item, NodeItem, ProtoBody, ProtoItem, Written},
    table::Field,
    value::{Base, Value},
};
use std::{collections::BTreeMap, rc::Rc, sync::Arc};

/// The prototypes declared in one file or one instance.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// The scope around it, and how many of that one's declarations it sees.
    parent: Option<(usize, usize)>,
    declared: usize,
    /// By name: the number of the declaration, and the prototype.
    names: BTreeMap<Box<str>, Vec<(usize, usize)>>,
}

/// Where the search for an external prototype stands.
#[derive(Debug, Clone, Copy)]
enum External {
    Unsought,
    Sought,
    Found(usize),
}

/// A declared prototype.
#[derive(Debug)]
pub(super) struct Prototype {
    item: Rc<ProtoItem>,
    file: Rc<File>,
    length: f64,
    angle: f32,
    /// Where it was declared, and the number of the declaration: it sees those before it.
    scope: (usize, usize),
    arguments: Rc<BTreeMap<Box<str>, Argument>>,
    external: External,
}

impl Prototype {
    pub(super) fn is_external(&self) -> bool {
        matches!(self.item.body, ProtoBody::Extern(_))
    }
}

/// The prototypes of a file that was read for them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Library {
    scope: usize,
    /// Its first prototype, which an address without a name means.
    first: Option<usize>,
}

impl Resolver<'_> {
    /// A new scope inside another.
    pub(super) fn scope(&mut self, parent: Option<(usize, usize)>) -> usize {
        self.scopes.push(Scope { parent, ..Scope::default() });
        self.scopes.len() - 1
    }

    /// Declares a prototype; the defaults of its fields are of the names here.
    pub(super) fn declare(&mut self, frame: &mut Frame, item: &Rc<ProtoItem>) {
        let mut arguments = BTreeMap::new();
        for field in &item.interface {
            let value = field.value.as_ref().and_then(|value| {
                let what = format!("the field `{}` of the prototype `{}`", shown(&field.name), shown(&item.name));
                match &value.written {
                    Written::Nodes(nodes) if field.ty.base == Base::Node => Some(Value::Nodes(self.items(frame, nodes, 1).into())),
                    Written::Is(_) => None,
                    _ => self.simple(frame, value, field.ty, false, &what),
                }
            });
            arguments.insert(field.name.clone(), Argument { ty: field.ty, access: field.access, place: field.place, value });
        }
        let index = self.prototypes.len();
        let scope = &mut self.scopes[frame.scope];
        let number = scope.declared;
        scope.declared += 1;
        scope.names.entry(item.name.clone()).or_default().push((number, index));
        self.prototypes.push(Prototype {
            item: Rc::clone(item),
            file: Rc::clone(&frame.file),
            length: frame.length,
            angle: frame.angle,
            scope: (frame.scope, number),
            arguments: Rc::new(arguments),
            external: External::Unsought,
        });
    }

    /// The prototype that a name means in a scope.
    pub(super) fn prototype(&self, scope: usize, name: &str) -> Option<usize> {
        let mut at = (scope, usize::MAX);
        loop {
            let scope = &self.scopes[at.0];
            let seen = scope.names.get(name).and_then(|list| list.iter().rev().find(|(number, _)| *number < at.1));
            if let Some((_, index)) = seen {
                return Some(*index);
            }
            at = scope.parent?;
        }
    }

    /// An instance of a prototype.
    pub(super) fn instance(&mut self, frame: &mut Frame, item: &NodeItem, prototype: usize, above: u16) -> Option<NodeId> {
        let Some(prototype) = self.definition(prototype) else {
            self.unknown(frame, item, Some(prototype), above);
            return None;
        };
        if self.instancing.contains(&prototype) || self.instancing.len() >= MAX_PROTO_DEPTH {
            let deep =
                if self.instancing.contains(&prototype) { "inside itself".into() } else { format!("{MAX_PROTO_DEPTH} deep in others") };
            self.error(item.place, format!("the prototype `{}` is used {deep}", shown(&item.name)));
            return None;
        }
        if !self.steps(item.place, INSTANCE_STEPS) {
            return None;
        }
        let (arguments, outer) = self.arguments(frame, item, prototype, above);
        let Prototype { item: declared, file, length, angle, scope, .. } = &self.prototypes[prototype];
        let (declared, length, angle, scope) = (Rc::clone(declared), *length, *angle, *scope);
        let connected = |a: &Argument| Connected { ty: a.ty, access: a.access, fields: vec![] };
        let connections = arguments.iter().map(|(name, a)| (name.clone(), connected(a))).collect();
        let mut inner = Frame {
            file: Rc::clone(file),
            length,
            angle,
            scope: self.scope(Some(scope)),
            names: BTreeMap::new(),
            arguments: Some(arguments),
            connections,
            late_routes: vec![],
            exported: vec![],
        };
        self.instancing.push(prototype);
        let root = self.body(&mut inner, &declared, above);
        self.finish(&mut inner);
        self.instancing.pop();
        let connections = inner.connections;
        for (field, of_outer) in outer {
            let fields = connections.get(&field).map(|c| c.fields.clone()).unwrap_or_default();
            if let Some(connected) = frame.connections.get_mut(&of_outer) {
                connected.fields.extend(fields);
            }
        }
        self.name_instance(frame, item, root, connections)
    }

    /// Walks the body of a prototype; its first node.
    fn body(&mut self, inner: &mut Frame, declared: &ProtoItem, above: u16) -> Option<NodeId> {
        let ProtoBody::Items(items) = &declared.body else { return None };
        let mut first = None;
        for item in items {
            match item {
                Item::Node(node) => {
                    let id = self.node(inner, node, above);
                    first.get_or_insert(id);
                }
                other => self.statement(inner, other),
            }
        }
        if first.is_none() {
            self.tally.add(declared.place, format!("the prototype `{}` has no nodes", shown(&declared.name)));
        }
        first.flatten()
    }

    fn name_instance(&mut self, frame: &mut Frame, item: &NodeItem, root: Option<NodeId>, connections: Connections) -> Option<NodeId> {
        if let Some(def) = &item.def {
            if let Some(root) = root {
                self.node_mut(root).def = Some(Arc::from(&**def));
            }
            let target = root.map_or(Target::Skipped(None), |root| Target::Instance(root, Rc::new(connections)));
            frame.names.insert(def.clone(), target);
        }
        root
    }

    /// The fields of an instance: the prototype's, with what the instance says. Also which of them are fields of the prototype around it.
    #[allow(clippy::type_complexity)] // Two lists by names, which no name would make clearer.
    fn arguments(
        &mut self,
        frame: &mut Frame,
        item: &NodeItem,
        prototype: usize,
        above: u16,
    ) -> (BTreeMap<Box<str>, Argument>, Vec<(Box<str>, Box<str>)>) {
        let mut arguments = (*self.prototypes[prototype].arguments).clone();
        let mut outer = vec![];
        let mut children: BTreeMap<Box<str>, Vec<NodeId>> = BTreeMap::new();
        for element in &item.body {
            match element {
                Item::Field(field) => {
                    let Some(argument) = arguments.get(&field.name) else {
                        self.unknown_argument(item, &field.name, field.place);
                        continue;
                    };
                    let (argument, of_outer) = self.argument(frame, item, field, argument.clone(), above);
                    outer.extend(of_outer.map(|name| (field.name.clone(), name)));
                    arguments.insert(field.name.clone(), argument);
                }
                Item::Node(child) => {
                    let Some(id) = self.node(frame, child, above + 1) else { continue };
                    let container: Box<str> = child.container.clone().unwrap_or_else(|| self.node_of(id).kind.container.into());
                    if arguments.get(&container).is_some_and(|a| a.ty.base == Base::Node) {
                        children.entry(container).or_default().push(id);
                    } else if &*container != "metadata" {
                        self.unknown_argument(item, &container, child.place);
                    }
                }
                other => self.statement(frame, other),
            }
        }
        for (name, ids) in children {
            if let Some(argument) = arguments.get_mut(&name) {
                argument.value = Some(Value::Nodes(ids.into()));
            }
        }
        (arguments, outer)
    }

    fn unknown_argument(&mut self, item: &NodeItem, field: &str, place: Place) {
        self.tally.add(place, format!("the prototype `{}` has no field `{}`, which was skipped", shown(&item.name), shown(field)));
    }

    /// One field of an instance, and the field of the prototype around it that it is.
    fn argument(
        &mut self,
        frame: &mut Frame,
        item: &NodeItem,
        field: &FieldItem,
        argument: Argument,
        above: u16,
    ) -> (Argument, Option<Box<str>>) {
        let what = format!("the field `{}` of the prototype `{}`", shown(&field.name), shown(&item.name));
        let value = match &field.written {
            Written::Is(name) => {
                let around = frame.arguments.as_ref().and_then(|a| a.get(name));
                if around.is_none_or(|a| a.ty != argument.ty) {
                    self.warn(field.place, format!("{what} is IS `{}`, which is no field of its type around it", shown(name)));
                    return (argument, None);
                }
                let value = around.and_then(|a| a.value.clone()).or_else(|| argument.value.clone());
                return (Argument { value, place: field.place, ..argument }, Some(name.clone()));
            }
            _ if !argument.access.has_value() => {
                self.warn(field.place, format!("{what} is an event and has no value; the value was skipped"));
                None
            }
            Written::Nodes(nodes) if argument.ty.base == Base::Node => {
                let mut ids = self.items(frame, nodes, above + 1);
                if !argument.ty.many && ids.len() > 1 {
                    self.warn(field.place, format!("{what} holds one node and was given {}; the last counts", ids.len()));
                    ids.drain(..ids.len() - 1);
                }
                Some(Value::Nodes(ids.into()))
            }
            _ => self.simple(frame, field, argument.ty, false, &what),
        };
        let value = value.or(argument.value);
        (Argument { value, place: field.place, ..argument }, None)
    }

    /// `field IS name`: the value of the instance, if there is one, and a way for its events.
    pub(super) fn connect(&mut self, frame: &mut Frame, id: NodeId, (index, field): (u16, &Field), name: &str, place: Place, above: u16) {
        let Some(argument) = frame.arguments.as_ref().map(|a| a.get(name)) else {
            return self.warn(place, format!("IS `{}` stands in no prototype; it was skipped", shown(name)));
        };
        let Some(argument) = argument else {
            return self.warn(place, format!("IS `{}`: the prototype has no such field; it was skipped", shown(name)));
        };
        if argument.ty != field.ty || !stands_for(field.access, argument.access) {
            let message = format!("IS `{}` is {} and the field `{}` is {}; it was skipped", shown(name), argument.ty, field.name, field.ty);
            return self.warn(place, message);
        }
        if let Some(value) = &argument.value
            && field.access.has_value()
        {
            // A number in the interface of a prototype is known to be an angle only here.
            let value = if argument.ty.base == Base::Rotation {
                value.clone()
            } else {
                in_radians(value.clone(), field.ty, field.angle, frame.angle)
            };
            self.set(id, index, argument.place, value, above);
        }
        if let Some(connected) = frame.connections.get_mut(name) {
            connected.fields.push((id, index));
        }
    }

    /// The prototype itself: an external one is sought in the bundle when it is first used.
    pub(super) fn definition(&mut self, prototype: usize) -> Option<usize> {
        let ProtoBody::Extern(address) = &Rc::clone(&self.prototypes[prototype].item).body else { return Some(prototype) };
        match self.prototypes[prototype].external {
            External::Found(index) => return Some(index),
            // Also what a prototype finds that is external in a circle.
            External::Sought => return None,
            External::Unsought => self.prototypes[prototype].external = External::Sought,
        }
        let found = self.seek(prototype, address).and_then(|found| self.definition(found))?;
        self.prototypes[prototype].external = External::Found(found);
        Some(found)
    }

    /// The first of the addresses that leads to a prototype in the bundle.
    fn seek(&mut self, prototype: usize, address: &FieldItem) -> Option<usize> {
        let Prototype { file, item, .. } = &self.prototypes[prototype];
        let (file, item) = (Rc::clone(file), Rc::clone(item));
        let urls = self.addresses(&file, address);
        for url in &urls {
            let (path, name) = url.split_once('#').map_or((&**url, None), |(path, name)| (path, Some(name)));
            let Some(path) = self.find(address.place, path, &format!("the file of the prototype `{}`", shown(&item.name))) else {
                continue;
            };
            let Some(library) = self.library(&path) else { continue };
            let found = match name {
                Some(name) => self.prototype(library.scope, name),
                None => library.first,
            };
            if found.is_some() {
                return found;
            }
            let said = name.unwrap_or("any");
            self.warn(address.place, format!("`{path}` does not declare the prototype `{}`", shown(said)));
        }
        let said: Vec<String> = urls.iter().take(4).map(|u| format!("`{}`", shown(u))).collect();
        let message =
            format!("the external prototype `{}` is at none of its addresses in the bundle: {}", shown(&item.name), said.join(", "));
        self.warn(address.place, message);
        None
    }

    /// The prototypes that a file declares. Its nodes are not looked at.
    fn library(&mut self, path: &crate::import::BundlePath) -> Option<Library> {
        if let Some(known) = self.libraries.get(path) {
            return *known;
        }
        self.libraries.insert(path.clone(), None);
        let file = self.load(path)?;
        let mut frame = self.file_frame(&file);
        let before = self.prototypes.len();
        for item in &file.items {
            if let Item::Proto(proto) = item
                && self.step(proto.place)
            {
                self.declare(&mut frame, proto);
            }
        }
        let first = self.scopes[frame.scope].names.values().flatten().filter(|(number, _)| *number == 0).map(|(_, index)| *index).next();
        let library = Library { scope: frame.scope, first: first.filter(|i| *i >= before) };
        self.libraries.insert(path.clone(), Some(library));
        Some(library)
    }
}
