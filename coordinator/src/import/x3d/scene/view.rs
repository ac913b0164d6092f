//! Viewpoints: cameras of the scene, and what a viewpoint or light projects (Kamburelis 4.5).

use super::{
    space::{self, narrow, point, rotation, upright},
    walk::Placed,
};
use crate::import::{findings::Findings, mesh::stretch, x3d::NodeRef};
use glam::{DMat4, DVec3, DVec4};
use kiln_proto::{
    math,
    scene::{Camera, Lens, Light, LightShape},
};
use std::f32::consts::PI;

/// Aspect of the picture through which the bound viewpoint projects: the one that previews have unless told otherwise.
const ASPECT: f64 = 4.0 / 3.0;

/// A viewpoint as a camera; `None` where its numbers make none, which is then a warning.
pub(super) fn camera(placed: &Placed<'_>, name: String, findings: &mut Findings) -> Option<Camera> {
    let node = placed.node;
    let turn = rotation(node.vec4("orientation"));
    let direction = |v: DVec3| placed.matrix.transform_vector3(turn * v).try_normalize();
    let (Some(forward), Some(up)) = (direction(DVec3::NEG_Z), direction(DVec3::Y)) else {
        findings.warn(node.at(), format!("the viewpoint `{name}` looks nowhere and was left out"));
        return None;
    };
    let lens = if node.kind() == "OrthoViewpoint" {
        let [_, bottom, _, top] = extent(node);
        // The file's lengths are those of the viewpoint's group.
        let half_height = (top - bottom).abs() / 2.0 * stretch(&placed.matrix) as f32;
        if !(half_height > 0.0 && half_height.is_finite()) {
            findings.warn(node.at_field("fieldOfView"), format!("the viewpoint `{name}` shows no height and was left out"));
            return None;
        }
        Lens::Orthographic { half_height }
    } else {
        Lens::Perspective { fov: field_of_view(node, findings), of_smaller: true }
    };
    let eye = point(&placed.matrix, node.vec3("position"));
    Some(Camera { name, eye: narrow(eye), forward: narrow(forward), up: narrow(upright(forward, up)), lens })
}

/// Left, bottom, right and top of what an OrthoViewpoint shows.
pub(super) fn extent(node: NodeRef<'_>) -> [f32; 4] {
    node.mf_float("fieldOfView").first_chunk().copied().unwrap_or([-1.0, -1.0, 1.0, 1.0])
}

fn field_of_view(node: NodeRef<'_>, findings: &mut Findings) -> f32 {
    let fov = node.float("fieldOfView");
    if fov > 0.0 && fov < PI {
        return fov;
    }
    findings.warn(node.at_field("fieldOfView"), format!("the fieldOfView {fov} does not lie in (0, pi); pi/4 is used"));
    PI / 4.0
}

/// A view of the world: where it is, where it looks, and the matrix that brings eye space (x right, y up, -z ahead) into clip space.
struct View {
    eye: DVec3,
    forward: DVec3,
    up: DVec3,
    clip: DMat4,
}

impl View {
    /// Rows of the matrix from world to (s q, t q, r q, q).
    fn rows(&self) -> [[f32; 4]; 4] {
        let side = self.forward.cross(self.up);
        let axes = [side, self.up, -self.forward];
        let row = |a: DVec3| a.extend(-a.dot(self.eye));
        let eye = DMat4::from_cols(row(axes[0]), row(axes[1]), row(axes[2]), DVec4::W).transpose();
        let half = DMat4::from_translation(DVec3::splat(0.5)) * DMat4::from_scale(DVec3::splat(0.5));
        let rows = (half * self.clip * eye).transpose();
        [rows.x_axis, rows.y_axis, rows.z_axis, rows.w_axis].map(|r| r.as_vec4().to_array())
    }
}

