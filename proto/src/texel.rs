//! From texels to points: which texels of a surface's texture its charts cover, where they lie in the world, and whose light a gutter
//! texel borrows.
//!
//! A texel is *covered* when its centre lies on a triangle (the lowest-numbered one where edges touch). An uncovered texel within two
//! texels of a covered one is *gutter* and takes the row of the nearest covered texel, ties to the lowest row, then column. Both follow
//! from the plan alone, so coordinator, worker and package reader agree without sending masks about. Coordinates are f64 here: a texel
//! centre on a shared edge must fall on the same side on every machine. The alternative, conservative coverage of every touched texel,
//! would bake centres that lie beside the surface.
//!
//! A raster that was told of its seams ([`SurfaceRaster::with_seams`]) lets texels reach over edges of charts behind which the surface goes on:
//! the coordinator and readers, which only ask what is covered, do without.

mod seam;

use crate::{
    frame::{Frame, FrameRule, SurfaceFrames},
    plan::SurfacePlan,
    scene::{Scene, Surface},
    sets::DisjointSets,
    tile::{Cell, TILE_SIDE},
};
use glam::{DVec2, DVec3, Vec3};
use seam::Seams;
use std::collections::HashMap;

/// Texels around a chart that borrow its light.
pub const GUTTER: i64 = 2;
/// Slack of the inside test, in barycentric units: a centre on an edge is inside.
const EDGE: f64 = 1e-9;
/// Neighbouring triangles join a texel's footprint when the normals of their planes agree to this cosine.
const COPLANAR: f32 = 0.999_9;

/// A covered texel, or one beside a chart that takes its light from across a seam.
#[derive(Debug, Clone, PartialEq)]
pub struct Texel {
    /// Column.
    pub x: u32,
    /// Row; row 0 holds v = 0.
    pub y: u32,
    /// The triangle under its centre, counted within the surface.
    pub triangle: u32,
    /// The world position of its centre, metres.
    pub position: Vec3,
    /// Its frame: that of its centre, turned as its own chart has it.
    pub frame: Frame,
    /// The weights of the second and third corner of `triangle` at its centre.
    bary: DVec2,
    /// The triangle of its own chart whose plane its square is laid out in.
    start: u32,
    /// Triangles of the same chart that its square touches and that go on flat or smoothly from its own, which is the first.
    near: Vec<u32>,
}

/// A point on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The triangle, counted within the surface.
    pub triangle: u32,
    /// Barycentric weights of its second and third corner.
    pub bary: [f32; 2],
    /// World position, metres.
    pub position: Vec3,
}

/// What a texel of a tile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// Column in the texture.
    pub x: u32,
    /// Row in the texture.
    pub y: u32,
    /// The covered texel whose light this is: itself, unless it is gutter.
    pub source: (u32, u32),
}

impl Row {
    /// Whether the texel itself is on a chart.
    #[must_use]
    pub fn is_covered(self) -> bool {
        self.source == (self.x, self.y)
    }
}

/// A triangle in texel coordinates, with the inverse of its edge matrix.
struct Flat {
    corners: [DVec2; 3],
    /// Rows of the inverse of [e1 e2]; `None` for a triangle without area in the texture.
    inverse: Option<[DVec2; 2]>,
    low: DVec2,
    high: DVec2,
}

impl Flat {
    fn new(uv: [[f32; 2]; 3], width: f64, height: f64) -> Self {
        let p = uv.map(|[u, v]| DVec2::new(f64::from(u) * width, f64::from(v) * height));
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let det = e1.x * e2.y - e2.x * e1.y;
        let inverse = (det.abs() > 1e-12).then(|| [DVec2::new(e2.y, -e2.x) / det, DVec2::new(-e1.y, e1.x) / det]);
        Self { corners: p, inverse, low: p[0].min(p[1]).min(p[2]), high: p[0].max(p[1]).max(p[2]) }
    }

    /// Barycentric weights of the second and third corner, unclamped.
    fn bary(&self, at: DVec2) -> Option<DVec2> {
        let rows = self.inverse?;
        let d = at - self.corners[0];
        Some(DVec2::new(rows[0].dot(d), rows[1].dot(d)))
    }

    fn inside(&self, at: DVec2) -> Option<DVec2> {
        self.bary(at).filter(|b| b.x >= -EDGE && b.y >= -EDGE && b.x + b.y <= 1.0 + EDGE)
    }
}

