//! Geometry nodes against geometric truth: areas, volumes, closedness, normals and texture extents.

use super::*;
use crate::import::mesh::{
    Mesh, newell,
    tests::{area, euler, triangles, volume},
};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

mod lists;
mod sweeps;

/// Normals are unit, look out of their polygons' fronts, and every corner has all attributes.
fn check(mesh: &Mesh) {
    let normals = mesh.normals.as_ref().unwrap();
    assert_eq!((normals.at.len(), mesh.uv_sets[0].at.len()), (mesh.corners.len(), mesh.corners.len()));
    for run in mesh.polygons() {
        let face = newell(run.clone().map(|c| mesh.place(c)));
        for c in run {
            let n = Vec3::from_array(normals.get(c)).as_dvec3();
            assert!((n.length() - 1.0).abs() < 1e-6 && n.dot(face) >= 0.0);
            assert!(mesh.uv_sets[0].get(c).iter().all(|x| x.is_finite()));
        }
    }
}

/// Texture coordinates at a corner for which the position fits.
fn uv_where(mesh: &Mesh, fits: impl Fn(DVec3, DVec3) -> bool) -> [f32; 2] {
    let normals = mesh.normals.as_ref().unwrap();
    let corner = (0..mesh.corners.len()).find(|c| fits(mesh.place(*c), Vec3::from_array(normals.get(*c)).as_dvec3()));
    mesh.uv_sets[0].get(corner.unwrap())
}

