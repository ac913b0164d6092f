//! ROUTE, IMPORT and EXPORT.

use super::{
    Resolver,
    frame::{Frame, Target},
};
use crate::import::x3d::{
    document::{NodeId, Place, Route},
    limits::ROUTE_STEPS,
    literal::shown,
    syntax::RouteItem,
    table::Access,
    value::{FieldType, Store},
};
use std::collections::BTreeMap;

/// One end of a route: the type of the field and the fields that it stands for; of a node that was left out, `None` where nothing is known.
type End = Option<(FieldType, Vec<(NodeId, u16)>)>;

impl Resolver<'_> {
    /// Adds a route. A name that is not there yet is looked up again at the `end` of the file.
    pub(super) fn route(&mut self, frame: &mut Frame, route: &RouteItem, end: bool) {
        let missing = [&route.from.0, &route.to.0].into_iter().find(|n| !frame.names.contains_key(*n));
        if let Some(name) = missing {
            if end {
                self.warn(route.place, format!("ROUTE: no node `{}`; the route was skipped", shown(name)));
            } else {
                frame.late_routes.push(route.clone());
            }
            return;
        }
        let from = self.end(frame, &route.from, true);
        let to = self.end(frame, &route.to, false);
        let (from, to) = match (from, to) {
            (Ok(from), Ok(to)) => (from, to),
            (Err(message), _) | (_, Err(message)) => {
                return self.warn(route.place, format!("ROUTE: {message}; the route was skipped"));
            }
        };
        let (Some((from_type, from)), Some((to_type, to))) = (from, to) else { return };
        if from_type != to_type {
            let ends = format!("{}.{} is {from_type} and {}.{} is {to_type}", route.from.0, route.from.1, route.to.0, route.to.1);
            return self.warn(route.place, format!("ROUTE: {ends}; the route was skipped"));
        }
        self.add_routes(frame, route.place, &from, &to);
    }

    fn add_routes(&mut self, frame: &Frame, place: Place, from: &[(NodeId, u16)], to: &[(NodeId, u16)]) {
        for from in from {
            for to in to {
                if !self.steps(place, ROUTE_STEPS) {
                    return;
                }
                let field = |(id, index): &(NodeId, u16)| &self.node_of(*id).kind.fields[usize::from(*index)];
                let (sender, receiver) = (field(from), field(to));
                let plain = receiver.angle && !sender.angle && sender.ty.store() == Store::Floats;
                let factor = if plain { frame.angle } else { 1.0 };
                self.document.routes.push(Route { from: *from, to: *to, factor, place });
            }
        }
    }

    /// The field at one end, or what is wrong with it.
    fn end(&self, frame: &Frame, (name, field): &(Box<str>, Box<str>), sends: bool) -> Result<End, String> {
        let allowed = |access: Access| if sends { access.sends() } else { access.receives() };
        let way = if sends { "sends no events" } else { "takes no events" };
        let refused = || format!("the field `{}` of `{}` {way}", shown(field), shown(name));
        let none = |kind: &str| format!("`{}` ({}) has no field `{}`", shown(name), shown(kind), shown(field));
        match frame.names.get(name) {
            Some(Target::Node(id)) => {
                let kind = self.node_of(*id).kind;
                let (index, found) = kind.event(field).ok_or_else(|| none(kind.name))?;
                if allowed(found.access) { Ok(Some((found.ty, vec![(*id, index)]))) } else { Err(refused()) }
            }
            Some(Target::Instance(_, connections)) => {
                let exposed = |n: Option<&str>| connections.get(n?).filter(|c| c.access == Access::InputOutput);
                let found = connections.get(field);
                let found = found.or_else(|| exposed(field.strip_prefix("set_"))).or_else(|| exposed(field.strip_suffix("_changed")));
                let found = found.ok_or_else(|| none("an instance of a prototype"))?;
                let fields = found.fields.iter().filter(|(id, index)| {
                    // An inputOutput field may be connected to one that only sends or only takes.
                    allowed(self.node_of(*id).kind.fields[usize::from(*index)].access)
                });
                if allowed(found.access) { Ok(Some((found.ty, fields.copied().collect()))) } else { Err(refused()) }
            }
            // The table lists all events of some of the nodes that are left out, and none of the others.
            Some(Target::Skipped(Some(kind))) if sends && kind.fields.iter().any(|f| f.access == Access::Output) => {
                let (_, found) = kind.event(field).ok_or_else(|| none(kind.name))?;
                if allowed(found.access) { Ok(Some((found.ty, vec![]))) } else { Err(refused()) }
            }
            _ => Ok(None),
        }
    }

    /// `IMPORT inline.exported AS local`.
    pub(super) fn import(&mut self, frame: &mut Frame, place: Place, inline: &str, exported: &str, local: &str) {
        let target = match frame.names.get(inline) {
            Some(Target::Node(id)) => self.exports.get(id).and_then(|e| e.get(exported)).cloned(),
            Some(Target::Skipped(_)) => Some(Target::Skipped(None)),
            _ => None,
        };
        match target {
            Some(target) => {
                frame.names.insert(local.into(), target);
            }
            None => {
                frame.names.insert(local.into(), Target::Skipped(None));
                self.warn(place, format!("IMPORT: `{}` exports no `{}`; it was skipped", shown(inline), shown(exported)));
            }
        }
    }

    /// What a file exports.
    pub(super) fn export(&mut self, frame: &mut Frame) -> BTreeMap<Box<str>, Target> {
        let mut exports = BTreeMap::new();
        for (place, local, exported) in std::mem::take(&mut frame.exported) {
            match frame.names.get(&local) {
                Some(target) => {
                    exports.insert(exported, target.clone());
                }
                None => self.warn(place, format!("EXPORT: no node `{}`; it was skipped", shown(&local))),
            }
        }
        exports
    }
}
