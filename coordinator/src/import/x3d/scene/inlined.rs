//! Files of other formats that an X3D scene inlines: each is imported once, as if it stood alone, then put in its places among the surfaces.
//!
//! What all places together come to is counted before the first copy: a few nodes that use each other may inline a file a million times.

use super::{
    space,
    walk::{Placed, World},
};
use crate::import::{
    Bundle, BundlePath,
    findings::{At, Findings},
    import_file,
    name::Names,
    surfaces::Surfaces,
};
use glam::DMat4;
use kiln_proto::{
    limits,
    options::ImportOptions,
    scene::{Falloff, LightShape, Mapping, Part, Reflection, Scene, Surface, TextureRef, Triangle},
};
use std::collections::{BTreeMap, BTreeSet};

/// The scenes of all inlined files with their places.
pub(super) struct Files<'w, 'd> {
    scenes: Vec<Scene>,
    /// In the order of the walk: where, and the index of which scene.
    places: Vec<(&'w Placed<'d>, usize)>,
}

/// Reads the inlined files; nothing where all their places together are more than a scene may have, which is then an error.
pub(super) fn read<'w, 'd>(bundle: &Bundle, world: &'w World<'d>, options: &ImportOptions, findings: &mut Findings) -> Files<'w, 'd> {
    let mut files = Files { scenes: vec![], places: vec![] };
    let mut known: BTreeMap<&BundlePath, Option<usize>> = BTreeMap::new();
    let mut sums = [0usize; 3];
    for (placed, path) in &world.files {
        let index = *known.entry(path).or_insert_with(|| {
            files.scenes.push(import_file(bundle, path, options, findings)?);
            Some(files.scenes.len() - 1)
        });
        let Some(index) = index else { continue };
        let scene = &files.scenes[index];
        let own = [scene.triangle_count(), scene.surfaces.len(), scene.lights.len()];
        (0..3).for_each(|k| sums[k] = sums[k].saturating_add(own[k]));
        for ((what, most), sum) in
            [("triangles", limits::TRIANGLES), ("surfaces", limits::SURFACES), ("lights", limits::LIGHTS)].iter().zip(sums)
        {
            if sum > *most {
                findings.error(placed.node.at(), format!("with this Inline the scene has {sum} {what}; at most {most} are allowed"));
                return Files { scenes: vec![], places: vec![] };
            }
        }
        files.places.push((placed, index));
    }
    files
}

impl<'w, 'd> Files<'w, 'd> {
    /// Every scene at each of its places.
    pub(super) fn placed(&self) -> impl Iterator<Item = (&'w Placed<'d>, &Scene)> {
        self.places.iter().map(|(placed, index)| (*placed, &self.scenes[*index]))
    }

    /// Adds all of them to a scene and its surfaces.
    pub(super) fn absorb(self, surfaces: &mut Surfaces, scene: &mut Scene, findings: &mut Findings) {
        let first: Vec<u32> = self.scenes.iter().map(|file| add_materials(file, scene)).collect();
        let mut names = Names::of(scene.lights.iter().map(|l| l.name.as_str()));
        for (placed, index) in &self.places {
            let file = &self.scenes[*index];
            surfaces.absorb(file, first[*index], placed, findings);
            for light in &file.lights {
                let mut light = light.clone();
                place_light(&mut light, &placed.matrix);
                light.name = names.take(&light.name);
                scene.lights.push(light);
            }
            if !file.cameras.is_empty() {
                findings.count(placed.node.at(), "cameras of inlined files were left out");
            }
        }
    }
}

/// Adds a file's materials and textures; returns the index of its first material.
fn add_materials(file: &Scene, scene: &mut Scene) -> u32 {
    let (materials, textures) = (scene.materials.len() as u32, scene.textures.len() as u32);
    for material in &file.materials {
        let mut material = material.clone();
        textures_of(&mut material).into_iter().for_each(|t| t.texture += textures);
        scene.materials.push(material);
    }
    scene.textures.extend_from_slice(&file.textures);
    materials
}

impl Surfaces {
    /// Adds the surfaces of a file at a place; its materials begin at `first_material`.
    fn absorb(&mut self, file: &Scene, first_material: u32, placed: &Placed<'_>, findings: &mut Findings) {
        let matrix = placed.matrix;
        let mirrors = matrix.determinant() < 0.0;
        let backs: BTreeSet<u32> = file.surfaces.iter().filter_map(|s| s.back_of).collect();
        for (index, front) in file.surfaces.iter().enumerate().filter(|(_, s)| s.back_of.is_none()) {
            let two_sided = backs.contains(&(index as u32));
            for (part, first) in front.parts.iter().scan(0, |end, part| {
                let first = *end;
                *end += part.triangles as usize;
                Some((part, first))
            }) {
                let range = first..first + part.triangles as usize;
                let surface = self.moved(front, range, file, &matrix, mirrors, placed.node.at(), findings);
                if !surface.triangles.is_empty() {
                    let part = Part::plain("", part.material + first_material, surface.triangles.len());
                    self.push(surface, part, &front.name, two_sided, None);
                }
            }
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
            if let Some(tangents) = front.tangents.get(i) {
                let moved = tangents.map(|t| {
                    let [x, y, z, side] = file.tangents[t as usize];
                    let [x, y, z] = space::narrow(matrix.transform_vector3(space::wide([x, y, z])).normalize_or_zero());
                    self.weld.tangents.id([x, y, z, if mirrors { -side } else { side }])
                });
                surface.tangents.push(turn(mirrors, moved));
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
