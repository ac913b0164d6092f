//! A surface's layout in its texture: where texels lie in the world, and what their squares hold.

use super::{
    GUTTER, Row, SurfacePoint, Texel,
    bins::Bins,
    cover::offsets,
    flat::{Flat, onto},
    seam::Seams,
};
use crate::{
    frame::{Frame, FrameRule, SurfaceFrames},
    plan::SurfacePlan,
    scene::{Scene, Surface},
    sets::DisjointSets,
    tile::TILE_SIDE,
};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Neighbouring triangles join a texel's footprint when the normals of their planes agree to this cosine.
const COPLANAR: f32 = 0.999_9;
/// Texels from a gutter texel within which the nearest edge of its chart's border lies: its source shows a point of the chart, at most half
/// a texel's diagonal from its own centre, and a border lies before that.
pub(super) const BORDER: u32 = 2 * GUTTER as u32;

/// One surface's triangles laid out in its texture, binned by tile.
pub struct SurfaceRaster {
    /// World corners of each triangle, metres.
    corners: Vec<[DVec3; 3]>,
    charts: Vec<u32>,
    pub(super) flats: Vec<Flat>,
    pub(super) frames: SurfaceFrames,
    rule: FrameRule,
    /// Where the surface goes on across edges of charts, if that was asked for.
    seams: Option<Seams>,
    /// Which triangles go on smoothly into each other, by a number that they share; empty for a surface that is flat in each triangle.
    joined: Vec<u32>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) bins: Bins,
}

impl SurfaceRaster {
    /// Lays out a surface as its plan says. Cost: linear in triangles and in the cells that they touch. It owns what it needs, so that a
    /// worker may keep it beside the scene across leases.
    #[must_use]
    pub fn new(scene: &Scene, surface: &Surface, plan: &SurfacePlan, rule: FrameRule) -> Self {
        let (width, height) = (plan.size.width, plan.size.height);
        let flats: Vec<Flat> = plan.uv.iter().map(|uv| Flat::new(*uv, f64::from(width), f64::from(height))).collect();
        let corners: Vec<[DVec3; 3]> = surface.triangles.iter().map(|t| scene.corners(t)).collect();
        let frames = SurfaceFrames::new(scene, surface, plan, rule);
        let joined = if frames.is_smooth() { smooth_groups(scene, surface, plan) } else { vec![] };
        let bins = Bins::new(&flats, width, height);
        Self { corners, charts: plan.charts.clone(), flats, frames, rule, seams: None, joined, width, height, bins }
    }

    /// The same raster with the seams of its charts; `scene`, `surface` and `plan` are those that it was made of. Cost: O(n log n) in
    /// triangles.
    #[must_use]
    pub fn with_seams(mut self, scene: &Scene, surface: &Surface, plan: &SurfacePlan) -> Self {
        self.seams = Some(Seams::new(scene, surface, plan, &self.frames));
        self
    }

    /// The frame at a point of the surface; `None` on a triangle without area.
    #[must_use]
    pub fn frame(&self, point: &SurfacePoint) -> Option<Frame> {
        self.frames.at(point.triangle, point.bary.map(f64::from))
    }

    /// The normal of a triangle's plane; `None` for a triangle without area.
    #[must_use]
    pub fn geometric_normal(&self, triangle: u32) -> Option<Vec3> {
        self.frames.geometric_normal(triangle)
    }

    /// Cells along u.
    #[must_use]
    pub fn columns(&self) -> u32 {
        self.width.div_ceil(TILE_SIDE)
    }

    /// Cells along v.
    #[must_use]
    pub fn rows(&self) -> u32 {
        self.height.div_ceil(TILE_SIDE)
    }

