//! Charts in their own planes, and what becomes of them in a texture: all at one density, packed, and written as texture coordinates.
//!
//! A chart's box is stretched to whole texels (by less than one), so that edges along the box run between texels and its texels are covered
//! whole. A chart too thin to hold a texel centre grows until it holds one: every chart has light.

use super::{
    Charts, Wanted,
    pack::{self, Packed, Piece},
    raster,
};
use glam::{DVec2, Vec2Swizzles};
use kiln_proto::{limits, settings::TextureSize};

/// Steps that the search for a density takes: a millionth of the range.
const STEPS: u32 = 20;
/// Texels by which a chart may grow until it holds a texel centre.
const GROWTH: u32 = 8;
/// A chart of fewer texels is looked at whether it holds a centre.
const SMALL: f64 = 16.0;
/// Share of its box above which a chart is packed as its box.
const BOXY: f64 = 0.9;

/// Why charts do not fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum DoesNotFit {
    /// Not even with a texel for each.
    #[error("its {charts} charts do not fit into {size} texels with their gutters; give it a larger texture")]
    Size { charts: usize, size: TextureSize },
    /// Not even into the largest texture.
    #[error("its {charts} charts do not fit into the largest texture; split the surface, or give it texture coordinates")]
    Any { charts: usize },
}

/// Where a chart came from, which says how it may be cut if it covers a texel twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Origin {
    /// One triangle.
    Triangle,
    /// A flat polygon of the file.
    Polygon,
    /// Neighbouring polygons in one plane.
    Plane,
    /// Triangles that were flattened together.
    Flattened,
    /// The author's chart.
    Author,
}

/// A piece of a surface in a plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chart {
    pub(super) origin: Origin,
    /// Its triangles, counted within the surface.
    pub(super) triangles: Vec<u32>,
    /// Their corners: shares of the box, in [0, 1].
    corners: Vec<[DVec2; 3]>,
    /// Sides of the box, metres.
    pub(super) extent: DVec2,
}

impl Chart {
    /// A chart of triangles whose corners lie at these points of a plane, metres.
    pub(super) fn new(origin: Origin, triangles: Vec<u32>, corners: &[[DVec2; 3]]) -> Self {
        let low = corners.iter().flatten().copied().reduce(DVec2::min).unwrap_or_default();
        let high = corners.iter().flatten().copied().reduce(DVec2::max).unwrap_or_default();
        // Never zero, so that shares of it are numbers.
        let extent = (high - low).max(DVec2::splat(f64::MIN_POSITIVE));
        let share = |p: DVec2| ((p - low) / extent).clamp(DVec2::ZERO, DVec2::ONE);
        Self { origin, triangles, corners: corners.iter().map(|t| t.map(share)).collect(), extent }
    }

    /// The share of its box that it takes.
    fn filling(&self) -> f64 {
        self.corners.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a).abs() / 2.0).sum()
    }

    /// The chart's box in texels at a density (1/m).
    fn texels(&self, density: f64) -> (u32, u32) {
        let most = f64::from(2 * limits::TEXTURE_SIDE);
        // Rounding noise must not add a texel to a wall of exactly ten metres.
        let side = |metres: f64| (metres * density - 1e-6).ceil().clamp(1.0, most) as u32;
        let (mut w, mut h) = (side(self.extent.x), side(self.extent.y));
        if w.min(h) <= 3 || self.filling() * f64::from(w) * f64::from(h) < SMALL {
            for _ in 0..GROWTH {
                if self.holds_a_centre(w, h) {
                    break;
                }
                (w, h) = (w + 1, h + 1);
            }
        }
        (w, h)
    }

    fn holds_a_centre(&self, w: u32, h: u32) -> bool {
        let scale = DVec2::new(f64::from(w), f64::from(h));
        self.corners.iter().any(|t| !raster::inside(t.map(|c| c * scale), w, h, |_, _| false))
    }

    /// What a packer sees of it in a box of this size.
    fn piece(&self, (w, h): (u32, u32)) -> Piece {
        let fits = w <= u32::from(u16::MAX) && h <= u32::from(u16::MAX);
        if w.min(h) <= 2 * pack::GAP as u32 || !fits || self.filling() > BOXY {
            return Piece::full(w, h);
        }
        let scale = DVec2::new(f64::from(w), f64::from(h));
        let mut outline = [vec![(u16::MAX, 0); w as usize], vec![(u16::MAX, 0); h as usize]];
        for t in &self.corners {
            let t = t.map(|c| c * scale);
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                trace(&mut outline[0], a, b, h);
                trace(&mut outline[1], a.yx(), b.yx(), w);
            }
        }
        // A column that nothing is drawn in (a chart of several pieces) is taken whole.
        for (line, side) in outline.iter_mut().zip([h, w]) {
            line.iter_mut().filter(|(low, high)| low >= high).for_each(|empty| *empty = (0, side as u16));
        }
        Piece { size: (w, h), outline: Some(outline) }
    }

    /// Texels that it costs at a density, its share of the gutters included.
    pub(super) fn cost(&self, density: f64) -> f64 {
        let size = self.texels(density);
        self.piece(size).taken() as f64 + pack::GAP as f64 * f64::from(size.0 + size.1)
    }
}

