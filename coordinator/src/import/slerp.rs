//! Along great circles, in f64 and without the C library: rotations as quaternions (x, y, z, w), and directions.

use kiln_proto::math;

/// The scalar product.
pub(super) fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// To length one; what has no length stays.
pub(super) fn normalized<const N: usize>(v: [f64; N]) -> [f64; N] {
    let length = dot(&v, &v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { v }
}

/// From `a` to `b`, unit vectors of any dimension, along the great circle; of opposite ones the straight line, which has no direction to
/// choose.
pub(super) fn slerp<const N: usize>(a: [f64; N], b: [f64; N], t: f64) -> [f64; N] {
    let cos = dot(&a, &b);
    let mix = |u: f64, v: f64| std::array::from_fn(|i| u * a[i] + v * b[i]);
    if cos.abs() > 1.0 - 1e-9 {
        return normalized(mix(1.0 - t, t));
    }
    let angle = math::acos(cos);
    let sine = |radians: f64| math::sin_cos_degrees(radians.to_degrees()).0;
    mix(sine((1.0 - t) * angle) / sine(angle), sine(t * angle) / sine(angle))
}

/// Slerp of unit quaternions the short way round: q and -q are the same rotation (glTF 2.0, appendix C.4; ISO/IEC 19775-1: 19.3.2.1).
pub(super) fn shortest(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    slerp(a, if dot(&a, &b) < 0.0 { b.map(|c| -c) } else { b }, t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_evenly_by_the_shorter_way() {
        let turn = |degrees: f64| {
            let (s, c) = math::sin_cos_degrees(degrees / 2.0);
            [0.0, s, 0.0, c]
        };
        for (from, to, share, expected) in
            [(0.0, 90.0, 1.0 / 3.0, 30.0), (10.0, 10.5, 0.5, 10.25), (-20.0, 340.5, 0.5, -19.75), (7.0, 7.0, 0.5, 7.0)]
        {
            let found = shortest(turn(from), turn(to), share);
            assert!(dot(&found, &turn(expected)).abs() > 1.0 - 1e-9, "{from} to {to}");
            let found = shortest(turn(from), turn(to).map(|c| -c), share);
            assert!(dot(&found, &turn(expected)).abs() > 1.0 - 1e-9, "{from} to {to}, the other way to write it");
        }
    }

    #[test]
    fn directions_meet_in_the_middle() {
        let half = slerp([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5);
        assert!((half[0] - 0.5f64.sqrt()).abs() < 1e-12 && (half[1] - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(normalized([0.0; 3]), [0.0; 3]);
    }
}
