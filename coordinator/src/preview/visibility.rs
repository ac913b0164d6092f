//! What every ray sees: the nearest front of a triangle, where on it, and what is seen through it.
//!
//! obvhs builds the hierarchy and walks it; the triangle test is ours, in f64: the three edge functions of a ray are triple products, and
//! two triangles that share an edge compute the same one with opposite sign, so that no ray slips through between them. Boxes are grown by
//! the rounding of obvhs's f32 box test, which would otherwise tear the same gaps. Backs are not there: a room can be looked into from
//! outside; what has two sides has two surfaces, and each ray finds that which faces it. Holes of masks are asked for as triangles are met;
//! behind what is blended or clear the ray is followed on, from the nearest layer to the farthest. The hierarchy is built for each picture
//! (a second for a million triangles), because its boxes depend on how far the eye is; keeping it for several would save time only where
//! the same scene is looked at again and again.

use super::{
    camera::Camera,
    stop::{Stop, Stopped},
};
use glam::{DVec3, Vec3, Vec3A};
use kiln_proto::{
    frame::SurfaceFrames,
    lookup,
    plan::Plan,
    scene::{Place, Scene, Veil},
    units::Rgb,
};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser::collapse},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
    ray::{Ray, RayHit},
};
use rayon::prelude::*;
use std::ops::Range;

/// How far boxes grow, relative to the largest number in the box test: 16 units in the last place.
const GROW: f32 = 16.0 * f32::EPSILON;
/// Triangles of a leaf, at most, and what a step down the tree costs beside a triangle test.
const LEAF: (u32, f32) = (8, 3.0);

/// Layers that a ray is followed through in one go, which bounds the memory of a band.
const LAYERS: usize = 16;

/// How often rays go on from there. What lies behind 1,024 layers is not seen: a bound of time, not of memory.
pub(super) const GOES: usize = 64;

/// What a ray sees of one surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    /// Which surface.
    pub(super) surface: u32,
    /// The chart, numbered over the whole scene from 1.
    pub(super) chart: u32,
    /// Where, in the texture coordinates of the plan.
    pub(super) uv: [f32; 2],
    /// The unit direction toward the eye, in the surface's frame there.
    pub(super) toward: Vec3,
    /// How much of it is seen, and of what lies behind.
    pub(super) veil: Veil,
}

/// How far a ray has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Walk {
    /// It is still at the eye.
    Eye,
    /// It goes on behind a layer.
    Behind(Hit),
    /// Nothing behind its last layer is seen.
    Done,
}

/// What some rays see.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Looked {
    /// The layers of one ray after the other, the nearest first.
    pub(super) layers: Vec<Seen>,
    /// How many layers each ray has: none where it sees the background alone.
    pub(super) counts: Vec<u8>,
    /// How far each ray has come.
    pub(super) walks: Vec<Walk>,
}

/// A scene ready to be looked at.
pub(super) struct Stage<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    corners: Vec<[DVec3; 3]>,
    frames: Vec<SurfaceFrames>,
    /// Number of the first triangle of each surface, and of all in the end.
    first: Vec<usize>,
    /// What the charts of each surface count from.
    charts: Vec<u32>,
    /// The material of each triangle that something may be seen through; empty where nothing is.
    veils: Vec<Option<u32>>,
    tree: Bvh2,
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    triangle: usize,
    t: f32,
    /// Barycentric weights of the corners.
    weights: [f64; 3],
}