    /// The covered texel at (x, y), if it is covered.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32) -> Option<Texel> {
        let (triangle, bary) = self.owner(x, y)?;
        let frame = self.frames.at(triangle, bary.to_array())?;
        let (low, high) = (DVec2::new(f64::from(x), f64::from(y)), DVec2::new(f64::from(x) + 1.0, f64::from(y) + 1.0));
        let joins = |t: &u32| self.joins(*t, triangle, low) && self.flats[*t as usize].meets(low, high);
        let near = std::iter::once(triangle).chain(self.bins.at(x, y).iter().copied().filter(joins)).collect();
        Some(Texel { x, y, triangle, position: self.position(triangle, bary), frame, bary, start: triangle, near })
    }

    /// The chart of the texel at (x, y), if it is covered.
    #[must_use]
    pub fn chart(&self, x: u32, y: u32) -> Option<u32> {
        self.owner(x, y).map(|(triangle, _)| self.charts[triangle as usize])
    }

    /// The texel of a gutter's row at its place across a seam: its square is laid out in the plane of its chart's nearest triangle and
    /// along the surface from there, its frame is the own chart's carried over. `None` where the chart ends there, which leaves the row the
    /// copy of its source that it is; likewise for covered texels and without seams.
    #[must_use]
    pub fn beyond(&self, row: Row) -> Option<Texel> {
        let seams = self.seams.as_ref().filter(|_| !row.is_covered())?;
        let chart = self.charts[self.owner(row.source.0, row.source.1)?.0 as usize];
        let centre = DVec2::new(f64::from(row.x) + 0.5, f64::from(row.y) + 0.5);
        let own = self.bins.around(row.x, row.y, BORDER).filter(|t| self.charts[*t as usize] == chart);
        let start = seams.start(&self.flats, own, centre)?;
        let at = self.flats[start as usize].bary(centre)?;
        let (triangle, bary) = seams.follow(&self.corners, start, at)?;
        let tangent = self.frames.at(start, onto(at).to_array())?.tangent;
        let frame = self.turned(self.frames.at(triangle, bary.to_array())?.normal, tangent);
        Some(Texel { x: row.x, y: row.y, triangle, position: self.position(triangle, bary), frame, bary, start, near: vec![] })
    }

    /// The point of a texel's footprint at (dx, dy) in [0, 1)² of its square, or `None` where the surface does not go on as far.
    #[must_use]
    pub fn footprint(&self, texel: &Texel, dx: f32, dy: f32) -> Option<SurfacePoint> {
        let at = DVec2::new(f64::from(texel.x) + f64::from(dx), f64::from(texel.y) + f64::from(dy));
        let own = texel.near.iter().find_map(|t| Some(self.point(*t, self.flats[*t as usize].inside(at)?)));
        own.or_else(|| {
            let (seams, bary) = (self.seams.as_ref()?, self.flats[texel.start as usize].bary(at)?);
            let (triangle, bary) = seams.follow(&self.corners, texel.start, bary)?;
            Some(self.point(triangle, bary))
        })
    }

    /// The frame at a point of a texel's footprint, where it differs from the texel's: on smooth surfaces, and beyond seams, where the own
    /// chart's is carried over.
    #[must_use]
    pub fn frame_within(&self, texel: &Texel, point: &SurfacePoint) -> Option<Frame> {
        let low = DVec2::new(f64::from(texel.x), f64::from(texel.y));
        let is_own = point.triangle == texel.triangle || self.joins(point.triangle, texel.triangle, low);
        if texel.near.is_empty() || !is_own {
            return Some(self.turned(self.frame(point)?.normal, texel.frame.tangent));
        }
        if self.frames.is_smooth() { self.frame(point) } else { None }
    }

    fn turned(&self, normal: Vec3, tangent: Vec3) -> Frame {
        match self.rule {
            FrameRule::Thesis => Frame::thesis(normal.as_dvec3()),
            FrameRule::Texture => Frame::oriented(normal.as_dvec3(), tangent.as_dvec3()),
        }
    }

    /// Half the longer diagonal of a texel in the world, metres, or the whole where it does not show its centre: no point of its square is
    /// farther from the one that it shows.
    #[must_use]
    pub fn reach(&self, texel: &Texel) -> f32 {
        let (flat, [a, b, c]) = (&self.flats[texel.start as usize], self.corners[texel.start as usize]);
        let Some([first, second]) = flat.inverse else { return 0.0 };
        let step = |x: f64, y: f64| (b - a) * first.dot(DVec2::new(x, y)) + (c - a) * second.dot(DVec2::new(x, y));
        let share = if self.under_centre(texel.x, texel.y).is_some() || texel.near.is_empty() { 0.5 } else { 1.0 };
        (share * step(1.0, 1.0).length().max(step(1.0, -1.0).length())) as f32
    }

    /// The covered texels of a texel's chart within the gutter's reach of it, nearest first; ties go to the lowest row, then column.
    pub fn neighbours(&self, texel: &Texel) -> impl Iterator<Item = Texel> {
        let (x, y, chart) = (i64::from(texel.x), i64::from(texel.y), self.charts[texel.start as usize]);
        let mut around: Vec<(i64, i64, i64)> = offsets().map(|(dx, dy)| (dx * dx + dy * dy, y + dy, x + dx)).collect();
        around.sort_unstable();
        let within = |(d, y, x): &(i64, i64, i64)| *d > 0 && self.holds(*x, *y);
        let texel = move |(_, y, x): (i64, i64, i64)| self.texel(x as u32, y as u32);
        around.into_iter().filter(within).filter_map(texel).filter(move |t| self.charts[t.triangle as usize] == chart)
    }

    /// The point that a texel shows: its centre, unless that lies beside the chart.
    #[must_use]
    pub fn centre(&self, texel: &Texel) -> SurfacePoint {
        self.point(texel.triangle, texel.bary)
    }

    /// Whether a triangle whose box meets the square at `low` goes on from `triangle` on the same chart.
    fn joins(&self, t: u32, triangle: u32, low: DVec2) -> bool {
        let flat = &self.flats[t as usize];
        let goes_on = |own: Vec3, other: Vec3| own.dot(other) > COPLANAR || self.is_smooth_between(t, triangle);
        t != triangle
            && flat.inverse.is_some()
            && self.charts[t as usize] == self.charts[triangle as usize]
            && flat.low.cmplt(low + 1.0).all()
            && flat.high.cmpgt(low).all()
            && self.frames.geometric_normal(triangle).zip(self.frames.geometric_normal(t)).is_some_and(|(own, other)| goes_on(own, other))
    }

    fn is_smooth_between(&self, a: u32, b: u32) -> bool {
        self.joined.get(a as usize).is_some_and(|group| *group == self.joined[b as usize])
    }

    fn point(&self, triangle: u32, bary: DVec2) -> SurfacePoint {
        SurfacePoint { triangle, bary: [bary.x as f32, bary.y as f32], position: self.position(triangle, bary) }
    }

    fn position(&self, triangle: u32, bary: DVec2) -> Vec3 {
        let [a, b, c] = self.corners[triangle as usize];
        (a + (b - a) * bary.x + (c - a) * bary.y).as_vec3()
    }
}

/// Numbers triangles so that those share one that are connected over edges where positions, texture coordinates and normals agree: the
/// texture goes on there, and so does the frame.
fn smooth_groups(scene: &Scene, surface: &Surface, plan: &SurfacePlan) -> Vec<u32> {
    type Corner = (u32, [u32; 2], [i32; 3]);
    let mut sets = DisjointSets::new(surface.triangles.len());
    // Looked up, never iterated: the order of hashing cannot matter.
    let mut edges: HashMap<(u32, Corner, Corner), u32> = HashMap::new();
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let corner = |k: usize| -> Corner {
            // Steps of 1/256: normals that were computed twice differ in their last bits.
            let normal = scene.normals[surface.normals[t][k] as usize].map(|n| (n * 256.0).round() as i32);
            (triangle.corners[k], plan.uv[t][k].map(f32::to_bits), normal)
        };
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corner(i), corner(j))) {
            let first = *edges.entry((plan.charts[t], a.min(b), a.max(b))).or_insert(t as u32);
            sets.join(first, t as u32);
        }
    }
    (0..surface.triangles.len() as u32).map(|t| sets.first(t)).collect()
}