/// One surface's triangles laid out in its texture, binned by tile.
pub struct SurfaceRaster {
    /// World corners of each triangle, metres.
    corners: Vec<[DVec3; 3]>,
    charts: Vec<u32>,
    flats: Vec<Flat>,
    frames: SurfaceFrames,
    rule: FrameRule,
    /// Where the surface goes on across edges of charts, if that was asked for.
    seams: Option<Seams>,
    /// Which triangles go on smoothly into each other, by a number that they share; empty for a surface that is flat in each triangle.
    joined: Vec<u32>,
    width: u32,
    height: u32,
    /// Triangles whose box, grown by the gutter, touches a cell: `bins[starts[c]..starts[c + 1]]`, ascending.
    starts: Vec<usize>,
    bins: Vec<u32>,
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
        let (starts, bins) = bin(&flats, width, height);
        Self { corners, charts: plan.charts.clone(), flats, frames, rule, seams: None, joined, width, height, starts, bins }
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

    fn candidates(&self, x: u32, y: u32) -> &[u32] {
        let cell = (y / TILE_SIDE * self.columns() + x / TILE_SIDE) as usize;
        &self.bins[self.starts[cell]..self.starts[cell + 1]]
    }

    /// The triangle under a texel's centre and the barycentric weights there.
    fn owner(&self, x: u32, y: u32) -> Option<(u32, DVec2)> {
        let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let usable = |t: &u32| self.frames.geometric_normal(*t).is_some();
        self.candidates(x, y).iter().filter(|t| usable(t)).find_map(|t| Some((*t, self.flats[*t as usize].inside(centre)?)))
    }

    /// The covered texel at (x, y), if it is covered.
    #[must_use]
    pub fn texel(&self, x: u32, y: u32) -> Option<Texel> {
        let (triangle, bary) = self.owner(x, y)?;
        let (frame, normal) = (self.frames.at(triangle, bary.to_array())?, self.frames.geometric_normal(triangle)?);
        let (low, high) = (DVec2::new(f64::from(x), f64::from(y)), DVec2::new(f64::from(x) + 1.0, f64::from(y) + 1.0));
        let joins = |t: u32| {
            let flat = &self.flats[t as usize];
            t != triangle
                && self.charts[t as usize] == self.charts[triangle as usize]
                && flat.low.cmplt(high).all()
                && flat.high.cmpgt(low).all()
                && self.frames.geometric_normal(t).is_some_and(|o| o.dot(normal) > COPLANAR || self.is_smooth_between(t, triangle))
        };
        let near = std::iter::once(triangle).chain(self.candidates(x, y).iter().copied().filter(|t| joins(*t))).collect();
        Some(Texel { x, y, triangle, position: self.position(triangle, bary), frame, bary, start: triangle, near })
    }

