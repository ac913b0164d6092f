//! EXT_mesh_gpu_instancing: copies of a node's mesh, placed within the node.

use super::{
    accessor::Accessors,
    json::Json,
    node::{Local, Node, unit},
    report::Report,
};
use glam::{DMat4, DQuat, DVec3};

/// The places of the copies within the node; one, where it asks for none.
pub(super) fn transforms(node: &Node<'_>, accessors: &Accessors<'_, '_>, report: &mut Report<'_>) -> Option<Vec<DMat4>> {
    let Some(extension) = node.json.extension("EXT_mesh_gpu_instancing") else { return Some(vec![DMat4::IDENTITY]) };
    let attributes = report.required(extension, "attributes")?;
    let translations = read::<3>(attributes, "TRANSLATION", "VEC3", accessors, report)?;
    let rotations = read::<4>(attributes, "ROTATION", "VEC4", accessors, report)?;
    let scales = read::<3>(attributes, "SCALE", "VEC3", accessors, report)?;
    let counts = [translations.len(), rotations.len(), scales.len()];
    let count = counts.into_iter().max().unwrap_or(0);
    if counts.iter().any(|n| *n != 0 && *n != count) {
        report.error(attributes, format!("translations, rotations and scales of instances differ in number: {counts:?}"));
        return None;
    }
    if node.skin.is_some() {
        report.error(extension, "a skinned mesh cannot be instanced");
        return None;
    }
    let of = |i: usize| {
        let translation = translations.get(i).map_or(DVec3::ZERO, |v| DVec3::from_array(*v));
        let rotation = rotations.get(i).map_or(DQuat::IDENTITY, |v| unit(DQuat::from_array(*v)));
        let scale = scales.get(i).map_or(DVec3::ONE, |v| DVec3::from_array(*v));
        Local::Parts { translation, rotation, scale }.matrix()
    };
    Some((0..count).map(of).collect())
}

fn read<const N: usize>(
    attributes: Json<'_>,
    name: &str,
    kind: &str,
    accessors: &Accessors<'_, '_>,
    report: &mut Report<'_>,
) -> Option<Vec<[f64; N]>> {
    let Some(at) = attributes.get(name) else { return Some(vec![]) };
    let found = accessors.at(at, report)?;
    if found.kind() != kind {
        report.error(at, format!("an accessor of type {kind} is expected here, not {}", found.kind()));
        return None;
    }
    Some(found.all(&accessors.buffers).collect())
}
