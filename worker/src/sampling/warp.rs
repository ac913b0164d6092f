//! Maps from the unit square to directions and triangles. All of them keep neighbours together, so that stratification survives.

use glam::Vec3;
use kiln_proto::math;

/// 1/pi.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;

/// A point of the unit disk: Shirley and Chiu's concentric map (1997).
#[must_use]
#[inline]
pub fn concentric_disk(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, turns) = if a.abs() > b.abs() { (a, 0.125 * (b / a)) } else { (b, 0.25 - 0.125 * (a / b)) };
    let (sin, cos) = math::sin_cos_turns(turns);
    [r * cos, r * sin]
}

/// A local direction with density cos/pi (1/sr) about +Z.
#[must_use]
#[inline]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = concentric_disk(u);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// A direction about `axis` with density (n + 1)/(2 pi) cos^n (1/sr), `exponent` = n, over the hemisphere of the axis.
#[must_use]
#[inline]
pub fn power_lobe(axis: Vec3, exponent: f32, u: [f32; 2]) -> Vec3 {
    // 1 - u keeps the cosine away from zero: u is in [0, 1).
    let cos = math::pow(1.0 - u[0], 1.0 / (exponent + 1.0));
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (s, c) = math::sin_cos_turns(u[1]);
    let (x, y) = basis(axis);
    x * (sin * c) + y * (sin * s) + axis * cos
}

/// Two unit vectors that complete a unit `normal` to a right-handed frame (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
#[must_use]
#[inline]
pub fn basis(normal: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x), Vec3::new(b, sign + normal.y * normal.y * a, -normal.y))
}

/// Barycentric weights of the second and third corner, uniform over a triangle: the low-distortion map of Heitz (2019).
#[must_use]
#[inline]
pub fn triangle(u: [f32; 2]) -> [f32; 2] {
    if u[1] > u[0] {
        let b = 0.5 * u[0];
        [b, u[1] - b]
    } else {
        let c = 0.5 * u[1];
        [u[0] - c, c]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi_square::{Case, check};

    #[test]
    fn hemisphere_and_lobe_samples_follow_their_densities() {
        let cases: Vec<Case<'_>> = vec![
            Case::new("cosine", &cosine_hemisphere, &|w| w.z.max(0.0) * INV_PI),
            Case::new("lobe 0", &|u| power_lobe(Vec3::Z, 0.0, u), &|w| if w.z > 0.0 { 0.5 * INV_PI } else { 0.0 }),
            Case::new("lobe 15", &|u| power_lobe(Vec3::X, 15.0, u), &|w| 8.0 * INV_PI * math::pow(w.x.max(0.0), 15.0)),
            Case::new("lobe 60", &|u| power_lobe(Vec3::new(0.6, 0.0, -0.8), 60.0, u), &|w| {
                30.5 * INV_PI * math::pow((0.6 * w.x - 0.8 * w.z).max(0.0), 60.0)
            }),
        ];
        check(&cases);
    }

    #[test]
    fn triangle_samples_are_uniform() {
        // The third part of a triangle next to each corner (its weight above 2/3 has area 1/9).
        let n = 1000;
        let mut near = [0u32; 3];
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [b, c] = triangle([(i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32]);
            let a = 1.0 - b - c;
            assert!(a >= -1e-6 && b >= 0.0 && c >= 0.0);
            for (k, w) in [a, b, c].into_iter().enumerate() {
                near[k] += u32::from(w > 2.0 / 3.0);
            }
        }
        for count in near {
            assert!((f64::from(count) / f64::from(n * n) - 1.0 / 9.0).abs() < 1e-3, "{near:?}");
        }
    }

    #[test]
    fn a_basis_is_orthonormal_and_right_handed() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.3, -0.2, -0.9).normalize(), Vec3::new(1e-4, 0.0, -1.0).normalize()] {
            let (x, y) = basis(n);
            assert!(x.dot(y).abs() < 1e-6 && x.cross(y).distance(n) < 1e-6 && (x.length() - 1.0).abs() < 1e-6, "{n}");
        }
    }
}