/// The matrix of a light, whose projection is complete; `None` for a point light, which looks nowhere in particular.
pub(super) fn light_matrix(light: &Light) -> Option<[[f32; 4]; 4]> {
    let p = &light.projection;
    let (near, far) = (f64::from(p.near), f64::from(p.far));
    let (forward, clip) = match light.shape {
        LightShape::Directional { direction } => (direction, orthographic(p.rectangle.map(f64::from), near, far)),
        LightShape::Spot { direction, .. } => (direction, perspective(f64::from(p.angle), 1.0, near, far)),
        LightShape::Point { .. } => return None,
    };
    Some(View { eye: space::wide(p.location), forward: space::wide(forward), up: space::wide(p.up), clip }.rows())
}

/// The matrix of a viewpoint. The bound one has the aspect of the picture, any other projects with its field of view along both axes; one
/// without a field of view projects this rectangle.
pub(super) fn viewpoint_matrix(camera: &Camera, is_bound: bool, rectangle: Option<[f32; 4]>, ends: [f32; 2]) -> [[f32; 4]; 4] {
    let aspect = if is_bound { ASPECT } else { 1.0 };
    let [near, far] = ends.map(f64::from);
    let clip = match camera.lens {
        Lens::Perspective { fov, .. } => perspective(f64::from(fov), aspect, near, far),
        Lens::Orthographic { half_height: half } => orthographic(rectangle.unwrap_or([-half, -half, half, half]).map(f64::from), near, far),
    };
    View { eye: space::wide(camera.eye), forward: space::wide(camera.forward), up: space::wide(camera.up), clip }.rows()
}

/// OpenGL's perspective: `fov` radians along the smaller side, `aspect` width over height.
fn perspective(fov: f64, aspect: f64, near: f64, far: f64) -> DMat4 {
    let (sin, cos) = math::sin_cos_degrees(fov.to_degrees() / 2.0);
    let cot = cos / sin;
    let depth = near - far;
    DMat4::from_cols(
        DVec4::new(cot / aspect.max(1.0), 0.0, 0.0, 0.0),
        DVec4::new(0.0, cot * aspect.min(1.0), 0.0, 0.0),
        DVec4::new(0.0, 0.0, (near + far) / depth, -1.0),
        DVec4::new(0.0, 0.0, 2.0 * near * far / depth, 0.0),
    )
}

fn orthographic([left, bottom, right, top]: [f64; 4], near: f64, far: f64) -> DMat4 {
    let size = DVec3::new(right - left, top - bottom, near - far);
    let middle = DVec3::new(right + left, top + bottom, near + far) / size;
    DMat4::from_cols(
        DVec4::new(2.0 / size.x, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / size.y, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 2.0 / size.z, 0.0),
        DVec4::new(-middle.x, -middle.y, middle.z, 1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn project(rows: [[f32; 4]; 4], p: [f32; 3]) -> [f32; 4] {
        rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    fn close(found: [f32; 4], wanted: [f32; 4]) {
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?} is not {wanted:?}");
    }

    #[test]
    fn a_square_view_maps_its_frustum_to_the_unit_cube() {
        let clip = perspective(std::f64::consts::FRAC_PI_2, 1.0, 1.0, 9.0);
        let rows = View { eye: DVec3::new(1.0, 2.0, 3.0), forward: DVec3::NEG_Z, up: DVec3::Y, clip }.rows();
        close(project(rows, [1.0, 2.0, 2.0]), [0.5, 0.5, 0.0, 1.0]);
        close(project(rows, [2.0, 3.0, 2.0]), [1.0, 1.0, 0.0, 1.0]);
        close(project(rows, [1.0, 2.0, -6.0]), [4.5, 4.5, 9.0, 9.0]);
        assert!(project(rows, [1.0, 2.0, 4.0])[3] < 0.0, "behind");
    }

    #[test]
    fn a_rectangle_maps_to_the_unit_square_and_depth_to_the_unit_interval() {
        let clip = orthographic([-1.0, -2.0, 3.0, 4.0], 1.0, 5.0);
        let rows = View { eye: DVec3::ZERO, forward: DVec3::NEG_Y, up: DVec3::Z, clip }.rows();
        // Side is forward x up = -Y x Z = -X.
        close(project(rows, [1.0, -1.0, -2.0]), [0.0, 0.0, 0.0, 1.0]);
        close(project(rows, [-3.0, -5.0, 4.0]), [1.0, 1.0, 1.0, 1.0]);
    }
}
