//! Polygons to triangles: a fan where the polygon is convex, ears clipped where it is not.
//!
//! Everything happens in the plane of Newell's normal, in f64, with fixed order: the same polygon gives the same triangles everywhere.
//! The ears are in `ears`.
//!
//! Holes are expected as exporters write them: bridged, so that the polygon runs along the bridge twice and its ends appear twice.

use super::ears;
use glam::{DVec2, DVec3};

/// A triangle whose doubled area is below this share of its longest side squared has no direction to speak of.
const NO_AREA: f64 = 1e-10;

/// A polygon in triangles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    /// Corner indices, in the polygon's orientation; always n - 2 triangles, some of them without area where corners lie on a line.
    pub triangles: Vec<[usize; 3]>,
    /// Whether they tile the polygon. Not so where it crosses itself.
    pub sound: bool,
}

/// Cuts a polygon. One of fewer than three corners has no triangles.
#[must_use]
pub fn triangulate(corners: &[DVec3]) -> Cut {
    let n = corners.len();
    if n <= 3 {
        return Cut { triangles: if n == 3 { vec![[0, 1, 2]] } else { vec![] }, sound: true };
    }
    let all: Vec<usize> = (0..n).collect();
    let Some(flat) = project(corners) else {
        let triangles = fan(&all);
        let sound = triangles.iter().all(|t| has_no_area(t.map(|i| corners[i])));
        return Cut { triangles, sound };
    };
    if (0..n).all(|i| turn(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) >= 0.0) && fan_is_sound(&flat) {
        return Cut { triangles: fan(&all), sound: true };
    }
    ears::clip(&flat)
}

/// Whether a triangle is too thin to have a normal.
#[must_use]
pub fn has_no_area([a, b, c]: [DVec3; 3]) -> bool {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() <= NO_AREA * longest
}

/// Newell's normal: the sum over edges of their cross products, twice the polygon's vector area.
#[must_use]
pub fn newell(corners: impl IntoIterator<Item = DVec3>) -> DVec3 {
    let mut corners = corners.into_iter();
    let Some(origin) = corners.next() else { return DVec3::ZERO };
    let mut last = DVec3::ZERO;
    corners
        .map(|corner| {
            let to = corner - origin;
            std::mem::replace(&mut last, to).cross(to)
        })
        .sum()
}

/// The polygon in its plane, counter-clockwise: the coordinate in which the normal is largest is left out.
fn project(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    let normal = newell(corners.iter().copied());
    let size = normal.abs();
    if size.max_element() <= 0.0 {
        return None;
    }
    let along = |p: &DVec3| {
        if size.x >= size.y && size.x >= size.z {
            if normal.x > 0.0 { DVec2::new(p.y, p.z) } else { DVec2::new(p.z, p.y) }
        } else if size.y >= size.z {
            if normal.y > 0.0 { DVec2::new(p.z, p.x) } else { DVec2::new(p.x, p.z) }
        } else if normal.z > 0.0 {
            DVec2::new(p.x, p.y)
        } else {
            DVec2::new(p.y, p.x)
        }
    };
    Some(corners.iter().map(along).collect())
}

/// Twice the signed area of a, b, c: positive for a left turn.
pub(super) fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// A polygon may turn left everywhere and still wind around twice; then a triangle of the fan turns right.
fn fan_is_sound(flat: &[DVec2]) -> bool {
    (1..flat.len() - 1).all(|i| turn(flat[0], flat[i], flat[i + 1]) > 0.0)
}

