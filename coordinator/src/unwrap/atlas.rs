//! Charts of neighbouring triangles of a curved mesh, flattened together.
//!
//! `uvunwrap` grows charts within a cone of normals, flattens each by least-squares conformal maps evened out by as-rigid-as-possible
//! steps, and cuts those that would fold, overlap or stretch by more than a factor; without its SIMD solver it gives the same bits on every
//! CPU. Its own packing knows no texture of a given size, so charts are taken out of it and packed by `pack`. An unwrapper of our own would
//! be another two thousand lines for the same charts; `xatlas` is C++ and its Rust binding does not link everywhere.

use super::chart::{Chart, Origin};
use glam::{DVec2, DVec3};
use kiln_proto::scene::{Scene, Surface};
use std::{
    collections::HashMap,
    panic::{AssertUnwindSafe, catch_unwind},
};
use uvunwrap::{Density, MeshInput, Options, Packing};

/// Triangles that are flattened at once, at most: beyond, polygons are charts. A million take from ten seconds to a minute.
const MOST: usize = 4_000_000;
/// Triangles of a chart, about: the solver's cost grows faster than the chart, so meshes of more triangles have smaller charts.
const CHART_TRIANGLES: std::ops::RangeInclusive<f64> = 1e3..=8e3;
/// Triangles of a chart times those of its mesh.
const CHART_WORK: f64 = 4e8;
/// Neighbours that meet at an edge whose normals differ by more than this (cosine, 30 degrees) are in different charts, unless the surface
/// is smooth there: texels on both sides of a fold have frames of their own, and nothing between them means anything.
const FOLD: f64 = 0.866;
/// Texels along each side of the atlas that `uvunwrap` is asked for; only proportions count.
const SIDE: f64 = 512.0;

/// Charts of some triangles of a surface; those that it leaves out, for having next to no area, are in none. `None` where it can do
/// nothing.
pub(super) fn flatten(scene: &Scene, surface: &Surface, triangles: &[u32]) -> Option<Vec<Chart>> {
    if triangles.len() > MOST {
        return None;
    }
    let mesh = Welded::new(scene, surface, triangles)?;
    let per_chart = (CHART_WORK / triangles.len() as f64).clamp(*CHART_TRIANGLES.start(), *CHART_TRIANGLES.end());
    let options = Options {
        density: Density::Fixed { texels_per_unit: (SIDE / mesh.area.sqrt()) as f32, page_size: None },
        packing: Packing::Fast,
        max_chart_area: if triangles.len() as f64 > per_chart { (mesh.area * per_chart / triangles.len() as f64) as f32 } else { 0.0 },
        ..Options::default()
    };
    let input = MeshInput { seams: Some(&mesh.seams), ..MeshInput::new(&mesh.positions, &mesh.indices) };
    // Geometry is outside data, and what flattens it is not ours: a panic costs a mesh its better charts, never the service.
    let atlas = catch_unwind(AssertUnwindSafe(|| uvunwrap::generate(&[input], &options))).ok()?.ok()?;
    let (out, texels) = (atlas.meshes.first()?, DVec2::new(f64::from(atlas.width), f64::from(atlas.height)));
    let mut groups: Vec<Vec<usize>> = vec![vec![]; atlas.chart_count as usize];
    for (k, corners) in out.indices.chunks_exact(3).enumerate() {
        let [a, b, c] = [0, 1, 2].map(|i| out.vertices[corners[i] as usize].chart);
        if let Some(chart) = a.filter(|_| a == b && b == c) {
            groups[chart as usize].push(k);
        }
    }
    let point = |vertex: u32| DVec2::from_array(out.vertices[vertex as usize].uv.map(f64::from)) * texels;
    let chart = |group: Vec<usize>| {
        let corners: Vec<[DVec2; 3]> = group.iter().map(|k| [0, 1, 2].map(|i| point(out.indices[3 * k + i]))).collect();
        let flat: f64 = corners.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a).abs() / 2.0).sum();
        let world: f64 = group.iter().map(|k| area(scene, surface, triangles[*k])).sum();
        let metres = (world / flat).sqrt();
        let usable = flat > 0.0 && metres > 0.0 && metres.is_finite();
        let triangles = group.iter().map(|k| triangles[*k]).collect();
        usable.then(|| Chart::new(Origin::Flattened, triangles, &corners.iter().map(|t| t.map(|p| p * metres)).collect::<Vec<_>>()))
    };
    Some(groups.into_iter().filter(|group| !group.is_empty()).filter_map(chart).collect())
}

