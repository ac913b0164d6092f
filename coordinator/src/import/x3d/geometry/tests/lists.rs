//! Nodes that list their faces.

use super::*;
use proptest::prelude::*;

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 0.5];

/// Two triangles of a square.
fn halves() -> IndexedFaceSet {
    let composed = Composed { coord: SQUARE.to_vec(), ..Composed::default() };
    IndexedFaceSet { composed, coord_index: vec![0, 1, 2, -1, 0, 2, 3], ..IndexedFaceSet::default() }
}

fn cube(crease_angle: f32, ccw: bool) -> Mesh {
    let coord = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|b| b as f32)).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let coord_index = quads.iter().flat_map(|q| q.iter().copied().chain([-1])).collect();
    let composed = Composed { coord, ccw, ..Composed::default() };
    IndexedFaceSet { composed, coord_index, crease_angle, ..IndexedFaceSet::default() }.build().unwrap().mesh
}

#[test]
fn a_cube_is_flat_at_crease_0_and_smooth_at_2_and_turns_with_ccw() {
    assert_eq!((cube(0.0, true).normals.unwrap().values.len(), cube(2.0, true).normals.unwrap().values.len()), (6, 8));
    for crease in [0.0, 2.0] {
        let (out, inside) = (cube(crease, true), cube(crease, false));
        check(&out);
        check(&inside);
        assert!((volume(&out) - 1.0).abs() < 1e-12 && (volume(&inside) + 1.0).abs() < 1e-12 && euler(&out) == (2, 0));
    }
}

#[test]
fn colours_go_by_face_or_vertex_with_and_without_indices() {
    let colours = |per_vertex: bool, index: &[i32], count: usize| {
        let mut node = halves();
        node.composed.color = [RED, BLUE, [0.5; 4], [0.25; 4]][..count].to_vec();
        node.composed.color_per_vertex = per_vertex;
        node.color_index = index.to_vec();
        let g = node.build().unwrap();
        let c = g.mesh.colours.unwrap();
        ((0..6).map(|k| c.get(k)[0]).collect::<Vec<_>>(), g.repairs.to_string())
    };
    let none = String::new();
    assert_eq!(colours(true, &[], 4), (vec![1.0, 0.0, 0.5, 1.0, 0.5, 0.25], none.clone()));
    assert_eq!(colours(true, &[1, 1, 0, -1, 0, 1, 0, -1], 2), (vec![0.0, 0.0, 1.0, 1.0, 0.0, 1.0], none.clone()));
    assert_eq!(colours(false, &[], 2), (vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0], none.clone()));
    assert_eq!(colours(false, &[1, 0], 2), (vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0], none));
    let (short, said) = colours(true, &[], 2);
    assert_eq!(short, [1.0, 0.0, 1.0, 1.0, 1.0, 1.0], "white where there is none");
    assert_eq!(said, "corners for which there is no colour became white: 3, the first at color[2]");
}

#[test]
fn normals_are_taken_as_given_and_made_where_they_are_missing() {
    let mut node = halves();
    node.composed.normal = vec![[0.0, 3.0, 4.0], [0.0, 0.0, 2.0]];
    node.composed.normal_per_vertex = false;
    node.normal_index = vec![1, 0];
    let n = node.build().unwrap().mesh.normals.unwrap();
    assert_eq!((n.get(0), n.get(5)), ([0.0, 0.0, 1.0], [0.0, 0.6, 0.8]));
    node.composed.normal = vec![[0.0, 0.6, 0.8], [0.0; 3], [f32::NAN; 3]];
    node.composed.normal_per_vertex = true;
    node.normal_index.clear();
    for ccw in [true, false] {
        node.composed.ccw = ccw;
        let g = node.build().unwrap();
        let n = g.mesh.normals.as_ref().unwrap();
        let at = |position: [f32; 3]| n.get((0..6).find(|c| g.mesh.place(*c).as_vec3().to_array() == position).unwrap());
        assert_eq!(at(SQUARE[0]), [0.0, 0.6, 0.8]);
        assert_eq!(at(SQUARE[3])[2], if ccw { 1.0 } else { -1.0 }, "the generated one follows ccw");
        assert_eq!(g.repairs.0[0].count, 4, "zero, NaN twice, and missing");
    }
}

