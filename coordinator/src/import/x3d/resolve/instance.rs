//! Instances of prototypes.
//!
//! An instance is its first node: the body is walked anew with the instance's values where it says IS, and what stands beside the first
//! node (interpolators, as a rule) is there for the events only. The alternative, a node that points at a body with holes, would have
//! every reader of the document fill the holes.

use super::{
    Resolver,
    frame::{Argument, Arguments, Connected, Connections, Frame, Target},
    proto::Prototype,
    value::{in_radians, is_read_once, stands_for},
};
use crate::import::x3d::{
    document::{NodeId, Place},
    limits::{INSTANCE_STEPS, MAX_PROTO_DEPTH},
    literal::shown,
    syntax::{FieldItem, Item, NodeItem, ProtoBody, ProtoItem, Written},
    table::Field,
    value::{Base, Value},
};
use std::{collections::BTreeMap, rc::Rc, sync::Arc};

/// A field of an instance and the field of the prototype around it that it is.
type Outer = (Box<str>, Box<str>);

impl Resolver<'_> {
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
        let fields = self.prototypes[prototype].arguments.len() as u64;
        if !self.steps(item.place, INSTANCE_STEPS + fields) {
            return None;
        }
        let (arguments, outer) = self.arguments(frame, item, prototype, above);
        let Prototype { item: declared, file, length, angle, scope, .. } = &self.prototypes[prototype];
        let (declared, length, angle, scope) = (Rc::clone(declared), *length, *angle, *scope);
        let scale = (length / frame.length) as f32;
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
        let root = self.body(&mut inner, &declared, above + u16::from(scale != 1.0));
        let root = root.and_then(|root| self.in_other_units(root, scale, item.place, above));
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

    /// A node as seen from a file whose unit of length goes `scale` times into that of the node's. Files keep their units: a prototype of
    /// another file is scaled like a file that is inlined, and so is, the other way, a node that is handed to it. (ISO/IEC 19775-1, 4.3.6
    /// gives units to a world and says nothing of prototypes that are used in another.)
    fn in_other_units(&mut self, id: NodeId, scale: f32, place: Place, above: u16) -> Option<NodeId> {
        let kind = self.node_of(id).kind;
        // Light from far away has a group to shine on, and no length but those of its shadow map.
        let is_far_light = matches!(kind.name, "DirectionalLight" | "EnvironmentLight");
        let is_placed = kind.field("children").is_some() || (kind.container == "children" && !is_far_light);
        match kind.container {
            _ if scale == 1.0 => Some(id),
            _ if is_placed => self.scaled(vec![id], scale, place, above),
            "geometry" | "coord" => {
                let what = "geometry without a shape crosses from a file to one with another unit of length, which was not converted";
                self.tally.add(place, what.to_owned());
                Some(id)
            }
            _ => Some(id),
        }
    }

    /// Nodes in a field of an instance that has `above` nodes above it.
    fn handed_over(&mut self, ids: &[NodeId], scale: f32, place: Place, above: u16) -> Value {
        Value::Nodes(ids.iter().filter_map(|id| self.in_other_units(*id, scale, place, above + 1)).collect())
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
    fn arguments(&mut self, frame: &mut Frame, item: &NodeItem, prototype: usize, above: u16) -> (Arguments, Vec<Outer>) {
        let mut arguments = self.prototypes[prototype].arguments.clone();
        let scale = (frame.length / self.prototypes[prototype].length) as f32;
        let mut outer = vec![];
        let mut children: BTreeMap<Box<str>, Vec<NodeId>> = BTreeMap::new();
        for element in &item.body {
            match element {
                Item::Field(field) => {
                    let Some(argument) = arguments.get(&field.name) else {
                        self.unknown_argument(item, &field.name, field.place);
                        continue;
                    };
                    let (argument, of_outer) = self.argument(frame, item, field, argument.clone(), scale, above);
                    outer.extend(of_outer.map(|name| (field.name.clone(), name)));
                    arguments.insert(field.name.clone(), argument);
                }
                Item::Node(child) => {
                    let Some(id) = self.node(frame, child, above + 1) else { continue };
                    let container: Box<str> = child.container.clone().unwrap_or_else(|| self.node_of(id).kind.container.into());
                    if arguments.get(&container).is_some_and(|a| a.ty.base == Base::Node) {
                        let id = self.in_other_units(id, scale, child.place, above + 1);
                        children.entry(container).or_default().extend(id);
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
        scale: f32,
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
                // The value stands where it was written, from which addresses in it count, and not where it is handed on.
                // The prototype's own default is in its own units and stays as it is.
                let Some(Argument { value: Some(value), place, angle, .. }) = around.cloned() else {
                    return (argument, Some(name.clone()));
                };
                let value = match value {
                    Value::Nodes(ids) => self.handed_over(&ids, scale, place, above),
                    other => other,
                };
                return (Argument { value: Some(value), place, angle, ..argument }, Some(name.clone()));
            }
            _ if !argument.access.has_value() => {
                self.warn(field.place, format!("{what} is an event and has no value; the value was skipped"));
                None
            }
            Written::Nodes(nodes) if argument.ty.base == Base::Node => {
                let mut ids = self.items(frame, nodes, None, above + 1);
                if !argument.ty.many && ids.len() > 1 {
                    self.warn(field.place, format!("{what} holds one node and was given {}; the last counts", ids.len()));
                    ids.drain(..ids.len() - 1);
                }
                Some(self.handed_over(&ids, scale, field.place, above))
            }
            _ => self.simple(frame, field, argument.ty, false, &what),
        };
        match value {
            Some(value) => (Argument { value: Some(value), place: field.place, angle: frame.angle, ..argument }, None),
            None => (argument, None),
        }
    }

    /// `field IS name`: the value of the instance, if there is one, and a way for its events.
    pub(super) fn connect(&mut self, frame: &mut Frame, id: NodeId, (index, field): (u16, &Field), name: &str, place: Place, above: u16) {
        // Said once for all instances.
        let Some(argument) = frame.arguments.as_ref().map(|a| a.get(name)) else {
            return self.tally.add(place, format!("IS `{}` stands in no prototype; it was skipped", shown(name)));
        };
        let Some(argument) = argument else {
            return self.tally.add(place, format!("IS `{}`: the prototype has no such field; it was skipped", shown(name)));
        };
        if argument.ty != field.ty || !(stands_for(field.access, argument.access) || is_read_once(field.access, argument.access)) {
            let (outer, inner) = (argument.access.name(), field.access.name());
            let message = format!(
                "IS `{}` is {outer} {} and the field `{}` is {inner} {}; it was skipped",
                shown(name),
                argument.ty,
                field.name,
                field.ty
            );
            return self.tally.add(place, message);
        }
        if is_read_once(field.access, argument.access) {
            let message = format!("IS `{}` takes events, which the field `{}` does not; its value was taken", shown(name), field.name);
            self.tally.add(place, message);
        }
        if let Some(value) = &argument.value
            && field.access.has_value()
        {
            // A number in the interface of a prototype is known to be an angle only here.
            let value = if argument.ty.base == Base::Rotation {
                value.clone()
            } else {
                in_radians(value.clone(), field.ty, field.angle, argument.angle)
            };
            self.set(id, index, argument.place, value, above);
        }
        if let Some(connected) = frame.connections.get_mut(name)
            && stands_for(field.access, argument.access)
        {
            connected.fields.push((id, index));
        }
    }
}
