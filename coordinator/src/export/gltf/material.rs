//! Materials: metallic-roughness as it is, with the extensions that it needs, and Phong's as near as that model comes.
//!
//! A matt Phong material is exact: without a specular share what is left of glTF's is Lambert's. A glossy one keeps its reflectance at
//! normal incidence (KHR_materials_specular), takes the roughness whose microfacets have the width of its lobe, and grows brighter at
//! grazing angles, which Phong's does not. What is a mirror or has a lobe and no diffuse colour becomes a metal of that colour.

use super::{ExportError, Writer, number, numbers, scaled, texture::Textures};
use kiln_proto::{
    scene::{AlphaMode, LayerMode, Material, MetallicRoughness, Phong, Reflection, Scene},
    units::Rgb,
};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Reflectance of a dielectric of the default index of refraction, 1.5, at normal incidence (glTF 2.0, appendix B).
const DIELECTRIC: f32 = 0.04;

/// The coordinates that a primitive needs for its material.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Coordinates {
    /// The scene's sets, at least so many.
    pub(super) sets: usize,
    /// Behind them: a set and a map of it that glTF cannot say.
    pub(super) extra: Vec<(u32, [[f32; 3]; 2])>,
}

/// The materials of a file.
pub(super) struct Materials<'s> {
    /// Whose they are.
    pub(super) scene: &'s Scene,
    /// The most sets that a surface has: where extra sets begin.
    pub(super) most_sets: usize,
    known: BTreeMap<(u32, bool), (usize, Coordinates)>,
    list: Vec<Value>,
    /// The textures that they use.
    pub(super) textures: Textures<'s>,
}

impl<'s> Materials<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        let most_sets = scene.surfaces.iter().map(|s| s.uv_sets.len()).max().unwrap_or_default();
        Self { scene, most_sets, known: BTreeMap::new(), list: vec![], textures: Textures::new(scene) }
    }

    /// The index of a material, seen from both sides or one, and the coordinates that it looks up.
    pub(super) fn choose(&mut self, index: u32, double_sided: bool, writer: &mut Writer<'_>) -> Result<(usize, Coordinates), ExportError> {
        if let Some((known, coordinates)) = self.known.get(&(index, double_sided)) {
            return Ok((*known, coordinates.clone()));
        }
        let scene = self.scene;
        let material = &scene.materials[index as usize];
        let mut maker = Maker { all: self, writer, material, coordinates: Coordinates::default(), json: Map::new() };
        maker.make()?;
        let Maker { mut json, mut coordinates, .. } = maker;
        if !coordinates.extra.is_empty() {
            coordinates.sets = self.most_sets;
        }
        json.insert("name".into(), json!(material.name));
        if double_sided {
            json.insert("doubleSided".into(), json!(true));
        }
        self.list.push(Value::Object(json));
        self.known.insert((index, double_sided), (self.list.len() - 1, coordinates.clone()));
        Ok((self.list.len() - 1, coordinates))
    }

    /// Materials, textures, images and samplers.
    pub(super) fn into_lists(self) -> [Vec<Value>; 4] {
        let [textures, images, samplers] = self.textures.into_lists();
        [self.list, textures, images, samplers]
    }
}

/// One material while it is made.
pub(super) struct Maker<'m, 's, 'w> {
    /// The materials made before it.
    pub(super) all: &'m mut Materials<'s>,
    /// Where bytes and remarks go.
    pub(super) writer: &'m mut Writer<'w>,
    /// What it is made of.
    pub(super) material: &'s Material,
    /// The coordinates that it looks up.
    pub(super) coordinates: Coordinates,
    /// What it is so far.
    pub(super) json: Map<String, Value>,
}