pub(super) fn fan(left: &[usize]) -> Vec<[usize; 3]> {
    (1..left.len() - 1).map(|i| [left[0], left[i], left[i + 1]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        triangles.iter().map(|t| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).length() / 2.0).sum()
    }

    fn lift(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|(x, y)| DVec3::new(*x, *y, 0.5 * x - 0.25 * y)).collect()
    }

    #[test]
    fn concave_polygons_keep_their_area_and_orientation() {
        let arrow = lift(&[(0.0, 0.0), (2.0, 0.0), (1.0, 0.5), (2.0, 2.0), (0.0, 2.0)]);
        let comb =
            lift(&[(0., 0.), (5., 0.), (5., 3.), (4., 3.), (4., 1.), (3., 1.), (3., 3.), (2., 3.), (2., 1.), (1., 1.), (1., 3.), (0., 3.)]);
        for polygon in [arrow, comb] {
            for start in 0..polygon.len() {
                let mut rotated = polygon.clone();
                rotated.rotate_left(start);
                let Cut { triangles, sound } = triangulate(&rotated);
                assert!(sound);
                let whole = newell(rotated.iter().copied());
                assert_eq!(triangles.len(), rotated.len() - 2);
                assert!((area(&rotated, &triangles) - whole.length() / 2.0).abs() < 1e-9);
                assert!(triangles.iter().all(|t| newell(t.map(|i| rotated[i])).dot(whole) > 0.0));
            }
        }
    }

    #[test]
    fn degenerate_polygons_become_fans() {
        let line = lift(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)]);
        assert_eq!(triangulate(&line), Cut { triangles: vec![[0, 1, 2], [0, 2, 3]], sound: true });
        let bow = lift(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        let cut = triangulate(&bow);
        assert_eq!((cut.triangles.len(), cut.sound), (2, false));
        assert_eq!(triangulate(&bow[..2]).triangles, [[0; 3]; 0]);
    }

    /// A square with two square holes, each reached by a bridge that runs there and back.
    #[test]
    fn bridged_holes_stay_holes() {
        let ring = lift(&[
            (0., 0.),
            (9., 0.),
            (9., 9.),
            (0., 9.),
            (0., 0.),
            (1., 1.),
            (1., 4.),
            (4., 4.),
            (4., 1.),
            (1., 1.),
            (0., 0.),
            (5., 1.),
            (5., 4.),
            (8., 4.),
            (8., 1.),
            (5., 1.),
        ]);
        for start in 0..ring.len() {
            let mut rotated = ring.clone();
            rotated.rotate_left(start);
            let Cut { triangles, sound } = triangulate(&rotated);
            let scale = newell(lift(&[(0., 0.), (1., 0.), (1., 1.), (0., 1.)])).length() / 2.0;
            assert!(sound && (area(&rotated, &triangles) / scale - 63.0).abs() < 1e-9, "from {start}");
        }
    }

    /// Corners on straight edges, spikes and repeated corners cost nothing but triangles without area.
    #[test]
    fn straight_corners_and_spikes_do_no_harm() {
        let polygon = lift(&[
            (0., 0.),
            (1., 0.),
            (2., 0.),
            (3., 0.),
            (3., 0.),
            (3., 1.),
            (4., 1.),
            (3., 1.),
            (3., 2.),
            (1.5, 2.),
            (1.5, 1.),
            (1.5, 2.),
            (0., 2.),
            (0., 1.),
        ]);
        let Cut { triangles, sound } = triangulate(&polygon);
        assert!(sound && (area(&polygon, &triangles) - newell(polygon.iter().copied()).length() / 2.0).abs() < 1e-9);
        assert_eq!(triangles.len(), polygon.len() - 2);
        // A spike out of a reflex corner hides that it is one until the spike is gone.
        let hidden = lift(&[(0., 0.), (2., 0.), (2., 1.), (1., 1.), (0.5, 0.5), (1., 1.), (1., 2.), (0., 2.)]);
        for start in 0..hidden.len() {
            let mut rotated = hidden.clone();
            rotated.rotate_left(start);
            let Cut { triangles, sound } = triangulate(&rotated);
            assert!(sound && (area(&rotated, &triangles) - newell(rotated.iter().copied()).length() / 2.0).abs() < 1e-9, "from {start}");
        }
    }

    /// A comb of teeth as long as the polygon is wide, the worst of the honest cases, and a tangle: both end, and the comb is right.
    #[test]
    fn large_polygons_end() {
        let teeth = 1_500;
        let mut comb = vec![(-1.0, 0.0), (-1.0, f64::from(2 * teeth))];
        for i in (0..teeth).rev() {
            comb.extend([(100.0, f64::from(2 * i + 1)), (0.0, f64::from(2 * i))]);
        }
        comb.reverse();
        let corners = lift(&comb);
        let Cut { triangles, sound } = triangulate(&corners);
        assert!(sound && (area(&corners, &triangles) / (newell(corners.iter().copied()).length() / 2.0) - 1.0).abs() < 1e-9);
        let tangle: Vec<(f64, f64)> = (0..3_000u32).map(|i| (f64::from(i * 7919 % 3001), f64::from(i * 104_729 % 2999))).collect();
        assert_eq!(triangulate(&lift(&tangle)).triangles.len(), 2_998);
    }

    proptest! {
        /// Any rotation of the plane: rounding of f32 takes the corners out of it, and the area stays.
        #[test]
        fn turned_polygons_keep_their_area(x in -1.0f64..1.0, y in -1.0f64..1.0, z in -1.0f64..1.0, turn in 0.0f64..6.3) {
            let flat = [(0., 0.), (5., 0.), (5., 3.), (4., 3.), (4., 1.), (3., 1.), (3., 3.), (2., 3.), (2., 1.), (1., 1.), (1., 3.), (0., 3.), (0., 1.)];
            let m = super::super::axis_angle(DVec3::new(x, y, z), turn);
            let corners: Vec<DVec3> = flat.iter().map(|(x, y)| (m * DVec3::new(*x, *y, 7.0)).as_vec3().as_dvec3()).collect();
            let Cut { triangles, sound } = triangulate(&corners);
            prop_assert!(sound && (area(&corners, &triangles) - 11.0).abs() < 1e-4);
        }

        /// Star-shaped polygons with random radii: simple, mostly concave. Their triangles tile them.
        #[test]
        fn stars_are_tiled(radii in prop::collection::vec(0.1f64..1.0, 4..24)) {
            let n = radii.len() as f64;
            let polygon: Vec<(f64, f64)> = radii.iter().enumerate().map(|(i, r)| {
                let (sin, cos) = kiln_proto::math::sin_cos_degrees(360.0 * i as f64 / n);
                (r * cos, r * sin)
            }).collect();
            let corners = lift(&polygon);
            let Cut { triangles, sound } = triangulate(&corners);
            prop_assert!(sound);
            prop_assert_eq!(triangles.len(), corners.len() - 2);
            prop_assert!((area(&corners, &triangles) - newell(corners.iter().copied()).length() / 2.0).abs() < 1e-9);
        }
    }
}
