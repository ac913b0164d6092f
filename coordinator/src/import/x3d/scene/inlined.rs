//! Files of other formats that an X3D scene inlines: each is imported once, as if it stood alone, then put in its places among the
//! surfaces.
//!
//! What all places together come to is counted before the first copy: a few nodes that use each other may inline a file a million times.

use super::{
    reach::{Reach, TooManyPairs},
    space,
    walk::{Placed, World},
};
use crate::import::{Bundle, BundlePath, findings::Findings, images::Images, import_file, mesh, name::Names, surfaces::Surfaces};
use glam::{DMat3, DMat4};
use kiln_proto::{
    limits,
    options::ImportOptions,
    scene::{Falloff, Light, LightShape, Part, Scene, Surface, Triangle},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
};

/// The scenes of all inlined files, whose textures are those of the scene around them, with their places.
pub(super) struct Files<'w, 'd> {
    scenes: Vec<Scene>,
    /// In the order of the walk: where, and the index of which scene.
    places: Vec<(&'w Placed<'d>, usize)>,
}

/// Reads the inlined files; nothing where all their places together are more than a scene may have, which is then an error.
pub(super) fn read<'w, 'd>(
    bundle: &Bundle,
    world: &'w World<'d>,
    options: &ImportOptions,
    images: &mut Images,
    findings: &mut Findings,
) -> Files<'w, 'd> {
    let mut files = Files { scenes: vec![], places: vec![] };
    let mut known: BTreeMap<&BundlePath, Option<usize>> = BTreeMap::new();
    let (mut sums, mut boxes) = ([0usize; 3], vec![]);
    for (placed, path) in &world.files {
        let index = *known.entry(path).or_insert_with(|| {
            let scene = import_file(bundle, path, options, images, findings)?;
            boxes.push(scene.bounds());
            files.scenes.push(scene);
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
        if stays_finite(boxes[index], &scene.lights, &placed.matrix) {
            files.places.push((placed, index));
        } else {
            findings.error(placed.node.at(), format!("`{path}` becomes infinitely large or far where this Inline places it"));
        }
    }
    files
}

/// Whether what a box is around, and lights, are within the range of f32 where a matrix moves them.
fn stays_finite((low, high): ([f32; 3], [f32; 3]), lights: &[Light], matrix: &DMat4) -> bool {
    let moved = |p: [f32; 3]| space::narrow(space::point(matrix, p)).into_iter().all(f32::is_finite);
    let corner = |k: usize| std::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] });
    let is_empty = low[0] > high[0];
    let lit = |light: &Light| {
        let mut light = light.clone();
        place_light(&mut light, matrix);
        let is_in_range = !matches!(light.falloff, Falloff::InverseSquare { range: Some(range) } if !range.is_finite());
        let (LightShape::Point { position } | LightShape::Spot { position, .. }) = light.shape else { return is_in_range };
        is_in_range && position.into_iter().all(f32::is_finite)
    };
    (is_empty || (0..8).all(|k| moved(corner(k)))) && lights.iter().all(lit)
}

impl<'w, 'd> Files<'w, 'd> {
    /// Every scene at each of its places.
    pub(super) fn placed(&self) -> impl Iterator<Item = (&'w Placed<'d>, &Scene)> {
        self.places.iter().map(|(placed, index)| (*placed, &self.scenes[*index]))
    }

    /// Adds all of them to a scene and its surfaces.
    pub(super) fn absorb(self, surfaces: &mut Surfaces, scene: &mut Scene, reach: &mut Reach<'_, '_>, findings: &mut Findings) {
        let first: Vec<u32> = self.scenes.iter().map(|file| add_materials(file, scene)).collect();
        let mut names = Names::of(scene.lights.iter().map(|l| l.name.as_str()));
        for (placed, index) in &self.places {
            let copy = Instance {
                file: &self.scenes[*index],
                first_material: first[*index],
                placed,
                of_normals: mesh::for_normals(DMat3::from_mat4(placed.matrix)),
            };
            if let Err(e) = surfaces.absorb(&copy, reach, findings) {
                return findings.error(placed.node.at(), e.to_string());
            }
            for light in &copy.file.lights {
                let mut light = light.clone();
                place_light(&mut light, &placed.matrix);
                light.name = names.take(&light.name);
                scene.lights.push(light);
            }
            if !copy.file.cameras.is_empty() {
                findings.count(placed.node.at(), "cameras of inlined files were left out");
            }
        }
    }
}

