//! What materials reflect and let through: metallic-roughness, the older specular-glossiness, and the extensions of both.

use super::{
    json::Json,
    material::{Base, Materials, rgb},
    property::{POSITIVE, SHARE},
    report::Report,
};
use crate::import::coat::{self, Coat};
use kiln_proto::{
    math,
    scene::{Coding, LayerMode, MetallicRoughness, TextureLayer, TextureRef},
    units::Rgb,
};

/// The deepest that light goes into a volume, in attenuation distances: whatever is absorbed at all is gone by then.
const DEEPEST: f32 = 1e9;

/// What a volume does to the light that crosses it (KHR_materials_volume), as a thin wall that tints what passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Volume {
    /// Thickness as a share of the attenuation distance; the thickness is one of the mesh's space, the distance of the world
    /// (KHR_materials_volume, "Properties").
    share: f32,
    /// What is left of light after the distance.
    color: [f32; 3],
}

impl Volume {
    /// Tints a material whose node stretches lengths by this much: Beer's law over the thickness. There is one base colour for what goes
    /// through and for what is scattered back, so this is exact where the transmission is 1, and else right for their sum: of an opaque
    /// volume with a transmission of 0.5 both become half of what they were, while the one should be gone and the other whole.
    pub(super) fn tint(self, pbr: &mut MetallicRoughness, stretch: f32) {
        let depth = (self.share * stretch).clamp(f32::MIN_POSITIVE, DEEPEST);
        let left = self.color.map(|c| if c < 1.0 { 1.0 - pbr.transmission + pbr.transmission * math::pow(c, depth) } else { 1.0 });
        pbr.base_color = pbr.base_color * Rgb::from(left);
    }
}

