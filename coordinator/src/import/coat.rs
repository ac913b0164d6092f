//! A clear coat folded into the one specular lobe that the canonical material has (KHR_materials_clearcoat).
//!
//! The coat is a second lobe of index of refraction 1.5 above the material. Its reflectance at normal incidence joins that of the lobe
//! below, which it dims, and the roughness of the two is their mean weighted by reflectance. Energy and the strength of reflections
//! survive; a sharp highlight upon a blurred one becomes one of middle width. A lobe of its own would cost every material a third term for
//! a rare one.
//!
//! Where textures multiply the factors, the fold is that of their means, and factors change in proportion: textures keep their contrast.
//! A fold texel by texel would need a new set of textures for each material, and still be wrong wherever two of them are laid differently.

use super::images::Images;
use kiln_proto::{
    scene::{LayerMode, MetallicRoughness, TextureRef},
    units::Rgb,
};

/// Reflectance of a coat at normal incidence: index of refraction 1.5.
const COAT: f32 = 0.04;
/// Most that an index of refraction reflects at normal incidence here (one of about 39); 0, which reflects everything, stands for more.
const MOST: f32 = 0.9;

/// A coat: its strength, [0, 1], and its roughness.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coat {
    pub(super) strength: f32,
    pub(super) roughness: f32,
}

/// Means of the textures that multiply the factors of a material; one where there is none.
#[derive(Debug, Clone, Copy)]
struct Means {
    base: [f32; 3],
    metallic: f32,
    roughness: f32,
    specular: f32,
    specular_color: [f32; 3],
}

impl Means {
    fn of(m: &MetallicRoughness, images: &mut Images) -> Self {
        let mut mean = |texture: Option<TextureRef>| texture.map_or([1.0; 4], |t| images.mean(t.texture));
        let [_, roughness, metallic, _] = mean(m.metallic_roughness_texture);
        let [.., specular] = mean(m.specular_texture);
        let [r, g, b, _] = mean(m.specular_color_texture);
        let mut base = [1.0; 3];
        for layer in &m.layers {
            if let LayerMode::Modulate { scale } = layer.mode {
                let texture = mean(Some(layer.texture));
                base = std::array::from_fn(|c| base[c] * texture[c] * scale);
            }
        }
        Self { base, metallic, roughness, specular, specular_color: [r, g, b] }
    }
}

/// Reflectance at normal incidence of an index of refraction against air; 0 stands for total reflection.
fn reflectance_of(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// The index of refraction that reflects this share, at most [`MOST`], at normal incidence.
fn ior_of(reflectance: f32) -> f32 {
    let r = reflectance.sqrt();
    (1.0 + r) / (1.0 - r)
}

/// Lays a coat over a material whose textures are among these.
pub(super) fn fold(m: &mut MetallicRoughness, coat: Coat, images: &mut Images) {
    let means = Means::of(m, images);
    fold_with(m, coat, &means);
}

fn fold_with(m: &mut MetallicRoughness, Coat { strength, roughness }: Coat, means: &Means) {
    let coat = strength * COAT;
    let (specular, metallic) = (m.specular * means.specular, m.metallic * means.metallic);
    let base = product(m.base_color.to_array(), means.base);
    let below = product(m.specular_color.to_array(), means.specular_color).map(|c| (reflectance_of(m.ior) * c).min(1.0) * specular);
    let together = below.map(|f| coat + (1.0 - coat) * f);
    let weight = (1.0 - coat) * (metallic * greatest(base) + (1.0 - metallic) * greatest(below));
    let rough = m.roughness * means.roughness;
    let alpha = (coat * roughness * roughness + weight * rough * rough) / (coat + weight).max(f32::MIN_POSITIVE);
    m.roughness = factor(alpha.sqrt(), means.roughness);
    m.base_color = Rgb::from(std::array::from_fn(|c| factor(base[c] + metallic * coat * (1.0 - base[c]), means.base[c])));
    m.specular = factor(specular.max(strength), means.specular);
    reflect(m, together, means);
}

/// Gives a material this reflectance at normal incidence, in the mean, by its index of refraction and its specular colour.
fn reflect(m: &mut MetallicRoughness, reflectance: [f32; 3], means: &Means) {
    let strength = (m.specular * means.specular).max(f32::MIN_POSITIVE);
    let wanted = reflectance.map(|f| (f / strength).min(1.0));
    let most = greatest(wanted).max(f32::MIN_POSITIVE);
    // What reflects everything (specular-glossiness) goes on saying so: its colour is the reflectance.
    let whole = if m.ior == 0.0 || most > MOST { 1.0 } else { most };
    m.ior = if whole < 1.0 { ior_of(most) } else { 0.0 };
    let divided = |c: usize| wanted[c] / whole / if means.specular_color[c] > 0.0 { means.specular_color[c] } else { 1.0 };
    m.specular_color = Rgb::from(std::array::from_fn(divided));
}

/// What a texture of this mean has to be multiplied with, at most one, to have the mean `wanted`.
fn factor(wanted: f32, mean: f32) -> f32 {
    if mean > 0.0 { (wanted / mean).min(1.0) } else { 1.0 }
}

fn greatest(v: [f32; 3]) -> f32 {
    v.into_iter().fold(0.0, f32::max)
}

fn product(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| a[c] * b[c])
}

