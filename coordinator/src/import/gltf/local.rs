//! How a node stands within its parent: a matrix, or scale, rotation and translation.

use super::{json::Json, property::ANY, report::Report};
use glam::{DMat4, DQuat, DVec3, DVec4};

/// A quaternion whose length is further from one than this was not meant as it stands.
const UNIT: f64 = 1e-3;

/// How far the last row of an affine matrix may be from what it should be: the rounding of programs that multiply in single precision.
const LAST_ROW: f64 = 1e-5;

/// How a node stands within its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Local {
    /// Any affine map.
    Matrix(DMat4),
    /// Scale, then rotation, then translation.
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    /// Where its parent is.
    pub(super) const STILL: Self = Self::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// What a node says.
    pub(super) fn read(json: Json<'_>, report: &mut Report<'_>) -> Self {
        let parts = ["translation", "rotation", "scale"].into_iter().find(|name| json.get(name).is_some());
        if let Some(matrix) = report.vector::<16>(json, "matrix", &ANY) {
            if let Some(name) = parts {
                report.error(json, format!("the node has both `matrix` and `{name}`; it may have one of them"));
            }
            let mut matrix = DMat4::from_cols_array(&matrix);
            let off = (matrix.row(3) - DVec4::W).abs().max_element();
            if off > LAST_ROW {
                report.error(json, "the last row of `matrix` must be 0, 0, 0, 1");
            } else if off > 0.0 {
                report.count(json, "matrices whose last row is 0, 0, 0, 1 but for rounding (taken as that)");
                (matrix.x_axis.w, matrix.y_axis.w, matrix.z_axis.w, matrix.w_axis.w) = (0.0, 0.0, 0.0, 1.0);
            }
            let (x, y, z) = (matrix.x_axis.truncate(), matrix.y_axis.truncate(), matrix.z_axis.truncate());
            let skewed = |a: DVec3, b: DVec3| a.dot(b).abs() > 1e-3 * (a.length() * b.length()).max(f64::MIN_POSITIVE);
            if skewed(x, y) || skewed(y, z) || skewed(z, x) {
                report.count(json, "matrices with a shear, which glTF forbids (applied all the same)");
            }
            return Self::Matrix(matrix);
        }
        Self::Parts {
            translation: report.vector(json, "translation", &ANY).map_or(DVec3::ZERO, DVec3::from_array),
            rotation: rotation(json, report),
            scale: report.vector(json, "scale", &ANY).map_or(DVec3::ONE, DVec3::from_array),
        }
    }

    /// As a matrix.
    pub(super) fn matrix(&self) -> DMat4 {
        match *self {
            Self::Matrix(m) => m,
            Self::Parts { translation, rotation, scale } => DMat4::from_scale_rotation_translation(scale, rotation, translation),
        }
    }
}

fn rotation(json: Json<'_>, report: &mut Report<'_>) -> DQuat {
    let Some(q) = report.vector(json, "rotation", &ANY).map(DQuat::from_array) else { return DQuat::IDENTITY };
    let length = q.length();
    if (length - 1.0).abs() > UNIT {
        report.count(json, "rotations that are no unit quaternions (brought to length 1)");
    }
    unit(q)
}

/// A quaternion of length one; no rotation at all where it has no length.
pub(super) fn unit(q: DQuat) -> DQuat {
    let length = q.length();
    if length > 0.0 && length.is_finite() { q * (1.0 / length) } else { DQuat::IDENTITY }
}
