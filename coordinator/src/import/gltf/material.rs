//! Materials: glTF's own and the extensions that a bake can honour; the others are said by name.
//!
//! Materials become canonical ones as primitives ask for them: what nothing shows never reaches the scene, nor do its images.

use super::{
    json::Json,
    report::{ANY, POSITIVE, Report, SHARE},
    texture::Textures,
};
use crate::import::coat;
use kiln_proto::{
    limits, math,
    scene::{AlphaMode, Coding, LayerMode, Mapping, Material, MetallicRoughness, NormalMap, Opacity, Reflection, TextureLayer},
    units::Rgb,
};
use std::collections::BTreeMap;

/// What is looked up and not read, with the member that says how strong it is.
const SKIPPED: [(&str, &str); 5] = [
    ("KHR_materials_anisotropy", "anisotropyStrength"),
    ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor"),
    ("KHR_materials_dispersion", "dispersion"),
    ("KHR_materials_iridescence", "iridescenceFactor"),
    ("KHR_materials_sheen", "sheenColorFactor"),
];

/// The materials of a scene so far.
pub(super) struct Materials<'a, 'd> {
    /// The textures that they use.
    pub(super) textures: Textures<'a, 'd>,
    list: Vec<Json<'d>>,
    converted: BTreeMap<Option<usize>, Converted>,
    ids: BTreeMap<(Option<usize>, Option<[u32; 3]>), u32>,
    /// Canonical materials.
    pub(super) materials: Vec<Material>,
}

/// A material as far as the scene can hold it.
#[derive(Debug, Clone)]
struct Converted {
    material: Material,
    two_sided: bool,
}

/// The base colour of a material, whichever extension it is written in.
#[derive(Clone, Copy)]
struct Base<'d> {
    /// What has the texture as a member.
    owner: Option<Json<'d>>,
    /// The name of that member.
    texture: &'static str,
    color: Rgb,
    alpha: f32,
}

/// What a primitive needs to know of its material.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    /// Index into the scene's materials.
    pub(super) id: u32,
    /// Whether it is seen from both sides.
    pub(super) two_sided: bool,
    /// Sets of texture coordinates that it looks up.
    pub(super) sets: Vec<u32>,
    /// Whether it has a normal map.
    pub(super) has_normal_map: bool,
}

impl<'a, 'd> Materials<'a, 'd> {
    pub(super) fn new(list: Vec<Json<'d>>, textures: Textures<'a, 'd>) -> Self {
        Self { textures, list, converted: BTreeMap::new(), ids: BTreeMap::new(), materials: vec![] }
    }

    /// The name of a material.
    pub(super) fn name(&self, index: Option<usize>) -> String {
        let Some(index) = index else { return "default".to_owned() };
        let name = self.list.get(index).and_then(|json| json.get("name")?.string());
        name.filter(|n| !n.trim().is_empty()).map_or_else(|| format!("material{index}"), |n| n.into_owned())
    }

    /// The material of a primitive; `tint` is the mean of its vertex colours, for materials that cannot take them vertex by vertex.
    pub(super) fn choose(&mut self, index: Option<usize>, tint: Option<[f32; 3]>, report: &mut Report<'_>) -> Chosen {
        if !self.converted.contains_key(&index) {
            let converted = self.convert(index, report);
            self.converted.insert(index, converted);
        }
        let Converted { material, two_sided } = self.converted[&index].clone();
        let tint = tint.filter(|t| material.reflection == Reflection::None && *t != [1.0; 3]);
        if let (Some(_), Some(json)) = (tint, index.and_then(|i| self.list.get(i))) {
            report.count(*json, "unlit primitives with vertex colours were given the mean of them");
        }
        let sets = material.textures().filter_map(|t| match t.mapping {
            Mapping::Uv { set } => Some(set),
            Mapping::Projected { .. } => None,
        });
        let (sets, has_normal_map) = (sets.collect(), material.normal_map.is_some());
        let next = self.materials.len() as u32;
        let id = *self.ids.entry((index, tint.map(|t| t.map(f32::to_bits)))).or_insert(next);
        if id == next {
            let emission = tint.map_or(material.emission, |t| product(material.emission, Rgb::from(t)));
            self.materials.push(Material { emission, ..material });
        }
        Chosen { id, two_sided, sets, has_normal_map }
    }

    /// Checks what unused materials and textures refer to, and looks at unused images.
    pub(super) fn check_unused(&self, report: &mut Report<'_>) {
        for (_, json) in self.list.iter().enumerate().filter(|(i, _)| !self.converted.contains_key(&Some(*i))) {
            let extensions = json.get("extensions").into_iter().flat_map(|e| e.members().map(|(_, extension)| extension));
            for owner in [Some(*json), json.get("pbrMetallicRoughness")].into_iter().flatten().chain(extensions) {
                for (_, info) in owner.members().filter(|(name, _)| name.ends_with("Texture")) {
                    self.textures.check(info, report);
                }
            }
        }
        self.textures.check_unused(report);
    }

