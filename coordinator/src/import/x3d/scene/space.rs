//! Where nodes lie: the matrices of grouping nodes (ISO/IEC 19775-1: 10.4.4), and what a matrix does to points, directions and lengths.

use crate::import::{mesh::axis_angle, x3d::NodeRef};
use glam::{DMat3, DMat4, DVec3, Vec3};

/// From the space of a node's children to that of the node; the identity for nodes that do not move what they hold.
pub(super) fn local(node: NodeRef<'_>) -> DMat4 {
    match node.kind() {
        "Transform" | "EspduTransform" | "CADPart" | "HAnimHumanoid" | "HAnimJoint" | "HAnimSite" => placed(node),
        "MatrixTransform" => matrix(node.matrix4("matrix")),
        _ => DMat4::IDENTITY,
    }
}

/// P' = T C R SR S -SR -C P.
fn placed(node: NodeRef<'_>) -> DMat4 {
    let vector = |field| wide(node.vec3(field));
    let turn = |field| DMat4::from_mat3(rotation(node.vec4(field)));
    let (centre, scale) = (vector("center"), vector("scale"));
    let orientation = turn("scaleOrientation");
    DMat4::from_translation(vector("translation") + centre)
        * turn("rotation")
        * orientation
        * DMat4::from_scale(scale)
        * orientation.transpose()
        * DMat4::from_translation(-centre)
}

/// The rotation of an `SFRotation`.
pub(super) fn rotation([x, y, z, angle]: [f32; 4]) -> DMat3 {
    axis_angle(wide([x, y, z]), f64::from(angle))
}

/// A matrix as X3D writes it: sixteen numbers of which the last row translates, which are glam's columns.
fn matrix(numbers: [f32; 16]) -> DMat4 {
    DMat4::from_cols_array(&numbers.map(f64::from))
}

/// A vector in f64.
pub(super) fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}

/// A vector in f32.
pub(super) fn narrow(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// A point of a node in the world.
pub(super) fn point(matrix: &DMat4, p: [f32; 3]) -> DVec3 {
    matrix.transform_point3(wide(p))
}

/// A direction of a node in the world, unit; `None` for one without length.
pub(super) fn direction(matrix: &DMat4, d: [f32; 3]) -> Option<DVec3> {
    matrix.transform_vector3(wide(d)).try_normalize()
}

/// A unit vector orthogonal to the unit vector `forward`, as near to `up` as can be; some one where `up` says nothing.
pub(super) fn upright(forward: DVec3, up: DVec3) -> DVec3 {
    let candidates = [up, DVec3::Y, DVec3::Z];
    let orthogonal = |v: DVec3| (v - forward * v.dot(forward)).try_normalize().filter(|o| o.dot(v).abs() > 1e-6 * v.length());
    candidates.into_iter().find_map(orthogonal).unwrap_or_else(|| forward.any_orthonormal_vector())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_orthogonal_and_never_missing() {
        assert_eq!(upright(DVec3::NEG_Z, DVec3::new(0.0, 2.0, 5.0)), DVec3::Y);
        assert_eq!(upright(DVec3::NEG_Y, DVec3::Y), DVec3::Z, "an up along the view says nothing");
        assert_eq!(upright(DVec3::NEG_Z, DVec3::ZERO), DVec3::Y);
    }

    #[test]
    fn a_flattened_direction_is_none() {
        assert!(direction(&DMat4::from_scale(DVec3::ZERO), [0.0, 0.0, 1.0]).is_none());
    }
}
