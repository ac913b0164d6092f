//! Charts of flat polygons: neighbours in one plane together, each other polygon by itself, and what is not flat triangle by triangle.
//!
//! A chart lies in its plane with its longest border edge along u, so that rectangles fill their boxes. Nothing is stretched; the price is
//! a cut at every fold, which flat walls have anyway.

use super::chart::{Chart, Origin};
use glam::{DVec2, DVec3};
use kiln_proto::{
    scene::{Scene, Surface},
    sets::DisjointSets,
};

/// Triangles whose normals differ more than this (cosine) from their polygon's get charts of their own.
const FLAT: f64 = 0.99;
/// Neighbours join where their normals differ less than this (cosine, a quarter of a degree), and none from that of all by more than the
/// next.
const NEIGHBOURS: f64 = 0.999_99;
const PLANE: f64 = 0.999_8;

/// Charts of some triangles of a surface, in their order.
pub(super) fn planes(scene: &Scene, surface: &Surface, triangles: &[u32]) -> Vec<Chart> {
    let mesh = Mesh { scene, surface };
    let polygons = mesh.polygons(triangles);
    let mut groups: Vec<Vec<usize>> = vec![];
    for (polygon, group) in mesh.joined(&polygons).into_iter().enumerate() {
        groups.resize(groups.len().max(group as usize + 1), vec![]);
        groups[group as usize].push(polygon);
    }
    let mut charts = vec![];
    for group in groups {
        let together: Vec<u32> = group.iter().flat_map(|p| polygons[*p].1.iter().copied()).collect();
        if group.len() > 1 && mesh.is_flat(&together, PLANE) {
            charts.push(mesh.chart(Origin::Plane, together));
        } else {
            charts.extend(group.iter().map(|p| mesh.chart(polygons[*p].0, polygons[*p].1.clone())));
        }
    }
    charts
}

/// The smaller charts that a chart can be cut into; `None` for one that cannot be cut.
pub(super) fn cut(scene: &Scene, surface: &Surface, chart: &Chart) -> Option<Vec<Chart>> {
    let mesh = Mesh { scene, surface };
    let single = |t: &u32| mesh.chart(Origin::Triangle, vec![*t]);
    match chart.origin {
        Origin::Triangle => None,
        Origin::Polygon => Some(chart.triangles.iter().map(single).collect()),
        Origin::Plane => {
            Some(mesh.polygons(&chart.triangles).into_iter().map(|(origin, triangles)| mesh.chart(origin, triangles)).collect())
        }
        Origin::Flattened | Origin::Author => Some(planes(scene, surface, &chart.triangles)),
    }
}

struct Mesh<'a> {
    scene: &'a Scene,
    surface: &'a Surface,
}

impl Mesh<'_> {
    fn corners(&self, t: u32) -> [DVec3; 3] {
        self.scene.corners(&self.surface.triangles[t as usize])
    }

    fn indices(&self, t: u32) -> [u32; 3] {
        self.surface.triangles[t as usize].corners
    }

    /// Twice the area of a triangle along its normal.
    fn normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a)
    }

    fn is_flat(&self, triangles: &[u32], cosine: f64) -> bool {
        let whole: DVec3 = triangles.iter().map(|t| self.normal(*t)).sum();
        whole.length() > 0.0 && triangles.iter().map(|t| self.normal(*t)).all(|n| n.dot(whole) >= cosine * n.length() * whole.length())
    }

    /// The flat polygons among these triangles; those that are not flat, triangle by triangle.
    fn polygons(&self, triangles: &[u32]) -> Vec<(Origin, Vec<u32>)> {
        let polygon = |t: u32| self.surface.triangles[t as usize].polygon;
        let mut polygons = vec![];
        for group in triangles.chunk_by(|a, b| polygon(*a) == polygon(*b)) {
            if group.len() > 1 && self.is_flat(group, FLAT) {
                polygons.push((Origin::Polygon, group.to_vec()));
            } else {
                polygons.extend(group.iter().map(|t| (Origin::Triangle, vec![*t])));
            }
        }
        polygons
    }

    /// The group of each polygon: neighbours over an edge that only these two share, in one plane, are in one.
    fn joined(&self, polygons: &[(Origin, Vec<u32>)]) -> Vec<u32> {
        let all = || polygons.iter().enumerate().flat_map(|(p, (_, triangles))| triangles.iter().map(move |t| (p as u32, *t)));
        let mut edges: Vec<(u32, u32, bool, u32, u32)> = vec![];
        for (p, t) in all() {
            let c = self.indices(t);
            edges.extend([(c[0], c[1]), (c[1], c[2]), (c[2], c[0])].map(|(a, b)| (a.min(b), a.max(b), a < b, p, t)));
        }
        edges.sort_unstable();
        let mut sets = DisjointSets::new(polygons.len());
        for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if let [a, b] = same
                && a.2 != b.2
                && a.3 != b.3
            {
                let (n, m) = (self.normal(a.4), self.normal(b.4));
                if n.dot(m) >= NEIGHBOURS * n.length() * m.length() {
                    sets.join(a.3, b.3);
                }
            }
        }
        sets.numbers()
    }

    fn chart(&self, origin: Origin, triangles: Vec<u32>) -> Chart {
        let whole: DVec3 = triangles.iter().map(|t| self.normal(*t)).sum();
        let n = whole.try_normalize().unwrap_or(DVec3::Y);
        let edge = self.longest_border(&triangles);
        let tangent = (edge - n * n.dot(edge)).try_normalize().unwrap_or_else(|| n.any_orthonormal_vector());
        let bitangent = n.cross(tangent);
        let from = self.corners(triangles[0])[0];
        let flat = |t: &u32| self.corners(*t).map(|p| DVec2::new((p - from).dot(tangent), (p - from).dot(bitangent)));
        let corners: Vec<[DVec2; 3]> = triangles.iter().map(flat).collect();
        Chart::new(origin, triangles, &corners)
    }

    /// The longest edge that only one of the triangles has; the first of equals.
    fn longest_border(&self, triangles: &[u32]) -> DVec3 {
        let mut edges: Vec<(u32, u32, usize, usize)> = vec![];
        for (t, triangle) in triangles.iter().enumerate() {
            let corner = self.indices(*triangle);
            for k in 0..3 {
                let (a, b) = (corner[k], corner[(k + 1) % 3]);
                edges.push((a.min(b), a.max(b), t, k));
            }
        }
        edges.sort_unstable();
        let borders = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|same| same.len() == 1).map(|same| (same[0].2, same[0].3));
        let mut borders: Vec<(usize, usize)> = borders.collect();
        borders.sort_unstable();
        let vector = |(t, k): (usize, usize)| {
            let corners = self.corners(triangles[t]);
            corners[(k + 1) % 3] - corners[k]
        };
        let mut longest = (0.0, vector((0, 0)));
        for edge in borders.into_iter().map(vector) {
            if edge.length_squared() > longest.0 {
                longest = (edge.length_squared(), edge);
            }
        }
        longest.1
    }
}