    fn convert(&mut self, index: Option<usize>, report: &mut Report<'_>) -> Converted {
        let name = self.name(index);
        let Some(json) = index.and_then(|i| self.list.get(i)).copied() else {
            // glTF 2.0, section 3.9: all properties at their defaults.
            let plain = MetallicRoughness::plain(Rgb::WHITE, 1.0, 1.0);
            return Converted { material: Material::new(name, Reflection::MetallicRoughness(plain)), two_sided: false };
        };
        let two_sided = report.boolean(json, "doubleSided", false);
        let base = Self::base(json, report);
        let opacity = self.opacity(json, base, report);
        if json.get("occlusionTexture").is_some() {
            report.warn_once(json, "occlusion", "occlusion textures are not read: the bake computes what they stand for (said once)");
        }
        if json.extension("KHR_materials_unlit").is_some() {
            return Converted { material: self.unlit(name, json, base, opacity, report), two_sided };
        }
        for (extension, strength) in SKIPPED {
            let Some(found) = json.extension(extension) else { continue };
            let is_off =
                |v: Json<'_>| v.number() == Some(0.0) || (v.items().next().is_some() && v.items().all(|i| i.number() == Some(0.0)));
            if found.get(strength).is_some_and(|v| !is_off(v)) {
                report.warn_once(json, extension, format!("{extension} is not read; its materials are imported without it (said once)"));
            }
        }
        let mut pbr = match json.extension("KHR_materials_pbrSpecularGlossiness") {
            Some(extension) => self.specular_glossiness(extension, base, report),
            None => self.metallic_roughness(base, report),
        };
        self.specular(json, &mut pbr, report);
        self.transmission(json, &mut pbr, report);
        self.clearcoat(json, &mut pbr, report);
        let mut material = Material { opacity, ..Material::new(name, Reflection::MetallicRoughness(pbr)) };
        self.emission(json, &mut material, report);
        self.normal_map(json, &mut material, report);
        Converted { material, two_sided }
    }

