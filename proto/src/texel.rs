//! From texels to points: which texels of a surface's texture its charts cover, where they lie in the world, and whose light a gutter
//! texel borrows.
//!
//! A texel is *covered* when its centre lies on a triangle (the lowest-numbered one where edges touch). An uncovered texel within two
//! texels of a covered one is *gutter* and takes the row of the nearest covered texel, ties to the lowest row, then column. Both follow
//! from the plan alone, so coordinator, worker and package reader agree without sending masks about. Coordinates are f64 here: a texel
//! centre on a shared edge must fall on the same side on every machine. The alternative, conservative coverage of every touched texel,
//! would bake centres that lie beside the surface.

use crate::{
    frame::{Frame, FrameRule, SurfaceFrames},
    plan::SurfacePlan,
    scene::{Scene, Surface},
    sets::DisjointSets,
    tile::{Cell, TILE_SIDE},
};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Texels around a chart that borrow its light.
pub const GUTTER: i64 = 2;
/// Slack of the inside test, in barycentric units: a centre on an edge is inside.
const EDGE: f64 = 1e-9;
/// Neighbouring triangles join a texel's footprint when the normals of their planes agree to this cosine.
const COPLANAR: f32 = 0.999_9;

/// A covered texel.
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
    /// Its frame: that of its centre.
    pub frame: Frame,
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
    origin: DVec2,
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
        Self { origin: p[0], inverse, low: p[0].min(p[1]).min(p[2]), high: p[0].max(p[1]).max(p[2]) }
    }

    /// Barycentric weights of the second and third corner, unclamped.
    fn bary(&self, at: DVec2) -> Option<DVec2> {
        let rows = self.inverse?;
        let d = at - self.origin;
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
        Self { corners, charts: plan.charts.clone(), flats, frames, joined, width, height, starts, bins }
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
        Some(Texel { x, y, triangle, position: self.position(triangle, bary), frame, near })
    }

    /// The point of a texel's footprint at (dx, dy) in [0, 1)² of its square, or `None` where no chart lies there.
    #[must_use]
    pub fn footprint(&self, texel: &Texel, dx: f32, dy: f32) -> Option<SurfacePoint> {
        let at = DVec2::new(f64::from(texel.x) + f64::from(dx), f64::from(texel.y) + f64::from(dy));
        texel.near.iter().find_map(|t| Some(self.point(*t, self.flats[*t as usize].inside(at)?)))
    }

    /// The point at a texel's centre.
    #[must_use]
    pub fn centre(&self, texel: &Texel) -> SurfacePoint {
        let at = DVec2::new(f64::from(texel.x) + 0.5, f64::from(texel.y) + 0.5);
        self.point(texel.triangle, self.flats[texel.triangle as usize].bary(at).unwrap_or_default())
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
    let square = (-GUTTER..=GUTTER).flat_map(|dy| (-GUTTER..=GUTTER).map(move |dx| (dx, dy)));
    let (_, sy, sx) = square.filter(|(dx, dy)| is_covered(x + dx, y + dy)).map(|(dx, dy)| (dx * dx + dy * dy, y + dy, x + dx)).min()?;
    Some((sx as u32, sy as u32))
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
        // One texel of slack: owners are asked for texels of the window that a tile looks through, always in the texel's own cell.
        (cell(flat.low.x - 1.0, columns)..=cell(flat.high.x + 1.0, columns), cell(flat.low.y - 1.0, rows)..=cell(flat.high.y + 1.0, rows))
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
mod tests {
    use super::*;
    use crate::{plan::ChartSource, scene::Triangle, settings::TextureSize};

    /// A unit square of two triangles with the given texture coordinates of its corners.
    fn square(uv: [[f32; 2]; 4], width: u32, height: u32) -> (Scene, SurfacePlan) {
        let corners = [[0u32, 1, 2], [0, 2, 3]];
        let triangles = corners.iter().map(|c| (Triangle { corners: *c, polygon: 0 }, Some(c.map(|k| uv[k as usize])))).collect();
        let surface = Surface::plain("s", 0, triangles);
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let scene = Scene { positions, surfaces: vec![surface], ..Scene::empty() };
        let plan = SurfacePlan {
            size: TextureSize { width, height },
            source: ChartSource::Author,
            uv: corners.iter().map(|c| c.map(|k| uv[k as usize])).collect(),
            charts: vec![0, 0],
            covered: 0,
            tiles: vec![],
        };
        (scene, plan)
    }

    const FULL: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn a_full_chart_covers_every_texel_once_and_centres_lie_where_they_should() {
        let (scene, plan) = square(FULL, 40, 20);
        let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture);
        for (x, y) in [(0, 0), (39, 19), (13, 7), (32, 0)] {
            let t = raster.texel(x, y).unwrap();
            assert!(t.position.distance(Vec3::new((x as f32 + 0.5) / 40.0, (y as f32 + 0.5) / 20.0, 0.0)) < 1e-6);
            assert_eq!((t.frame.tangent, t.frame.normal), (Vec3::X, Vec3::Z));
        }
        let rows: Vec<Row> = [(0, 0), (1, 0)].iter().flat_map(|(x, y)| raster.tile(Cell { x: *x, y: *y })).collect();
        assert_eq!(rows.len(), 800);
        assert!(rows.iter().all(|r| r.is_covered()));
    }

    #[test]
    fn gutters_are_two_texels_and_reach_into_neighbouring_tiles() {
        // The chart ends exactly at column 32, the edge of the first tile.
        let (scene, plan) = square([[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]], 64, 32);
        let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture);
        assert_eq!(raster.tile(Cell { x: 0, y: 0 }).len(), 1024);
        let next = raster.tile(Cell { x: 1, y: 0 });
        assert_eq!(next.len(), 64);
        assert!(next.iter().all(|r| !r.is_covered() && r.source == (31, r.y) && (32..34).contains(&r.x)));
        assert!(raster.texel(32, 0).is_none());
    }

    #[test]
    fn gutter_ties_go_to_the_lowest_row_then_column() {
        let only = |set: &'static [(i64, i64)]| move |x: i64, y: i64| set.contains(&(x, y));
        assert_eq!(nearest(5, 5, &only(&[(4, 5), (5, 4), (6, 5)])), Some((5, 4)));
        assert_eq!(nearest(5, 5, &only(&[(6, 5), (4, 5)])), Some((4, 5)));
        assert_eq!(nearest(5, 5, &only(&[(3, 3), (7, 5)])), Some((7, 5)));
        assert_eq!(nearest(5, 5, &only(&[(2, 5)])), None);
    }

    #[test]
    fn a_footprint_spans_the_triangles_of_its_chart_and_nothing_else() {
        let (scene, mut plan) = square(FULL, 4, 4);
        let share = |plan: &SurfacePlan| {
            let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], plan, FrameRule::Texture);
            let texel = raster.texel(1, 1).unwrap();
            (0..64).filter(|k| raster.footprint(&texel, (k % 8) as f32 / 8.0 + 0.06, (k / 8) as f32 / 8.0 + 0.01).is_some()).count()
        };
        assert_eq!(share(&plan), 64, "the diagonal runs through the texel, both halves count");
        plan.charts = vec![0, 1];
        assert!(share(&plan) < 64, "another chart is another surface in the texture");
    }

    #[test]
    fn smooth_triangles_join_where_they_bend_and_frames_turn_within_a_texel() {
        // The square is folded along its diagonal; normals lean toward each other as far as its smooth surface has them equal there.
        let (mut scene, plan) = square(FULL, 4, 4);
        scene.positions[3] = [0.0, 1.0, 0.5];
        scene.normals = [[0.3, -0.3, 1.0], [0.0, 0.0, 1.0], [0.3, -0.3, 1.0], [0.5, -0.5, 1.0]]
            .map(|n| Vec3::from_array(n).normalize().to_array())
            .to_vec();
        let shares = |scene: &Scene| {
            let raster = SurfaceRaster::new(scene, &scene.surfaces[0], &plan, FrameRule::Texture);
            let texel = raster.texel(1, 1).unwrap();
            let points: Vec<SurfacePoint> =
                (0..64).filter_map(|k| raster.footprint(&texel, (k % 8) as f32 / 8.0 + 0.06, (k / 8) as f32 / 8.0 + 0.01)).collect();
            let normals: Vec<Vec3> = points.iter().map(|p| raster.frame(p).unwrap().normal).collect();
            (points.len(), normals.iter().map(|n| n.distance(texel.frame.normal)).fold(0.0, f32::max))
        };
        let (flat, _) = shares(&scene);
        assert!(flat < 64, "a fold is an edge on a flat surface");
        scene.surfaces[0].normals = scene.surfaces[0].triangles.iter().map(|t| t.corners).collect();
        let (joined, turn) = shares(&scene);
        assert!(joined == 64 && turn > 0.01 && turn < 0.2, "{joined} {turn}");
        // Another normal at one end of the fold: a hard edge.
        scene.normals.push([0.0, 0.0, 1.0]);
        scene.surfaces[0].normals[1][0] = 4;
        assert_eq!(shares(&scene).0, flat);
    }
}
