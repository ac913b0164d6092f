//! Surfaces as meshes: corners that agree in everything become one vertex again.

use super::{
    ExportError, Writer,
    material::{Coordinates, Materials},
};
use glam::Vec3;
use kiln_proto::scene::{Part, Reflection, Surface};
use serde_json::{Map, Value, json};
use std::{collections::BTreeMap, ops::Range};

/// How far the square of a normal's length may be from one before it is brought there: what the validator tolerates, and less.
const UNIT: f32 = 1e-4;

/// The vertices of one primitive.
#[derive(Default)]
struct Vertices {
    known: BTreeMap<Vec<u32>, u32>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    tangents: Vec<[f32; 4]>,
    colors: Vec<[f32; 4]>,
    /// By set, v down.
    uvs: Vec<Vec<[f32; 2]>>,
    indices: Vec<u32>,
}

/// One corner of a triangle.
struct Corner {
    position: [f32; 3],
    normal: Option<[f32; 3]>,
    tangent: Option<[f32; 4]>,
    color: Option<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
}

impl Writer<'_> {
    /// A mesh and a node for each surface that is not the back of another, and for backs of another material.
    pub(super) fn meshes(&mut self, materials: &mut Materials<'_>) -> Result<Vec<Value>, ExportError> {
        let scene = self.scene;
        let mut backs: Vec<Option<&Surface>> = vec![None; scene.surfaces.len()];
        for back in &scene.surfaces {
            if let Some(front) = back.back_of {
                backs[front as usize] = Some(back);
            }
        }
        let mut meshes = vec![];
        for (index, surface) in scene.surfaces.iter().enumerate() {
            let front = surface.back_of.map(|front| &scene.surfaces[front as usize]);
            if front.is_some_and(|front| same_sides(front, surface)) {
                continue;
            }
            let double_sided = backs[index].is_some_and(|back| same_sides(surface, back));
            let primitives = self.primitives(surface, double_sided, materials)?;
            self.nodes.push(json!({"name": surface.name, "mesh": meshes.len()}));
            meshes.push(json!({"name": surface.name, "primitives": primitives}));
        }
        Ok(meshes)
    }

    fn primitives(&mut self, surface: &Surface, double_sided: bool, materials: &mut Materials<'_>) -> Result<Vec<Value>, ExportError> {
        let mut start = 0;
        let mut primitives = vec![];
        for part in &surface.parts {
            let range = start..start + part.triangles as usize;
            start = range.end;
            if !range.is_empty() {
                primitives.push(self.primitive(surface, part, range, double_sided, materials)?);
            }
        }
        Ok(primitives)
    }

    fn primitive(
        &mut self,
        surface: &Surface,
        part: &Part,
        triangles: Range<usize>,
        double_sided: bool,
        materials: &mut Materials<'_>,
    ) -> Result<Value, ExportError> {
        self.note_part(part);
        let (material, wanted) = materials.choose(part.material, double_sided, self)?;
        let unlit = matches!(self.scene.materials[part.material as usize].reflection, Reflection::None);
        let own = (0..surface.uv_sets.len()).rev().find(|set| surface.uv_sets[*set][triangles.clone()].iter().any(Option::is_some));
        let sets = wanted.sets.max(own.map_or(0, |set| set + 1));
        let mut vertices = Vertices { uvs: vec![vec![]; sets + wanted.extra.len()], ..Vertices::default() };
        for triangle in triangles {
            for corner in 0..3 {
                let found = self.corner(surface, triangle, corner, unlit, sets, &wanted);
                vertices.add(found);
            }
        }
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), json!(self.buffers.attribute(&vertices.positions, true)?));
        if !vertices.normals.is_empty() {
            attributes.insert("NORMAL".into(), json!(self.buffers.attribute(&vertices.normals, false)?));
        }
        // Where a corner has none, whoever reads the file makes them all.
        if !vertices.tangents.is_empty() && vertices.tangents.len() == vertices.positions.len() {
            attributes.insert("TANGENT".into(), json!(self.buffers.attribute(&vertices.tangents, false)?));
        }
        if vertices.colors.iter().any(|c| *c != [1.0; 4]) {
            attributes.insert("COLOR_0".into(), json!(self.buffers.attribute(&vertices.colors, false)?));
        }
        for (set, uvs) in vertices.uvs.iter().enumerate() {
            attributes.insert(format!("TEXCOORD_{set}"), json!(self.buffers.attribute(uvs, false)?));
        }
        let indices = self.buffers.indices(&vertices.indices, vertices.positions.len())?;
        Ok(json!({"attributes": attributes, "indices": indices, "material": material}))
    }

    fn corner(&self, surface: &Surface, triangle: usize, corner: usize, unlit: bool, sets: usize, wanted: &Coordinates) -> Corner {
        let scene = self.scene;
        let at = |set: usize| surface.uv(set, triangle).map_or([0.0; 2], |uv| uv[corner]);
        let extra = wanted.extra.iter().map(|(set, m)| {
            let [u, v] = at(*set as usize);
            m.map(|[a, b, c]| a * u + b * v + c)
        });
        let uvs = (0..sets).map(at).chain(extra).map(|[u, v]| [u + 0.0, 1.0 - v]);
        let color = surface.colors.get(triangle).map(|c| scene.colors[c[corner] as usize]);
        let normal = surface.normals.get(triangle).map(|n| self.normal(surface, triangle, n[corner]));
        Corner {
            position: scene.positions[surface.triangles[triangle].corners[corner] as usize],
            // glTF has no tangents without normals.
            normal: normal.or_else(|| (!surface.tangents.is_empty()).then(|| self.flat(surface, triangle))),
            tangent: surface.tangents.get(triangle).and_then(|t| unit_tangent(scene.tangents[t[corner] as usize])),
            // A material that only emits has its own colour at every vertex; a vertex's opacity acts all the same.
            color: color.map(|c| if unlit { [1.0, 1.0, 1.0, c[3]] } else { c }),
            uvs: uvs.collect(),
        }
    }

    /// A normal of length one; that of the triangle where it has no length.
    fn normal(&self, surface: &Surface, triangle: usize, index: u32) -> [f32; 3] {
        let normal = Vec3::from_array(self.scene.normals[index as usize]);
        if (normal.length_squared() - 1.0).abs() <= UNIT {
            return normal.to_array();
        }
        normal.try_normalize().map_or_else(|| self.flat(surface, triangle), |unit| unit.to_array())
    }

    /// The normal of a triangle itself.
    fn flat(&self, surface: &Surface, triangle: usize) -> [f32; 3] {
        let [a, b, c] = self.scene.corners(&surface.triangles[triangle]);
        (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array()
    }

    fn note_part(&mut self, part: &Part) {
        if !part.casts_shadows {
            self.notes.count("parts that throw no shadow throw one in glTF", &part.name);
        }
        if !part.receive_shadows.is_empty() || !part.shadow_maps.is_empty() {
            self.notes.count("shadow fields of parts, which glTF has no place for, were left out", &part.name);
        }
        if !part.unlit_by.is_empty() {
            self.notes.count("parts that some lights do not shine on are lit by every light in glTF", &part.name);
        }
    }
}