impl Maker<'_, '_, '_> {
    fn make(&mut self) -> Result<(), ExportError> {
        let material = self.material;
        match &material.reflection {
            Reflection::None => self.shining()?,
            Reflection::Phong(phong) => self.phong(phong)?,
            Reflection::MetallicRoughness(pbr) => self.metallic_roughness(pbr)?,
        }
        if let Some(map) = &material.normal_map
            && let Some(mut info) = self.texture(&map.texture, None, true)?
        {
            info["scale"] = number(map.scale);
            self.json.insert("normalTexture".into(), info);
        }
        match material.opacity.mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { cutoff } => {
                self.json.insert("alphaMode".into(), json!("MASK"));
                self.json.insert("alphaCutoff".into(), number(cutoff));
            }
            AlphaMode::Blend => {
                self.json.insert("alphaMode".into(), json!("BLEND"));
            }
        }
        Ok(())
    }

    /// A remark about the material.
    pub(super) fn note(&mut self, what: &'static str) {
        self.writer.notes.count(what, &self.material.name);
    }

    fn extension(&mut self, name: &'static str, value: Value) {
        self.writer.extensions.insert(name);
        let extensions = self.json.entry("extensions").or_insert_with(|| json!({}));
        extensions[name] = value;
    }

    /// What only emits: unlit where its colour is one, else a black material that emits.
    fn shining(&mut self) -> Result<(), ExportError> {
        let material = self.material;
        let layer = material.emission_texture;
        if material.emission.max_channel() <= 1.0 {
            self.base(material.emission, layer, [0.0, 1.0], None)?;
            self.extension("KHR_materials_unlit", json!({}));
            return Ok(());
        }
        self.base(Rgb::BLACK, None, [0.0, 1.0], None)?;
        self.extension("KHR_materials_specular", json!({"specularFactor": 0}));
        self.emission()
    }

    fn phong(&mut self, phong: &Phong) -> Result<(), ExportError> {
        let Phong { diffuse, layers, specular, specular_texture, lobe, .. } = phong;
        let roughness = lobe.roughness();
        if !specular.is_black() {
            self.note("glossy Phong materials were written as metallic-roughness ones, which reflect more at grazing angles");
        }
        if !specular.is_black() && diffuse.is_black() && layers.iter().all(|l| matches!(l.mode, LayerMode::Modulate { .. })) {
            self.base(*specular, *specular_texture, [1.0, roughness], None)?;
            return self.emission();
        }
        let (factor, layer) = self.base_layer(*diffuse, layers);
        self.base(factor, layer, [0.0, roughness], None)?;
        if specular.is_black() {
            self.extension("KHR_materials_specular", json!({"specularFactor": 0}));
        } else {
            let color = (*specular * (1.0 / DIELECTRIC)).to_array();
            let mut extension = json!({"specularColorFactor": numbers(&color)});
            if let Some(reference) = specular_texture
                && let Some(info) = self.texture(reference, None, false)?
            {
                extension["specularColorTexture"] = info;
            }
            self.extension("KHR_materials_specular", extension);
        }
        self.emission()
    }

    fn metallic_roughness(&mut self, pbr: &MetallicRoughness) -> Result<(), ExportError> {
        let (factor, layer) = self.base_layer(pbr.base_color, &pbr.layers);
        self.base(factor, layer, [pbr.metallic, pbr.roughness], pbr.metallic_roughness_texture)?;
        if pbr.ior != 1.5 {
            self.extension("KHR_materials_ior", json!({"ior": number(pbr.ior)}));
        }
        let mut specular = Map::new();
        if pbr.specular != 1.0 {
            specular.insert("specularFactor".into(), number(pbr.specular));
        }
        if pbr.specular_color != Rgb::WHITE {
            specular.insert("specularColorFactor".into(), numbers(&pbr.specular_color.to_array()));
        }
        // The strength is in the alpha channel: an image without one changes nothing.
        let strength = pbr.specular_texture.filter(|t| self.all.scene.textures[t.texture as usize].has_alpha);
        for (name, reference, linear) in [("specularTexture", strength, true), ("specularColorTexture", pbr.specular_color_texture, false)]
        {
            if let Some(reference) = reference
                && let Some(info) = self.texture(&reference, None, linear)?
            {
                specular.insert(name.into(), info);
            }
        }
        if !specular.is_empty() {
            self.extension("KHR_materials_specular", Value::Object(specular));
        }
        if pbr.transmission > 0.0 {
            let mut extension = json!({"transmissionFactor": number(pbr.transmission)});
            if let Some(reference) = pbr.transmission_texture
                && let Some(info) = self.texture(&reference, None, true)?
            {
                extension["transmissionTexture"] = info;
            }
            self.extension("KHR_materials_transmission", extension);
        }
        self.emission()
    }

    fn emission(&mut self) -> Result<(), ExportError> {
        let material = self.material;
        if material.emission.is_black() {
            return Ok(());
        }
        let strength = scaled(material.emission.max_channel());
        let factor = (material.emission * (1.0 / strength)).to_array().map(|c| c.min(1.0));
        self.json.insert("emissiveFactor".into(), numbers(&factor));
        if strength > 1.0 {
            self.extension("KHR_materials_emissive_strength", json!({"emissiveStrength": number(strength)}));
        }
        if let Some(reference) = &material.emission_texture
            && let Some(info) = self.texture(reference, None, false)?
        {
            self.json.insert("emissiveTexture".into(), info);
        }
        Ok(())
    }
}
