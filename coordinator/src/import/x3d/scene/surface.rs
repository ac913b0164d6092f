//! Surfaces from meshes in the world, and from scenes that were inlined from other formats.

use super::{space, walk::Placed};
use crate::import::{
    findings::{At, Findings},
    mesh::Mesh,
    name::{Names, Stems},
    two_sided,
    weld::Weld,
};
use glam::DMat4;
use kiln_proto::{
    limits,
    scene::{Falloff, LightShape, Mapping, Part, Reflection, Scene, ShadowMap, Surface, TextureRef, Triangle},
};
use std::collections::BTreeSet;

/// What a mesh looks like.
pub(super) struct Look<'n> {
    pub(super) name: &'n str,
    pub(super) front: u32,
    /// The material of the back, where it is another one.
    pub(super) back: Option<u32>,
    pub(super) two_sided: bool,
    pub(super) casts_shadows: bool,
    pub(super) receive_shadows: Vec<u32>,
    pub(super) unlit_by: Vec<u32>,
    pub(super) shadow_maps: Vec<(u32, ShadowMap)>,
}

/// The surfaces of a scene so far.
#[derive(Default)]
pub(super) struct Surfaces {
    weld: Weld,
    fronts: Vec<Surface>,
    two_sided: Vec<bool>,
    /// Materials of backs.
    backs: Vec<Option<u32>>,
    names: Names,
    stems: Stems,
}

impl Surfaces {
    /// Adds a mesh in world space.
    pub(super) fn add(&mut self, mesh: &Mesh, look: Look<'_>, at: At<'_>, findings: &mut Findings) {
        let cut = mesh.triangulate();
        (0..cut.without_area).for_each(|_| findings.count(at, "triangles without area were dropped"));
        (0..cut.crossed).for_each(|_| findings.count(at, "polygons that cross themselves were cut as well as they can be"));
        let mut surface = Surface { uv_sets: vec![vec![]; mesh.uv_sets.len().min(limits::UV_SETS)], ..Surface::default() };
        for t in &cut.triangles {
            let corners = t.corners.map(|c| self.weld.positions.id(mesh.positions[mesh.corners[c as usize] as usize]));
            if let Err(left) = self.weld.triangle(corners) {
                findings.count(at, left.words());
                continue;
            }
            surface.triangles.push(Triangle { corners, polygon: t.polygon });
            for (set, channel) in surface.uv_sets.iter_mut().zip(&mesh.uv_sets) {
                set.push(Some(t.corners.map(|c| channel.get(c as usize))));
            }
            if let Some(normals) = &mesh.normals {
                surface.normals.push(t.corners.map(|c| self.weld.normals.id(normals.get(c as usize))));
            }
            if let Some(colours) = &mesh.colours {
                surface.colors.push(t.corners.map(|c| self.weld.colors.id(colours.get(c as usize))));
            }
        }
        if surface.triangles.is_empty() {
            findings.count(at, "shapes without any triangle left were dropped");
            return;
        }
        self.drop_flat_normals(&mut surface);
        let part = Part {
            casts_shadows: look.casts_shadows,
            receive_shadows: look.receive_shadows,
            unlit_by: look.unlit_by,
            shadow_maps: look.shadow_maps,
            ..Part::plain("", look.front, surface.triangles.len())
        };
        self.push(surface, part, look.name, look.two_sided, look.back);
    }

    /// A surface whose normals all are those of its triangles is flat, which needs no normals and is laid out polygon by polygon.
    fn drop_flat_normals(&self, surface: &mut Surface) {
        let place = |c: u32| space::wide(self.weld.positions.values[c as usize]);
        let flat = surface.triangles.iter().zip(&surface.normals).all(|(t, normals)| {
            let [a, b, c] = t.corners.map(place);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            normals.iter().all(|n| space::wide(self.weld.normals.values[*n as usize]).dot(normal) > 1.0 - 1e-6)
        });
        if flat {
            surface.normals.clear();
        }
    }

    fn push(&mut self, mut surface: Surface, part: Part, name: &str, two_sided: bool, back: Option<u32>) {
        let wanted: String = name.chars().take(limits::NAME_BYTES / 8).collect();
        surface.name = self.names.take(&wanted);
        surface.file_stem = self.stems.take(&surface.name);
        surface.parts = vec![Part { name: surface.name.clone(), ..part }];
        self.fronts.push(surface);
        self.two_sided.push(two_sided);
        self.backs.push(back);
    }

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

    /// Hands all over to the scene, with backs.
    pub(super) fn finish(self, scene: &mut Scene) {
        (scene.positions, scene.normals, scene.colors) = (self.weld.positions.values, self.weld.normals.values, self.weld.colors.values);
        scene.surfaces = self.fronts;
        two_sided::split(scene, &self.two_sided);
        let mut backs = self.backs.into_iter();
        let mut material = None;
        for surface in &mut scene.surfaces {
            if surface.back_of.is_none() {
                material = backs.next().flatten();
            } else if let Some(back) = material {
                surface.parts.iter_mut().for_each(|p| p.material = back);
            }
        }
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