/// A tangent of length one, if it has a length.
fn unit_tangent([x, y, z, side]: [f32; 4]) -> Option<[f32; 4]> {
    let tangent = Vec3::new(x, y, z);
    let unit = if (tangent.length_squared() - 1.0).abs() <= UNIT { Some(tangent) } else { tangent.try_normalize() };
    unit.map(|t| t.extend(side).to_array())
}

/// Whether a surface and its back differ in nothing but their side.
fn same_sides(front: &Surface, back: &Surface) -> bool {
    let materials = |s: &Surface| s.parts.iter().map(|p| (p.material, p.triangles)).collect::<Vec<_>>();
    materials(front) == materials(back)
}

impl Vertices {
    fn add(&mut self, corner: Corner) {
        let Corner { position, normal, tangent, color, uvs } = corner;
        let of_four = |v: &Option<[f32; 4]>| v.map_or(vec![], |v| v.to_vec());
        let numbers = [&position[..], normal.as_ref().map_or(&[], |n| &n[..]), &of_four(&tangent), &of_four(&color), uvs.as_flattened()];
        let key = numbers.into_iter().flatten().map(|v| v.to_bits()).collect();
        let next = self.positions.len() as u32;
        let id = *self.known.entry(key).or_insert(next);
        self.indices.push(id);
        if id == next {
            self.positions.push(position);
            self.normals.extend(normal);
            self.tangents.extend(tangent);
            self.colors.extend(color);
            self.uvs.iter_mut().zip(uvs).for_each(|(set, uv)| set.push(uv));
        }
    }
}
