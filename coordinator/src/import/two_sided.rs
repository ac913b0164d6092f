//! What is seen from both sides becomes two surfaces, `NAME` and `NAME~back`, each with a light field of its own.
//!
//! The back is the front with the second and third corner of every triangle exchanged, and all that belongs to corners with them, and with
//! its normals and the sides of its bitangents reversed. Making the copy here rather than in the worker keeps one rule for everything
//! behind the import: a triangle reflects and emits on its front.

use super::name::{Names, Stems};
use kiln_proto::scene::{Scene, Surface, Triangle};
use std::collections::BTreeMap;

/// Gives a back to every surface whose entry in `two_sided` is true, right behind its front.
pub(super) fn split(scene: &mut Scene, two_sided: &[bool]) {
    let fronts = std::mem::take(&mut scene.surfaces);
    let mut names = Names::of(fronts.iter().map(|s| s.name.as_str()));
    let mut stems = Stems::of(fronts.iter().map(|s| s.file_stem.as_str()));
    let (mut reversed, mut mirrored) = (BTreeMap::new(), BTreeMap::new());
    for (at, front) in fronts.into_iter().enumerate() {
        let index = scene.surfaces.len() as u32;
        let back = two_sided.get(at).copied().unwrap_or(false).then(|| {
            let name = names.take(&format!("{}~back", front.name));
            let file_stem = stems.take(&format!("{}~back", front.file_stem));
            let mut back = back_of(&front, index, name, file_stem);
            let (normals, tangents) = (&mut scene.normals, &mut scene.tangents);
            back.normals
                .iter_mut()
                .flatten()
                .for_each(|n| *n = *reversed.entry(*n).or_insert_with(|| changed(normals, *n, |n| n.map(|v| 0.0 - v))));
            let mirror = |[x, y, z, side]: [f32; 4]| [x, y, z, -side];
            back.tangents.iter_mut().flatten().for_each(|t| *t = *mirrored.entry(*t).or_insert_with(|| changed(tangents, *t, mirror)));
            back
        });
        scene.surfaces.push(front);
        scene.surfaces.extend(back);
    }
}

/// Adds what becomes of a value.
fn changed<T: Copy>(values: &mut Vec<T>, index: u32, change: impl Fn(T) -> T) -> u32 {
    values.push(change(values[index as usize]));
    values.len() as u32 - 1
}

/// The back of a surface, with the normals and tangents of its front.
fn back_of(front: &Surface, index: u32, name: String, file_stem: String) -> Surface {
    fn turn<T: Copy>([a, b, c]: [T; 3]) -> [T; 3] {
        [a, c, b]
    }
    let mut parts = front.parts.clone();
    match parts.as_mut_slice() {
        [only] => only.name.clone_from(&name),
        several => several.iter_mut().for_each(|part| part.name += "~back"),
    }
    Surface {
        name,
        file_stem,
        back_of: Some(index),
        parts,
        triangles: front.triangles.iter().map(|t| Triangle { corners: turn(t.corners), ..*t }).collect(),
        uv_sets: front.uv_sets.iter().map(|set| set.iter().map(|uv| uv.map(turn)).collect()).collect(),
        normals: front.normals.iter().copied().map(turn).collect(),
        tangents: front.tangents.iter().copied().map(turn).collect(),
        colors: front.colors.iter().copied().map(turn).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::{
        scene::{Material, Part},
        units::Rgb,
    };

    fn sheet(name: &str) -> Surface {
        Surface {
            name: name.into(),
            file_stem: name.replace('~', "_"),
            parts: vec![Part::plain(name, 0, 1)],
            triangles: vec![Triangle { corners: [0, 1, 2], polygon: 4 }],
            uv_sets: vec![vec![Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])]],
            normals: vec![[0, 0, 1]],
            tangents: vec![[0, 1, 0]],
            colors: vec![[0, 1, 0]],
            ..Surface::default()
        }
    }

    #[test]
    fn a_back_follows_its_front_turned_over() {
        let mut scene = Scene {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]],
            tangents: vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, -1.0]],
            colors: vec![[1.0; 4], [0.5; 4]],
            surfaces: vec![sheet("wall"), sheet("leaf"), sheet("leaf~back")],
            materials: vec![Material::matt("m", Rgb::WHITE)],
            ..Scene::empty()
        };
        split(&mut scene, &[false, true, false]);
        scene.validate().unwrap();
        let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["wall", "leaf", "leaf~back-2", "leaf~back"]);
        let back = &scene.surfaces[2];
        assert_eq!((back.back_of, back.parts[0].name.as_str()), (Some(1), "leaf~back-2"));
        assert_eq!(back.triangles[0], Triangle { corners: [0, 2, 1], polygon: 4 });
        assert_eq!(back.uv_sets[0][0].unwrap()[1], [0.0, 1.0]);
        assert_eq!((back.normals[0], back.colors[0]), ([2, 3, 2], [0, 0, 1]));
        assert_eq!((back.tangents[0], &scene.tangents[2..]), ([2, 2, 3], &[[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 0.0, 1.0]][..]));
        assert_eq!(scene.normals[2..], [[0.0, 0.0, -1.0], [0.0, -0.6, -0.8]]);
    }
}