#[cfg(test)]
mod tests {
    use super::*;

    const BARE: Means = Means { base: [1.0; 3], metallic: 1.0, roughness: 1.0, specular: 1.0, specular_color: [1.0; 3] };

    fn coated(mut m: MetallicRoughness, strength: f32, roughness: f32, means: Means) -> MetallicRoughness {
        fold_with(&mut m, Coat { strength, roughness }, &means);
        m
    }

    fn normal_incidence(m: &MetallicRoughness) -> [f32; 3] {
        m.specular_color.to_array().map(|c| (reflectance_of(m.ior) * c).min(1.0) * m.specular)
    }

    #[test]
    fn a_coat_adds_its_reflectance_and_its_gloss() {
        let m = coated(MetallicRoughness::plain(Rgb::splat(0.5), 0.0, 0.8), 1.0, 0.0, BARE);
        let expected = COAT + (1.0 - COAT) * COAT;
        assert!(normal_incidence(&m).iter().all(|f| (f - expected).abs() < 1e-5), "{m:?}");
        assert!((m.roughness * m.roughness - 0.64 * 0.96 / 1.96).abs() < 1e-4, "{m:?}");
        assert_eq!(m.base_color, Rgb::splat(0.5));
    }

    #[test]
    fn no_coat_changes_nothing_and_one_over_nothing_shines() {
        let before = MetallicRoughness { specular: 0.5, ior: 1.8, ..MetallicRoughness::plain(Rgb::splat(0.5), 0.3, 0.4) };
        let m = coated(before.clone(), 0.0, 0.0, BARE);
        assert!((m.ior - before.ior).abs() < 1e-4 && (m.roughness - 0.4).abs() < 1e-6 && m.specular == 0.5);
        let matt = MetallicRoughness { specular: 0.0, ..MetallicRoughness::plain(Rgb::splat(0.5), 0.0, 1.0) };
        let matt = coated(matt, 0.5, 0.1, BARE);
        assert!(normal_incidence(&matt).iter().all(|f| (f - 0.02).abs() < 1e-5), "{matt:?}");
        assert!((matt.roughness - 0.1).abs() < 1e-6);
        let metal = coated(MetallicRoughness::plain(Rgb::new(1.0, 0.5, 0.0), 1.0, 0.2), 1.0, 0.2, BARE);
        assert!((metal.base_color.b - 0.04).abs() < 1e-6 && (metal.roughness - 0.2).abs() < 1e-6);
    }

    /// Car paint as exporters write it: factors of one, and a texture that says no metal and a roughness of 0.8.
    #[test]
    fn textures_rule_where_there_are_any() {
        let paint = MetallicRoughness::plain(Rgb::WHITE, 1.0, 1.0);
        let textures = Means { base: [0.5, 0.25, 0.0], metallic: 0.0, roughness: 0.8, ..BARE };
        let m = coated(paint, 1.0, 0.0, textures);
        let plain = coated(MetallicRoughness::plain(Rgb::new(0.5, 0.25, 0.0), 0.0, 0.8), 1.0, 0.0, BARE);
        assert!((m.roughness * 0.8 - plain.roughness).abs() < 1e-5, "{m:?}");
        assert_eq!((m.metallic, m.base_color, m.ior), (1.0, Rgb::WHITE, plain.ior));
        // Textures of specular strength and colour: the mean reflectance is that of the same material without them.
        let shiny = MetallicRoughness { ior: 2.0, ..MetallicRoughness::plain(Rgb::WHITE, 0.0, 0.5) };
        let m = coated(shiny.clone(), 1.0, 0.5, Means { specular: 0.5, specular_color: [1.0, 0.5, 0.25], ..BARE });
        let factors = MetallicRoughness { specular: 0.5, specular_color: Rgb::new(1.0, 0.5, 0.25), ..shiny };
        let expected = normal_incidence(&coated(factors, 1.0, 0.5, BARE));
        let found =
            m.specular_color.to_array().into_iter().zip([1.0, 0.5, 0.25]).map(|(c, t)| c * t * reflectance_of(m.ior) * m.specular * 0.5);
        assert!(found.zip(expected).all(|(f, e)| (f - e).abs() < 1e-5), "{m:?}");
    }

    /// Specular-glossiness is ior 0, and its specular colour the reflectance.
    #[test]
    fn what_reflects_everything_is_coated_like_the_rest() {
        let gloss =
            MetallicRoughness { ior: 0.0, specular_color: Rgb::new(0.95, 0.5, 0.0), ..MetallicRoughness::plain(Rgb::BLACK, 0.0, 0.5) };
        let m = coated(gloss, 1.0, 0.0, BARE);
        assert_eq!(m.ior, 0.0);
        let expected = [0.04 + 0.96 * 0.95, 0.04 + 0.96 * 0.5, 0.04];
        assert!(normal_incidence(&m).iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-6), "{m:?}");
        assert!(m.roughness < 0.5 && m.roughness > 0.45, "{m:?}");
    }
}
