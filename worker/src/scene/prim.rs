//! Primitives: triangles with what a path needs to know of them.
//!
//! Both sides of a two-sided surface are primitives, but only the front is in the hierarchy: two triangles in one place would be hit in
//! turns of rounding. A hit from behind takes the primitive of the back.

use crate::sampling::warp;
use glam::{DVec3, Vec3};
use kiln_proto::{
    frame::{Frame, corner_normals},
    scene::{Scene, Surface},
};

/// How far rays start off a surface, relative to the largest coordinate of its triangle: 32 units in the last place, ten times the error of
/// an interpolated position. Relative, so that a scene a thousand times smaller bakes the same.
const LIFT: f32 = 32.0 * f32::EPSILON;
/// How far they start from the triangle's edges, in units of the lift: rounding must not carry a point at an edge beyond the wall that
/// stands there, nor lifting one in a corner that is narrower than a right angle (down to 30 degrees).
const INSET: f32 = 2.0;
/// How far a point may be raised onto the smooth surface, relative to the longest edge. A sphere of eight segments needs 0.19 of it.
const HIGHEST: f32 = 0.25;
/// An interpolated normal is turned toward the triangle's until their cosine is at least this.
const LEAST_AGREEMENT: f32 = 0.05;

/// A triangle with what a path needs to know of it.
#[derive(Debug, Clone, Copy)]
pub struct Prim {
    /// World corners, metres.
    pub corners: [Vec3; 3],
    /// Normal from the winding, and two axes that complete it; no texture follows them.
    pub frame: Frame,
    /// Metres by which points on it are lifted before rays leave them.
    pub lift: f32,
    /// Index of the material.
    pub material: u32,
    /// Index of the surface.
    pub surface: u32,
    /// Index of the part within it.
    pub part: u32,
    /// Its index among the lights' emitters.
    pub emitter: Option<u32>,
    /// The other side: of a front its back, of a back its front.
    pub other: Option<u32>,
    /// Index of its vertex normals, where it is smooth.
    pub smooth: Option<u32>,
    /// Whether it is a back, which is not in the hierarchy.
    pub is_back: bool,
    /// Whether it has vertex colours.
    pub is_colored: bool,
    /// Whether its material emits, so that most hits need not ask.
    pub is_emissive: bool,
    /// Whether its material has a normal map.
    pub is_mapped: bool,
}

/// The primitives of a scene.
#[derive(Debug, Default)]
pub(super) struct Prims {
    pub(super) all: Vec<Prim>,
    /// The first primitive of each surface.
    pub(super) first: Vec<u32>,
    /// Unit vertex normals of smooth primitives.
    pub(super) normals: Vec<[Vec3; 3]>,
}

impl Prims {
    /// Cost: linear in triangles.
    pub(super) fn new(scene: &Scene) -> Self {
        let mut prims = Self { all: Vec::with_capacity(scene.triangle_count()), ..Self::default() };
        for (index, surface) in scene.surfaces.iter().enumerate() {
            prims.first.push(prims.all.len() as u32);
            for (t, part) in surface.part_of_triangles().enumerate() {
                let smooth = prims.vertex_normals(scene, surface, t);
                let corners = scene.corners(&surface.triangles[t]);
                let material = &scene.materials[surface.parts[part].material as usize];
                let (is_emissive, is_mapped) = (material.is_emissive(), material.normal_map.is_some());
                prims.all.push(Prim { is_emissive, is_mapped, ..Prim::new(corners, (index, surface), part, smooth) });
            }
        }
        prims.pair(scene);
        prims
    }

    fn vertex_normals(&mut self, scene: &Scene, surface: &Surface, triangle: usize) -> Option<u32> {
        let corners = corner_normals(scene, surface, triangle)?;
        self.normals.push(corners.map(|n| n.as_vec3()));
        Some(self.normals.len() as u32 - 1)
    }

    fn pair(&mut self, scene: &Scene) {
        for (index, surface) in scene.surfaces.iter().enumerate() {
            let Some(front) = surface.back_of else { continue };
            let (front, back) = (self.first[front as usize], self.first[index]);
            for t in 0..surface.triangles.len() as u32 {
                self.all[(front + t) as usize].other = Some(back + t);
                self.all[(back + t) as usize].other = Some(front + t);
            }
        }
    }
}

impl Prim {
    fn new(corners: [DVec3; 3], (surface, owner): (usize, &Surface), part: usize, smooth: Option<u32>) -> Self {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize().unwrap_or(DVec3::Y).as_vec3();
        let (tangent, bitangent) = warp::basis(normal);
        let corners = corners.map(|c| c.as_vec3());
        let largest = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max);
        Self {
            corners,
            frame: Frame { tangent, bitangent, normal },
            lift: LIFT * largest,
            material: owner.parts[part].material,
            surface: surface as u32,
            part: part as u32,
            emitter: None,
            other: None,
            smooth,
            is_back: owner.back_of.is_some(),
            is_colored: !owner.colors.is_empty(),
            is_emissive: false,
            is_mapped: false,
        }
    }

    /// The point with these weights of the second and third corner.
    #[inline]
    pub fn at(&self, [b, c]: [f32; 2]) -> Vec3 {
        self.corners[0] * (1.0 - b - c) + self.corners[1] * b + self.corners[2] * c
    }

    /// A point on it a little nearer to its middle.
    #[inline]
    pub(super) fn inset(&self, at: Vec3) -> Vec3 {
        let inward = (self.corners[0] + self.corners[1] + self.corners[2]) * (1.0 / 3.0) - at;
        let distance = inward.length();
        let step = if distance > 0.0 { (INSET * self.lift).min(distance) / distance } else { 0.0 };
        at + inward * step
    }

    /// Its area, m².
    #[must_use]
    pub fn area(&self) -> f32 {
        0.5 * (self.corners[1] - self.corners[0]).cross(self.corners[2] - self.corners[0]).length()
    }

    /// A point moved out onto the smooth surface that the vertex normals mean (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems
    /// II, chapter 4): onto the tangent planes of the corners, weighted. In hollows, where the point lies before those planes, it stays.
    #[inline]
    pub(super) fn raised(&self, point: Vec3, [b, c]: [f32; 2], normals: &[Vec3; 3]) -> Vec3 {
        let mut offset = Vec3::ZERO;
        for ((corner, normal), weight) in self.corners.iter().zip(normals).zip([1.0 - b - c, b, c]) {
            let below = normal.dot(*corner - point).max(0.0);
            offset += *normal * (below * weight.max(0.0));
        }
        let [x, y, z] = self.corners;
        let edge = (y - x).length().max((z - y).length()).max((x - z).length());
        point + offset.clamp_length_max(HIGHEST * edge)
    }

    /// The interpolated normal, turned away from the plane of the triangle where the author's normals lean too far.
    #[inline]
    pub(super) fn normal_at(&self, [b, c]: [f32; 2], normals: &[Vec3; 3]) -> Vec3 {
        let mean = (normals[0] * (1.0 - b - c) + normals[1] * b + normals[2] * c).normalize_or(self.frame.normal);
        let lean = LEAST_AGREEMENT - mean.dot(self.frame.normal);
        if lean <= 0.0 { mean } else { (mean + self.frame.normal * lean).normalize_or(self.frame.normal) }
    }
}