/// The area of a triangle, m².
pub(super) fn area(scene: &Scene, surface: &Surface, triangle: u32) -> f64 {
    let [a, b, c] = scene.corners(&surface.triangles[triangle as usize]);
    (b - a).cross(c - a).length() / 2.0
}

/// Triangles as a mesh of its own, as large as the unit cube: what is far away or small loses nothing to rounding.
struct Welded {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    /// Which edges of each triangle no chart goes on over.
    seams: Vec<[bool; 3]>,
    /// Its area.
    area: f64,
}

impl Welded {
    /// Vertices are split where normals are: such edges are preferred as borders of charts. `None` for a mesh without extent.
    fn new(scene: &Scene, surface: &Surface, triangles: &[u32]) -> Option<Self> {
        let corners = || triangles.iter().flat_map(|t| scene.corners(&surface.triangles[*t as usize]));
        let (low, high) = (corners().reduce(DVec3::min)?, corners().reduce(DVec3::max)?);
        let size = (high - low).max_element();
        let area = triangles.iter().map(|t| area(scene, surface, *t)).sum::<f64>() / (size * size);
        if !(size > 0.0 && area > 1e-12 && area.is_finite()) {
            return None;
        }
        let mut mesh = Self { positions: vec![], indices: vec![], seams: seams(scene, surface, triangles), area };
        // Looked up, never iterated: the order of hashing cannot matter.
        let mut numbers: HashMap<(u32, u32), u32> = HashMap::new();
        for t in triangles {
            let triangle = &surface.triangles[*t as usize];
            for k in 0..3 {
                let normal = surface.normals.get(*t as usize).map_or(0, |n| n[k]);
                let number = *numbers.entry((triangle.corners[k], normal)).or_insert_with(|| {
                    let p = DVec3::from_array(scene.positions[triangle.corners[k] as usize].map(f64::from));
                    mesh.positions.push(((p - low) / size).as_vec3().to_array());
                    mesh.positions.len() as u32 - 1
                });
                mesh.indices.push(number);
            }
        }
        Some(mesh)
    }
}

/// The folds of a surface among these triangles: edges between normals that differ, except where the author's normals are the same on both
/// sides.
fn seams(scene: &Scene, surface: &Surface, triangles: &[u32]) -> Vec<[bool; 3]> {
    let normal = |k: usize| {
        let [a, b, c] = scene.corners(&surface.triangles[triangles[k] as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let corner = |k: usize, i: usize| {
        let t = triangles[k] as usize;
        (surface.triangles[t].corners[i], surface.normals.get(t).map(|n| n[i]))
    };
    // Corners of each edge in the order of their vertices, which both sides have in common, then the triangle and the place of the edge in
    // it.
    let mut edges = Vec::with_capacity(3 * triangles.len());
    for k in 0..triangles.len() {
        edges.extend([(0, 1), (1, 2), (2, 0)].map(|(i, j)| {
            let (a, b) = (corner(k, i), corner(k, j));
            if a.0 <= b.0 { (a.0, b.0, a.1, b.1, k, i) } else { (b.0, a.0, b.1, a.1, k, i) }
        }));
    }
    edges.sort_unstable();
    let mut seams = vec![[false; 3]; triangles.len()];
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        for pair in same.windows(2) {
            let [(_, _, n0, n1, k, i), (_, _, m0, m1, l, _)] = [pair[0], pair[1]];
            let smooth = n0.is_some() && (n0, n1) == (m0, m1);
            seams[k][i] |= !smooth && normal(k).dot(normal(l)) < FOLD;
        }
    }
    seams
}
