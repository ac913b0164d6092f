//! ElevationGrid and Extrusion.

use super::*;
use kiln_proto::math::sin_cos_degrees;

fn ring(n: u32) -> impl Iterator<Item = [f32; 2]> {
    (0..=n).map(move |i| sin_cos_degrees(-360.0 * f64::from(i % n) / f64::from(n))).map(|(s, c)| [c as f32, s as f32])
}

fn grid() -> ElevationGrid {
    ElevationGrid { height: vec![0.0; 12], x_dimension: 4, z_dimension: 3, x_spacing: 2.0, z_spacing: 3.0, ..ElevationGrid::default() }
}

#[test]
fn elevation_grids_look_up_and_span_the_texture() {
    let g = grid().build().unwrap();
    check(&g.mesh);
    assert_eq!((g.mesh.polygon_count(), area(&g.mesh)), (6, 36.0));
    assert!(g.mesh.normals.as_ref().unwrap().values.iter().all(|n| *n == [0.0, 1.0, 0.0]));
    assert_eq!(uv_where(&g.mesh, |p, _| p == DVec3::new(6.0, 0.0, 6.0)), [1.0, 1.0]);
    assert_eq!(uv_where(&g.mesh, |p, _| p == DVec3::new(2.0, 0.0, 3.0)), [(1.0f64 / 3.0) as f32, 0.5]);
    let below = ElevationGrid { ccw: false, ..grid() }.build().unwrap();
    assert!(below.mesh.normals.as_ref().unwrap().values.iter().all(|n| n[1] == -1.0));
    check(&below.mesh);
}

#[test]
fn elevation_grids_colour_cells_or_points() {
    let mut node = grid();
    node.color = (0..12).map(|i| [i as f32 / 16.0, 0.0, 0.0, 1.0]).collect();
    let red = |node: &ElevationGrid, corner: usize| node.build().unwrap().mesh.colours.unwrap().get(corner)[0] * 16.0;
    assert_eq!((red(&node, 0), red(&node, 1), red(&node, 23)), (0.0, 4.0, 7.0));
    node.color_per_vertex = false;
    assert_eq!((red(&node, 0), red(&node, 1), red(&node, 23)), (0.0, 0.0, 5.0));
    node.height[5] = 1.0;
    node.crease_angle = 3.0;
    let g = node.build().unwrap();
    check(&g.mesh);
    assert_eq!(g.mesh.normals.unwrap().values.len(), 12, "smooth everywhere");
}

#[test]
fn elevation_grids_are_bounded_by_their_heights() {
    let g = ElevationGrid { height: vec![0.0; 11], ..grid() }.build().unwrap();
    assert_eq!((g.mesh.polygon_count(), g.repairs.0[0].first), (3, 8));
    let short = ElevationGrid { height: vec![0.0; 7], ..grid() }.build().unwrap_err();
    assert_eq!(short.to_string(), "height has 7 values; 12 are needed (xDimension times zDimension)");
    let huge = ElevationGrid { x_dimension: i32::MAX, z_dimension: i32::MAX, ..grid() }.build();
    assert!(matches!(huge, Err(GeometryError::TooLarge { .. })));
    assert!(matches!(ElevationGrid { x_dimension: 1, ..grid() }.build(), Err(GeometryError::Empty { .. })));
    assert!(matches!(ElevationGrid { z_dimension: -1, ..grid() }.build(), Err(GeometryError::OutOfRange { .. })));
    let hole = ElevationGrid { height: [vec![f32::NAN], vec![0.0; 11]].concat(), ..grid() }.build().unwrap();
    assert_eq!(hole.mesh.polygon_count(), 5);
}

#[test]
fn the_default_extrusion_is_a_box_and_turns_with_ccw() {
    let g = Extrusion::default().build().unwrap();
    check(&g.mesh);
    assert_eq!((euler(&g.mesh), area(&g.mesh)), ((2, 0), 16.0));
    assert!((volume(&g.mesh) - 4.0).abs() < 1e-12);
    assert_eq!(uv_where(&g.mesh, |p, n| n.y > 0.9 && p.x > 0.0 && p.z > 0.0), [1.0, 1.0]);
    let inside = Extrusion { ccw: false, ..Extrusion::default() }.build().unwrap();
    check(&inside.mesh);
    assert!((volume(&inside.mesh) + 4.0).abs() < 1e-12);
    let open = Extrusion { begin_cap: false, end_cap: false, ..Extrusion::default() }.build().unwrap();
    assert_eq!((open.mesh.polygon_count(), euler(&open.mesh)), (4, (0, 8)));
}

#[test]
fn a_circle_along_any_line_is_a_cylinder_with_radial_normals() {
    for end in [[0.0, 3.0, 0.0], [2.0, 1.0, -2.0], [0.0, -3.0, 0.0]] {
        let node = Extrusion { cross_section: ring(64).collect(), spine: vec![[0.0; 3], end], crease_angle: 0.5, ..Extrusion::default() };
        let g = node.build().unwrap();
        check(&g.mesh);
        assert_eq!((euler(&g.mesh), g.mesh.polygon_count()), ((2, 0), 66));
        assert!((volume(&g.mesh) / (3.0 * 32.0 * sin_cos_degrees(360.0 / 64.0).0) - 1.0).abs() < 1e-5);
        let axis = DVec3::from_array(end.map(f64::from)).normalize();
        let normals = g.mesh.normals.as_ref().unwrap();
        for c in g.mesh.polygons().take(64).flatten() {
            let place = g.mesh.place(c);
            let radial = (place - axis * axis.dot(place)).normalize();
            assert!(Vec3::from_array(normals.get(c)).as_dvec3().distance(radial) < 1e-5, "smooth over the joint too");
        }
        for c in g.mesh.polygons().skip(64).flatten() {
            assert!(Vec3::from_array(normals.get(c)).as_dvec3().dot(axis).abs() > 1.0 - 1e-6, "caps stay flat");
        }
    }
}

