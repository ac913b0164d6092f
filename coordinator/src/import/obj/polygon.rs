//! Polygons to triangles: a fan where the polygon is convex, ears clipped where it is not.
//!
//! Everything happens in the plane of Newell's normal, in f64, with fixed order: the same polygon gives the same triangles everywhere.
//! Ear clipping (Meisters 1975) costs the square of the corners in all but hostile cases; monotone partition would cost n log n and
//! three hundred lines for faces that have seldom more than ten corners.

use glam::{DVec2, DVec3};

/// Corner indices of the triangles of a polygon, in its orientation. Always n - 2 of them; where the polygon is degenerate or crosses
/// itself, the rest of it becomes a fan.
pub(super) fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let n = corners.len();
    if n == 3 {
        return vec![[0, 1, 2]];
    }
    let Some(flat) = project(corners) else { return fan(&(0..n).collect::<Vec<_>>()) };
    if (0..n).all(|i| turn(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) >= 0.0) && fan_is_sound(&flat) {
        return fan(&(0..n).collect::<Vec<_>>());
    }
    clip_ears(&flat)
}

/// Newell's normal: the sum over edges of their cross products, twice the polygon's vector area.
pub(super) fn newell(corners: &[DVec3]) -> DVec3 {
    let origin = corners.first().copied().unwrap_or_default();
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| (*a - origin).cross(*b - origin)).sum()
}

/// The polygon in its plane, counter-clockwise: the coordinate in which the normal is largest is left out.
fn project(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    let normal = newell(corners);
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
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// A polygon may turn left everywhere and still wind around twice; then a triangle of the fan turns right.
fn fan_is_sound(flat: &[DVec2]) -> bool {
    (1..flat.len() - 1).all(|i| turn(flat[0], flat[i], flat[i + 1]) > 0.0)
}

fn fan(left: &[usize]) -> Vec<[usize; 3]> {
    (1..left.len() - 1).map(|i| [left[0], left[i], left[i + 1]]).collect()
}

fn clip_ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    let mut out = Vec::with_capacity(flat.len() - 2);
    let mut at = 0;
    let mut refused = 0;
    while left.len() > 3 {
        let n = left.len();
        let ear = [left[(at + n - 1) % n], left[at % n], left[(at + 1) % n]];
        if is_ear(flat, &left, ear) {
            out.push(ear);
            left.remove(at % n);
            // Step over the next corner: clipping round the polygon gives fatter triangles than eating it from one end.
            at = if left.is_empty() { 0 } else { (at % n + 1) % left.len() };
            refused = 0;
        } else {
            at = (at + 1) % n;
            refused += 1;
            if refused > n {
                break;
            }
        }
    }
    out.extend(fan(&left));
    out
}

/// Whether the triangle lies inside the polygon: a left turn that holds no other corner.
fn is_ear(flat: &[DVec2], left: &[usize], [a, b, c]: [usize; 3]) -> bool {
    let (pa, pb, pc) = (flat[a], flat[b], flat[c]);
    if turn(pa, pb, pc) <= 0.0 {
        return false;
    }
    let holds = |p: DVec2| turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0;
    // A corner at the very place of one of the ear's is the other end of a bridge to a hole, and does not count.
    left.iter().map(|i| flat[*i]).all(|p| p == pa || p == pb || p == pc || !holds(p))
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
                let triangles = triangulate(&rotated);
                let whole = newell(&rotated);
                assert_eq!(triangles.len(), rotated.len() - 2);
                assert!((area(&rotated, &triangles) - whole.length() / 2.0).abs() < 1e-9);
                assert!(triangles.iter().all(|t| newell(&t.map(|i| rotated[i])).dot(whole) > 0.0));
            }
        }
    }

    #[test]
    fn degenerate_polygons_become_fans() {
        let line = lift(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)]);
        assert_eq!(triangulate(&line), [[0, 1, 2], [0, 2, 3]]);
        let bow = lift(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        assert_eq!(triangulate(&bow).len(), 2);
    }

    proptest! {
        /// Star-shaped polygons with random radii: simple, mostly concave. Their triangles tile them.
        #[test]
        fn stars_are_tiled(radii in prop::collection::vec(0.1f64..1.0, 4..24)) {
            let n = radii.len() as f64;
            let polygon: Vec<(f64, f64)> = radii.iter().enumerate().map(|(i, r)| {
                let (sin, cos) = kiln_proto::math::sin_cos_degrees(360.0 * i as f64 / n);
                (r * cos, r * sin)
            }).collect();
            let corners = lift(&polygon);
            let triangles = triangulate(&corners);
            prop_assert_eq!(triangles.len(), corners.len() - 2);
            prop_assert!((area(&corners, &triangles) - newell(&corners).length() / 2.0).abs() < 1e-9);
        }
    }
}
