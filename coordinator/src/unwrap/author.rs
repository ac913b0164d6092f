//! The author's texture coordinates: whether they can hold a light field as they are, and at what size.

use super::{Charts, Wanted, raster};
use glam::{DVec2, DVec3};
use kiln_proto::{
    limits,
    scene::{Scene, Surface},
    settings::TextureSize,
};
use std::collections::HashMap;

/// How far outside the unit square coordinates may lie and still be clamped.
const OUTSIDE: f32 = 1e-4;
/// Share of a surface's area that may lie on triangles without area in the texture.
const DEGENERATE: f64 = 1e-3;
/// Area in the unit square below which a triangle has none: a millionth of a texel of the largest texture.
const UV_AREA: f64 = 1e-14;

/// Why texture coordinates cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum Unusable {
    /// No triangle has any.
    #[error("there are none")]
    Missing,
    /// Some have none.
    #[error("{without} of {all} triangles have none")]
    Partial { without: usize, all: usize },
    /// They tile.
    #[error("they leave the unit square (one is {u}, {v})")]
    Outside { u: f32, v: f32 },
    /// They do not span an area.
    #[error("{percent:.1} % of the surface has no area in the texture")]
    Degenerate { percent: f64 },
    /// Two places share a texel.
    #[error("they overlap (at texel {x}, {y} of {size})")]
    Overlap { x: u32, y: u32, size: TextureSize },
}

/// The author's charts at the wanted size, with a note where the size had to be bounded.
pub(super) fn lay_out(scene: &Scene, surface: &Surface, wanted: Wanted) -> Result<(Charts, Option<String>), Unusable> {
    let uv = coordinates(surface)?;
    let extent = Extent::measure(scene, surface, &uv);
    if extent.degenerate > DEGENERATE * extent.world || extent.uv <= 0.0 {
        return Err(Unusable::Degenerate { percent: 100.0 * extent.degenerate / extent.world });
    }
    let (size, note) = match wanted {
        Wanted::Size(size) => (size, None),
        Wanted::Density(density) => extent.size(density),
    };
    if let Some((x, y)) = overlap(&uv, size) {
        return Err(Unusable::Overlap { x, y, size });
    }
    let charts = components(surface, &uv);
    Ok((Charts { size, uv, charts }, note))
}

/// All coordinates, clamped to the unit square.
fn coordinates(surface: &Surface) -> Result<Vec<[[f32; 2]; 3]>, Unusable> {
    let all = surface.triangles.len();
    let set = surface.uv_sets.first().map_or(&[][..], Vec::as_slice);
    let without = all - set.iter().flatten().count();
    if without == all {
        return Err(Unusable::Missing);
    }
    if without > 0 {
        return Err(Unusable::Partial { without, all });
    }
    let uv: Vec<[[f32; 2]; 3]> = set.iter().copied().flatten().collect();
    let far = |v: f32| !(-OUTSIDE..=1.0 + OUTSIDE).contains(&v);
    if let Some([u, v]) = uv.iter().flatten().find(|c| c.iter().any(|v| far(*v))) {
        return Err(Unusable::Outside { u: *u, v: *v });
    }
    Ok(uv.into_iter().map(|t| t.map(|c| c.map(|v| v.clamp(0.0, 1.0)))).collect())
}

/// Areas and stretch of a surface in its texture.
struct Extent {
    /// World area, m².
    world: f64,
    /// World area of triangles that have no area in the texture, m².
    degenerate: f64,
    /// Area in the unit square.
    uv: f64,
    /// Sum over triangles of |dP/du| (metres per unit u) times area in the unit square.
    along_u: f64,
    /// The same of |dP/dv|.
    along_v: f64,
}

