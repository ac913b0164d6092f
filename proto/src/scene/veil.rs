//! What is seen through a surface along a straight line: past its holes, between its blended grains, through clear glass.
//!
//! Glass with a rough face scatters and is no part of this: what it lets through is in its light field.

use super::{Material, MetallicRoughness, Place, Reflection, Scene};
use crate::units::Rgb;

/// The least alpha of a lobe of facets; below it a surface is perfectly smooth. f32 directions cannot tell narrower lobes from one
/// direction: they differ by a few 1e-7, and a lobe's width is about 2 alpha.
pub const LEAST_ALPHA: f32 = 1e-3;

/// alpha of a perceptual roughness: its square, or 0 where that is below [`LEAST_ALPHA`].
#[must_use]
pub fn alpha_of(roughness: f32) -> f32 {
    let alpha = roughness * roughness;
    if alpha < LEAST_ALPHA { 0.0 } else { alpha }
}

/// (1 - c)^5 of a cosine (Schlick 1994).
#[must_use]
#[inline(always)]
pub fn fifth(cos: f32) -> f32 {
    let m = (1.0 - cos).max(0.0);
    let square = m * m;
    square * square * m
}

/// How a place on a surface veils what lies behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Veil {
    /// The share of its own light, that of the light field, that is seen.
    pub own: f32,
    /// The share of the light from behind that is seen, per channel.
    pub through: Rgb,
}

impl Veil {
    /// Nothing of what lies behind.
    pub const OPAQUE: Veil = Veil { own: 1.0, through: Rgb::BLACK };
}

impl Material {
    /// Whether anything may be seen through it along a straight line.
    #[must_use]
    pub fn is_veil(&self) -> bool {
        self.may_be_clear() || self.lets_through()
    }

    /// Whether it may be clear glass somewhere: transmissive, and smooth or of a roughness that a texture decides.
    #[must_use]
    pub fn may_be_clear(&self) -> bool {
        matches!(&self.reflection, Reflection::MetallicRoughness(m)
            if m.transmission > 0.0 && (m.metallic_roughness_texture.is_some() || alpha_of(m.roughness) <= 0.0))
    }
}

impl Scene {
    /// How a place of this material veils what lies behind it, looked at under an angle whose cosine is `cos`.
    #[must_use]
    pub fn veil_at(&self, material: &Material, place: &Place, cos: f32) -> Veil {
        let own = self.coverage_at(&material.opacity, place);
        Veil { own, through: Rgb::splat(1.0 - own) + self.clear_at(material, place, cos) * own }
    }

    /// What clear glass lets straight through: its base colour, less what its two faces together reflect (KHR_materials_transmission,
    /// thin-walled; Schlick's Fresnel term of KHR_materials_ior and KHR_materials_specular). Black for rough faces and all other materials.
    #[must_use]
    pub fn clear_at(&self, material: &Material, place: &Place, cos: f32) -> Rgb {
        match &material.reflection {
            Reflection::MetallicRoughness(m) if m.transmission > 0.0 => self.glass_at(m, place, cos),
            _ => Rgb::BLACK,
        }
    }

    fn glass_at(&self, m: &MetallicRoughness, place: &Place, cos: f32) -> Rgb {
        let texel = |t: &Option<_>| t.as_ref().and_then(|t| self.texture_at(t, place)).unwrap_or([1.0; 4]);
        let [_, rough, metal, _] = texel(&m.metallic_roughness_texture);
        if alpha_of(m.roughness * rough) > 0.0 {
            return Rgb::BLACK;
        }
        let ratio = (m.ior - 1.0) / (m.ior + 1.0);
        let [r, g, b, _] = texel(&m.specular_color_texture);
        let f0 = (m.specular_color * Rgb::new(r, g, b) * (ratio * ratio)).max_channel().min(1.0);
        let reflected = m.specular * texel(&m.specular_texture)[3] * (f0 + (1.0 - f0) * fifth(cos));
        let share = (1.0 - m.metallic * metal) * m.transmission * texel(&m.transmission_texture)[0] * (1.0 - reflected);
        self.layered(m.base_color, &m.layers, place) * share
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AlphaMode, Opacity};
    use super::*;

    #[test]
    fn veils_add_up_to_what_is_there() {
        let place = Place { surface: 0, triangle: 0, bary: [0.3; 2], position: [0.0; 3] };
        let at = |m: &Material, cos| Scene::empty().veil_at(m, &place, cos);
        let matt = Material::matt("m", Rgb::splat(0.5));
        assert!(!matt.is_veil() && at(&matt, 1.0) == Veil::OPAQUE);
        let blend = Material { opacity: Opacity { mode: AlphaMode::Blend, factor: 0.25, texture: None }, ..matt };
        assert!(blend.is_veil() && at(&blend, 0.5) == Veil { own: 0.25, through: Rgb::splat(0.75) });
        let glass =
            |roughness| MetallicRoughness { transmission: 0.5, ..MetallicRoughness::plain(Rgb::new(1.0, 0.5, 0.0), 0.0, roughness) };
        let clear = Material::new("g", Reflection::MetallicRoughness(glass(0.0)));
        let through = at(&clear, 1.0).through;
        // 4 % are reflected, half of the rest goes through.
        assert!(clear.is_veil() && (through.r - 0.48).abs() < 1e-6 && (through.g - 0.24).abs() < 1e-6 && through.b == 0.0);
        assert_eq!(at(&clear, 0.0).through, Rgb::BLACK, "all is reflected at grazing angles");
        let rough = Material::new("r", Reflection::MetallicRoughness(glass(0.3)));
        assert!(!rough.is_veil() && at(&rough, 1.0) == Veil::OPAQUE);
    }
}
