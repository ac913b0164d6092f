//! Nodes, their fields and their children.

use super::{
    Resolver,
    frame::{Frame, Target},
};
use crate::import::x3d::{
    document::{Node, NodeId, Place},
    limits::{MAX_DEPTH, MAX_RECURSION},
    literal::{Form, shown},
    syntax::{FieldItem, Item, NodeItem, Written},
    table::{self, Field, NodeType},
    value::{Base, Value},
};
use std::sync::Arc;

/// The children of one node that came without the name of a field, by field, each list with its first place.
type Children = Vec<(u16, Place, Vec<NodeId>)>;

impl Resolver<'_> {
    /// Walks items that stand for nodes, below `above` other nodes; returns the nodes, with an empty one of the type `stand_in`, if there
    /// is such a type, in the place of each that was skipped.
    pub(super) fn items(&mut self, frame: &mut Frame, items: &[Item], stand_in: Option<&str>, above: u16) -> Vec<NodeId> {
        let mut ids = vec![];
        for item in items {
            match item {
                Item::Node(node) => ids.extend(self.node(frame, node, above).or_else(|| self.stand_in(node.place, stand_in?))),
                other => self.statement(frame, other),
            }
        }
        ids
    }

    /// An empty node in the place of one that was skipped: a Switch that chooses its second child means that child also where the first is
    /// of a type that nobody knows.
    fn stand_in(&mut self, place: Place, name: &str) -> Option<NodeId> {
        self.push(Node { kind: table::lookup(name)?, place, def: None, fields: vec![], height: 1 })
    }

    /// A statement in a file, in a body or among nodes.
    pub(super) fn statement(&mut self, frame: &mut Frame, item: &Item) {
        match item {
            Item::Route(route) if self.step(route.place) => self.route(frame, route, false),
            Item::Proto(proto) if self.step(proto.place) => self.declare(frame, proto),
            Item::Import { place, inline, exported, local } => self.import(frame, *place, inline, exported, local),
            Item::Export { place, local, exported } => frame.exported.push((*place, local.clone(), exported.clone())),
            _ => {}
        }
    }

    /// A node, the use of one, or an instance; `None` where there is nothing to bake in it.
    pub(super) fn node(&mut self, frame: &mut Frame, item: &NodeItem, above: u16) -> Option<NodeId> {
        if !self.step(item.place) {
            return None;
        }
        if !self.descend(item.place, above) {
            return None;
        }
        let id = self.any_node(frame, item, above);
        self.depth -= 1;
        id
    }

    /// Counts a node inside others, which the caller counts back; false where there are too many.
    pub(super) fn descend(&mut self, place: Place, above: u16) -> bool {
        // Defaults of prototypes hang nowhere yet and are counted from 0 again; the stack is not.
        if above >= MAX_DEPTH || self.depth >= MAX_RECURSION {
            self.error(place, format!("more than {MAX_DEPTH} nodes inside one another, with what is instantiated here"));
            return false;
        }
        self.depth += 1;
        true
    }

    fn any_node(&mut self, frame: &mut Frame, item: &NodeItem, above: u16) -> Option<NodeId> {
        if let Some(name) = &item.usage {
            return self.usage(frame, item, name, above);
        }
        let built_in = table::lookup(&item.name);
        if let Some(prototype) = self.prototype(frame.scope, &item.name)
            // Extensions are declared as external prototypes for viewers that do not know them.
            && !(self.prototypes[prototype].is_external() && built_in.is_some_and(|kind| !kind.skipped))
        {
            return self.instance(frame, item, prototype, above);
        }
        match built_in.or_else(|| self.in_capitals(frame, item)) {
            Some(kind) if !kind.skipped => self.built_in(frame, item, kind, above),
            Some(kind) => {
                self.tally.add(item.place, format!("the node `{}` is not supported and was skipped", kind.name));
                self.skip(frame, item, Some(kind), above);
                None
            }
            None => {
                self.unknown(frame, item, None, above);
                None
            }
        }
    }

    /// The type that a page of HTML means, which may be written without capitals there.
    fn in_capitals(&mut self, frame: &Frame, item: &NodeItem) -> Option<&'static NodeType> {
        let kind = table::lookup_in_any_case(&item.name).filter(|_| frame.file.source.form == Form::Xml)?;
        self.tally.add(item.place, "nodes written in other capitals than X3D's, as pages of HTML have them, were read as X3D's".to_owned());
        Some(kind)
    }

    /// `USE name`.
    fn usage(&mut self, frame: &Frame, item: &NodeItem, name: &str, above: u16) -> Option<NodeId> {
        let id = match frame.names.get(name) {
            Some(Target::Node(id) | Target::Instance(id, _)) => *id,
            Some(Target::Skipped(_)) => return None,
            None => {
                self.warn(item.place, format!("USE `{}`: no node of this name before it; it was skipped", shown(name)));
                return None;
            }
        };
        if self.is_open(id) {
            self.warn(item.place, format!("USE `{}`: the node would contain itself; it was skipped", shown(name)));
            return None;
        }
        let kind = self.node_of(id).kind.name;
        if !item.name.is_empty() && table::lookup(&item.name).is_some_and(|k| k.name != kind) {
            self.warn(item.place, format!("USE `{}` is said to be a `{}` and is a `{kind}`", shown(name), shown(&item.name)));
        }
        self.fits(id, item.place, above).then_some(id)
    }

    /// A node of the table.
    fn built_in(&mut self, frame: &mut Frame, item: &NodeItem, kind: &'static NodeType, above: u16) -> Option<NodeId> {
        let def = item.def.as_deref().map(Arc::from);
        let id = self.push(Node { kind, place: item.place, def, fields: vec![], height: 1 })?;
        if let Some(def) = &item.def {
            frame.names.insert(def.clone(), Target::Node(id));
        }
        self.open.push(id);
        let mut children = Children::new();
        for element in &item.body {
            match element {
                Item::Field(field) => self.field(frame, id, field, above),
                Item::Node(child) => self.child(frame, id, child, &mut children, above),
                Item::Declared { place, nodes } => {
                    self.tally.add(*place, format!("fields that a `{}` declares for itself were skipped", kind.name));
                    self.skip_items(frame, nodes, above + 1);
                }
                other => self.statement(frame, other),
            }
        }
        for (field, place, ids) in children {
            self.set_nodes(id, field, place, ids, above);
        }
        self.later_defaults(frame, id);
        if kind.is_inline() {
            self.inline(frame, id, item.def.is_some(), above);
        }
        self.open.pop();
        Some(id)
    }

    /// Defaults that the standard has changed hold for files of the later version.
    fn later_defaults(&mut self, frame: &Frame, id: NodeId) {
        let kind = self.node_of(id).kind;
        for (index, field) in kind.fields.iter().enumerate() {
            if let Some((version, value)) = &field.since
                && frame.file.version >= *version
                && self.node_of(id).get(index as u16).is_none()
            {
                let place = self.node_of(id).place;
                self.set(id, index as u16, place, value.clone(), 0);
            }
        }
    }

    /// A field with its value.
    fn field(&mut self, frame: &mut Frame, id: NodeId, item: &FieldItem, above: u16) {
        if !self.step(item.place) {
            return;
        }
        let kind = self.node_of(id).kind;
        // `set_intensity IS power` is said of the event alone.
        let found = if matches!(item.written, Written::Is(_)) { kind.event(&item.name) } else { kind.field(&item.name) };
        let found = found.or_else(|| kind.field_in_any_case(&item.name).filter(|_| frame.file.source.form == Form::Xml));
        let Some((index, field)) = found else {
            self.tally.add(item.place, format!("the field `{}` of `{}` is unknown and was skipped", shown(&item.name), kind.name));
            if let Written::Nodes(items) = &item.written {
                self.skip_items(frame, items, above + 1);
            }
            return;
        };
        if let Written::Is(name) = &item.written {
            return self.connect(frame, id, (index, field), name, item.place, above);
        }
        if !field.access.has_value() {
            let message = format!("the field `{}` of `{}` is an event and has no value; the value was skipped", field.name, kind.name);
            return self.warn(item.place, message);
        }
        if self.node_of(id).get(index).is_some() {
            self.warn(item.place, format!("the field `{}` of this `{}` is given twice; the last counts", field.name, kind.name));
        }
        match &item.written {
            Written::Nodes(items) if field.ty.base == Base::Node => {
                let ids = self.items(frame, items, field.stand_in, above + 1);
                self.set_nodes(id, index, item.place, ids, above);
            }
            _ => {
                let what = format!("the field `{}` of `{}`", field.name, kind.name);
                if let Some(value) = self.simple(frame, item, field.ty, field.angle, &what) {
                    self.set(id, index, item.place, value, above);
                }
            }
        }
    }

    /// Gives a field of nodes its nodes.
    pub(super) fn set_nodes(&mut self, id: NodeId, field: u16, place: Place, mut ids: Vec<NodeId>, above: u16) {
        let kind = self.node_of(id).kind;
        let spec = &kind.fields[usize::from(field)];
        if !spec.ty.many && ids.len() > 1 {
            self.warn(
                place,
                format!("the field `{}` of `{}` holds one node and was given {}; the last counts", spec.name, kind.name, ids.len()),
            );
            ids.drain(..ids.len() - 1);
        }
        self.set(id, field, place, Value::Nodes(ids.into()), above);
    }

    /// A child that says its field by `containerField`, or by its type.
    fn child(&mut self, frame: &mut Frame, parent: NodeId, item: &NodeItem, children: &mut Children, above: u16) {
        let Some(id) = self.node(frame, item, above + 1).or_else(|| self.stand_in_of_child(frame, parent, item)) else { return };
        let parent_kind = self.node_of(parent).kind;
        let kind = self.node_of(id).kind;
        let container = item.container.as_deref().unwrap_or(kind.container);
        match parent_kind.field(container) {
            Some((field, Field { access, ty, .. })) if access.has_value() && ty.base == Base::Node => {
                match children.iter_mut().find(|(f, ..)| *f == field) {
                    Some((.., ids)) => ids.push(id),
                    None => children.push((field, item.place, vec![id])),
                }
            }
            _ => {
                let message = format!(
                    "`{}` has no field `{}` that could hold the node `{}`, which was skipped",
                    parent_kind.name,
                    shown(container),
                    kind.name
                );
                self.warn(item.place, message);
            }
        }
    }

    /// What stands in for a child that was skipped. One that says no field, of a type that nobody knows, is taken to be of the list.
    fn stand_in_of_child(&mut self, frame: &Frame, parent: NodeId, item: &NodeItem) -> Option<NodeId> {
        let skipped = match item.usage.as_ref().map(|name| frame.names.get(name)) {
            Some(Some(Target::Skipped(kind))) => *kind,
            _ => table::lookup(&item.name),
        };
        let container = item.container.as_deref().or(skipped.map(|kind| kind.container));
        let parent = self.node_of(parent).kind;
        let field = match container {
            Some(container) => parent.field(container)?.1,
            None => parent.fields.iter().find(|field| field.stand_in.is_some())?,
        };
        self.stand_in(item.place, field.stand_in?)
    }
}
