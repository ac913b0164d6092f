//! Shapes and measures that the tests of several importers use.

use super::*;

/// The cube from -1 to 1, six quads, eight shared vertices.
pub(in crate::import) fn cube() -> Mesh {
    let positions = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|b| 2.0 * b as f32 - 1.0)).collect();
    let mut mesh = Mesh { positions, ..Mesh::default() };
    for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        mesh.push_polygon(quad);
    }
    mesh
}

/// The triangles of all polygons that have an area: the polygon and the corners of the mesh.
pub(in crate::import) fn triangles(mesh: &Mesh) -> Vec<(usize, [usize; 3])> {
    let of =
        |(polygon, run): (usize, Range<usize>)| mesh.cut(polygon).triangles.into_iter().map(move |t| (polygon, t.map(|i| run.start + i)));
    mesh.polygons().enumerate().flat_map(of).filter(|(_, t)| !has_no_area(t.map(|c| mesh.place(c)))).collect()
}

/// The enclosed volume by the divergence theorem: positive where fronts are outside.
pub(in crate::import) fn volume(mesh: &Mesh) -> f64 {
    triangles(mesh).iter().map(|(_, t)| t.map(|c| mesh.place(c))).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// The area of all triangles.
pub(in crate::import) fn area(mesh: &Mesh) -> f64 {
    triangles(mesh).iter().map(|(_, t)| t.map(|c| mesh.place(c))).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
}

/// Vertices - edges + polygons, and edges that are not between exactly two polygons that run through it in opposite ways.
pub(in crate::import) fn euler(mesh: &Mesh) -> (i64, usize) {
    let mut edges = std::collections::BTreeMap::<(u32, u32), (i64, i64)>::new();
    for run in mesh.polygons() {
        for c in run.clone() {
            let (v, w) = (mesh.corners[c], mesh.corners[if c + 1 == run.end { run.start } else { c + 1 }]);
            let uses = edges.entry((v.min(w), v.max(w))).or_default();
            *uses = (uses.0 + 1, uses.1 + if v < w { 1 } else { -1 });
        }
    }
    let vertices: std::collections::BTreeSet<u32> = mesh.corners.iter().copied().collect();
    let odd = edges.values().filter(|u| **u != (2, 0)).count();
    (vertices.len() as i64 - edges.len() as i64 + mesh.polygon_count() as i64, odd)
}

#[test]
fn a_cube_is_measured_right_and_turns_around() {
    let mut mesh = cube();
    assert_eq!((volume(&mesh), area(&mesh), euler(&mesh)), (8.0, 24.0, (2, 0)));
    mesh.uv_sets = vec![box_mapping(&mesh)];
    mesh.normals = Some(smooth(&mesh, &Smoothing::Flat));
    let before: Vec<_> = (0..4).map(|c| (mesh.corners[c], mesh.uv_sets[0].get(c))).collect();
    mesh.reverse();
    let after: Vec<_> = (0..4).rev().map(|c| (mesh.corners[c], mesh.uv_sets[0].get(c))).collect();
    assert_eq!((volume(&mesh), before), (-8.0, after));
}

#[test]
fn triangles_without_area_are_left_out_and_crossed_polygons_noticed() {
    let mut mesh =
        Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, -3.0, 0.0]], ..Mesh::default() };
    mesh.push_polygon([0, 1, 2]);
    mesh.push_polygon([0, 3, 2, 4]);
    mesh.push_polygon([0, 2, 3, 4]);
    assert_eq!(triangles(&mesh).iter().map(|t| t.0).collect::<Vec<_>>(), [1, 1, 2, 2]);
    assert_eq!([0, 1, 2].map(|p| mesh.cut(p).sound), [true, true, false]);
    assert!(triangles(&mesh).iter().all(|(polygon, t)| t.iter().all(|c| mesh.run(*polygon).contains(c))));
}
