//! Files of other formats that an X3D scene inlines: each is imported as if it stood alone, then put in its place among the surfaces.

use super::{
    space,
    walk::{Placed, World},
};
use crate::import::{
    Bundle,
    findings::{At, Findings},
    import_file,
    name::Names,
    surfaces::Surfaces,
};
use glam::DMat4;
use kiln_proto::{
    options::ImportOptions,
    scene::{Falloff, LightShape, Mapping, Part, Reflection, Scene, Surface, TextureRef, Triangle},
};
use std::collections::BTreeSet;

/// The scenes of all inlined files, in the order of the walk; a file that stands in several places is imported for each.
pub(super) fn read<'w, 'd>(
    bundle: &Bundle,
    world: &'w World<'d>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Vec<(&'w Placed<'d>, Scene)> {
    let mut scenes = vec![];
    for (placed, path) in &world.files {
        if let Some(scene) = import_file(bundle, path, options, findings) {
            scenes.push((placed, scene));
        }
    }
    scenes
}

impl Surfaces {
    /// Adds a scene of another format at a place.
    pub(super) fn absorb(&mut self, mut file: Scene, placed: &Placed<'_>, scene: &mut Scene, findings: &mut Findings) {
        let offsets = (scene.materials.len() as u32, scene.textures.len() as u32);
        let matrix = placed.matrix;
        let mirrors = matrix.determinant() < 0.0;
        let backs: BTreeSet<u32> = file.surfaces.iter().filter_map(|s| s.back_of).collect();
        let fronts = std::mem::take(&mut file.surfaces);
        for (index, front) in fronts.into_iter().enumerate().filter(|(_, s)| s.back_of.is_none()) {
            let two_sided = backs.contains(&(index as u32));
            for (part, first) in front.parts.iter().scan(0, |end, part| {
                let first = *end;
                *end += part.triangles as usize;
                Some((part, first))
            }) {
                let range = first..first + part.triangles as usize;
                let surface = self.moved(&front, range, &file, &matrix, mirrors, placed.node.at(), findings);
                if !surface.triangles.is_empty() {
                    let part = Part::plain("", part.material + offsets.0, surface.triangles.len());
                    self.push(surface, part, &front.name, two_sided, None);
                }
            }
        }
        let shift = |t: &mut TextureRef| t.texture += offsets.1;
        for mut material in file.materials {
            textures_of(&mut material).into_iter().for_each(shift);
            scene.materials.push(material);
        }
        scene.textures.append(&mut file.textures);
        let mut names = Names::of(scene.lights.iter().map(|l| l.name.as_str()));
        for mut light in file.lights {
            place_light(&mut light, &matrix);
            light.name = names.take(&light.name);
            scene.lights.push(light);
        }
        if !file.cameras.is_empty() {
            findings.count(placed.node.at(), "cameras of inlined files were left out");
        }
    }

    #[allow(clippy::too_many_arguments)] // A run of triangles, where it comes from and where it goes.
    fn moved(
        &mut self,
        front: &Surface,
        range: std::ops::Range<usize>,
        file: &Scene,
        matrix: &DMat4,
        mirrors: bool,
        at: At<'_>,
        findings: &mut Findings,
    ) -> Surface {
        fn turn<T: Copy>(mirrors: bool, [a, b, c]: [T; 3]) -> [T; 3] {
            if mirrors { [a, c, b] } else { [a, b, c] }
        }
        let inverse = matrix.inverse().transpose();
        let mut surface = Surface { uv_sets: vec![vec![]; front.uv_sets.len()], ..Surface::default() };
        for i in range {
            let corners = front.triangles[i].corners.map(|c| {
                let p = space::point(matrix, file.positions[c as usize]);
                self.weld.positions.id(space::narrow(p))
            });
            let corners = turn(mirrors, corners);
            if let Err(left) = self.weld.triangle(corners) {
                findings.count(at, left.words());
                continue;
            }
            surface.triangles.push(Triangle { corners, polygon: front.triangles[i].polygon });
            for (set, from) in surface.uv_sets.iter_mut().zip(&front.uv_sets) {
                set.push(from[i].map(|uv| turn(mirrors, uv)));
            }
            if let Some(normals) = front.normals.get(i) {
                let moved = normals.map(|n| {
                    let n = file.normals[n as usize];
                    space::narrow(inverse.transform_vector3(space::wide(n)).normalize_or(space::wide(n)))
                });
                surface.normals.push(turn(mirrors, moved.map(|n| self.weld.normals.id(n))));
            }
            if let Some(colors) = front.colors.get(i) {
                surface.colors.push(turn(mirrors, colors.map(|c| self.weld.colors.id(file.colors[c as usize]))));
            }
        }
        surface
    }
}

/// Every texture that a material names, to be renumbered.
fn textures_of(material: &mut kiln_proto::scene::Material) -> Vec<&mut TextureRef> {
    let mut all: Vec<&mut TextureRef> = vec![];
    match &mut material.reflection {
        Reflection::None => {}
        Reflection::Phong(p) => {
            all.extend(p.layers.iter_mut().map(|l| &mut l.texture));
            all.extend(&mut p.specular_texture);
        }
        Reflection::MetallicRoughness(p) => {
            all.extend(p.layers.iter_mut().map(|l| &mut l.texture));
            all.extend(&mut p.metallic_roughness_texture);
            all.extend(&mut p.specular_texture);
            all.extend(&mut p.specular_color_texture);
            all.extend(&mut p.transmission_texture);
        }
    }
    all.extend(&mut material.emission_texture);
    all.extend(&mut material.opacity.texture);
    all.extend(material.normal_map.iter_mut().map(|n| &mut n.texture));
    debug_assert!(all.iter().all(|t| matches!(t.mapping, Mapping::Uv { .. })));
    all
}

fn place_light(light: &mut kiln_proto::scene::Light, matrix: &DMat4) {
    let at = |p: [f32; 3]| space::narrow(space::point(matrix, p));
    let along = |d: [f32; 3]| space::direction(matrix, d).map_or(d, space::narrow);
    match &mut light.shape {
        LightShape::Point { position } => *position = at(*position),
        LightShape::Spot { position, direction, .. } => (*position, *direction) = (at(*position), along(*direction)),
        LightShape::Directional { direction } => *direction = along(*direction),
    }
    if let Falloff::InverseSquare { range: Some(range) } = &mut light.falloff {
        *range *= space::stretch(matrix) as f32;
    }
}
