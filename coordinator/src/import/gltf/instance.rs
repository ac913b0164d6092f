//! EXT_mesh_gpu_instancing: copies of a node's mesh, placed within the node.
//!
//! Their number is known before the first is made, so that whoever shows them can refuse too many; they are read one after the other.

use super::{
    accessor::{Accessor, Accessors},
    form::{PLACE, TURN, of_form},
    local::{Local, unit},
    node::Node,
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

/// The extension.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// The attributes that say where copies stand.
const PLACES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

impl<'s, 'd> Instances<'s, 'd> {
    /// The copies that a node asks for; `None` where it does so wrongly.
    pub(super) fn of(node: &Node<'_>, accessors: &'s Accessors<'d, '_>, report: &mut Report<'_>) -> Option<Self> {
        let Some(extension) = node.json.extension(INSTANCING) else {
            return Some(Self { count: 1, translations: None, rotations: None, scales: None });
        };
        let attributes = report.required(extension, "attributes")?;
        let mut read = |name, form| match attributes.get(name) {
            Some(at) => of_form(at, form, None, accessors, report).map(Some),
            None => Some(None),
        };
        let [translations, rotations, scales] = [read(PLACES[0], &PLACE)?, read(PLACES[1], &TURN)?, read(PLACES[2], &PLACE)?];
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