#[test]
fn boxes_are_closed_and_each_face_has_the_whole_texture_upright() {
    let g = BoxNode { size: [2.0, 4.0, 6.0], solid: true }.build().unwrap();
    check(&g.mesh);
    assert_eq!((euler(&g.mesh), volume(&g.mesh), area(&g.mesh)), ((2, 0), 48.0, 88.0));
    assert!(!g.two_sided && g.repairs.0.is_empty());
    // The top right corner of each face, as somebody sees it who stands in front of it as the specification says.
    let corners = [[1., 2., 3.], [-1., 2., -3.], [1., 2., -3.], [-1., 2., 3.], [1., 2., -3.], [1., -2., 3.]];
    let fronts = [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
    for (corner, front) in corners.into_iter().zip(fronts) {
        assert_eq!(uv_where(&g.mesh, |p, n| p == DVec3::from_array(corner) && n == front), [1.0, 1.0], "{front}");
    }
}

#[test]
fn flat_boxes_keep_two_faces_and_negative_ones_are_refused() {
    let g = BoxNode { size: [2.0, 0.0, 2.0], ..BoxNode::default() }.build().unwrap();
    assert_eq!((g.mesh.polygon_count(), area(&g.mesh), g.repairs.0[0].first), (2, 8.0, 1));
    assert!(matches!(BoxNode { size: [0.0, 0.0, 1.0], solid: true }.build(), Err(GeometryError::Empty { .. })));
    let refused = BoxNode { size: [1.0, -1.0, 1.0], solid: true }.build().unwrap_err();
    assert_eq!(refused.to_string(), "size is -1; it must be 0 or greater");
    assert!(matches!(BoxNode { size: [f32::NAN; 3], solid: true }.build(), Err(GeometryError::NotFinite { field: "size", at: 0 })));
}

#[test]
fn spheres_are_closed_round_and_seamed_at_the_back() {
    let g = Sphere { radius: 2.0, solid: false }.build().unwrap();
    check(&g.mesh);
    assert_eq!(euler(&g.mesh), (2, 0));
    assert!(g.two_sided);
    let exact = 4.0 / 3.0 * PI * 8.0;
    assert!(volume(&g.mesh) < exact && volume(&g.mesh) > exact * 0.985);
    let normals = g.mesh.normals.as_ref().unwrap();
    for c in 0..g.mesh.corners.len() {
        let place = g.mesh.place(c);
        // At the poles too: their normal is the axis.
        assert!(Vec3::from_array(normals.get(c)).as_dvec3().distance(place / 2.0) < 1e-6 && (place.length() - 2.0).abs() < 1e-6);
    }
    // No facet is nearer to the centre than the documented half per cent allows.
    let nearest = g.mesh.polygons().map(|run| run.clone().map(|c| g.mesh.place(c)).sum::<DVec3>().length() / run.len() as f64);
    assert!(nearest.fold(f64::INFINITY, f64::min) > 2.0 * 0.9903);
    let left = uv_where(&g.mesh, |p, _| p.distance(DVec3::new(-2.0, 0.0, 0.0)) < 1e-6);
    assert_eq!(left, [0.25, 0.5], "counter-clockwise from the back, seen from above, comes -X first");
}

#[test]
fn cylinders_have_their_parts() {
    let g = Cylinder { radius: 1.5, height: 3.0, ..Cylinder::default() }.build().unwrap();
    check(&g.mesh);
    assert_eq!((euler(&g.mesh), g.mesh.polygon_count()), ((2, 0), 34));
    let exact = PI * 2.25 * 3.0;
    assert!(volume(&g.mesh) < exact && volume(&g.mesh) > 0.99 * exact);
    assert_eq!(uv_where(&g.mesh, |p, n| n.y == 1.0 && p.z < -1.49), [0.5, 1.0], "the lid's top is at the back");
    assert_eq!(uv_where(&g.mesh, |p, n| n.y == -1.0 && p.z > 1.49), [0.5, 1.0], "the floor's top is in front");
    assert_eq!(uv_where(&g.mesh, |p, n| n.y == 0.0 && p.z > 1.49 && p.y > 0.0), [0.5, 1.0]);
    let parts = |side, top, bottom| Cylinder { side, top, bottom, ..Cylinder::default() }.build();
    assert_eq!(parts(true, false, false).unwrap().mesh.polygon_count(), 32);
    assert_eq!(parts(false, true, false).unwrap().mesh.polygon_count(), 1);
    assert!(matches!(parts(false, false, false), Err(GeometryError::Empty { .. })));
    assert!(Cylinder { radius: 0.0, ..Cylinder::default() }.build().unwrap_err().to_string().contains("greater than 0"));
    let disc = Cylinder { height: 0.0, ..Cylinder::default() }.build().unwrap();
    assert_eq!((disc.mesh.polygon_count(), disc.repairs.0.len()), (2, 1));
}

#[test]
fn cones_lean_as_their_height_says() {
    let g = Cone { bottom_radius: 3.0, height: 4.0, ..Cone::default() }.build().unwrap();
    check(&g.mesh);
    assert_eq!((euler(&g.mesh), g.mesh.polygon_count()), ((2, 0), 33));
    let exact = PI * 9.0 * 4.0 / 3.0;
    assert!(volume(&g.mesh) < exact && volume(&g.mesh) > 0.99 * exact);
    let normals = g.mesh.normals.as_ref().unwrap();
    let mut sides = g.mesh.polygons().take(32).flatten();
    assert!(sides.all(|c| (normals.get(c)[1] - 0.6).abs() < 1e-6));
    let tip = uv_where(&g.mesh, |p, _| p.y > 1.99);
    assert_eq!(tip[1], 1.0);
    assert_eq!(Cone { bottom: false, ..Cone::default() }.build().unwrap().mesh.polygon_count(), 32);
    assert!(Cone { bottom: false, side: false, ..Cone::default() }.build().is_err());
}

#[test]
fn plane_figures_look_toward_z_and_are_two_sided() {
    let r = Rectangle2D { size: [4.0, 0.5], ..Rectangle2D::default() }.build().unwrap();
    check(&r.mesh);
    assert_eq!((area(&r.mesh), r.two_sided), (2.0, true));
    let exact = |inner: f64| (1.0 - inner * inner) * 16.0 * kiln_proto::math::sin_cos_degrees(360.0 / 32.0).0;
    for inner in [0.0, 0.5] {
        let d = Disk2D { inner_radius: inner as f32, ..Disk2D::default() }.build().unwrap();
        check(&d.mesh);
        assert!((area(&d.mesh) - exact(inner)).abs() < 1e-6 && d.mesh.polygon_count() == 1);
        assert_eq!(uv_where(&d.mesh, |p, _| p.y > 0.999), [0.5, 1.0]);
    }
    let bad = Disk2D { inner_radius: 2.0, ..Disk2D::default() }.build().unwrap_err();
    assert_eq!(bad.to_string(), "innerRadius is 2; it must be at most outerRadius");
    let vertices = vec![[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 1.0], [2.0, 0.0], [9.0, 9.0]];
    let t = TriangleSet2D { vertices, solid: true }.build().unwrap();
    check(&t.mesh);
    assert!(t.mesh.normals.as_ref().unwrap().values.iter().all(|n| *n == [0.0, 0.0, 1.0]));
    assert_eq!((area(&t.mesh), t.repairs.to_string()), (2.0, "entries after the last whole face were left out: 1, at vertices[6]".into()));
    assert_eq!(uv_where(&t.mesh, |p, _| p.y == 1.0), [0.0, 0.5]);
}

#[test]
fn arcs_close_as_they_say() {
    let arc = |closure_type: &str, start_angle: f32, end_angle: f32| {
        let g = ArcClose2D { closure_type: closure_type.into(), start_angle, end_angle, ..ArcClose2D::default() }.build().unwrap();
        check(&g.mesh);
        (area(&g.mesh), g.repairs.0.len())
    };
    let (quarter, turn) = (std::f32::consts::FRAC_PI_2, std::f32::consts::TAU);
    let disc = area(&Disk2D::default().build().unwrap().mesh);
    let close = |a: f64, b: f64| (a - b).abs() < 1e-6;
    assert!(close(arc("PIE", 0.0, quarter).0, disc / 4.0) && close(arc("CHORD", 0.0, quarter).0, disc / 4.0 - 0.5));
    assert!(close(arc("PIE", quarter, 0.0).0, disc * 0.75), "counter-clockwise, the long way, and not convex");
    assert!(close(arc("PIE", 1.0, 1.0).0, disc) && close(arc("CHORD", -1.0, turn).0, disc));
    assert_eq!(arc("ROUND", 0.0, quarter).1, 1);
    assert!(ArcClose2D { closure_type: "CHORD".into(), end_angle: 1e-3, ..ArcClose2D::default() }.build().is_err());
}
