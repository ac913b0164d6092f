//! Normals for meshes whose author gave none.
//!
//! Smooth groups are found edge by edge, as X3D 3.3, 11.2.3 words it: across an edge whose two faces differ by less than the crease angle,
//! the corners at its ends share a normal; otherwise they do not. The common shortcut, averaging at each vertex all faces within the
//! crease angle of this one, gives the two sides of a smooth edge different normals wherever three faces meet, which is a visible seam.
//! Faces are weighted by their angle at the vertex (Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets"), so that
//! cutting a face in two changes nothing. Cost: n log n in the corners.

use super::{Channel, Mesh, newell};
use glam::DVec3;
use kiln_proto::math;
use std::{cmp::Ordering, f64::consts::PI};

/// Who shares a normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothing<'a> {
    /// Nobody: every polygon is flat.
    Flat,
    /// Corners at an edge whose faces' normals differ by less than this angle, radians.
    Crease(f64),
    /// All corners of a vertex whose polygons are of one group; one number a polygon, or none where all polygons are one group.
    Shared(&'a [u32]),
}

/// Unit normals for all corners of a mesh. A polygon without area, which has no normal, gets +Z where nobody shares with it.
#[must_use]
pub fn smooth(mesh: &Mesh, smoothing: &Smoothing<'_>) -> Channel<[f32; 3]> {
    let faces = face_normals(mesh);
    let owner: Vec<u32> = mesh.polygons().enumerate().flat_map(|(face, run)| run.map(move |_| face as u32)).collect();
    match smoothing {
        Smoothing::Flat => Channel { values: faces.iter().map(|n| unit(*n, DVec3::ZERO)).collect(), at: owner },
        Smoothing::Crease(angle) if *angle <= 0.0 => smooth(mesh, &Smoothing::Flat),
        Smoothing::Crease(angle) => {
            let groups = join_at_edges(mesh, &faces, &owner, *angle);
            average(mesh, &faces, &owner, groups)
        }
        Smoothing::Shared(of_polygon) => {
            let mut groups = Groups::new(mesh.corners.len());
            let key = |c: usize| (mesh.corners[c], of_polygon.get(owner[c] as usize).copied().unwrap_or_default());
            let mut order: Vec<usize> = (0..mesh.corners.len()).collect();
            order.sort_by_key(|c| key(*c));
            order.windows(2).filter(|w| key(w[0]) == key(w[1])).for_each(|w| groups.join(w[0], w[1]));
            average(mesh, &faces, &owner, groups)
        }
    }
}

/// Unit normals of the polygons; zero for those without area.
fn face_normals(mesh: &Mesh) -> Vec<DVec3> {
    mesh.polygons().map(|run| newell(run.map(|c| mesh.place(c))).normalize_or_zero()).collect()
}

/// An edge of a polygon: its vertices, lower first, and the corners of the polygon there. Each pair is one number, high half first, which
/// sorts twice as fast as a tuple.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    vertices: u64,
    corners: u64,
}

impl Edge {
    fn new(vertices: [u32; 2], corners: [usize; 2]) -> Self {
        let pair = |high: u32, low: u32| u64::from(high) << 32 | u64::from(low);
        Self { vertices: pair(vertices[0], vertices[1]), corners: pair(corners[0] as u32, corners[1] as u32) }
    }

    fn corners(self) -> [usize; 2] {
        [self.corners >> 32, self.corners & 0xffff_ffff].map(|c| c as usize)
    }
}

fn edges(mesh: &Mesh) -> Vec<Edge> {
    let mut edges = Vec::with_capacity(mesh.corners.len());
    for run in mesh.polygons() {
        for c in run.clone() {
            let d = if c + 1 == run.end { run.start } else { c + 1 };
            let (v, w) = (mesh.corners[c], mesh.corners[d]);
            match v.cmp(&w) {
                Ordering::Less => edges.push(Edge::new([v, w], [c, d])),
                Ordering::Greater => edges.push(Edge::new([w, v], [d, c])),
                Ordering::Equal => {}
            }
        }
    }
    edges.sort_unstable();
    edges
}

/// Joins corners across smooth edges. Where more than two faces meet at an edge, each is compared with the next in the file's order.
fn join_at_edges(mesh: &Mesh, faces: &[DVec3], owner: &[u32], angle: f64) -> Groups {
    let mut groups = Groups::new(mesh.corners.len());
    let least = if angle > PI { f64::NEG_INFINITY } else { math::sin_cos_degrees(angle.to_degrees()).1 };
    for pair in edges(mesh).windows(2).filter(|pair| pair[0].vertices == pair[1].vertices) {
        let [a, b] = [pair[0].corners(), pair[1].corners()];
        let [m, n] = [a, b].map(|corners| faces[owner[corners[0]] as usize]);
        // A face without area has no direction that could differ, so it keeps nobody apart and joins nobody.
        if m != DVec3::ZERO && n != DVec3::ZERO && m.dot(n) > least {
            groups.join(a[0], b[0]);
            groups.join(a[1], b[1]);
        }
    }
    groups
}