impl<'a> Stage<'a> {
    /// Builds the hierarchy for the rays of a camera. Cost: O(n log n) in triangles, and about 250 bytes each.
    pub(super) fn new(scene: &'a Scene, plan: &'a Plan, camera: &Camera) -> Self {
        let corners: Vec<[DVec3; 3]> = scene.surfaces.iter().flat_map(|s| s.triangles.iter().map(|t| scene.corners(t))).collect();
        let largest = corners.iter().flatten().map(|c| c.abs().max_element() as f32).fold(camera.farthest(), f32::max);
        let grow = Vec3A::splat(GROW * largest);
        let boxed = |c: &[DVec3; 3]| {
            let (low, high) = (c[0].min(c[1]).min(c[2]), c[0].max(c[1]).max(c[2]));
            Aabb::new(Vec3A::from(low.as_vec3()) - grow, Vec3A::from(high.as_vec3()) + grow)
        };
        let boxes: Vec<Aabb> = corners.iter().map(boxed).collect();
        let tree = build(&boxes);
        let (mut first, mut charts) = (vec![0], vec![0]);
        for (surface, layout) in scene.surfaces.iter().zip(&plan.surfaces) {
            first.push(first[first.len() - 1] + surface.triangles.len());
            charts.push(charts[charts.len() - 1] + layout.charts.iter().max().map_or(0, |largest| largest + 1));
        }
        let layouts = scene.surfaces.par_iter().zip(&plan.surfaces);
        let frames = layouts.map(|(surface, layout)| SurfaceFrames::new(scene, surface, layout, plan.settings.frame)).collect();
        Self { scene, plan, corners, frames, first, charts, veils: veils(scene), tree }
    }

    /// What the rays through some rows of the picture see next, row by row, each from where it has come. Asks before each row whether to go
    /// on.
    pub(super) fn look(&self, camera: &Camera, rows: Range<u32>, walks: &[Walk], stop: &Stop) -> Result<Looked, Stopped> {
        let row = |(y, walks): (u32, &[Walk])| {
            let mut row = Looked::default();
            let wanted = stop.check().is_ok();
            for (x, walk) in (0..camera.size().width).zip(walks).filter(|_| wanted) {
                let before = row.layers.len();
                row.walks.push(self.along(camera.origin(x, y), camera.direction(x, y), *walk, &mut row.layers));
                row.counts.push((row.layers.len() - before) as u8);
            }
            row
        };
        let rows: Vec<Looked> = rows.into_par_iter().zip(walks.par_chunks(camera.size().width as usize)).map(row).collect();
        stop.check()?;
        let mut all = Looked::default();
        rows.iter().for_each(|row| {
            all.layers.extend_from_slice(&row.layers);
            all.counts.extend_from_slice(&row.counts);
            all.walks.extend_from_slice(&row.walks);
        });
        Ok(all)
    }

    /// Adds the next layers along a ray, and tells how far it has come then.
    fn along(&self, origin: DVec3, direction: Vec3, mut walk: Walk, layers: &mut Vec<Seen>) -> Walk {
        for _ in 0..LAYERS {
            let last = match walk {
                Walk::Eye => None,
                Walk::Behind(last) => Some(last),
                Walk::Done => break,
            };
            walk = Walk::Done;
            let Some(hit) = self.closest(origin, direction, last) else { break };
            let Some(seen) = self.seen(&hit, direction) else { break };
            layers.push(seen);
            if !seen.veil.through.is_black() {
                walk = Walk::Behind(hit);
            }
        }
        walk
    }

    fn seen(&self, hit: &Hit, direction: Vec3) -> Option<Seen> {
        let (surface, triangle) = self.locate(hit.triangle);
        let layout = &self.plan.surfaces[surface];
        let corners = layout.uv[triangle];
        let uv = std::array::from_fn(|k| corners.iter().zip(hit.weights).map(|(uv, w)| f64::from(uv[k]) * w).sum::<f64>() as f32);
        let frame = self.frames[surface].at(triangle as u32, [hit.weights[1], hit.weights[2]])?;
        let chart = self.charts[surface] + layout.charts[triangle] + 1;
        Some(Seen { surface: surface as u32, chart, uv, toward: frame.to_local(-direction), veil: self.veil(hit, direction) })
    }

    /// The surface of a triangle of the scene, and its number there.
    fn locate(&self, triangle: usize) -> (usize, usize) {
        let surface = self.first.partition_point(|first| *first <= triangle) - 1;
        (surface, triangle - self.first[surface])
    }

    /// How what is hit veils what lies behind it.
    fn veil(&self, hit: &Hit, direction: Vec3) -> Veil {
        let Some(material) = self.veils.get(hit.triangle).copied().flatten() else { return Veil::OPAQUE };
        let (surface, triangle) = self.locate(hit.triangle);
        let corners = self.corners[hit.triangle];
        let position = (0..3).map(|k| corners[k] * hit.weights[k]).sum::<DVec3>().as_vec3().to_array();
        let bary = [hit.weights[1] as f32, hit.weights[2] as f32];
        let place = Place { surface: surface as u32, triangle: triangle as u32, bary, position };
        let normal = self.frames[surface].geometric_normal(triangle as u32).unwrap_or(-direction);
        self.scene.veil_at(&self.scene.materials[material as usize], &place, -normal.dot(direction))
    }

