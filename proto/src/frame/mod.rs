//! The local frame of a texel: which way "x" and "y" point on a surface, so that baker, decoder and shader agree on every direction.
//!
//! A flat chart has one frame: N the polygon's normal, T = dP/du made orthogonal to N, B = N x T. On a smooth surface both are interpolated
//! ([`SurfaceFrames`]). Where texture coordinates are degenerate, and everywhere when `--frame thesis` is asked for, the frame is the
//! rotation that carries +Y to N (thesis 5.1.2).

mod lie;
mod surface;

pub use lie::Lie;
pub use surface::{SurfaceFrames, corner_normals};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Length that an interpolated tangent must have left beside the normal; below it, rounding would decide where it points.
const LEAST_TANGENT: f64 = 1e-4;

/// An orthonormal, right-handed frame in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Local x in world space.
    pub tangent: Vec3,
    /// Local y in world space: normal x tangent.
    pub bitangent: Vec3,
    /// Local z in world space.
    pub normal: Vec3,
}

/// Which rule orients the frames of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrameRule {
    /// The tangent follows the texture: T = dP/du.
    #[default]
    Texture,
    /// The thesis's rotation of +Y onto the normal (5.1.2).
    Thesis,
}

impl Frame {
    /// The frame of a triangle with `corners` in metres and texture coordinates `uv`, or `None` for a triangle without area.
    #[must_use]
    pub fn of_triangle(corners: [DVec3; 3], uv: [[f64; 2]; 3], rule: FrameRule) -> Option<Self> {
        let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let normal = e1.cross(e2);
        let length = normal.length();
        if length <= 0.0 || !length.is_finite() {
            return None;
        }
        let normal = normal / length;
        if rule == FrameRule::Thesis {
            return Some(Self::thesis(normal));
        }
        Some(Lie::of(corners, uv).map_or_else(|| Self::thesis(normal), |lie| Self::oriented(normal, lie.along_u)))
    }

    /// The frame of a unit normal whose x axis is `tangent` (of about unit length) made orthogonal to it, or the thesis's where nothing is
    /// left of the tangent.
    #[must_use]
    pub fn oriented(normal: DVec3, tangent: DVec3) -> Self {
        let across = tangent - normal * normal.dot(tangent);
        let size = across.length();
        if size >= LEAST_TANGENT { Self::from_axes(across / size, normal) } else { Self::thesis(normal) }
    }

    /// The rotation about Y x N that carries (0, 1, 0) to `normal`; for N = -Y, 180 degrees about X. The tangent is the image of +X.
    #[must_use]
    pub fn thesis(normal: DVec3) -> Self {
        let (x, y, z) = (normal.x, normal.y, normal.z);
        let tangent = if y <= -1.0 + 1e-12 {
            DVec3::X
        } else {
            // Rodrigues' rotation of +X with axis (z, 0, -x)/sin and cosine y: written without the division by the sine.
            let k = 1.0 / (1.0 + y);
            DVec3::new(1.0 - x * x * k, -x, -x * z * k)
        };
        let tangent = tangent - normal * normal.dot(tangent);
        Self::from_axes(tangent / tangent.length(), normal)
    }

    fn from_axes(tangent: DVec3, normal: DVec3) -> Self {
        Self { tangent: tangent.as_vec3(), bitangent: normal.cross(tangent).as_vec3(), normal: normal.as_vec3() }
    }

    /// A local direction in world space.
    #[must_use]
    #[inline]
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }

    /// A world direction in local space.
    #[must_use]
    #[inline]
    pub fn to_local(&self, world: Vec3) -> Vec3 {
        Vec3::new(self.tangent.dot(world), self.bitangent.dot(world), self.normal.dot(world))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn right_handed(f: &Frame) -> bool {
        f.tangent.cross(f.bitangent).distance(f.normal) < 1e-6 && (f.tangent.length() - 1.0).abs() < 1e-6
    }

    #[test]
    fn a_mirrored_chart_keeps_dp_du_and_a_right_handed_frame() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let plain = Frame::of_triangle(corners, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], FrameRule::Texture).unwrap();
        let flipped = Frame::of_triangle(corners, [[1.0, 0.0], [0.0, 0.0], [1.0, 1.0]], FrameRule::Texture).unwrap();
        assert_eq!((plain.tangent, plain.normal), (Vec3::X, Vec3::Z));
        assert_eq!((flipped.tangent, flipped.normal), (-Vec3::X, Vec3::Z));
        assert!(right_handed(&plain) && right_handed(&flipped));
    }

    #[test]
    fn the_thesis_frame_carries_y_to_the_normal() {
        for n in [DVec3::Y, DVec3::X, -DVec3::X, DVec3::Z, -DVec3::Y, DVec3::new(0.3, -0.9, 0.2).normalize()] {
            let f = Frame::thesis(n);
            assert!(right_handed(&f) && f.normal.distance(n.as_vec3()) < 1e-6, "{n}: {f:?}");
        }
        assert_eq!(Frame::thesis(DVec3::Y).tangent, Vec3::X);
        assert_eq!(Frame::thesis(-DVec3::Y).tangent, Vec3::X);
    }

    #[test]
    fn degenerate_texture_coordinates_fall_back_and_degenerate_triangles_are_none() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Z];
        let f = Frame::of_triangle(corners, [[0.5, 0.5]; 3], FrameRule::Texture).unwrap();
        assert_eq!(f, Frame::thesis(-DVec3::Y));
        assert!(Frame::of_triangle([DVec3::ZERO, DVec3::X, DVec3::X * 2.0], [[0.0, 0.0]; 3], FrameRule::Texture).is_none());
    }
}
