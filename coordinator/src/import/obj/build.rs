//! From faces to surfaces, named.
//!
//! A surface is an (object, material) pair: one light field has one material. It is called like its object where the object has one
//! material, and `OBJECT.MATERIAL` where it has several. Objects are `o` names where the file has any, else `g` names, else the file's.

use super::{material::Materials, scan::State, shade::Shaded};
use crate::import::{
    findings::{At, Findings},
    surfaces::{Look, Surfaces, called},
};
use kiln_proto::{limits, scene::Scene};
use std::collections::BTreeMap;

/// What an (object, material) pair is known by: indices into the names.
type Key = (Option<usize>, Option<usize>);

/// What becomes of one pair.
struct Part {
    key: Key,
    material: u32,
    /// The line of its first face.
    line: u32,
    polygons: Vec<u32>,
}

/// Adds the surfaces of a file to a scene, in the order of their first faces.
pub(super) fn build(file: &str, stem: &str, shaded: &Shaded, materials: &mut Materials<'_>, scene: &mut Scene, findings: &mut Findings) {
    let parts = parts(file, shaded, materials, findings);
    if parts.len() > limits::SURFACES {
        let message = format!("the scene has {} surfaces; at most {} are allowed", parts.len(), limits::SURFACES);
        findings.error(At::file(file), message);
        return;
    }
    let mut pieces: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    parts.iter().for_each(|p| *pieces.entry(p.key.0).or_default() += 1);
    let mut surfaces = Surfaces::default();
    for part in parts {
        let object = part.key.0.map_or(stem, |i| shaded.names[i].0.as_str());
        let material = part.key.1.map_or("default", |i| shaded.names[i].0.as_str());
        let name = called(object, (pieces[&part.key.0] > 1).then_some(material));
        let look = Look { name: &name, front: part.material, casts_shadows: true, ..Look::default() };
        let at = |polygon: usize| At::line(file, shaded.faces[polygon].line);
        if looks_up(materials, part.material) {
            let lacking = part.polygons.iter().map(|p| *p as usize).filter(|p| shaded.lacks_uv(*p));
            let what = "faces lack the texture coordinates that their material looks up, the lower left texel is taken";
            lacking.for_each(|p| findings.count(at(p), what));
        }
        if !surfaces.add(&shaded.mesh, part.polygons.iter().map(|p| *p as usize), look, at, findings) {
            findings.warn(At::line(file, part.line), format!("the surface `{name}` has no triangles left and was dropped"));
        }
    }
    surfaces.finish(scene);
}

fn looks_up(materials: &Materials<'_>, id: u32) -> bool {
    materials.materials.get(id as usize).is_some_and(|m| m.textures().next().is_some())
}

/// Sorts faces into pairs.
fn parts(file: &str, shaded: &Shaded, materials: &mut Materials<'_>, findings: &mut Findings) -> Vec<Part> {
    let by_object = shaded.states.iter().any(|s| s.object.is_some());
    let key = |state: &State| (if by_object { state.object } else { state.group }, state.material);
    let (mut parts, mut ids) = (Vec::<Part>::new(), BTreeMap::<Key, usize>::new());
    for (polygon, face) in shaded.faces.iter().enumerate() {
        let key = key(&shaded.states[face.state as usize]);
        let id = *ids.entry(key).or_insert_with(|| {
            let name = key.1.map(|i| &shaded.names[i]);
            let at = At::line(file, name.map_or(face.line, |(_, first)| *first));
            if name.is_none() {
                findings.warn_once(at, "no material", "faces before any `usemtl` have no material; a grey one is used");
            }
            let material = materials.id(name.map(|(n, _)| n.as_str()), at, findings);
            parts.push(Part { key, material, line: face.line, polygons: vec![] });
            parts.len() - 1
        });
        parts[id].polygons.push(polygon as u32);
    }
    parts
}