#[test]
fn texture_coordinates_go_by_corner_and_are_automatic_otherwise() {
    let mut node = halves();
    node.composed.coord.iter_mut().for_each(|p| p[1] *= 2.0);
    let automatic = node.build().unwrap().mesh;
    assert_eq!(automatic.uv_sets[0].get(2), [1.0, 0.5], "S along Y, which is longer");
    node.composed.tex_coord = vec![vec![[0.1, 0.2], [0.3, 0.4]], vec![[7.0, 7.0]; 4]];
    node.tex_coord_index = vec![1, 0, 1, -1, 0, 0, 9];
    let g = node.build().unwrap();
    assert_eq!((g.mesh.uv_sets[0].get(0), g.mesh.uv_sets[0].get(3)), ([0.3, 0.4], [0.1, 0.2]));
    assert_eq!((g.mesh.uv_sets[0].get(5), g.mesh.uv_sets[1].get(0)), (automatic.uv_sets[0].get(5), [7.0, 7.0]));
    assert_eq!(g.repairs.0[0].first, 6);
}

#[test]
fn bad_faces_are_dropped_and_counted_and_the_numbers_of_the_others_stay() {
    let mut node = halves();
    node.composed.coord.push([f32::INFINITY, 0.0, 0.0]);
    node.composed.color = vec![BLUE, BLUE, BLUE, RED];
    node.composed.color_per_vertex = false;
    node.coord_index = vec![0, 1, 99, -1, 0, 4, 1, -1, 0, 0, 1, 0, -1, -1, 0, 1, 2, 3, 0];
    let g = node.build().unwrap();
    assert_eq!((g.mesh.polygon_count(), g.mesh.corners.len(), g.mesh.positions.len()), (1, 4, 4));
    assert_eq!(g.mesh.colours.unwrap().get(0), RED, "the fourth face");
    assert_eq!(
        g.repairs.to_string(),
        "faces that name a point which does not exist were dropped: 1, at coordIndex[2]; \
         faces with a point that is not a finite number were dropped: 1, at coordIndex[5]; \
         faces with fewer than three different corners were dropped: 1, at coordIndex[8]"
    );
    node.coord_index.truncate(8);
    assert!(node.build().unwrap_err().to_string().starts_with("none of its faces can be used: faces that name"));
    node.coord_index.clear();
    assert_eq!(node.build().unwrap_err().to_string(), "it describes no surface: it has no faces");
    node.composed.coord.clear();
    assert!(matches!(node.build(), Err(GeometryError::Empty { why: "coord has no points" })));
}

#[test]
fn a_concave_face_keeps_its_area() {
    let coord = vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [2.0, 1.0, 0.0], [0.0, 4.0, 0.0]];
    let composed = Composed { coord, ..Composed::default() };
    let g = IndexedFaceSet { composed, coord_index: vec![0, 1, 2, 3, 4, -1], ..IndexedFaceSet::default() }.build().unwrap();
    check(&g.mesh);
    assert_eq!((g.mesh.polygon_count(), area(&g.mesh)), (1, 10.0));
}

/// The same square as a single, a strip, a fan and a quad, by index and in order.
#[test]
fn sets_cut_the_same_square() {
    let node = |order: &[usize]| Composed { coord: order.iter().map(|i| SQUARE[*i]).collect(), ..Composed::default() };
    let composed = node(&[0, 1, 2, 3]);
    let all = [
        IndexedTriangleSet { composed: composed.clone(), index: vec![0, 1, 2, 0, 2, 3] }.build(),
        IndexedQuadSet { composed: composed.clone(), index: vec![0, 1, 2, 3] }.build(),
        IndexedTriangleStripSet { composed: composed.clone(), index: vec![0, 1, 3, 2, -1] }.build(),
        IndexedTriangleFanSet { composed: composed.clone(), index: vec![0, 1, 2, 3] }.build(),
        TriangleSet(node(&[0, 1, 2, 0, 2, 3])).build(),
        QuadSet(composed.clone()).build(),
        TriangleStripSet { composed: node(&[0, 1, 3, 2]), strip_count: vec![4] }.build(),
        TriangleFanSet { composed, fan_count: vec![4] }.build(),
    ];
    for g in all {
        let g = g.unwrap();
        check(&g.mesh);
        let up = g.mesh.normals.as_ref().unwrap().values.iter().all(|n| *n == [0.0, 0.0, 1.0]);
        assert!(up && area(&g.mesh) == 1.0 && g.repairs.0.is_empty());
    }
}

#[test]
fn set_normals_are_averaged_per_vertex_within_a_strip_or_flat() {
    // A ridge along Y: two triangles that share the edge 0-1.
    let coord = vec![[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0]];
    let mut composed = Composed { coord, ..Composed::default() };
    let index = vec![0, 2, 1, 0, 1, 3];
    let x = |g: Geometry| g.mesh.normals.unwrap().get(0)[0];
    assert!(x(IndexedTriangleSet { composed: composed.clone(), index: index.clone() }.build().unwrap()).abs() < 1e-6);
    let strips = IndexedTriangleStripSet { composed: composed.clone(), index: vec![0, 2, 1, -1, 0, 1, 3] }.build().unwrap();
    assert!(x(strips) > 0.5, "each strip is smooth in itself only");
    composed.normal_per_vertex = false;
    assert!(x(IndexedTriangleSet { composed, index }.build().unwrap()) > 0.5);
}

