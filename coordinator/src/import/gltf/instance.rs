//! EXT_mesh_gpu_instancing: copies of a node's mesh, placed within the node.
//!
//! Their number is known before the first is made, so that whoever shows them can refuse too many; they are read one after the other.

use super::{
    accessor::{Accessor, Accessors},
    element::Component,
    json::Json,
    node::{Local, Node, unit},
    report::Report,
};
use glam::{DMat4, DQuat, DVec3};

/// The places of the copies within their node.
pub(super) struct Instances<'s, 'd> {
    /// How many there are; one, at the node itself, where it asks for none.
    pub(super) count: usize,
    translations: Option<&'s Accessor<'d>>,
    rotations: Option<&'s Accessor<'d>>,
    scales: Option<&'s Accessor<'d>>,
}

/// The attributes that say where copies stand.
const PLACES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];
/// What the attributes may be made of; integers are normalized.
const FLOATS: &[Component] = &[Component::F32];
const TURNS: &[Component] = &[Component::F32, Component::I8, Component::I16];

impl<'s, 'd> Instances<'s, 'd> {
    /// The copies that a node asks for; `None` where it does so wrongly.
    pub(super) fn of(node: &Node<'_>, accessors: &'s Accessors<'d, '_>, report: &mut Report<'_>) -> Option<Self> {
        let Some(extension) = node.json.extension("EXT_mesh_gpu_instancing") else {
            return Some(Self { count: 1, translations: None, rotations: None, scales: None });
        };
        let attributes = report.required(extension, "attributes")?;
        let translations = attribute(attributes, "TRANSLATION", ("VEC3", FLOATS), accessors, report)?;
        let rotations = attribute(attributes, "ROTATION", ("VEC4", TURNS), accessors, report)?;
        let scales = attribute(attributes, "SCALE", ("VEC3", FLOATS), accessors, report)?;
        let mut counts: Vec<usize> = [translations, rotations, scales].into_iter().flatten().map(|a| a.count).collect();
        // Attributes of other programs count as well: copies that have nothing else all stand at the node.
        for (_, at) in attributes.members().filter(|(name, _)| !PLACES.contains(&name.as_ref())) {
            counts.push(accessors.at(at, report)?.count);
        }
        let Some(count) = counts.first().copied() else {
            report.error(attributes, "instances without an attribute have no number; name one, or leave the extension out");
            return None;
        };
        if let Some(other) = counts.iter().find(|n| **n != count) {
            report.error(attributes, format!("the attributes of instances differ in number: {count} and {other}"));
            return None;
        }
        if node.skin().is_some() {
            report.error(extension, "a skinned mesh cannot be instanced");
            return None;
        }
        Some(Self { count, translations, rotations, scales })
    }

    /// The place of one copy.
    pub(super) fn matrix(&self, index: usize, accessors: &Accessors<'_, '_>) -> DMat4 {
        let vector = |of: Option<&Accessor<'_>>| of.map(|a| DVec3::from_array(a.get(&accessors.buffers, index)));
        let rotation = self.rotations.map(|a| unit(DQuat::from_array(a.get(&accessors.buffers, index))));
        Local::Parts {
            translation: vector(self.translations).unwrap_or(DVec3::ZERO),
            rotation: rotation.unwrap_or(DQuat::IDENTITY),
            scale: vector(self.scales).unwrap_or(DVec3::ONE),
        }
        .matrix()
    }
}

/// The accessor of an attribute, where there is one; `None` where it is of another form than this kind and these components.
fn attribute<'s, 'd>(
    attributes: Json<'_>,
    name: &str,
    (kind, components): (&str, &[Component]),
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Option<Option<&'s Accessor<'d>>> {
    let Some(at) = attributes.get(name) else { return Some(None) };
    let found = accessors.at(at, report)?;
    if found.kind() != kind {
        report.error(at, format!("an accessor of type {kind} is expected here, not {}", found.kind()));
        return None;
    }
    if !components.contains(&found.component) || (found.component != Component::F32 && !found.normalized) {
        let also = if components.len() > 1 { ", or normalized integers with a sign, of 8 or 16 bits" } else { "" };
        report.error(at, format!("floats are expected here{also}; the component type is {}", found.component.code()));
        return None;
    }
    Some(Some(found))
}
