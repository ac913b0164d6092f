//! Which texels hold light, and whose.

use super::{
    GUTTER, Row, SurfaceRaster,
    flat::{Flat, onto},
};
use crate::tile::{Cell, TILE_SIDE};
use glam::DVec2;

/// Texels along a side of what a tile has to know: its own, and as far as its gutter's sources and what decides whether those are covered.
const CENTRES: usize = TILE_SIDE as usize + 4 * GUTTER as usize;
/// Of what its gutter's sources are among.
const SOURCES: usize = TILE_SIDE as usize + 2 * GUTTER as usize;

impl SurfaceRaster {
    /// The triangle that a covered texel shows, and the barycentric weights of the point that it shows.
    pub(super) fn owner(&self, x: u32, y: u32) -> Option<(u32, DVec2)> {
        self.under_centre(x, y).or_else(|| {
            let found = self.tip(x, y)?;
            let (x, y) = (i64::from(x), i64::from(y));
            let near = |(dx, dy): (i64, i64)| self.holds(x + dx, y + dy) && self.under_centre((x + dx) as u32, (y + dy) as u32).is_some();
            (!offsets().any(near)).then_some(found)
        })
    }

    /// The triangle under a texel's centre.
    pub(super) fn under_centre(&self, x: u32, y: u32) -> Option<(u32, DVec2)> {
        let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        self.usable(x, y).find_map(|(t, flat)| Some((t, flat.inside(centre)?)))
    }

    /// The triangle that comes nearest to a texel's centre, if it is not under it, within the texel's square.
    fn tip(&self, x: u32, y: u32) -> Option<(u32, DVec2)> {
        let low = DVec2::new(f64::from(x), f64::from(y));
        let centre = low + 0.5;
        let points = self.usable(x, y).filter_map(|(t, flat)| Some((t, flat.nearest_within((low, low + 1.0), centre)?)));
        let distance = |p: &DVec2| p.distance_squared(centre);
        let (t, point) = points.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))?;
        Some((t, onto(self.flats[t as usize].bary(point)?)))
    }

    /// The triangles that may meet a texel and have an area in the world.
    fn usable(&self, x: u32, y: u32) -> impl Iterator<Item = (u32, &Flat)> {
        let with_area = |t: &&u32| self.frames.geometric_normal(**t).is_some();
        self.bins.at(x, y).iter().filter(with_area).map(|t| (*t, &self.flats[*t as usize]))
    }

    pub(super) fn holds(&self, x: i64, y: i64) -> bool {
        (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y)
    }

    /// The texels of a cell that hold light, row by row: covered ones and the gutter around charts, also charts of neighbouring cells.
    #[must_use]
    pub fn tile(&self, cell: Cell) -> Vec<Row> {
        let (x0, y0) = (i64::from(cell.x) * i64::from(TILE_SIDE), i64::from(cell.y) * i64::from(TILE_SIDE));
        let covered = self.covered_around(x0, y0);
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

    /// Which texels are covered, from a gutter's width before the texel (x0, y0) on.
    fn covered_around(&self, x0: i64, y0: i64) -> [[bool; SOURCES]; SOURCES] {
        let mut centres = [[false; CENTRES]; CENTRES];
        for (j, line) in centres.iter_mut().enumerate() {
            for (i, centre) in line.iter_mut().enumerate() {
                let (x, y) = (x0 + i as i64 - 2 * GUTTER, y0 + j as i64 - 2 * GUTTER);
                *centre = self.holds(x, y) && self.under_centre(x as u32, y as u32).is_some();
            }
        }
        let near = |i: usize, j: usize| centres[j..=j + 2 * GUTTER as usize].iter().any(|l| l[i..=i + 2 * GUTTER as usize].contains(&true));
        std::array::from_fn(|j| {
            std::array::from_fn(|i| {
                let (x, y) = (x0 + i as i64 - GUTTER, y0 + j as i64 - GUTTER);
                let centre = centres[j + GUTTER as usize][i + GUTTER as usize];
                centre || (self.holds(x, y) && !near(i, j) && self.tip(x as u32, y as u32).is_some())
            })
        })
    }
}