/// A circle carried around a circle, 48 by 24: Pappus' theorem gives volume and area.
#[test]
fn a_closed_spine_is_a_torus() {
    let spine = ring(48).map(|[x, z]| [3.0 * x, 0.0, 3.0 * z]).collect();
    let node =
        Extrusion { cross_section: ring(24).collect(), spine, crease_angle: 1.0, begin_cap: false, end_cap: false, ..Extrusion::default() };
    let g = node.build().unwrap();
    check(&g.mesh);
    assert_eq!(euler(&g.mesh), (0, 0));
    assert_eq!(g.mesh.normals.as_ref().unwrap().values.len(), 48 * 24);
    assert!((volume(&g.mesh) / (2.0 * PI * PI * 3.0) - 1.0).abs() < 0.02 && (area(&g.mesh) / (4.0 * PI * PI * 3.0) - 1.0).abs() < 0.02);
    let capped = Extrusion { begin_cap: true, end_cap: true, ..node }.build().unwrap();
    assert_eq!(capped.mesh.polygon_count(), 48 * 24 + 2, "caps are made even there");
}

#[test]
fn scales_and_orientations_follow_the_spine() {
    let spine = vec![[0.0; 3], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let tapered = Extrusion { spine: spine.clone(), scale: vec![[1.0, 1.0], [0.5, 0.5], [0.0, 0.0]], ..Extrusion::default() };
    let g = tapered.build().unwrap();
    assert!((volume(&g.mesh) - (4.0 + 2.0 + 1.0) / 3.0 - 1.0 / 3.0).abs() < 1e-6, "a frustum and a pyramid");
    let quarter = [0.0, 1.0, 0.0, std::f32::consts::FRAC_PI_2];
    let turned = Extrusion { spine: spine.clone(), scale: vec![[2.0, 1.0]], orientation: vec![quarter], ..Extrusion::default() };
    let reach = turned.build().unwrap().mesh.positions.iter().map(|p| p[2]).fold(0.0, f32::max);
    assert!((reach - 2.0).abs() < 1e-6, "x became z");
    let short = Extrusion { spine, scale: vec![[1.0, 1.0], [2.0, 2.0]], ..Extrusion::default() }.build().unwrap();
    assert_eq!((short.repairs.0[0].field, short.repairs.0[0].first), ("scale", 2));
    assert!((volume(&short.mesh) - 28.0 / 3.0 - 16.0).abs() < 1e-5);
}

/// A concave cross-section that is not closed, revolved on the spot: caps close it, and they keep its area.
#[test]
fn caps_are_concave_and_close_open_sections() {
    let l = vec![[0.0, 0.0], [0.0, 3.0], [1.0, 3.0], [1.0, 1.0], [3.0, 1.0], [3.0, 0.0]];
    let node = Extrusion { cross_section: l, spine: vec![[0.0; 3], [0.0, 2.0, 0.0]], ..Extrusion::default() };
    let g = node.build().unwrap();
    check(&g.mesh);
    // One side, from the last point to the first, is open.
    assert!((area(&g.mesh) - (5.0 * 2.0 + 2.0 * (3.0 + 2.0 + 1.0 + 3.0))).abs() < 1e-6);
    assert_eq!(g.mesh.polygon_count(), 7);
}

#[test]
fn hopeless_extrusions_are_refused() {
    let refused = |node: Extrusion| node.build().unwrap_err();
    assert!(matches!(refused(Extrusion { spine: vec![[0.0; 3]], ..Extrusion::default() }), GeometryError::Empty { .. }));
    let nan = Extrusion { spine: vec![[0.0; 3], [0.0, f32::NAN, 0.0]], ..Extrusion::default() };
    assert_eq!(refused(nan).to_string(), "spine[1] is not a finite number");
    let large = Extrusion { spine: vec![[0.0; 3]; 10_000], cross_section: vec![[0.0; 2]; 10_000], ..Extrusion::default() };
    assert!(matches!(refused(large), GeometryError::TooLarge { .. }));
    let far = Extrusion { spine: vec![[f32::MAX, 0.0, 0.0], [f32::MAX, 1.0, 0.0]], scale: vec![[f32::MAX; 2]], ..Extrusion::default() };
    assert!(matches!(refused(far), GeometryError::NotFinite { field: "spine", .. }));
    // All points of the spine in one place: surfaces without area, which the cutting into triangles counts.
    let flat = Extrusion { spine: vec![[1.0; 3]; 3], begin_cap: false, end_cap: false, ..Extrusion::default() }.build().unwrap();
    assert_eq!(triangles(&flat.mesh).len(), 0);
}
