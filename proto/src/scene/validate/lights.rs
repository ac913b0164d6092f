//! Lights with their shadow maps, and the environment.

use super::{InvalidScene, finite, is_share, is_strength, is_unit, views};
use crate::{
    limits,
    scene::{Environment, Falloff, Light, LightShape, Scene, ShadowMap},
};

impl Scene {
    /// A light: how strong it is, where it shines, how it is seen as a camera.
    pub(super) fn check_light(&self, l: &Light) -> Result<(), InvalidScene> {
        let bad = |reason| Err(InvalidScene::Light { what: "light", name: l.name.clone(), reason });
        if !is_strength(l.intensity) {
            return bad("has an intensity outside [0, 1e13]");
        }
        if !is_strength(l.ambient) {
            return bad("has an ambient term outside [0, 1e13]");
        }
        if !is_share(l.shadow_intensity) {
            return bad("has a shadow intensity outside [0, 1]");
        }
        if !is_placed(l.shape) {
            return bad("has a position, a direction or an angle out of range");
        }
        let weakened = match l.falloff {
            Falloff::InverseSquare { range } => range.is_none_or(|r| r > 0.0 && r.is_finite()),
            Falloff::Polynomial { attenuation, radius } => attenuation.iter().all(|a| *a >= 0.0 && a.is_finite()) && radius >= 0.0,
        };
        if !weakened {
            return bad("has a falloff out of range");
        }
        views::check_projection(l)?;
        l.shadow_map.iter().try_for_each(|map| check_shadow_map("light", &l.name, map))?;
        l.texture.iter().try_for_each(|t| self.check_texture_ref(&l.name, t))
    }
}

fn is_placed(shape: LightShape) -> bool {
    match shape {
        LightShape::Point { position } => finite(&position),
        LightShape::Directional { direction } => is_unit(direction),
        LightShape::Spot { position, direction, cut_off, beam_width, .. } => {
            finite(&position)
                && is_unit(direction)
                && (0.0..=std::f32::consts::PI).contains(&cut_off)
                && (0.0..=cut_off).contains(&beam_width)
        }
    }
}

/// The shadow map of a light, or that of a part for a light; `what` and `name` say whose.
pub(super) fn check_shadow_map(what: &'static str, name: &str, map: &ShadowMap) -> Result<(), InvalidScene> {
    let bad = |reason| Err(InvalidScene::Light { what, name: name.to_owned(), reason });
    if !(1..=limits::TEXTURE_SIDE).contains(&map.size) {
        return bad("has a shadow map whose size is zero or larger than a texture may be");
    }
    if !finite(&[map.scale, map.bias]) {
        return bad("has a shadow map whose scale or bias is not finite");
    }
    Ok(())
}

/// The environment: its size is that of its pixels, and none of them is no radiance.
pub(super) fn check_environment(e: &Environment) -> Result<(), InvalidScene> {
    let bad = |reason| Err(InvalidScene::Light { what: "environment", name: e.name.clone(), reason });
    let pixels = u64::from(e.width) * u64::from(e.height);
    if pixels == 0 || pixels > limits::ENVIRONMENT_PIXELS || e.rgb.len() as u64 != pixels {
        return bad("has a size that does not fit its pixels");
    }
    let usable = 0.0..=limits::BRIGHTEST;
    if !e.rotation.is_finite() || !usable.contains(&e.intensity) {
        return bad("has a rotation that is not finite or an intensity outside [0, 1e13]");
    }
    if e.rgb.as_flattened().iter().all(|v| usable.contains(v)) { Ok(()) } else { bad("has radiance outside [0, 1e13]") }
}