/// The nearest covered texel within the gutter's reach; ties go to the lowest row, then column.
pub(super) fn nearest(x: i64, y: i64, is_covered: &impl Fn(i64, i64) -> bool) -> Option<(u32, u32)> {
    if is_covered(x, y) {
        return Some((x as u32, y as u32));
    }
    let (_, sy, sx) = offsets().filter(|(dx, dy)| is_covered(x + dx, y + dy)).map(|(dx, dy)| (dx * dx + dy * dy, y + dy, x + dx)).min()?;
    Some((sx as u32, sy as u32))
}

/// Columns and rows within the gutter's reach, the middle included.
pub(super) fn offsets() -> impl Iterator<Item = (i64, i64)> {
    (-GUTTER..=GUTTER).flat_map(|dy| (-GUTTER..=GUTTER).map(move |dx| (dx, dy)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        frame::FrameRule,
        plan::{ChartSource, SurfacePlan},
        scene::{Scene, Surface, Triangle},
        settings::TextureSize,
    };
    use proptest::prelude::*;

    type Corners = [[f32; 2]; 3];

    /// A flat surface whose triangles lie in the world as they do in the texture, which is `width` x `height` texels.
    fn raster(triangles: &[Corners], width: u32, height: u32) -> SurfaceRaster {
        let mut scene = Scene::empty();
        scene.positions = triangles.as_flattened().iter().map(|[x, y]| [*x, *y, 0.0]).collect();
        let uv: Vec<Corners> = triangles.iter().map(|t| t.map(|[x, y]| [x / width as f32, y / height as f32])).collect();
        let corners = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        let list = corners.zip(&uv).map(|(corners, uv)| (Triangle { corners, polygon: 0 }, Some(*uv))).collect();
        scene.surfaces.push(Surface::plain("s", 0, list));
        let (size, charts) = (TextureSize { width, height }, vec![0; uv.len()]);
        let plan = SurfacePlan { size, source: ChartSource::Author, uv, charts, covered: 0, tiles: vec![] };
        SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture)
    }

    fn rows(raster: &SurfaceRaster) -> Vec<Row> {
        let cells = (0..raster.rows() as u16).flat_map(|y| (0..raster.columns() as u16).map(move |x| Cell { x, y }));
        let mut rows: Vec<Row> = cells.flat_map(|cell| raster.tile(cell)).collect();
        rows.sort_unstable_by_key(|r| (r.y, r.x));
        rows
    }

    /// The definition, asked of all triangles for each texel: who owns a covered one.
    fn plain(raster: &SurfaceRaster) -> Vec<Option<u32>> {
        let (w, h) = (i64::from(raster.width), i64::from(raster.height));
        let low = |k: i64| DVec2::new((k % w) as f64, (k / w) as f64);
        let all =
            || raster.flats.iter().enumerate().filter(|(t, f)| f.inverse.is_some() && raster.frames.geometric_normal(*t as u32).is_some());
        let under: Vec<Option<u32>> =
            (0..w * h).map(|k| all().find(|(_, f)| f.inside(low(k) + 0.5).is_some()).map(|(t, _)| t as u32)).collect();
        let tip = |k: i64| {
            let (x, y) = (k % w, k / w);
            let near = (y - GUTTER..=y + GUTTER).flat_map(|y| (x - GUTTER..=x + GUTTER).map(move |x| (x, y)));
            if near.filter(|(x, y)| raster.holds(*x, *y)).any(|(x, y)| under[(y * w + x) as usize].is_some()) {
                return None;
            }
            let points = all().filter_map(|(t, f)| Some((f.nearest_within((low(k), low(k) + 1.0), low(k) + 0.5)?, t as u32)));
            points.map(|(p, t)| (p.distance_squared(low(k) + 0.5), t)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, t)| t)
        };
        (0..w * h).map(|k| under[k as usize].or_else(|| tip(k))).collect()
    }

    /// A strip of small triangles, as a scan has them, and a few of any size and shape.
    fn mesh() -> impl Strategy<Value = Vec<Corners>> {
        let corner = || prop::array::uniform2(-5.0f32..60.0);
        let large = prop::collection::vec(prop::array::uniform3(corner()), 0..4);
        let sliver = (corner(), prop::array::uniform2(-30.0f32..30.0), prop::array::uniform2(-0.3f32..0.3))
            .prop_map(|(a, along, beside)| [a, [a[0] + along[0], a[1] + along[1]], [a[0] + beside[0], a[1] + beside[1]]]);
        let dense = (corner(), 0.05f32..0.4, 0usize..400).prop_map(|(from, side, count)| {
            (0..count)
                .map(|k| {
                    let at = [from[0] + (k / 2 % 17) as f32 * side, from[1] + (k / 34) as f32 * side];
                    let far = [at[0] + side, at[1] + side];
                    if k % 2 == 0 { [at, [far[0], at[1]], far] } else { [at, far, [at[0], far[1]]] }
                })
                .collect::<Vec<Corners>>()
        });
        // Long ones side by side, from a hair to some texels wide, of which many lie beside the texture.
        let sheet = (corner(), prop::array::uniform2(-90.0f32..90.0), prop::sample::select(vec![1e-4f32, 1e-2, 0.1, 0.7, 3.0]), 0usize..80)
            .prop_map(|(from, along, step, count)| {
                let at = |k: usize, end: [f32; 2]| [end[0] + k as f32 * step, end[1]];
                let far = [from[0] + along[0], from[1] + along[1]];
                let pair = |k: usize| {
                    let [a, b, c, d] = [at(k, from), at(k, far), at(k + 1, far), at(k + 1, from)];
                    [[a, b, c], [a, d, c]]
                };
                (0..count).flat_map(pair).collect::<Vec<Corners>>()
            });
        (dense, large, prop::collection::vec(sliver, 0..6), sheet).prop_map(|(a, b, c, d)| [a, b, c, d].concat())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
        #[test]
        fn lists_by_place_find_what_all_triangles_hold(triangles in mesh(), width in 1u32..60, height in 1u32..60) {
            let raster = raster(&triangles, width, height);
            let owners = plain(&raster);
            let is_covered = |x: i64, y: i64| raster.holds(x, y) && owners[(y * i64::from(width) + x) as usize].is_some();
            let mut expected = vec![];
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let source = nearest(i64::from(x), i64::from(y), &is_covered);
                expected.extend(source.map(|source| Row { x, y, source }));
                let texel = raster.texel(x, y);
                prop_assert_eq!(texel.as_ref().map(|t| t.triangle), owners[(y * width + x) as usize]);
                let (low, high) = (DVec2::new(f64::from(x), f64::from(y)), DVec2::new(f64::from(x) + 1.0, f64::from(y) + 1.0));
                let all = || raster.flats.iter().enumerate().filter(|(_, f)| f.inverse.is_some());
                let boxed = |f: &Flat| f.low.cmplt(high).all() && f.high.cmpgt(low).all();
                if let Some(texel) = texel {
                    let side = |t: u32| raster.frames.geometric_normal(t).map(|n| n.z > 0.0);
                    let joins = |t: &u32| *t != texel.triangle && side(*t) == Some(texel.frame.normal.z > 0.0);
                    let met = all().filter(|(_, f)| boxed(f) && f.meets(low, high)).map(|(t, _)| t as u32).filter(joins);
                    prop_assert_eq!(&texel.near, &std::iter::once(texel.triangle).chain(met).collect::<Vec<u32>>());
                    // None that holds a point of the square is left out.
                    for (dx, dy) in (0..16).map(|k| ((k % 4) as f32 / 3.01, (k / 4) as f32 / 3.01)) {
                        let at = low + DVec2::new(f64::from(dx), f64::from(dy));
                        let joined = all().filter(|(t, f)| boxed(f) && joins(&(*t as u32))).map(|(t, _)| t as u32);
                        let first = std::iter::once(texel.triangle).chain(joined).find(|t| raster.flats[*t as usize].inside(at).is_some());
                        prop_assert_eq!(raster.footprint(&texel, dx, dy).map(|p| p.triangle), first);
                    }
                }
                let around: std::collections::BTreeSet<u32> = raster.bins.around(x, y, 4).collect();
                let within = |f: &Flat| f.nearest_within((low - 4.0, high + 4.0), low + 0.5).is_some();
                prop_assert!(all().filter(|(_, f)| within(f)).all(|(t, _)| around.contains(&(t as u32))));
            }
            prop_assert_eq!(rows(&raster), expected);
        }

        /// The promise behind it: where a chart is looked at, there is light.
        #[test]
        fn each_point_of_a_chart_has_light_around_it(triangles in mesh(), at in prop::collection::vec([0.0f64..1.0, 0.0..1.0], 40)) {
            let raster = raster(&triangles, 55, 55);
            let held: std::collections::BTreeSet<(u32, u32)> = rows(&raster).iter().map(|r| (r.x, r.y)).collect();
            let size = TextureSize { width: 55, height: 55 };
            for (t, flat) in raster.flats.iter().enumerate() {
                for [u, v] in at.iter().filter(|[u, v]| u + v <= 1.0) {
                    let [a, b, c] = flat.corners;
                    let p = a + (b - a) * *u + (c - a) * *v;
                    let within = (p / 55.0).cmpge(DVec2::ZERO).all() && (p / 55.0).cmplt(DVec2::ONE).all();
                    let seen = within && flat.inverse.is_some() && raster.frames.geometric_normal(t as u32).is_some();
                    let texels = crate::lookup::footprint((p / 55.0).as_vec2().to_array(), size);
                    let lit = texels.iter().any(|(k, weight)| *weight > 0.0 && held.contains(&((k % 55) as u32, (k / 55) as u32)));
                    prop_assert!(lit || !seen, "{} of {:?}", p, flat.corners);
                }
            }
        }
    }

    #[test]
    fn the_tip_of_a_narrow_chart_is_covered_and_shows_itself() {
        // One texel wide, its hypotenuse crosses the line of centres at half of its length.
        let raster = raster(&[[[8.0, 4.0], [9.0, 4.0], [8.0, 24.0]]], 32, 32);
        let rows = rows(&raster);
        let covered: Vec<(u32, u32)> = rows.iter().filter(|r| r.is_covered()).map(|r| (r.x, r.y)).collect();
        let wanted: Vec<(u32, u32)> = (4..14).chain(16..24).map(|y| (8, y)).collect();
        assert_eq!(covered, wanted, "rows 14 and 15 are gutter of row 13");
        let tip = raster.texel(8, 20).unwrap();
        // The foot of (8.5, 20.5) on the hypotenuse, x = 8 + (24 - y)/20.
        assert!(tip.position.distance(glam::Vec3::new(8.175_81, 20.483_79, 0.0)) < 1e-4, "{}", tip.position);
        assert_eq!(raster.centre(&tip).position, tip.position);
        assert!(raster.reach(&tip) >= 1.4 && raster.reach(&raster.texel(8, 5).unwrap()) < 0.71);
        assert!((0..64).all(|k| raster.footprint(&tip, (k % 8) as f32 / 8.0, (k / 8) as f32 / 8.0).is_none_or(|p| p.position.y >= 20.0)));
        assert!(rows.iter().any(|r| (r.x, r.y) == (6, 23) && r.source == (8, 23)), "and has a gutter");
    }
}