impl Extent {
    fn measure(scene: &Scene, surface: &Surface, uv: &[[[f32; 2]; 3]]) -> Self {
        let mut out = Self { world: 0.0, degenerate: 0.0, uv: 0.0, along_u: 0.0, along_v: 0.0 };
        for (t, uv) in surface.triangles.iter().zip(uv) {
            let [a, b, c] = scene.corners(t);
            let (e1, e2): (DVec3, DVec3) = (b - a, c - a);
            let p = uv.map(|[u, v]| DVec2::new(f64::from(u), f64::from(v)));
            let (d1, d2) = (p[1] - p[0], p[2] - p[0]);
            let (area, flat) = (e1.cross(e2).length() / 2.0, d1.perp_dot(d2).abs() / 2.0);
            out.world += area;
            if flat <= UV_AREA {
                out.degenerate += area;
                continue;
            }
            out.uv += flat;
            // dP/du = (e1 dv2 - e2 dv1) / det, so times the area det/2 it needs no division.
            out.along_u += (e1 * d2.y - e2 * d1.y).length() / 2.0;
            out.along_v += (e2 * d1.x - e1 * d2.x).length() / 2.0;
        }
        out
    }

    /// The size at which a texel covers `density`^-2 m² on average, with the sides in proportion to the stretch along u and v.
    fn size(&self, density: f64) -> (TextureSize, Option<String>) {
        let (u, v) = (self.along_u / self.uv, self.along_v / self.uv);
        let k = density * (self.world / (self.uv * u * v)).sqrt();
        let (width, height) = (u * k, v * k);
        let max = f64::from(limits::TEXTURE_SIDE);
        let shrink = (max / width.max(height)).min(1.0);
        let side = |s: f64| (s * shrink).round().clamp(1.0, max) as u32;
        let size = TextureSize { width: side(width), height: side(height) };
        let note = format!(
            "{density} texels per metre would make a texture of {width:.0}x{height:.0}; it was bounded to {size} ({max} texels a side)"
        );
        (size, (shrink < 1.0).then_some(note))
    }
}

/// The first texel whose centre lies strictly inside two triangles.
fn overlap(uv: &[[[f32; 2]; 3]], size: TextureSize) -> Option<(u32, u32)> {
    let (width, height) = (size.width, size.height);
    let mut taken = vec![0u64; (size.texels() as usize).div_ceil(64)];
    let mut found = None;
    for t in uv {
        let corners = t.map(|[u, v]| DVec2::new(f64::from(u) * f64::from(width), f64::from(v) * f64::from(height)));
        let all = raster::inside(corners, width, height, |x, y| {
            let at = y as usize * width as usize + x as usize;
            let bit = 1u64 << (at % 64);
            if taken[at / 64] & bit != 0 {
                found = Some((x, y));
                return false;
            }
            taken[at / 64] |= bit;
            true
        });
        if !all {
            break;
        }
    }
    found
}

/// A corner in space and in the texture.
type Corner = (u32, [u32; 2]);

/// Charts: triangles that share an edge both in space and in the texture belong together. Numbered by their first triangles.
fn components(surface: &Surface, uv: &[[[f32; 2]; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..uv.len() as u32).collect();
    // Looked up, never iterated: the order of hashing cannot matter.
    let mut edges: HashMap<(Corner, Corner), u32> = HashMap::new();
    for (t, (triangle, uv)) in surface.triangles.iter().zip(uv).enumerate() {
        let corner = |k: usize| (triangle.corners[k], uv[k].map(f32::to_bits));
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corner(i), corner(j))) {
            let first = *edges.entry((a.min(b), a.max(b))).or_insert(t as u32);
            let (x, y) = (root(&mut parent, first), root(&mut parent, t as u32));
            // The lower number becomes the root, so a chart's root is its first triangle.
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let mut numbers = vec![u32::MAX; uv.len()];
    let mut next = 0;
    (0..uv.len() as u32)
        .map(|t| {
            let first = root(&mut parent, t) as usize;
            if numbers[first] == u32::MAX {
                numbers[first] = next;
                next += 1;
            }
            numbers[first]
        })
        .collect()
}

fn root(parent: &mut [u32], mut t: u32) -> u32 {
    while parent[t as usize] != t {
        parent[t as usize] = parent[parent[t as usize] as usize];
        t = parent[t as usize];
    }
    t
}
