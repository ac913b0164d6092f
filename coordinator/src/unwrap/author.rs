//! The author's texture coordinates: whether they can hold a light field as they are, at what size, and what charts they make.

use super::{
    Charts, Wanted,
    chart::{Chart, Origin},
    check::{self, Fault},
    flat,
};
use glam::{DVec2, DVec3};
use kiln_proto::{
    limits,
    scene::{Scene, Surface},
    sets::DisjointSets,
    settings::TextureSize,
};
use std::collections::HashMap;

/// How far outside the unit square coordinates may lie and still be clamped.
const OUTSIDE: f32 = 1e-4;
/// Share of an area that may lie on triangles without area in the texture, or turned over in it.
const DEGENERATE: f64 = 1e-3;
/// Area in the unit square below which a triangle has none: a millionth of a texel of the largest texture.
const UV_AREA: f64 = 1e-14;

/// A triangle with so many times less room than its share is squeezed, and so much of an area may be.
const SQUEEZED: f64 = 16.0;
const UNEVEN: f64 = 0.05;

/// Area in the unit square above which triangles overlap for certain, rounding apart.
const STACKED: f64 = 1.01;

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
    /// More area than the texture has.
    #[error("they overlap (together they cover {times:.1} times the texture)")]
    Stacked { times: f64 },
    /// A chart is folded over.
    #[error("{triangles} triangles are turned over within their charts")]
    Folded { triangles: usize },
    /// Whole charts are turned over.
    #[error("{mirrored} of its {all} charts are mirrored")]
    Mirrored { mirrored: usize, all: usize },
    /// Charts without room for their gutters.
    #[error("its charts are less than two gutters (4 texels) apart (at texel {x}, {y} of {size})")]
    Close { x: u32, y: u32, size: TextureSize },
}

impl Unusable {
    /// Whether the charts as such are good: they only have to be moved.
    pub(super) fn is_only_placement(&self) -> bool {
        matches!(self, Unusable::Mirrored { .. } | Unusable::Close { .. })
    }
}

/// The coordinates of a set on some triangles of a surface.
pub(super) struct Author<'a> {
    scene: &'a Scene,
    surface: &'a Surface,
    triangles: &'a [u32],
    /// In the order of `triangles`.
    uv: Vec<[[f32; 2]; 3]>,
    /// Triangles that share an edge both in space and in the texture belong together; numbered by their first triangles.
    charts: Vec<u32>,
}

impl<'a> Author<'a> {
    /// Reads a set: all coordinates, clamped to the unit square, in charts that are not folded.
    pub(super) fn read(scene: &'a Scene, surface: &'a Surface, set: usize, triangles: &'a [u32]) -> Result<Self, Unusable> {
        let uv = coordinates(surface, set, triangles)?;
        let charts = components(surface, triangles, &uv);
        let author = Self { scene, surface, triangles, uv, charts };
        let extent = author.extent(0..triangles.len());
        if extent.degenerate > DEGENERATE * extent.world || extent.uv <= 0.0 {
            return Err(Unusable::Degenerate { percent: 100.0 * extent.degenerate / extent.world });
        }
        // Coordinates lie in the unit square, so more area than it has lies on itself. Said before a texel is drawn: two million triangles
        // on top of each other would be drawn for hours.
        if extent.uv > STACKED {
            return Err(Unusable::Stacked { times: extent.uv });
        }
        let turns = author.turns();
        let folded = |k: &usize| {
            let [front, back] = turns[author.charts[*k] as usize];
            let least = front.min(back);
            least > DEGENERATE * (front + back) && (signed_area(author.uv[*k]) > 0.0) == (least == front)
        };
        match (0..triangles.len()).filter(folded).count() {
            0 => Ok(author),
            folded => Err(Unusable::Folded { triangles: folded }),
        }
    }

    /// The layout as the author has it, at the wanted size, with a note where that had to be bounded.
    pub(super) fn as_it_is(&self, wanted: Wanted) -> Result<(Charts, Option<String>), Unusable> {
        let (size, note) = match wanted {
            Wanted::Size(size) => (size, None),
            Wanted::Density(density) => self.extent(0..self.triangles.len()).size(density),
        };
        let layout = Charts { size, uv: self.uv.clone(), charts: self.charts.clone() };
        let close = match check::first_fault(&layout) {
            Some(Fault::Overlap { x, y, .. }) => return Err(Unusable::Overlap { x, y, size }),
            Some(Fault::Close { x, y, .. }) => Some(Unusable::Close { x, y, size }),
            None => None,
        };
        let turns = self.turns();
        let mirrored = turns.iter().filter(|[front, back]| back > front).count();
        match close {
            _ if mirrored > 0 => Err(Unusable::Mirrored { mirrored, all: turns.len() }),
            Some(close) => Err(close),
            None => Ok((layout, note)),
        }
    }