/// Adds a file's materials, whose textures are the scene's already; returns the index of its first material.
fn add_materials(file: &Scene, scene: &mut Scene) -> u32 {
    let first = scene.materials.len() as u32;
    scene.materials.extend_from_slice(&file.materials);
    first
}

/// A file at one of its places.
struct Instance<'a, 'd> {
    file: &'a Scene,
    /// Index of the file's first material among those of the scene.
    first_material: u32,
    placed: &'a Placed<'d>,
    /// What takes its normals there.
    of_normals: DMat3,
}

impl Surfaces {
    /// Adds the surfaces of a file at a place.
    fn absorb(&mut self, copy: &Instance<'_, '_>, reach: &mut Reach<'_, '_>, findings: &mut Findings) -> Result<(), TooManyPairs> {
        let file = copy.file;
        let unlit_by = reach.unlit_by(copy.placed.group)?;
        let backs: BTreeSet<u32> = file.surfaces.iter().filter_map(|s| s.back_of).collect();
        for (index, front) in file.surfaces.iter().enumerate().filter(|(_, s)| s.back_of.is_none()) {
            let two_sided = backs.contains(&(index as u32));
            let mut end = 0;
            for part in &front.parts {
                let range = end..end + part.triangles as usize;
                end = range.end;
                let surface = self.moved(front, range, copy, findings);
                if surface.triangles.is_empty() {
                    continue;
                }
                reach.take(unlit_by.len())?;
                let plain = Part::plain("", part.material + copy.first_material, surface.triangles.len());
                let part = Part { casts_shadows: part.casts_shadows, unlit_by: unlit_by.to_vec(), ..plain };
                self.push(surface, part, &front.name, two_sided, None);
            }
        }
        Ok(())
    }

    /// A run of triangles of a surface at its place.
    fn moved(&mut self, front: &Surface, range: Range<usize>, copy: &Instance<'_, '_>, findings: &mut Findings) -> Surface {
        fn turn<T: Copy>(mirrors: bool, [a, b, c]: [T; 3]) -> [T; 3] {
            if mirrors { [a, c, b] } else { [a, b, c] }
        }
        let (file, matrix) = (copy.file, &copy.placed.matrix);
        let mirrors = matrix.determinant() < 0.0;
        let mut surface = Surface { uv_sets: vec![vec![]; front.uv_sets.len()], ..Surface::default() };
        for i in range {
            let corners = front.triangles[i].corners.map(|c| {
                let p = space::point(matrix, file.positions[c as usize]);
                self.weld.positions.id(space::narrow(p))
            });
            let corners = turn(mirrors, corners);
            if let Err(left) = self.weld.triangle(corners) {
                findings.count(copy.placed.node.at(), left.words());
                continue;
            }
            surface.triangles.push(Triangle { corners, polygon: front.triangles[i].polygon });
            for (set, from) in surface.uv_sets.iter_mut().zip(&front.uv_sets) {
                set.push(from[i].map(|uv| turn(mirrors, uv)));
            }
            if let Some(normals) = front.normals.get(i) {
                let moved = normals.map(|n| {
                    let n = file.normals[n as usize];
                    space::narrow((copy.of_normals * space::wide(n)).normalize_or(space::wide(n)))
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

fn place_light(light: &mut Light, matrix: &DMat4) {
    let at = |p: [f32; 3]| space::narrow(space::point(matrix, p));
    let along = |d: [f32; 3]| space::direction(matrix, d).map_or(d, space::narrow);
    match &mut light.shape {
        LightShape::Point { position } => *position = at(*position),
        LightShape::Spot { position, direction, .. } => (*position, *direction) = (at(*position), along(*direction)),
        LightShape::Directional { direction } => *direction = along(*direction),
    }
    if let Falloff::InverseSquare { range: Some(range) } = &mut light.falloff {
        *range *= mesh::stretch(matrix) as f32;
    }
}
