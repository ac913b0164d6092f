//! Rotations as quaternions (x, y, z, w), in f64 and without the C library.

use crate::import::slerp::{dot, slerp};
use kiln_proto::math;

pub(super) type Quaternion = [f64; 4];

/// From axis and angle in radians; an axis of no length is no rotation.
pub(super) fn from_axis_angle([x, y, z, angle]: [f32; 4]) -> Quaternion {
    let axis = [x, y, z].map(f64::from);
    let length = dot(&axis, &axis).sqrt();
    if length == 0.0 {
        return [0.0, 0.0, 0.0, 1.0];
    }
    let (sin, cos) = sin_cos(f64::from(angle) / 2.0);
    let [x, y, z] = axis.map(|a| a / length * sin);
    [x, y, z, cos]
}

/// To axis and angle; about +Z where there is no rotation.
pub(super) fn to_axis_angle(q: Quaternion) -> [f32; 4] {
    // The half angle is kept in [0, 90] degrees.
    let q = if q[3] < 0.0 { q.map(|c| -c) } else { q };
    let sin = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]).sqrt();
    if sin < 1e-12 {
        return [0.0, 0.0, 1.0, 0.0];
    }
    let angle = 2.0 * math::acos(q[3]);
    [(q[0] / sin) as f32, (q[1] / sin) as f32, (q[2] / sin) as f32, angle as f32]
}

fn sin_cos(radians: f64) -> (f64, f64) {
    math::sin_cos_degrees(radians.to_degrees())
}

fn product(a: Quaternion, b: Quaternion) -> Quaternion {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

fn logarithm(q: Quaternion) -> [f64; 3] {
    let sin = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]).sqrt();
    let scale = if sin < 1e-12 { 0.0 } else { math::acos(q[3]) / sin };
    [q[0] * scale, q[1] * scale, q[2] * scale]
}

fn exponential(v: [f64; 3]) -> Quaternion {
    let angle = dot(&v, &v).sqrt();
    let (sin, cos) = sin_cos(angle);
    let scale = if angle < 1e-12 { 0.0 } else { sin / angle };
    [v[0] * scale, v[1] * scale, v[2] * scale, cos]
}

/// Spherical cubic interpolation from `q[1]` to `q[2]` of four neighbours (Shoemake, "Quaternion calculus and fast animation", 1987).
pub(super) fn squad(q: [Quaternion; 4], t: f64) -> Quaternion {
    let mut q = q;
    for i in 1..4 {
        if dot(&q[i - 1], &q[i]) < 0.0 {
            q[i] = q[i].map(|c| -c);
        }
    }
    let control = |before: Quaternion, at: Quaternion, after: Quaternion| {
        let inverse = [-at[0], -at[1], -at[2], at[3]];
        let (a, b) = (logarithm(product(inverse, after)), logarithm(product(inverse, before)));
        product(at, exponential(std::array::from_fn(|i| -(a[i] + b[i]) / 4.0)))
    };
    let ends = slerp(q[1], q[2], t);
    let controls = slerp(control(q[0], q[1], q[2]), control(q[1], q[2], q[3]), t);
    slerp(ends, controls, 2.0 * t * (1.0 - t))
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER: f32 = std::f32::consts::FRAC_PI_2;

    fn close(a: [f32; 4], b: [f32; 4]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} is not {b:?}");
    }

    #[test]
    fn there_and_back() {
        close(to_axis_angle(from_axis_angle([0.0, 2.0, 0.0, QUARTER])), [0.0, 1.0, 0.0, QUARTER]);
        close(to_axis_angle(from_axis_angle([0.0, 0.0, 0.0, 3.0])), [0.0, 0.0, 1.0, 0.0]);
        close(to_axis_angle(from_axis_angle([1.0, 0.0, 0.0, -1.0])), [-1.0, 0.0, 0.0, 1.0]);
    }

    /// On one axis and at even steps the spherical cubic is the line; elsewhere it meets its ends.
    #[test]
    fn squad_is_steady_on_one_axis() {
        let q: [Quaternion; 4] = std::array::from_fn(|i| from_axis_angle([0.0, 1.0, 0.0, 0.3 * i as f32]));
        close(to_axis_angle(squad(q, 0.5)), [0.0, 1.0, 0.0, 0.45]);
        let mixed = [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.7], [0.0, 0.0, 1.0, 1.1], [1.0, 1.0, 0.0, 2.0]].map(from_axis_angle);
        close(to_axis_angle(squad(mixed, 0.0)), [0.0, 1.0, 0.0, 0.7]);
        close(to_axis_angle(squad(mixed, 1.0)), [0.0, 0.0, 1.0, 1.1]);
    }
}
