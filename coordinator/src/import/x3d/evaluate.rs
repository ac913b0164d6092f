//! The scene at a time: clocks run, interpolators answer them, and ROUTEs carry the answers into fields.
//!
//! Time is counted in seconds from the moment the scene was loaded, and so are the times in its fields: a `startTime` of 0, the default,
//! starts at once. (A viewer counts from 1970, where a clock that neither loops nor is started by hand has run out long ago; a bake at a
//! time would then never see it.) Nobody touches anything, so sensors send nothing. Each node is looked at once, after those that send to
//! it; where routes go in a circle, the circle is followed once, as ISO/IEC 19775-1, 4.4.8.3 has it for one time stamp. Without a time
//! nothing here happens: fields are as the file has them.

mod clock;
mod curve;
mod interpolate;
mod rotation;
#[cfg(test)]
mod tests;

use super::{
    document::{Document, NodeId, Set},
    table::Access,
    value::Value,
};
use crate::import::findings::Findings;
use std::collections::{BTreeMap, BTreeSet};

/// Events of one moment: what a field of a node has sent.
type Events = BTreeMap<(NodeId, u16), Value>;

/// Sets the fields of a document to what they are at `time`, in seconds. Cost: linear in routes and in what they carry.
pub(super) fn evaluate(document: &mut Document, time: f64, findings: &mut Findings) {
    let mut incoming: BTreeMap<NodeId, Vec<usize>> = BTreeMap::new();
    for (index, route) in document.routes.iter().enumerate() {
        incoming.entry(route.to.0).or_default().push(index);
    }
    let mut events = Events::new();
    for id in order(document, findings) {
        let received = receive(document, incoming.get(&id).map_or(&[][..], Vec::as_slice), &mut events);
        let sent = match document.node(id).kind() {
            "TimeSensor" => clock::events(document.node(id), time),
            _ => received.into_iter().find(|(name, _)| *name == "set_fraction").and_then(|(_, fraction)| {
                let Value::Floats(fraction) = fraction else { return None };
                interpolate::events(document.node(id), *fraction.first()?, findings)
            }),
        };
        for (name, value) in sent.into_iter().flatten() {
            if let Some((index, _)) = document.nodes[id.0 as usize].kind.field(name) {
                events.insert((id, index), value);
            }
        }
    }
}

/// The nodes that routes touch, each behind those that send to it as far as there is such an order.
fn order(document: &Document, findings: &mut Findings) -> Vec<NodeId> {
    let mut waiting: BTreeMap<NodeId, usize> = BTreeMap::new();
    let mut outgoing: BTreeMap<NodeId, Vec<usize>> = BTreeMap::new();
    for (index, route) in document.routes.iter().enumerate() {
        waiting.entry(route.from.0).or_default();
        *waiting.entry(route.to.0).or_default() += 1;
        outgoing.entry(route.from.0).or_default().push(index);
    }
    let mut ready: BTreeSet<NodeId> = waiting.iter().filter(|(_, n)| **n == 0).map(|(id, _)| *id).collect();
    let mut order = vec![];
    let mut said = false;
    while !waiting.is_empty() {
        let next = ready.pop_first().or_else(|| {
            let (id, _) = waiting.first_key_value()?;
            if !said && let Some(route) = document.routes.iter().find(|r| r.to.0 == *id && waiting.contains_key(&r.from.0)) {
                findings.warn(document.at(route.place), "ROUTEs go in a circle from here; it was followed once");
                said = true;
            }
            Some(*id)
        });
        let Some(id) = next else { break };
        waiting.remove(&id);
        order.push(id);
        for route in outgoing.get(&id).map_or(&[][..], Vec::as_slice) {
            let to = document.routes[*route].to.0;
            if let Some(count) = waiting.get_mut(&to) {
                *count -= 1;
                if *count == 0 {
                    ready.insert(to);
                }
            }
        }
    }
    order
}

/// Hands a node the events that were sent to it: fields take them and send them on. The inputs that are no fields are returned.
fn receive(document: &mut Document, routes: &[usize], events: &mut Events) -> Vec<(&'static str, Value)> {
    let mut inputs = vec![];
    for index in routes {
        let route = document.routes[*index];
        let Some(value) = events.get(&route.from) else { continue };
        let value = scaled(value.clone(), route.factor);
        let (id, mut field) = route.to;
        let node = &mut document.nodes[id.0 as usize];
        let spec = &node.kind.fields[usize::from(field)];
        if spec.access == Access::Input {
            // `set_coordIndex` sets `coordIndex`, which the file may only initialise.
            match spec.name.strip_prefix("set_").and_then(|name| node.kind.field(name)) {
                Some((stored, target)) if target.ty == spec.ty => field = stored,
                _ => {
                    inputs.push((spec.name, value));
                    continue;
                }
            }
        }
        node.set(Set { field, place: route.place, value: value.clone() });
        events.insert((id, field), value);
    }
    inputs
}

fn scaled(value: Value, factor: f32) -> Value {
    match value {
        Value::Floats(numbers) if factor != 1.0 => Value::Floats(numbers.iter().map(|x| x * factor).collect()),
        other => other,
    }
}