#[test]
fn incomplete_sets_say_what_they_left_out() {
    let composed = Composed { coord: SQUARE.to_vec(), ..Composed::default() };
    let said = |g: Result<Geometry, GeometryError>| g.unwrap().repairs.to_string();
    let tail = said(IndexedTriangleSet { composed: composed.clone(), index: vec![0, 1, 2, 0, 2] }.build());
    assert_eq!(tail, "entries after the last whole face were left out: 1, at index[3]");
    let cut = said(TriangleStripSet { composed: composed.clone(), strip_count: vec![3, 7] }.build());
    assert!(cut.starts_with("counts beyond the last point were cut off: 1, at stripCount[1]"), "{cut}");
    let counts = said(TriangleFanSet { composed: composed.clone(), fan_count: vec![-5, 3] }.build());
    assert_eq!(counts, "counts below 3 were passed over: 1, at fanCount[0]; points after the last count were left out: 1, at coord[3]");
    let glue = said(IndexedTriangleStripSet { composed: composed.clone(), index: vec![0, 1, 3, 3, 2, 1, 2] }.build());
    assert_eq!(glue, "", "repeated vertices join strips");
    assert!(IndexedTriangleSet { composed: composed.clone(), index: vec![0, 1, -1] }.build().is_err());
    assert!(TriangleStripSet { composed, strip_count: vec![] }.build().is_err());
}

/// What holds of every mesh, whatever the file said.
fn holds(g: &Geometry) {
    let mesh = &g.mesh;
    let n = mesh.normals.as_ref().unwrap();
    assert!(n.values.iter().all(|n| (Vec3::from_array(*n).length() - 1.0).abs() < 1e-5));
    let corners = mesh.corners.len();
    assert!(n.at.len() == corners && mesh.uv_sets.iter().all(|c| c.at.len() == corners));
    assert!((0..corners).all(|c| mesh.place(c).is_finite() && mesh.uv_sets[0].get(c).iter().all(|x| x.is_finite())));
    assert!(mesh.colours.as_ref().is_none_or(|c| (0..corners).all(|k| c.get(k).iter().all(|x| (0.0..=1.0).contains(x)))));
    assert!(triangles(mesh).len() <= corners);
}

proptest! {
    /// Lists of any numbers and lengths: an answer, never a panic, and a mesh without gaps in its attributes.
    #[test]
    fn any_lists_give_a_mesh_or_a_reason(
        coord in prop::collection::vec(prop::array::uniform3(prop_oneof![8 => -2.0f32..2.0, 1 => Just(f32::NAN), 1 => Just(f32::MAX)]), 0..8),
        index in prop::collection::vec(-2i32..9, 0..24),
        other in prop::collection::vec(-2i32..5, 0..24),
        given in 0usize..6,
        flags in 0u8..8,
        crease in prop_oneof![-1.0f32..7.0, Just(f32::NAN)],
    ) {
        let [ccw, color_per_vertex, normal_per_vertex] = [1, 2, 4].map(|bit| flags & bit != 0);
        let normal = vec![[0.0, 0.0, 0.0], [f32::MAX; 3], [0.0, 1.0, 0.0], [f32::NAN; 3]][..given.min(4)].to_vec();
        let color = vec![RED, BLUE, [f32::NAN; 4], [9.0; 4]][..given.min(4)].to_vec();
        let tex_coord = vec![vec![[0.5, f32::INFINITY]; given]; given % 3];
        let composed = Composed { coord, normal, color, tex_coord, ccw, color_per_vertex, normal_per_vertex, solid: true };
        let indexed = |composed: &Composed| (composed.clone(), index.clone());
        let all = [
            IndexedFaceSet {
                composed: composed.clone(),
                coord_index: index.clone(),
                color_index: other.clone(),
                normal_index: other.clone(),
                tex_coord_index: other.clone(),
                crease_angle: crease,
            }.build(),
            { let (composed, index) = indexed(&composed); IndexedTriangleSet { composed, index }.build() },
            { let (composed, index) = indexed(&composed); IndexedQuadSet { composed, index }.build() },
            { let (composed, index) = indexed(&composed); IndexedTriangleStripSet { composed, index }.build() },
            { let (composed, index) = indexed(&composed); IndexedTriangleFanSet { composed, index }.build() },
            TriangleStripSet { composed: composed.clone(), strip_count: other.clone() }.build(),
            TriangleFanSet { composed: composed.clone(), fan_count: other }.build(),
            TriangleSet(composed.clone()).build(),
            QuadSet(composed).build(),
        ];
        all.iter().flatten().for_each(holds);
    }
}
