//! Meshes from one space into another.

use super::Mesh;
use glam::{DMat3, DMat4, DVec3, Vec3};
use kiln_proto::math::sin_cos_degrees;

/// A position left the range of f32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("position {position} becomes infinite where its node places it")]
pub struct Overflow {
    /// Index of the first such position.
    pub position: usize,
}

impl Mesh {
    /// Moves positions by an affine matrix and normals by the inverse transpose of its linear part. A mirroring matrix (negative
    /// determinant) turns the polygons around as well, so that their fronts stay outside. Normals that a flattening matrix leaves
    /// without a direction stay as they are; their polygons have no area.
    ///
    /// # Errors
    /// A position that is not finite afterwards; the mesh is then half moved and of no use.
    pub fn transform(&mut self, matrix: &DMat4) -> Result<(), Overflow> {
        for (position, p) in self.positions.iter_mut().enumerate() {
            let moved = matrix.transform_point3(Vec3::from_array(*p).as_dvec3()).as_vec3();
            if !moved.is_finite() {
                return Err(Overflow { position });
            }
            *p = moved.to_array();
        }
        let linear = DMat3::from_mat4(*matrix);
        let mirrors = linear.determinant() < 0.0;
        let turned = for_normals(linear);
        for n in self.normals.iter_mut().flat_map(|c| &mut c.values) {
            if let Some(moved) = (turned * Vec3::from_array(*n).as_dvec3()).try_normalize() {
                *n = moved.as_vec3().to_array();
            }
        }
        if mirrors {
            self.reverse();
        }
        Ok(())
    }
}

/// What takes normals along with a linear map: its inverse transpose up to a positive factor, without a division, and so also where a side
/// is flattened; outside stays outside in a mirror. The map is scaled to size one first, so that a scene in nanometres does not underflow.
#[must_use]
pub fn for_normals(m: DMat3) -> DMat3 {
    let size = m.to_cols_array().iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    let m = if size > 0.0 { m * (1.0 / size) } else { m };
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)) * sign
}

/// By how much a map stretches lengths: the mean over its axes. The cube root of its volume would be zero for one that flattens.
#[must_use]
pub fn stretch(matrix: &DMat4) -> f64 {
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    axes.iter().map(|axis| axis.truncate().length()).sum::<f64>() / 3.0
}

/// The rotation about an axis (any length but zero, which gives no rotation) by an angle in radians: Rodrigues' formula over
/// `kiln_proto::math`, because glam's own calls the C library.
#[must_use]
pub fn axis_angle(axis: DVec3, radians: f64) -> DMat3 {
    let Some(k) = axis.try_normalize() else { return DMat3::IDENTITY };
    let (s, c) = sin_cos_degrees(radians.to_degrees());
    let turned = |v: DVec3| v * c + k.cross(v) * s + k * (k.dot(v) * (1.0 - c));
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::super::{
        Smoothing, smooth,
        tests::{cube, volume},
    };
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn mirrors_keep_fronts_outside_and_stretching_keeps_normals_upright() {
        let mut mesh = cube();
        mesh.normals = Some(smooth(&mesh, &Smoothing::Flat));
        let mirror = DMat4::from_scale(DVec3::new(-2.0, 3.0, 1.0)) * DMat4::from_translation(DVec3::new(5.0, 0.0, 0.0));
        mesh.transform(&mirror).unwrap();
        assert!((volume(&mesh) - 8.0 * 6.0).abs() < 1e-6, "positive: outward");
        let shear = DMat4::from_cols_array(&[1., 0., 0., 0., 1., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
        mesh.transform(&shear).unwrap();
        let normals = mesh.normals.clone().unwrap();
        for run in mesh.polygons() {
            let face = super::super::newell(run.clone().map(|c| mesh.place(c))).normalize();
            for c in run {
                assert!(Vec3::from_array(normals.get(c)).as_dvec3().distance(face) < 1e-6);
            }
        }
    }

    #[test]
    fn lengths_follow_the_mean_of_the_axes() {
        assert_eq!(stretch(&DMat4::from_scale(DVec3::new(1.0, 2.0, 3.0))), 2.0);
    }

    #[test]
    fn flattening_keeps_a_unit_normal_and_overflow_is_told() {
        let mut mesh = cube();
        mesh.normals = Some(smooth(&mesh, &Smoothing::Flat));
        mesh.transform(&DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))).unwrap();
        assert!(mesh.normals.unwrap().values.iter().all(|n| (Vec3::from_array(*n).length() - 1.0).abs() < 1e-6));
        assert_eq!(cube().transform(&DMat4::from_scale(DVec3::splat(1e39))), Err(Overflow { position: 0 }));
    }

    #[test]
    fn normals_stay_orthogonal_to_what_they_stand_on() {
        let m = DMat3::from_cols(DVec3::new(-2.0, 0.1, 0.0), DVec3::new(0.3, 0.5, 0.2), DVec3::new(0.0, 0.7, 3.0)) * 1e-120;
        let (a, b) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-0.5, 0.25, 1.0));
        let normal = a.cross(b);
        let moved = for_normals(m) * normal;
        assert!((moved.dot(m * a) * 1e120).abs() < 1e-12 && (moved.dot(m * b) * 1e120).abs() < 1e-12);
        assert!(moved.dot((m * 1e120).inverse().transpose() * normal) > 0.0, "outside stays outside, also in a mirror");
        let flat = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0));
        assert_eq!((for_normals(flat) * DVec3::Z).normalize(), DVec3::Z);
        assert!((stretch(&DMat4::from_scale(DVec3::new(1.0, -2.0, 6.0))) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn rotations_turn_right_handed() {
        let m = axis_angle(DVec3::new(0.0, 0.0, 7.0), FRAC_PI_2);
        assert!((m * DVec3::X).distance(DVec3::Y) < 1e-15);
        assert!((axis_angle(DVec3::ONE, 2.0 * FRAC_PI_2 / 1.5) * DVec3::X).distance(DVec3::Y) < 1e-12, "a third of a turn");
        assert_eq!(axis_angle(DVec3::ZERO, 1.0), DMat3::IDENTITY);
    }
}
