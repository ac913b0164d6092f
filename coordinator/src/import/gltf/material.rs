//! Materials: glTF's own and the extensions that a bake can honour; the others are said by name.
//!
//! Materials become canonical ones as primitives ask for them: what nothing shows never reaches the scene, nor do its images.

use super::{
    json::Json,
    property::{ANY, POSITIVE, SHARE},
    reflection::Volume,
    report::Report,
    texture::Textures,
};
use kiln_proto::{
    limits,
    scene::{AlphaMode, Coding, Mapping, Material, MetallicRoughness, NormalMap, Opacity, Reflection},
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
    ids: BTreeMap<Variant, u32>,
    /// Canonical materials.
    pub(super) materials: Vec<Material>,
}

/// A canonical material by the file's and what a node makes of it: a tint, and how much it stretches a volume.
type Variant = (Option<usize>, Option<[u32; 3]>, Option<u32>);

/// A material as far as the scene can hold it.
#[derive(Debug)]
struct Converted {
    material: Material,
    two_sided: bool,
    volume: Option<Volume>,
}

/// The base colour of a material, whichever extension it is written in.
#[derive(Clone, Copy)]
pub(super) struct Base<'d> {
    /// What has the texture as a member.
    pub(super) owner: Option<Json<'d>>,
    /// The name of that member.
    pub(super) texture: &'static str,
    /// The factor of the colour.
    pub(super) color: Rgb,
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
    fn name(&self, index: Option<usize>) -> String {
        let Some(index) = index else { return "default".to_owned() };
        self.list.get(index).and_then(|json| json.name()).unwrap_or_else(|| format!("material{index}"))
    }

    /// The material of a primitive. `tint` is the mean of its vertex colours, for materials that cannot take them vertex by vertex;
    /// `stretch` by how much lengths of its mesh are stretched in the world, for the thickness of volumes.
    pub(super) fn choose(
        &mut self,
        index: Option<usize>,
        tint: impl FnOnce() -> Option<[f32; 3]>,
        stretch: f64,
        report: &mut Report<'_>,
    ) -> Chosen {
        if !self.converted.contains_key(&index) {
            let converted = self.convert(index, report);
            self.converted.insert(index, converted);
        }
        let Converted { material, two_sided, volume } = &self.converted[&index];
        let tint = if material.reflection == Reflection::None { tint().filter(|t| *t != [1.0; 3]) } else { None };
        if let (Some(_), Some(json)) = (tint, index.and_then(|i| self.list.get(i))) {
            report.count(*json, "unlit primitives with vertex colours were given the mean of them");
        }
        let sets = material.textures().filter_map(|t| match t.mapping {
            Mapping::Uv { set } => Some(set),
            Mapping::Projected { .. } => None,
        });
        let (sets, has_normal_map) = (sets.collect(), material.normal_map.is_some());
        let next = self.materials.len() as u32;
        let stretch = rounded(stretch);
        let key = (index, tint.map(|t| t.map(f32::to_bits)), volume.map(|_| stretch.to_bits()));
        let id = *self.ids.entry(key).or_insert(next);
        if id == next {
            let mut made = material.clone();
            made.emission = tint.map_or(made.emission, |t| made.emission * Rgb::from(t));
            if let (Some(volume), Reflection::MetallicRoughness(pbr)) = (volume, &mut made.reflection) {
                volume.tint(pbr, stretch);
            }
            self.materials.push(made);
        }
        Chosen { id, two_sided: *two_sided, sets, has_normal_map }
    }

    /// Checks which textures materials refer to, those among them that are not looked up, and looks at unused textures and images.
    pub(super) fn check(&self, report: &mut Report<'_>) {
        for json in &self.list {
            // What extensions of other makers call a texture may be anything.
            let extensions = json.get("extensions").into_iter().flat_map(Json::members);
            let extensions = extensions.filter(|(name, _)| name.starts_with("KHR_")).map(|(_, extension)| extension);
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
            return Converted { material: Material::new(name, Reflection::MetallicRoughness(plain)), two_sided: false, volume: None };
        };
        let two_sided = report.boolean(json, "doubleSided", false);
        let base = Self::base(json, report);
        let opacity = self.opacity(json, base, report);
        if json.get("occlusionTexture").is_some() {
            report.warn_once(json, "occlusion", "occlusion textures are not read: the bake computes what they stand for (said once)");
        }
        if json.extension("KHR_materials_unlit").is_some() {
            let material = self.unlit(name, json, base, opacity, report);
            return Converted { material, two_sided, volume: None };
        }
        for (extension, strength) in SKIPPED {
            let Some(found) = json.extension(extension) else { continue };
            let is_off =
                |v: Json<'_>| v.number() == Some(0.0) || (v.items().next().is_some() && v.items().all(|i| i.number() == Some(0.0)));
            if found.get(strength).is_some_and(|v| !is_off(v)) {
                report.warn_once(json, extension, format!("{extension} is not read; its materials are imported without it (said once)"));
            }
        }
        let (pbr, volume) = self.reflection(json, base, report);
        let mut material = Material { opacity, ..Material::new(name, Reflection::MetallicRoughness(pbr)) };
        self.emission(json, &mut material, report);
        self.normal_map(json, &mut material, report);
        Converted { material, two_sided, volume }
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
}

/// To 11 bits, a thousandth: rotated copies, which rounding stretches differently, share a material.
fn rounded(stretch: f64) -> f32 {
    f32::from_bits(((stretch as f32).to_bits() + 0x800) & !0xfff)
}

/// A colour.
pub(super) fn rgb(v: [f64; 3]) -> Rgb {
    Rgb::from(v.map(|c| c as f32))
}