impl<'d> Materials<'_, 'd> {
    /// The reflection of a material and the volume behind it.
    pub(super) fn reflection(&mut self, json: Json<'d>, base: Base<'d>, report: &mut Report<'_>) -> (MetallicRoughness, Option<Volume>) {
        let mut pbr = match json.extension("KHR_materials_pbrSpecularGlossiness") {
            Some(extension) => self.specular_glossiness(extension, base, report),
            None => {
                let mut pbr = self.metallic_roughness(base, report);
                self.specular(json, &mut pbr, report);
                pbr
            }
        };
        self.transmission(json, &mut pbr, report);
        self.clearcoat(json, &mut pbr, report);
        let volume = volume(json, &pbr, report);
        (pbr, volume)
    }

    fn metallic_roughness(&mut self, base: Base<'d>, report: &mut Report<'_>) -> MetallicRoughness {
        let Some(pbr) = base.owner else { return MetallicRoughness::plain(Rgb::WHITE, 1.0, 1.0) };
        let metallic = report.number(pbr, "metallicFactor", 1.0, &SHARE) as f32;
        let roughness = report.number(pbr, "roughnessFactor", 1.0, &SHARE) as f32;
        MetallicRoughness {
            layers: self.layers(pbr, base.texture, report),
            metallic_roughness_texture: self.linear(pbr, "metallicRoughnessTexture", report),
            ..MetallicRoughness::plain(base.color, metallic, roughness)
        }
    }

    /// KHR_materials_pbrSpecularGlossiness: a dielectric with the index of refraction 0, which KHR_materials_ior has for this: its
    /// specular colour is the reflectance.
    fn specular_glossiness(&mut self, extension: Json<'d>, base: Base<'d>, report: &mut Report<'_>) -> MetallicRoughness {
        let specular = rgb(report.vector(extension, "specularFactor", &SHARE).unwrap_or([1.0; 3]));
        let gloss = report.number(extension, "glossinessFactor", 1.0, &SHARE) as f32;
        report.warn_once(extension, "gloss", "KHR_materials_pbrSpecularGlossiness was converted to metallic-roughness (said once)");
        let texture = self.textures.find(extension, "specularGlossinessTexture", Coding::Srgb, true, report);
        let rough = texture.filter(|t| t.transparent).and_then(|t| self.textures.roughness_of(extension, t.reference, gloss, report));
        MetallicRoughness {
            layers: self.layers(extension, base.texture, report),
            ior: 0.0,
            specular_color: specular,
            specular_color_texture: texture.map(|t| t.reference),
            metallic_roughness_texture: rough,
            ..MetallicRoughness::plain(base.color, 0.0, if rough.is_some() { 1.0 } else { 1.0 - gloss })
        }
    }

    /// KHR_materials_ior and KHR_materials_specular.
    fn specular(&mut self, json: Json<'d>, pbr: &mut MetallicRoughness, report: &mut Report<'_>) {
        if let Some(extension) = json.extension("KHR_materials_ior") {
            let ior = report.number(extension, "ior", 1.5, &POSITIVE) as f32;
            if ior != 0.0 && ior < 1.0 {
                report.error(extension, format!("the index of refraction is {ior}; it must be 0 or at least 1"));
            }
            pbr.ior = ior;
        }
        let Some(extension) = json.extension("KHR_materials_specular") else { return };
        pbr.specular = report.number(extension, "specularFactor", 1.0, &SHARE) as f32;
        pbr.specular_color = rgb(report.vector(extension, "specularColorFactor", &POSITIVE).unwrap_or([1.0; 3]));
        let strength = self.textures.find(extension, "specularTexture", Coding::Linear, true, report);
        pbr.specular_texture = strength.filter(|t| t.transparent).map(|t| t.reference);
        let color = self.textures.find(extension, "specularColorTexture", Coding::Srgb, false, report);
        pbr.specular_color_texture = color.map(|t| t.reference);
    }

    /// KHR_materials_transmission, that of a thin wall.
    fn transmission(&mut self, json: Json<'d>, pbr: &mut MetallicRoughness, report: &mut Report<'_>) {
        let Some(extension) = json.extension("KHR_materials_transmission") else { return };
        pbr.transmission = report.number(extension, "transmissionFactor", 0.0, &SHARE) as f32;
        pbr.transmission_texture = self.linear(extension, "transmissionTexture", report);
    }

    /// KHR_materials_clearcoat, folded into the lobe below.
    fn clearcoat(&mut self, json: Json<'d>, pbr: &mut MetallicRoughness, report: &mut Report<'_>) {
        let Some(extension) = json.extension("KHR_materials_clearcoat") else { return };
        let mut strength = report.number(extension, "clearcoatFactor", 0.0, &SHARE) as f32;
        let mut roughness = report.number(extension, "clearcoatRoughnessFactor", 0.0, &SHARE) as f32;
        if strength <= 0.0 {
            return;
        }
        report.warn_once(extension, "coat", "clear coats are folded into the specular lobe below them (said once)");
        for (name, factor, channel) in [("clearcoatTexture", &mut strength, 0), ("clearcoatRoughnessTexture", &mut roughness, 1)] {
            if extension.get(name).is_some() {
                report.count(extension, "textures of clear coats count by their means");
                *factor *= self.textures.mean(extension, name, Coding::Linear, report).map_or(1.0, |mean| mean[channel]);
            }
        }
        if extension.get("clearcoatNormalTexture").is_some() {
            report.count(extension, "normal maps of clear coats were not read");
        }
        coat::fold(pbr, Coat { strength, roughness }, self.textures.images);
    }

    fn layers(&mut self, owner: Json<'d>, name: &str, report: &mut Report<'_>) -> Vec<TextureLayer> {
        let found = self.textures.find(owner, name, Coding::Srgb, false, report);
        found.map(|t| TextureLayer { texture: t.reference, mode: LayerMode::Modulate { scale: 1.0 } }).into_iter().collect()
    }

    /// A texture of numbers.
    pub(super) fn linear(&mut self, owner: Json<'d>, name: &str, report: &mut Report<'_>) -> Option<TextureRef> {
        self.textures.find(owner, name, Coding::Linear, false, report).map(|t| t.reference)
    }
}

fn volume(json: Json<'_>, pbr: &MetallicRoughness, report: &mut Report<'_>) -> Option<Volume> {
    let extension = json.extension("KHR_materials_volume")?;
    let thickness = report.number(extension, "thicknessFactor", 0.0, &POSITIVE);
    if thickness <= 0.0 || pbr.transmission <= 0.0 {
        return None;
    }
    let message = "volumes are taken as thin walls: light is tinted over `thicknessFactor` and goes straight on (said once)";
    report.warn_once(extension, "volume", message);
    if extension.get("thicknessTexture").is_some() {
        report.count(extension, "thickness textures were not read; the thickness factor is used everywhere");
    }
    let color = report.vector::<3>(extension, "attenuationColor", &SHARE).unwrap_or([1.0; 3]).map(|c| c as f32);
    let distance = extension.get("attenuationDistance").and_then(|at| report.number_at(at, &POSITIVE)).filter(|d| *d > 0.0)?;
    Some(Volume { share: (thickness / distance).min(f64::from(DEEPEST)) as f32, color })
}