/// Widens the rows that each column takes by an edge from `a` to `b`.
fn trace(columns: &mut [(u16, u16)], a: DVec2, b: DVec2, height: u32) {
    let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
    let slope = if b.x > a.x { (b.y - a.y) / (b.x - a.x) } else { 0.0 };
    let last = columns.len() - 1;
    let column = |x: f64| (x.floor().max(0.0) as usize).min(last);
    for c in column(a.x)..=column(b.x) {
        let at = |x: f64| a.y + (x.clamp(a.x, b.x) - a.x) * slope;
        let (mut y0, mut y1) = (at(c as f64), at(c as f64 + 1.0));
        if slope == 0.0 {
            (y0, y1) = (a.y, b.y);
        }
        let row = |y: f64| y.clamp(0.0, f64::from(height)) as u16;
        let (low, high) = &mut columns[c];
        *low = (*low).min(row(y0.min(y1).floor()));
        *high = (*high).max(row(y0.max(y1).ceil()));
    }
}

/// Packs charts as wanted and writes their coordinates, with a note where the density had to be bounded.
pub(super) fn arrange(triangles: usize, charts: &[Chart], wanted: Wanted) -> Result<(Charts, Option<String>), DoesNotFit> {
    match wanted {
        Wanted::Size(size) => {
            let fit = densest(charts, size).ok_or(DoesNotFit::Size { charts: charts.len(), size })?;
            Ok((place(triangles, charts, &fit, size), None))
        }
        Wanted::Density(density) => {
            if let Some(fit) = fit(charts, density, |pieces| pack::pack_free(pieces, limits::TEXTURE_SIDE)) {
                let size = TextureSize { width: fit.packed.width, height: fit.packed.height };
                return Ok((place(triangles, charts, &fit, size), None));
            }
            let size = TextureSize { width: limits::TEXTURE_SIDE, height: limits::TEXTURE_SIDE };
            let fit = densest(charts, size).ok_or(DoesNotFit::Any { charts: charts.len() })?;
            let note = format!("{density} texels per metre do not fit into {size}; {:.3} are used", fit.density);
            Ok((place(triangles, charts, &fit, size), Some(note)))
        }
    }
}

/// Charts packed at a density.
struct Fit {
    /// Texels per metre.
    density: f64,
    /// Box of each chart, texels.
    sizes: Vec<(u32, u32)>,
    packed: Packed,
}

/// Packs the charts at a density; `None` where they do not fit, which is seen before their outlines are drawn where it is plain.
fn fit(charts: &[Chart], density: f64, pack: impl Fn(&[Piece]) -> Option<Packed>) -> Option<Fit> {
    let side = u64::from(limits::TEXTURE_SIDE);
    let sizes: Vec<(u32, u32)> = charts.iter().map(|c| c.texels(density)).collect();
    // Every chart takes a texel of each of its columns and rows at least.
    let least: u64 = sizes.iter().map(|(w, h)| u64::from(*w.max(h))).sum();
    if least > side * side || sizes.iter().any(|(w, h)| u64::from(*w.max(h)) > side) {
        return None;
    }
    let pieces: Vec<Piece> = charts.iter().zip(&sizes).map(|(chart, size)| chart.piece(*size)).collect();
    Some(Fit { density, packed: pack(&pieces)?, sizes })
}

/// The highest density, found by bisection, at which the charts fit.
fn densest(charts: &[Chart], size: TextureSize) -> Option<Fit> {
    let fit = |density: f64| fit(charts, density, |pieces| pack::pack(pieces, size.width, size.height));
    let area: f64 = charts.iter().map(|c| c.extent.x * c.extent.y * c.filling()).sum();
    // The charts alone fill the texture at the upper end, so nothing above it can fit.
    let mut high = (size.texels() as f64 / area).sqrt();
    if let Some(best) = fit(high) {
        return Some(best);
    }
    let mut best = fit(high * 1e-6)?;
    for _ in 0..STEPS {
        let middle = (best.density + high) / 2.0;
        match fit(middle) {
            Some(better) => best = better,
            None => high = middle,
        }
    }
    Some(best)
}

/// Writes the charts' coordinates.
fn place(triangles: usize, charts: &[Chart], fit: &Fit, size: TextureSize) -> Charts {
    let mut uv = vec![[[0.0; 2]; 3]; triangles];
    let mut ids = vec![0; triangles];
    for (id, (chart, (place, texels))) in charts.iter().zip(fit.packed.places.iter().zip(&fit.sizes)).enumerate() {
        let (w, h) = (f64::from(texels.0), f64::from(texels.1));
        let at = |c: DVec2| {
            let (x, y) = (c.x * w, c.y * h);
            let (x, y) = match place.turns {
                0 => (x, y),
                1 => (h - y, x),
                2 => (w - x, h - y),
                _ => (y, w - x),
            };
            let (x, y) = (x + f64::from(place.origin.0), y + f64::from(place.origin.1));
            [(x / f64::from(size.width)) as f32, (y / f64::from(size.height)) as f32]
        };
        for (t, corners) in chart.triangles.iter().zip(&chart.corners) {
            uv[*t as usize] = corners.map(at);
            ids[*t as usize] = id as u32;
        }
    }
    Charts { size, uv, charts: ids }
}