    /// Whether a hit lies behind another. What is as near on the same surface is the other side of a shared edge, and the same layer.
    fn is_behind(&self, hit: &Hit, last: &Hit) -> bool {
        let same = || self.locate(hit.triangle).0 == self.locate(last.triangle).0;
        (hit.t, hit.triangle) > (last.t, last.triangle) && (hit.t > last.t * (1.0 + GROW) || !same())
    }

    /// The nearest front along a ray behind the hit `last`; of equally near ones that of the lowest number, which a page that draws in this
    /// order shows, too.
    fn closest(&self, origin: DVec3, direction: Vec3, last: Option<Hit>) -> Option<Hit> {
        let (mut best, d): (Option<Hit>, _) = (None, direction.as_dvec3());
        // Boxes are walked from the last layer on; distances stay those from the eye, so that they compare.
        let begin = last.map_or(0.0, |last| last.t * (1.0 - GROW));
        let ray = Ray::new_inf((origin + d * f64::from(begin)).as_vec3().into(), direction.into());
        self.tree.ray_traverse(ray, &mut RayHit::none(), |_, at| {
            let triangle = self.tree.primitive_indices[at] as usize;
            let Some(hit) = self.cross(triangle, origin, d) else { return f32::INFINITY };
            let is_behind = last.is_none_or(|last| self.is_behind(&hit, &last));
            let nothing = |hit: &Hit| !self.veils.is_empty() && self.veil(hit, direction) == NOTHING;
            if is_behind && best.is_none_or(|b| (hit.t, triangle) < (b.t, b.triangle)) && !nothing(&hit) {
                best = Some(hit);
            }
            // A little farther than it is: what is as near must still be looked at.
            best.map_or(f32::INFINITY, |best| best.t * (1.0 + GROW) - begin)
        });
        best
    }

    fn cross(&self, triangle: usize, origin: DVec3, d: DVec3) -> Option<Hit> {
        let p = self.corners[triangle].map(|c| c - origin);
        // A front turns counter-clockwise against the ray: each edge function is then negative, and minus them are the weights.
        let edge = |a: usize, b: usize| -d.dot(p[a].cross(p[b]));
        let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
        let sum: f64 = edges.iter().sum();
        if edges.iter().any(|e| *e < 0.0) || sum <= 0.0 {
            return None;
        }
        let weights = edges.map(|e| e / sum);
        let t = (0..3).map(|k| weights[k] * p[k].dot(d)).sum::<f64>() / d.length_squared();
        (t > 0.0).then_some(Hit { triangle, t: t as f32, weights })
    }
}

/// What a hole is.
const NOTHING: Veil = Veil { own: 0.0, through: Rgb::WHITE };

/// The material of each triangle that something may be seen through; empty where nothing is.
fn veils(scene: &Scene) -> Vec<Option<u32>> {
    if !scene.surfaces.iter().any(|s| scene.materials_of(s).any(kiln_proto::scene::Material::is_veil)) {
        return vec![];
    }
    let material = |s: &'_ kiln_proto::scene::Surface, part: usize| {
        let material = s.parts[part].material;
        scene.materials[material as usize].is_veil().then_some(material)
    };
    scene.surfaces.iter().flat_map(|s| s.part_of_triangles().map(move |part| material(s, part))).collect()
}

/// The hierarchy over boxes, without obvhs's optimiser, which may make a tree deeper than the stack that its traversal reserves, and
/// without its self-test in debug builds, whose recursion a scene of a thousand identical triangles, one long chain, takes off the end of
/// the stack.
fn build(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(PlocSearchDistance::Low, boxes, indices, SortPrecision::U64, 2);
    collapse(&mut tree, LEAF.0, LEAF.1);
    tree
}

impl Seen {
    /// The texels that it needs, with their weights.
    pub(super) fn footprint(&self, plan: &Plan) -> lookup::Footprint {
        lookup::footprint(self.uv, plan.surfaces[self.surface as usize].size)
    }
}
