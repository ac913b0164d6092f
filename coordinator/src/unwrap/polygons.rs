//! One chart per flat polygon, all at one density, packed on shelves.
//!
//! A polygon lies in its plane with its longest edge along u, so that rectangles fill their boxes. Its box is stretched to whole texels
//! (by less than one), so that edges along the box run between texels and its texels are covered whole. A chart too thin to hold a
//! texel centre grows until it holds one: every polygon has light.

use super::{
    Charts, Wanted,
    pack::{self, Packed},
    raster,
};
use glam::{DVec2, DVec3};
use kiln_proto::{
    limits,
    scene::{Scene, Surface},
    settings::TextureSize,
};
use std::ops::Range;

/// Triangles whose normals differ more than this (cosine) from their polygon's get charts of their own.
const FLAT: f64 = 0.99;
/// Steps that the search for a density takes: a millionth of the range.
const STEPS: u32 = 20;
/// Texels by which a chart may grow until it holds a texel centre.
const GROWTH: u32 = 8;

/// Why polygons do not fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum DoesNotFit {
    /// Not even with a texel for each.
    #[error("its {charts} charts of one polygon each do not fit into {size} texels with their gutters; give it a larger texture")]
    Size { charts: usize, size: TextureSize },
    /// Not even into the largest texture.
    #[error(
        "its {charts} charts of one polygon each do not fit into the largest texture; split the surface, or give it texture coordinates"
    )]
    Any { charts: usize },
}

/// A polygon in its plane.
struct Chart {
    /// Its triangles, counted within the surface.
    triangles: Range<usize>,
    /// Their corners: shares of the box, in [0, 1].
    corners: Vec<[DVec2; 3]>,
    /// Sides of the box, metres.
    extent: DVec2,
}

