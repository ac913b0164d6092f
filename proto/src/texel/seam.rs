//! Seams: where a surface goes on across the edge of a chart, and the walk that follows it there.
//!
//! Two charts that meet in a smooth edge show a line where bilinear filtering of one ends in copies of its own border. The remedy here is
//! that the texture of each chart goes on over the edge: a gutter texel is laid out in the plane of the chart's last triangle, folded about
//! the edge into the plane of the next one, and captured there, in the frame of its own chart; squares of covered texels reach over
//! likewise. Filtering then runs on over the seam on both sides, and both sides see the same light. Least-squares stitching (Ray and
//! others, "Invisible Seams", 2010), which moves the border texels of both charts until their interpolations agree, lost: it needs the
//! radiance of both sides at once, so that tiles would depend on each other, it would be solved for every direction, and charts whose
//! frames are turned against each other store different directions. Cost: 24 bytes a triangle, and one more texel to capture for each
//! gutter texel that is not a copy.
//!
//! Edges are found by their positions in space. Edges of more than two triangles, edges of other materials and T-junctions are no seams.

use super::flat::{EDGE, Flat, closest};
use crate::{
    frame::SurfaceFrames,
    plan::SurfacePlan,
    scene::{Scene, Surface},
};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Surfaces go on where their normals agree to this cosine: three degrees.
const SMOOTH: f32 = 0.998_6;
/// Triangles that a walk crosses before it gives up: a texel of a mesh that is finer than its texture.
const STEPS: u32 = 32;
/// Slack of distances in texels: at a corner where a seam and a border are equally near, the seam counts.
const EQUAL: f64 = 1e-6;

/// What lies across an edge of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Across {
    /// Nothing of this surface, or what does not go on from here: the chart ends.
    Border,
    /// The same chart, bent too sharply to go on.
    Fold,
    /// The same chart.
    Chart(Corner),
    /// A place of the texture that does not adjoin; the surface goes on there.
    Seam(Corner),
}

/// A corner of a triangle, which also names the edge that lies opposite: 3 x triangle + corner.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Corner(u32);

impl Corner {
    fn triangle(self) -> u32 {
        self.0 / 3
    }

    /// The corner itself and the ends of its edge, in the order of the winding.
    fn turn(self) -> [usize; 3] {
        let k = (self.0 % 3) as usize;
        [k, (k + 1) % 3, (k + 2) % 3]
    }
}

/// What lies across every edge of a surface.
pub(super) struct Seams {
    /// By triangle and corner.
    across: Vec<[Across; 3]>,
}

impl Seams {
    /// Cost: O(n log n) in triangles.
    pub(super) fn new(scene: &Scene, surface: &Surface, plan: &SurfacePlan, frames: &SurfaceFrames) -> Self {
        let places = places(scene, surface);
        let ends = |corner: Corner| {
            let (places, [_, a, b]) = (places[corner.triangle() as usize], corner.turn());
            (places[a], places[b])
        };
        let mut edges: Vec<((u32, u32), u32)> = (0..3 * places.len() as u32).map(|c| (ends(Corner(c)), c)).collect();
        edges.sort_unstable();
        let only = |ends: (u32, u32)| {
            let from = edges.partition_point(|e| e.0 < ends);
            let mut found = edges[from..].iter().take_while(|e| e.0 == ends);
            found.next().filter(|_| found.next().is_none()).map(|e| Corner(e.1))
        };
        let materials: Vec<u32> = surface.part_of_triangles().map(|part| surface.parts[part].material).collect();
        let across = |corner: Corner| -> Across {
            let (a, b) = ends(corner);
            let Some(other) = only((a, b)).and_then(|_| only((b, a))) else { return Across::Border };
            let (t, o) = (corner.triangle() as usize, other.triangle() as usize);
            let bends = !goes_on(scene, surface, frames, corner, other);
            if plan.charts[t] == plan.charts[o] && adjoin(plan, corner, other) {
                if bends { Across::Fold } else { Across::Chart(other) }
            } else if bends || materials[t] != materials[o] {
                Across::Border
            } else {
                Across::Seam(other)
            }
        };
        Self { across: (0..places.len() as u32).map(|t| [0, 1, 2].map(|k| across(Corner(3 * t + k)))).collect() }
    }

    /// The triangle from which a texel beside a chart goes on over a seam: that of the chart's nearest edge. `None` where the chart ends
    /// there. `triangles` are those of the chart that may be near, in any order.
    pub(super) fn start(&self, flats: &[Flat], triangles: impl Iterator<Item = u32>, at: DVec2) -> Option<u32> {
        let (mut border, mut seam) = (f64::INFINITY, None);
        for corner in triangles.flat_map(|t| [0, 1, 2].map(|k| Corner(3 * t + k))) {
            let (flat, [k, a, b]) = (&flats[corner.triangle() as usize], corner.turn());
            let distance = at.distance(closest(at, flat.corners[a], flat.corners[b]));
            match self.across[corner.triangle() as usize][k] {
                Across::Border => border = border.min(distance),
                Across::Seam(_) if seam.is_none_or(|least| (distance, corner.triangle()) < least) => {
                    seam = Some((distance, corner.triangle()));
                }
                _ => {}
            }
        }
        seam.filter(|(distance, _)| *distance <= border + EQUAL).map(|(_, triangle)| triangle)
    }