    /// Whether hardly any of it has next to no room: what was drawn for a picture may squeeze a side of a body into a line.
    pub(super) fn is_even(&self) -> bool {
        let all = self.extent(0..self.triangles.len());
        let squeezed = |k: &usize| {
            let one = self.extent([*k]);
            one.uv * all.world * SQUEEZED < one.world * all.uv
        };
        let area: f64 = (0..self.triangles.len()).filter(squeezed).map(|k| self.extent([k]).world).sum();
        area <= UNEVEN * all.world
    }

    /// The author's charts, each at its true size on average and mirrored ones turned back; what has no area in the texture lies in its
    /// planes.
    pub(super) fn to_charts(&self) -> Vec<Chart> {
        let mut members: Vec<Vec<usize>> = vec![vec![]; self.turns().len()];
        self.charts.iter().enumerate().for_each(|(k, chart)| members[*chart as usize].push(k));
        members.into_iter().flat_map(|members| self.chart(&members)).collect()
    }

    fn chart(&self, members: &[usize]) -> Vec<Chart> {
        let triangles: Vec<u32> = members.iter().map(|k| self.triangles[*k]).collect();
        let extent = self.extent(members.iter().copied());
        let stretch = DVec2::new(extent.along_u, extent.along_v) / extent.uv;
        let even = (extent.world / (extent.uv * stretch.x * stretch.y)).sqrt();
        if extent.uv <= 0.0 || !even.is_finite() || even <= 0.0 {
            return flat::planes(self.scene, self.surface, &triangles);
        }
        let mirrored = members.iter().map(|k| signed_area(self.uv[*k])).sum::<f64>() < 0.0;
        let scale = stretch * even * DVec2::new(if mirrored { -1.0 } else { 1.0 }, 1.0);
        let corners: Vec<[DVec2; 3]> = members.iter().map(|k| points(self.uv[*k]).map(|p| p * scale)).collect();
        vec![Chart::new(Origin::Author, triangles, &corners)]
    }

    /// Area in the unit square of the triangles of each chart that show their fronts, and of those that show their backs.
    fn turns(&self) -> Vec<[f64; 2]> {
        let mut turns = vec![[0.0; 2]; self.charts.iter().max().map_or(0, |last| *last as usize + 1)];
        for (uv, chart) in self.uv.iter().zip(&self.charts) {
            let area = signed_area(*uv);
            turns[*chart as usize][usize::from(area < 0.0)] += area.abs();
        }
        turns
    }

    fn extent(&self, members: impl IntoIterator<Item = usize>) -> Extent {
        let mut out = Extent { world: 0.0, degenerate: 0.0, uv: 0.0, along_u: 0.0, along_v: 0.0 };
        for k in members {
            let [a, b, c] = self.scene.corners(&self.surface.triangles[self.triangles[k] as usize]);
            let (e1, e2): (DVec3, DVec3) = (b - a, c - a);
            let p = points(self.uv[k]);
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
}

fn points(uv: [[f32; 2]; 3]) -> [DVec2; 3] {
    uv.map(|[u, v]| DVec2::new(f64::from(u), f64::from(v)))
}

fn signed_area(uv: [[f32; 2]; 3]) -> f64 {
    let [a, b, c] = points(uv);
    (b - a).perp_dot(c - a) / 2.0
}

/// All coordinates of a set, clamped to the unit square.
fn coordinates(surface: &Surface, set: usize, triangles: &[u32]) -> Result<Vec<[[f32; 2]; 3]>, Unusable> {
    let all = triangles.len();
    let uv: Vec<[[f32; 2]; 3]> = triangles.iter().filter_map(|t| surface.uv(set, *t as usize)).collect();
    match all - uv.len() {
        0 => {}
        without if without == all => return Err(Unusable::Missing),
        without => return Err(Unusable::Partial { without, all }),
    }
    let far = |v: f32| !(-OUTSIDE..=1.0 + OUTSIDE).contains(&v);
    if let Some([u, v]) = uv.iter().flatten().find(|c| c.iter().any(|v| far(*v))) {
        return Err(Unusable::Outside { u: *u, v: *v });
    }
    Ok(uv.into_iter().map(|t| t.map(|c| c.map(|v| v.clamp(0.0, 1.0)))).collect())
}

/// Areas and stretch of triangles in their texture.
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

/// A corner in space and in the texture.
type Corner = (u32, [u32; 2]);

fn components(surface: &Surface, triangles: &[u32], uv: &[[[f32; 2]; 3]]) -> Vec<u32> {
    let mut sets = DisjointSets::new(uv.len());
    // Looked up, never iterated: the order of hashing cannot matter.
    let mut edges: HashMap<(Corner, Corner), u32> = HashMap::new();
    for (k, (t, uv)) in triangles.iter().zip(uv).enumerate() {
        let corner = |i: usize| (surface.triangles[*t as usize].corners[i], uv[i].map(f32::to_bits));
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corner(i), corner(j))) {
            let first = *edges.entry((a.min(b), a.max(b))).or_insert(k as u32);
            sets.join(first, k as u32);
        }
    }
    sets.numbers()
}