/// Charts for all polygons of a surface, with a note where the density had to be bounded.
pub(super) fn lay_out(scene: &Scene, surface: &Surface, wanted: Wanted) -> Result<(Charts, Option<String>), DoesNotFit> {
    let charts = flatten(scene, surface);
    match wanted {
        Wanted::Size(size) => {
            let fit = densest(&charts, size).ok_or(DoesNotFit::Size { charts: charts.len(), size })?;
            Ok((place(surface, &charts, &fit, size), None))
        }
        Wanted::Density(density) => {
            let sizes: Vec<(u32, u32)> = charts.iter().map(|c| c.texels(density)).collect();
            if let Some(packed) = pack::pack_free(&sizes, limits::TEXTURE_SIDE) {
                let size = TextureSize { width: packed.width, height: packed.height };
                return Ok((place(surface, &charts, &Fit { density, sizes, packed }, size), None));
            }
            let size = TextureSize { width: limits::TEXTURE_SIDE, height: limits::TEXTURE_SIDE };
            let fit = densest(&charts, size).ok_or(DoesNotFit::Any { charts: charts.len() })?;
            let note = format!("{density} texels per metre do not fit into {size}; {:.3} are used", fit.density);
            Ok((place(surface, &charts, &fit, size), Some(note)))
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

/// The highest density, found by bisection, at which the charts fit.
fn densest(charts: &[Chart], size: TextureSize) -> Option<Fit> {
    let fit = |density: f64| {
        let sizes: Vec<(u32, u32)> = charts.iter().map(|c| c.texels(density)).collect();
        pack::pack(&sizes, size.width, size.height).map(|packed| Fit { density, sizes, packed })
    };
    let area: f64 = charts.iter().map(|c| c.extent.x * c.extent.y).sum();
    // Boxes alone fill the texture at the upper end, so nothing above it can fit.
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
fn place(surface: &Surface, charts: &[Chart], fit: &Fit, size: TextureSize) -> Charts {
    let mut uv = vec![[[0.0; 2]; 3]; surface.triangles.len()];
    let mut ids = vec![0; surface.triangles.len()];
    for (id, (chart, (origin, texels))) in charts.iter().zip(fit.packed.origins.iter().zip(&fit.sizes)).enumerate() {
        let at = |c: DVec2| {
            let x = f64::from(origin.0) + c.x * f64::from(texels.0);
            let y = f64::from(origin.1) + c.y * f64::from(texels.1);
            [(x / f64::from(size.width)) as f32, (y / f64::from(size.height)) as f32]
        };
        for (t, corners) in chart.triangles.clone().zip(&chart.corners) {
            uv[t] = corners.map(at);
            ids[t] = id as u32;
        }
    }
    Charts { size, uv, charts: ids }
}

impl Chart {
    /// The chart's box in texels at a density (1/m).
    fn texels(&self, density: f64) -> (u32, u32) {
        let most = f64::from(2 * limits::TEXTURE_SIDE);
        // Rounding noise must not add a texel to a wall of exactly ten metres.
        let side = |metres: f64| (metres * density - 1e-6).ceil().clamp(1.0, most) as u32;
        let (mut w, mut h) = (side(self.extent.x), side(self.extent.y));
        if w.min(h) <= 3 {
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
}

/// All polygons of a surface in their planes; those that are not flat, triangle by triangle.
fn flatten(scene: &Scene, surface: &Surface) -> Vec<Chart> {
    let mut charts = vec![];
    let mut start = 0;
    for group in surface.triangles.chunk_by(|a, b| a.polygon == b.polygon) {
        let corners: Vec<[DVec3; 3]> = group.iter().map(|t| scene.corners(t)).collect();
        let indices: Vec<[u32; 3]> = group.iter().map(|t| t.corners).collect();
        if is_flat(&corners) {
            charts.push(chart(start..start + group.len(), &corners, &indices));
        } else {
            let each = (0..group.len()).map(|k| chart(start + k..start + k + 1, &corners[k..=k], &indices[k..=k]));
            charts.extend(each);
        }
        start += group.len();
    }
    charts
}

fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

fn is_flat(corners: &[[DVec3; 3]]) -> bool {
    let whole: DVec3 = corners.iter().map(normal).sum();
    corners.iter().map(normal).all(|n| n.dot(whole) >= FLAT * n.length() * whole.length())
}

fn chart(triangles: Range<usize>, corners: &[[DVec3; 3]], indices: &[[u32; 3]]) -> Chart {
    let n: DVec3 = corners.iter().map(normal).sum::<DVec3>().normalize();
    let edge = longest_border(corners, indices);
    let tangent = (edge - n * n.dot(edge)).normalize();
    let bitangent = n.cross(tangent);
    let origin = corners[0][0];
    let flat: Vec<[DVec2; 3]> =
        corners.iter().map(|t| t.map(|p| DVec2::new((p - origin).dot(tangent), (p - origin).dot(bitangent)))).collect();
    let low = flat.iter().flatten().copied().reduce(DVec2::min).unwrap_or_default();
    let high = flat.iter().flatten().copied().reduce(DVec2::max).unwrap_or_default();
    // Never zero, so that shares of it are numbers.
    let extent = (high - low).max(DVec2::splat(f64::MIN_POSITIVE));
    Chart { triangles, corners: flat.iter().map(|t| t.map(|p| ((p - low) / extent).clamp(DVec2::ZERO, DVec2::ONE))).collect(), extent }
}

/// The longest edge that only one triangle of the polygon has; the first of equals.
fn longest_border(corners: &[[DVec3; 3]], indices: &[[u32; 3]]) -> DVec3 {
    let mut edges: Vec<(u32, u32, usize, usize)> = vec![];
    for (t, corner) in indices.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corner[k], corner[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t, k));
        }
    }
    edges.sort_unstable();
    let borders = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|same| same.len() == 1).map(|same| (same[0].2, same[0].3));
    let vector = |(t, k): (usize, usize)| corners[t][(k + 1) % 3] - corners[t][k];
    let mut longest = (0.0, vector((0, 0)));
    let mut borders: Vec<(usize, usize)> = borders.collect();
    borders.sort_unstable();
    for edge in borders.into_iter().map(vector) {
        if edge.length_squared() > longest.0 {
            longest = (edge.length_squared(), edge);
        }
    }
    longest.1
}