    /// The texel of a gutter's row at its place across a seam: its square is laid out in the plane of its chart's nearest triangle and along
    /// the surface from there, its frame is the own chart's carried over. `None` where the chart ends there, which leaves the row the copy of
    /// its source that it is; likewise for covered texels and without seams.
    #[must_use]
    pub fn beyond(&self, row: Row) -> Option<Texel> {
        let seams = self.seams.as_ref().filter(|_| !row.is_covered())?;
        let chart = self.charts[self.owner(row.source.0, row.source.1)?.0 as usize];
        let centre = DVec2::new(f64::from(row.x) + 0.5, f64::from(row.y) + 0.5);
        let own = self.candidates(row.x, row.y).iter().copied().filter(|t| self.charts[*t as usize] == chart);
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
        if !texel.near.contains(&point.triangle) {
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

    /// Half the longer diagonal of a texel in the world, metres: no point of its square is farther from its centre.
    #[must_use]
    pub fn reach(&self, texel: &Texel) -> f32 {
        let (flat, [a, b, c]) = (&self.flats[texel.start as usize], self.corners[texel.start as usize]);
        let Some([first, second]) = flat.inverse else { return 0.0 };
        let step = |x: f64, y: f64| (b - a) * first.dot(DVec2::new(x, y)) + (c - a) * second.dot(DVec2::new(x, y));
        (0.5 * step(1.0, 1.0).length().max(step(1.0, -1.0).length())) as f32
    }

    /// The covered texels of a texel's chart within the gutter's reach of it, nearest first; ties go to the lowest row, then column.
    pub fn neighbours(&self, texel: &Texel) -> impl Iterator<Item = Texel> {
        let (x, y, chart) = (i64::from(texel.x), i64::from(texel.y), self.charts[texel.start as usize]);
        let mut around: Vec<(i64, i64, i64)> = offsets().map(|(dx, dy)| (dx * dx + dy * dy, y + dy, x + dx)).collect();
        around.sort_unstable();
        let within =
            |(d, y, x): &(i64, i64, i64)| *d > 0 && (0..i64::from(self.width)).contains(x) && (0..i64::from(self.height)).contains(y);
        let texel = move |(_, y, x): (i64, i64, i64)| self.texel(x as u32, y as u32);
        around.into_iter().filter(within).filter_map(texel).filter(move |t| self.charts[t.triangle as usize] == chart)
    }

    /// The point at a texel's centre.
    #[must_use]
    pub fn centre(&self, texel: &Texel) -> SurfacePoint {
        self.point(texel.triangle, texel.bary)
    }

    /// The texels of a cell that hold light, row by row: covered ones and the gutter around charts, also charts of neighbouring cells.
    #[must_use]
    pub fn tile(&self, cell: Cell) -> Vec<Row> {
        const SPAN: i64 = TILE_SIDE as i64 + 2 * GUTTER;
        let (x0, y0) = (i64::from(cell.x) * i64::from(TILE_SIDE), i64::from(cell.y) * i64::from(TILE_SIDE));
        let within = |x: i64, y: i64| (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y);
        let mut covered = [[false; SPAN as usize]; SPAN as usize];
        for (j, line) in covered.iter_mut().enumerate() {
            for (i, texel) in line.iter_mut().enumerate() {
                let (x, y) = (x0 + i as i64 - GUTTER, y0 + j as i64 - GUTTER);
                *texel = within(x, y) && self.owner(x as u32, y as u32).is_some();
            }
        }
        let is_covered = |x: i64, y: i64| covered[(y - y0 + GUTTER) as usize][(x - x0 + GUTTER) as usize];
        let mut rows = Vec::new();
        for y in y0..(y0 + i64::from(TILE_SIDE)).min(i64::from(self.height)) {
            for x in x0..(x0 + i64::from(TILE_SIDE)).min(i64::from(self.width)) {
                if let Some(source) = nearest(x, y, &is_covered) {
                    rows.push(Row { x: x as u32, y: y as u32, source });
                }
            }
        }
        rows
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

/// The nearest covered texel within the gutter's reach; ties go to the lowest row, then column.
fn nearest(x: i64, y: i64, is_covered: &impl Fn(i64, i64) -> bool) -> Option<(u32, u32)> {
    if is_covered(x, y) {
        return Some((x as u32, y as u32));
    }
    let (_, sy, sx) = offsets().filter(|(dx, dy)| is_covered(x + dx, y + dy)).map(|(dx, dy)| (dx * dx + dy * dy, y + dy, x + dx)).min()?;
    Some((sx as u32, sy as u32))
}

/// Columns and rows within the gutter's reach, the middle included.
fn offsets() -> impl Iterator<Item = (i64, i64)> {
    (-GUTTER..=GUTTER).flat_map(|dy| (-GUTTER..=GUTTER).map(move |dx| (dx, dy)))
}

/// Barycentric weights of the second and third corner moved onto the triangle.
fn onto(bary: DVec2) -> DVec2 {
    let clamped = bary.max(DVec2::ZERO);
    clamped / (clamped.x + clamped.y).max(1.0)
}

/// Numbers triangles so that those share one that are connected over edges where positions, texture coordinates and normals agree: the texture
/// goes on there, and so does the frame.
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

fn bin(flats: &[Flat], width: u32, height: u32) -> (Vec<usize>, Vec<u32>) {
    let (columns, rows) = (width.div_ceil(TILE_SIDE), height.div_ceil(TILE_SIDE));
    let reach = |flat: &Flat| {
        let cell = |v: f64, n: u32| ((v / f64::from(TILE_SIDE)).floor().max(0.0) as u32).min(n - 1);
        // Gutter texels look for edges of their chart in their own cell.
        let slack = GUTTER as f64 + 1.0;
        let cells = |low: f64, high: f64, n: u32| cell(low - slack, n)..=cell(high + slack, n);
        (cells(flat.low.x, flat.high.x, columns), cells(flat.low.y, flat.high.y, rows))
    };
    let mut starts = vec![0usize; (columns * rows) as usize + 1];
    let each = |visit: &mut dyn FnMut(usize, u32)| {
        for (t, flat) in flats.iter().enumerate().filter(|(_, f)| f.inverse.is_some()) {
            let (xs, ys) = reach(flat);
            ys.for_each(|y| xs.clone().for_each(|x| visit((y * columns + x) as usize, t as u32)));
        }
    };
    each(&mut |cell, _| starts[cell + 1] += 1);
    for c in 1..starts.len() {
        starts[c] += starts[c - 1];
    }
    let mut next = starts.clone();
    let mut bins = vec![0; starts[starts.len() - 1]];
    each(&mut |cell, t| {
        bins[next[cell]] = t;
        next[cell] += 1;
    });
    (starts, bins)
}

#[cfg(test)]
mod tests;
