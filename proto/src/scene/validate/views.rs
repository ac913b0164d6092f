//! What looks at the scene: cameras, projectors, and lights as cameras.

use super::{InvalidScene, finite, is_unit, within};
use crate::scene::{Camera, Lens, Light, LightShape, Projection, Projector, Scene};
use glam::Vec3;
use std::f32::consts::PI;

impl Scene {
    /// A projector: it belongs to a light that exists, and its matrix has numbers.
    pub(super) fn check_projector(&self, p: &Projector) -> Result<(), InvalidScene> {
        let owner = || format!("projector `{}`", p.name);
        p.light.iter().try_for_each(|light| within(owner, "light", *light, self.lights.len()))?;
        if p.matrix.as_flattened().iter().all(|v| v.is_finite()) { Ok(()) } else { Err(InvalidScene::NotFinite { owner: owner() }) }
    }
}

/// A camera of the author's: a place, two directions and a lens.
pub(super) fn check_camera(c: &Camera) -> Result<(), InvalidScene> {
    let bad = |reason| Err(InvalidScene::Light { what: "camera", name: c.name.clone(), reason });
    if ![c.eye, c.forward, c.up].iter().all(|v| finite(v)) {
        return Err(InvalidScene::NotFinite { owner: format!("camera `{}`", c.name) });
    }
    if !is_unit(c.forward) || !is_upright(c.up, c.forward) {
        return bad("looks along a direction or has an up that is not unit, or the two are not orthogonal");
    }
    match c.lens {
        Lens::Perspective { fov, .. } if !(fov > 0.0 && fov <= PI) => bad("has a field of view outside (0, pi]"),
        Lens::Orthographic { half_height } if !(half_height > 0.0 && half_height.is_finite()) => {
            bad("shows a height that is not a finite number above zero")
        }
        _ => Ok(()),
    }
}

/// The light as a camera. A light of a format without shadow maps has no projection: all of it is zero.
pub(super) fn check_projection(l: &Light) -> Result<(), InvalidScene> {
    let p = &l.projection;
    if *p == Projection::default() {
        return Ok(());
    }
    let bad = |reason| Err(InvalidScene::Light { what: "light", name: l.name.clone(), reason });
    if !(p.near >= 0.0 && p.near < p.far && p.far.is_finite()) {
        return bad("has a projection whose near and far are not finite numbers, near from zero on and below far");
    }
    let along = match l.shape {
        LightShape::Point { .. } => None,
        LightShape::Spot { direction, .. } | LightShape::Directional { direction } => Some(direction),
    };
    if !along.map_or(is_unit(p.up), |direction| is_upright(p.up, direction)) {
        return bad("has a projection whose up is not unit, or not orthogonal to the light's direction");
    }
    let [left, bottom, right, top] = p.rectangle;
    let framed = match l.shape {
        LightShape::Directional { .. } => finite(&p.rectangle) && left < right && bottom < top,
        _ => p.rectangle == [0.0; 4],
    };
    if !framed {
        return bad("has a projection rectangle that is not left, bottom, right, top with left < right and bottom < top");
    }
    if !finite(&p.location) {
        return bad("has a projection location that is not finite");
    }
    let opens = match l.shape {
        LightShape::Spot { .. } => p.angle > 0.0 && p.angle < PI,
        _ => p.angle == 0.0,
    };
    if !opens {
        return bad("has a projection angle outside (0, pi)");
    }
    if p.automatic < 16 { Ok(()) } else { bad("has a projection with unknown automatic values") }
}

fn is_upright(up: [f32; 3], forward: [f32; 3]) -> bool {
    is_unit(up) && Vec3::from_array(up).dot(Vec3::from_array(forward)).abs() < 1e-3
}
