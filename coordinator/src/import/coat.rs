//! A clear coat folded into the one specular lobe that the canonical material has (KHR_materials_clearcoat).
//!
//! The coat is a second lobe of index of refraction 1.5 above the material. Its reflectance at normal incidence joins that of the lobe below,
//! which it dims, and the roughness of the two is their mean weighted by reflectance. Energy and the strength of reflections survive; a sharp
//! highlight upon a blurred one becomes one of middle width. A lobe of its own would cost every material a third term for a rare one.

use kiln_proto::{scene::MetallicRoughness, units::Rgb};

/// Reflectance of a coat at normal incidence: index of refraction 1.5.
const COAT: f32 = 0.04;
/// Most that a dielectric reflects at normal incidence here: an index of refraction of about 39.
const MOST: f32 = 0.9;

/// Reflectance at normal incidence of an index of refraction against air; 0 stands for total reflection.
pub(super) fn reflectance_of(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// The index of refraction that reflects this share at normal incidence.
pub(super) fn ior_of(reflectance: f32) -> f32 {
    let r = reflectance.clamp(0.0, MOST).sqrt();
    (1.0 + r) / (1.0 - r)
}

/// Lays a coat of this strength, [0, 1], and roughness over a material. One that reflects everything (ior 0) has nothing to gain.
pub(super) fn fold(m: &mut MetallicRoughness, strength: f32, roughness: f32) {
    if m.ior == 0.0 {
        return;
    }
    let coat = strength * COAT;
    let below = m.specular_color.to_array().map(|c| (reflectance_of(m.ior) * c).min(1.0) * m.specular);
    let together = below.map(|f| coat + (1.0 - coat) * f);
    let most = together.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let metal = m.base_color.max_channel();
    let weight = (1.0 - coat) * (m.metallic * metal + (1.0 - m.metallic) * below.iter().copied().fold(0.0, f32::max));
    let alpha = (coat * roughness * roughness + weight * m.roughness * m.roughness) / (coat + weight).max(f32::MIN_POSITIVE);
    m.specular = m.specular.max(strength);
    m.specular_color = Rgb::from(together.map(|f| f / most));
    m.ior = ior_of(most / m.specular.max(f32::MIN_POSITIVE));
    m.base_color = Rgb::from(m.base_color.to_array().map(|c| c + m.metallic * coat * (1.0 - c)));
    m.roughness = alpha.sqrt().min(1.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal_incidence(m: &MetallicRoughness) -> [f32; 3] {
        m.specular_color.to_array().map(|c| (reflectance_of(m.ior) * c).min(1.0) * m.specular)
    }

    #[test]
    fn a_coat_adds_its_reflectance_and_its_gloss() {
        let mut m = MetallicRoughness::plain(Rgb::splat(0.5), 0.0, 0.8);
        fold(&mut m, 1.0, 0.0);
        let expected = COAT + (1.0 - COAT) * COAT;
        assert!(normal_incidence(&m).iter().all(|f| (f - expected).abs() < 1e-5), "{m:?}");
        assert!((m.roughness * m.roughness - 0.64 * 0.96 / 1.96).abs() < 1e-4, "{m:?}");
        assert_eq!(m.base_color, Rgb::splat(0.5));
    }

    #[test]
    fn no_coat_changes_nothing_and_one_over_nothing_shines() {
        let before = MetallicRoughness { specular: 0.5, ior: 1.8, ..MetallicRoughness::plain(Rgb::splat(0.5), 0.3, 0.4) };
        let mut m = before.clone();
        fold(&mut m, 0.0, 0.0);
        assert!((m.ior - before.ior).abs() < 1e-4 && (m.roughness - 0.4).abs() < 1e-6 && m.specular == 0.5);
        let mut matt = MetallicRoughness { specular: 0.0, ..MetallicRoughness::plain(Rgb::splat(0.5), 0.0, 1.0) };
        fold(&mut matt, 0.5, 0.1);
        assert!(normal_incidence(&matt).iter().all(|f| (f - 0.02).abs() < 1e-5), "{matt:?}");
        assert!((matt.roughness - 0.1).abs() < 1e-6);
        let mut metal = MetallicRoughness::plain(Rgb::new(1.0, 0.5, 0.0), 1.0, 0.2);
        fold(&mut metal, 1.0, 0.2);
        assert!((metal.base_color.b - 0.04).abs() < 1e-6 && (metal.roughness - 0.2).abs() < 1e-6);
    }
}