/// One normal for each group of corners.
fn average(mesh: &Mesh, faces: &[DVec3], owner: &[u32], mut groups: Groups) -> Channel<[f32; 3]> {
    let mut sums = vec![DVec3::ZERO; mesh.corners.len()];
    for run in mesh.polygons() {
        for c in run.clone() {
            sums[groups.root(c)] += faces[owner[c] as usize] * angle_at(mesh, &run, c);
        }
    }
    let mut out = Channel { values: vec![], at: Vec::with_capacity(mesh.corners.len()) };
    let mut ids = vec![u32::MAX; mesh.corners.len()];
    for c in 0..mesh.corners.len() {
        let root = groups.root(c);
        if ids[root] == u32::MAX {
            ids[root] = out.values.len() as u32;
            out.values.push(unit(sums[root], faces[owner[c] as usize]));
        }
        out.at.push(ids[root]);
    }
    out
}

/// The angle of a polygon at one of its corners, radians; zero where an edge has no length.
fn angle_at(mesh: &Mesh, run: &std::ops::Range<usize>, c: usize) -> f64 {
    let before = if c == run.start { run.end - 1 } else { c - 1 };
    let after = if c + 1 == run.end { run.start } else { c + 1 };
    let to = |other: usize| (mesh.place(other) - mesh.place(c)).normalize_or_zero();
    let (a, b) = (to(before), to(after));
    if a == DVec3::ZERO || b == DVec3::ZERO { 0.0 } else { math::acos(a.dot(b)) }
}

fn unit(sum: DVec3, otherwise: DVec3) -> [f32; 3] {
    // Opposite faces cancel to rounding noise, which is no direction.
    let n = if sum.length() > 1e-9 { sum } else { otherwise };
    n.try_normalize().unwrap_or(DVec3::Z).as_vec3().to_array()
}

/// Disjoint sets of corners; the root of a set is its lowest member.
struct Groups(Vec<u32>);

impl Groups {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut c: usize) -> usize {
        while self.0[c] as usize != c {
            self.0[c] = self.0[self.0[c] as usize];
            c = self.0[c] as usize;
        }
        c
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::cube;
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_cube_is_flat_below_its_edge_angle_and_round_above() {
        let mesh = cube();
        assert_eq!(smooth(&mesh, &Smoothing::Crease(0.0)).values.len(), 6);
        assert_eq!(smooth(&mesh, &Smoothing::Crease(1.5)).values.len(), 24, "one for each corner, all equal within a face");
        let flat = smooth(&mesh, &Smoothing::Crease(1.5));
        for run in mesh.polygons() {
            assert!(run.clone().all(|c| flat.get(c) == flat.get(run.start)));
        }
        let round = smooth(&mesh, &Smoothing::Crease(2.0));
        assert_eq!(round.values.len(), 8);
        for c in 0..mesh.corners.len() {
            let out = mesh.place(c).normalize().as_vec3();
            assert!(Vec3::from_array(round.get(c)).distance(out) < 1e-6, "along the diagonal, whoever it is cut by");
        }
    }

    /// Two quads with a right angle between them and a third that continues the first: the smooth edge has one normal at both of its
    /// ends, and the crease two.
    #[test]
    fn a_crease_ends_only_its_own_edge() {
        let mut mesh = Mesh {
            positions: vec![
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [2.0, 0.0, 0.1],
                [2.0, 1.0, 0.1],
                [0.0, 0.0, -1.0],
                [1.0, 0.0, -1.0],
            ],
            ..Mesh::default()
        };
        mesh.push_polygon([0, 1, 2, 3]);
        mesh.push_polygon([1, 4, 5, 2]);
        mesh.push_polygon([6, 7, 1, 0]);
        let n = smooth(&mesh, &Smoothing::Crease(0.5));
        assert_eq!(n.at[1], n.at[4], "vertex 1 in both front quads");
        assert_eq!(n.at[2], n.at[7], "vertex 2 in both front quads");
        assert_ne!(n.at[1], n.at[10], "vertex 1 in the bottom");
        let angle_weighted = (DVec3::Z + DVec3::new(-0.1, 0.0, 1.0).normalize()).normalize().as_vec3();
        assert!(Vec3::from_array(n.get(1)).distance(angle_weighted) < 1e-6);
    }

    #[test]
    fn sharing_stops_at_groups_and_degenerate_faces_have_a_unit_normal() {
        let mut mesh = Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..Mesh::default() };
        mesh.push_polygon([0, 1, 2]);
        mesh.push_polygon([0, 2, 3]);
        mesh.push_polygon([1, 1, 1]);
        let all = smooth(&mesh, &Smoothing::Shared(&[]));
        assert_eq!(all.at[0], all.at[3]);
        let two = smooth(&mesh, &Smoothing::Shared(&[0, 1, 2]));
        assert_eq!((two.get(0), two.get(3)), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]));
        for smoothing in [Smoothing::Flat, Smoothing::Crease(3.0), Smoothing::Shared(&[])] {
            let n = smooth(&mesh, &smoothing);
            assert!(n.values.iter().all(|n| (Vec3::from_array(*n).length() - 1.0).abs() < 1e-6));
        }
    }

    /// More faces at an edge than a surface has, and faces on top of each other: linear work, unit normals.
    #[test]
    fn fans_about_one_edge_are_bounded() {
        let mut mesh = Mesh { positions: vec![[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], ..Mesh::default() };
        for k in 0..20_000 {
            mesh.push_polygon([0, 1, 2 + k % 2]);
        }
        let n = smooth(&mesh, &Smoothing::Crease(4.0));
        assert!(n.values.iter().all(|n| (Vec3::from_array(*n).length() - 1.0).abs() < 1e-6));
    }
}