    fn base(json: Json<'d>, report: &mut Report<'_>) -> Base<'d> {
        let (owner, factor, texture) = match json.extension("KHR_materials_pbrSpecularGlossiness") {
            Some(extension) => (Some(extension), "diffuseFactor", "diffuseTexture"),
            None => (json.get("pbrMetallicRoughness"), "baseColorFactor", "baseColorTexture"),
        };
        let [r, g, b, alpha] = owner.and_then(|owner| report.vector(owner, factor, &SHARE)).unwrap_or([1.0; 4]);
        Base { owner, texture, color: rgb([r, g, b]), alpha: alpha as f32 }
    }

    fn opacity(&mut self, json: Json<'d>, base: Base<'d>, report: &mut Report<'_>) -> Opacity {
        let mode = match report.string(json, "alphaMode").as_deref() {
            None | Some("OPAQUE") => return Opacity::OPAQUE,
            Some("MASK") => AlphaMode::Mask { cutoff: report.number(json, "alphaCutoff", 0.5, &POSITIVE) as f32 },
            Some("BLEND") => AlphaMode::Blend,
            Some(other) => {
                report.error(json, format!("`{other}` is no alpha mode; there are OPAQUE, MASK and BLEND"));
                return Opacity::OPAQUE;
            }
        };
        let found = base.owner.and_then(|owner| self.textures.find(owner, base.texture, Coding::Srgb, true, report));
        Opacity { mode, factor: base.alpha, texture: found.filter(|f| f.transparent).map(|f| f.reference) }
    }

    /// KHR_materials_unlit: what shines with its base colour and reflects nothing.
    fn unlit(&mut self, name: String, json: Json<'d>, base: Base<'d>, opacity: Opacity, report: &mut Report<'_>) -> Material {
        report.warn_once(
            json,
            "unlit",
            "unlit materials are taken as shining with their colour; they light what is around them (said once)",
        );
        let texture = base.owner.and_then(|owner| self.textures.find(owner, base.texture, Coding::Srgb, false, report));
        let emission_texture = texture.map(|t| t.reference);
        Material { emission: base.color, emission_texture, opacity, ..Material::new(name, Reflection::None) }
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

    /// KHR_materials_pbrSpecularGlossiness: a dielectric whose index of refraction and specular colour give the stated reflectance.
    fn specular_glossiness(&mut self, extension: Json<'d>, base: Base<'d>, report: &mut Report<'_>) -> MetallicRoughness {
        let specular = rgb(report.vector(extension, "specularFactor", &SHARE).unwrap_or([1.0; 3]));
        let gloss = report.number(extension, "glossinessFactor", 1.0, &SHARE) as f32;
        report.warn_once(extension, "gloss", "KHR_materials_pbrSpecularGlossiness was converted to metallic-roughness (said once)");
        let texture = self.textures.find(extension, "specularGlossinessTexture", Coding::Srgb, true, report);
        let rough = texture.filter(|t| t.transparent).and_then(|t| self.textures.roughness_of(extension, t.reference, gloss, report));
        let most = specular.max_channel();
        let ior = coat::ior_of(most);
        let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
        MetallicRoughness {
            layers: self.layers(extension, base.texture, report),
            ior,
            specular_color: specular * scale,
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

    /// KHR_materials_transmission, and KHR_materials_volume as a thin wall that tints what passes it.
    fn transmission(&mut self, json: Json<'d>, pbr: &mut MetallicRoughness, report: &mut Report<'_>) {
        if let Some(extension) = json.extension("KHR_materials_transmission") {
            pbr.transmission = report.number(extension, "transmissionFactor", 0.0, &SHARE) as f32;
            pbr.transmission_texture = self.linear(extension, "transmissionTexture", report);
        }
        let Some(extension) = json.extension("KHR_materials_volume") else { return };
        let thickness = report.number(extension, "thicknessFactor", 0.0, &POSITIVE);
        if thickness <= 0.0 || pbr.transmission <= 0.0 {
            return;
        }
        let message = "volumes are taken as thin walls: light is tinted over `thicknessFactor` and goes straight on (said once)";
        report.warn_once(extension, "volume", message);
        if extension.get("thicknessTexture").is_some() {
            report.count(extension, "thickness textures were not read; the thickness factor is used everywhere");
        }
        let color = report.vector::<3>(extension, "attenuationColor", &SHARE).unwrap_or([1.0; 3]);
        let distance = extension.get("attenuationDistance").and_then(|at| report.number_at(at, &POSITIVE));
        if let Some(distance) = distance.filter(|d| *d > 0.0) {
            // Beer's law over the thickness; what is reflected is not tinted.
            let share = (thickness / distance) as f32;
            let tint = color.map(|c| 1.0 - pbr.transmission + pbr.transmission * math::pow(c as f32, share));
            pbr.base_color = product(pbr.base_color, Rgb::from(tint));
        }
    }

    fn clearcoat(&mut self, json: Json<'d>, pbr: &mut MetallicRoughness, report: &mut Report<'_>) {
        let Some(extension) = json.extension("KHR_materials_clearcoat") else { return };
        let strength = report.number(extension, "clearcoatFactor", 0.0, &SHARE) as f32;
        let roughness = report.number(extension, "clearcoatRoughnessFactor", 0.0, &SHARE) as f32;
        if strength <= 0.0 {
            return;
        }
        report.warn_once(extension, "coat", "clear coats are folded into the specular lobe below them (said once)");
        let textures = ["clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"];
        if textures.iter().any(|name| extension.get(name).is_some()) {
            report.count(extension, "textures of clear coats were not read; the factors are used everywhere");
        }
        coat::fold(pbr, strength, roughness);
    }

    fn emission(&mut self, json: Json<'d>, material: &mut Material, report: &mut Report<'_>) {
        let strength = json.extension("KHR_materials_emissive_strength");
        let strength = strength.map_or(1.0, |e| report.number(e, "emissiveStrength", 1.0, &POSITIVE)) as f32;
        material.emission = rgb(report.vector(json, "emissiveFactor", &SHARE).unwrap_or([0.0; 3])) * strength;
        if !(0.0..=limits::BRIGHTEST).contains(&material.emission.max_channel()) {
            let [r, g, b] = material.emission.to_array();
            report.error(json, format!("the emission is {r:e} {g:e} {b:e}; at most {:e} is possible", limits::BRIGHTEST));
        }
        if !material.emission.is_black() {
            material.emission_texture = self.textures.find(json, "emissiveTexture", Coding::Srgb, false, report).map(|t| t.reference);
        }
    }

    fn normal_map(&mut self, json: Json<'d>, material: &mut Material, report: &mut Report<'_>) {
        let Some(info) = json.get("normalTexture") else { return };
        let scale = report.number(info, "scale", 1.0, &ANY) as f32;
        let texture = self.linear(json, "normalTexture", report);
        material.normal_map = texture.map(|texture| NormalMap { texture, scale });
    }

    fn layers(&mut self, owner: Json<'d>, name: &str, report: &mut Report<'_>) -> Vec<TextureLayer> {
        let found = self.textures.find(owner, name, Coding::Srgb, false, report);
        found.map(|t| TextureLayer { texture: t.reference, mode: LayerMode::Modulate { scale: 1.0 } }).into_iter().collect()
    }

    fn linear(&mut self, owner: Json<'d>, name: &str, report: &mut Report<'_>) -> Option<kiln_proto::scene::TextureRef> {
        self.textures.find(owner, name, Coding::Linear, false, report).map(|t| t.reference)
    }
}

fn rgb(v: [f64; 3]) -> Rgb {
    Rgb::from(v.map(|c| c as f32))
}

fn product(a: Rgb, b: Rgb) -> Rgb {
    Rgb::new(a.r * b.r, a.g * b.g, a.b * b.b)
}