    /// Where a point of the plane of `start`, given by its barycentric weights there, lies once the plane is laid along the surface: the
    /// triangle and its weights. `None` where the surface ends on the way.
    pub(super) fn follow(&self, corners: &[[DVec3; 3]], start: u32, bary: DVec2) -> Option<(u32, DVec2)> {
        let (mut triangle, mut bary) = (start, bary);
        for _ in 0..STEPS {
            let weights = [1.0 - bary.x - bary.y, bary.x, bary.y];
            if weights.iter().all(|w| *w >= -EDGE) {
                return Some((triangle, bary));
            }
            let next = |k: usize| match self.across[triangle as usize][k] {
                Across::Chart(other) | Across::Seam(other) if weights[k] < -EDGE => Some((weights[k], k, other)),
                _ => None,
            };
            let (_, k, other) = (0..3).filter_map(next).min_by(|a, b| a.0.total_cmp(&b.0))?;
            bary = laid(corners, (Corner(3 * triangle + k as u32), other), bary)?;
            triangle = other.triangle();
        }
        None
    }
}

/// The weights in the triangle of `other` of a point beyond the edge opposite of `own`, turned about that edge.
fn laid(corners: &[[DVec3; 3]], (own, other): (Corner, Corner), bary: DVec2) -> Option<DVec2> {
    let [k, a, b] = own.turn();
    let mine = corners[own.triangle() as usize];
    let point = mine[0] + (mine[1] - mine[0]) * bary.x + (mine[2] - mine[0]) * bary.y;
    let along = (mine[b] - mine[a]).try_normalize()?;
    let beside = |v: DVec3| v - along * v.dot(along);
    // Distances along the edge and away from it are kept.
    let (from, away) = (point - mine[a], beside(point - mine[a]).dot(-beside(mine[k] - mine[a]).try_normalize()?));
    let (theirs, [m, ..]) = (corners[other.triangle() as usize], other.turn());
    let across = beside(theirs[m] - mine[a]).try_normalize()?;
    let at = mine[a] + along * from.dot(along) + across * away - theirs[0];
    let (e1, e2) = (theirs[1] - theirs[0], theirs[2] - theirs[0]);
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (p1, p2, det) = (at.dot(e1), at.dot(e2), d11 * d22 - d12 * d12);
    let bary = DVec2::new(d22 * p1 - d12 * p2, d11 * p2 - d12 * p1) / det;
    bary.is_finite().then_some(bary)
}

/// Numbers of the places of each triangle's corners: the same for vertices in the same place.
fn places(scene: &Scene, surface: &Surface) -> Vec<[u32; 3]> {
    // Looked up, never iterated: the order of hashing cannot matter. Adding 0 makes one zero of two.
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
    let mut place = |corner: u32| {
        let next = numbers.len() as u32;
        *numbers.entry(scene.positions[corner as usize].map(|v| (v + 0.0).to_bits())).or_insert(next)
    };
    surface.triangles.iter().map(|t| t.corners.map(&mut place)).collect()
}

/// Whether the edge has the same texture coordinates on both sides.
fn adjoin(plan: &SurfacePlan, own: Corner, other: Corner) -> bool {
    let uv = |corner: Corner, k: usize| plan.uv[corner.triangle() as usize][k].map(f32::to_bits);
    let ([_, a, b], [_, c, d]) = (own.turn(), other.turn());
    uv(own, a) == uv(other, d) && uv(own, b) == uv(other, c)
}

/// Whether normals agree on both sides of an edge: those of its ends where the surface has any, else those of the triangles.
fn goes_on(scene: &Scene, surface: &Surface, frames: &SurfaceFrames, own: Corner, other: Corner) -> bool {
    let (t, o) = (own.triangle(), other.triangle());
    let (Some(mine), Some(theirs)) = (frames.geometric_normal(t), frames.geometric_normal(o)) else { return false };
    if surface.normals.is_empty() {
        return mine.dot(theirs) > SMOOTH;
    }
    let normal = |t: u32, k: usize| Vec3::from_array(scene.normals[surface.normals[t as usize][k] as usize]).normalize_or_zero();
    let ([_, a, b], [_, c, d]) = (own.turn(), other.turn());
    normal(t, a).dot(normal(o, d)) > SMOOTH && normal(t, b).dot(normal(o, c)) > SMOOTH
}
