//! From MTL to the canonical material: defaults, illumination models, energy, textures.

use super::map::Map;
use super::mtl::{Library, RawMaterial, Stated};
use crate::import::{
    Bundle,
    bundle::Found,
    findings::{At, Findings},
    images::{Images, Wanted},
};
use kiln_proto::{
    scene::{Coding, LayerMode, Lobe, Material, Phong, Reflection, TextureLayer, TextureRef, energy_scale},
    units::Rgb,
};
use std::collections::BTreeMap;

/// Phong exponents from here on are taken for mirrors where the illumination model asks for ray-traced reflection.
const MIRROR_EXPONENT: f32 = 1000.0;

/// Canonical materials and textures, made as faces ask for them: what no face uses never reaches the scene.
pub(super) struct Materials<'a> {
    bundle: &'a Bundle,
    library: &'a Library,
    ids: BTreeMap<Option<String>, u32>,
    /// The materials so far.
    pub(super) materials: Vec<Material>,
    /// The textures so far.
    pub(super) images: Images,
}

impl<'a> Materials<'a> {
    pub(super) fn new(bundle: &'a Bundle, library: &'a Library) -> Self {
        Self { bundle, library, ids: BTreeMap::new(), materials: vec![], images: Images::default() }
    }

    /// The id of the material of this name; unknown names and faces without a material share a grey one.
    pub(super) fn id(&mut self, name: Option<&str>, at: At<'_>, findings: &mut Findings) -> u32 {
        let known = name.filter(|n| self.library.contains_key(*n));
        if let (Some(name), None) = (name, known) {
            findings.warn_once(
                at,
                &format!("usemtl {name}"),
                format!("the material `{name}` is defined nowhere; a grey one is used instead"),
            );
        }
        let key = known.map(str::to_owned);
        if let Some(id) = self.ids.get(&key) {
            return *id;
        }
        let material = match known.and_then(|n| self.library.get_key_value(n)) {
            Some((name, raw)) => self.convert(name, raw, findings),
            None => default_material(),
        };
        let id = self.materials.len() as u32;
        self.materials.push(material);
        self.ids.insert(key, id);
        id
    }

    fn convert(&mut self, name: &str, raw: &RawMaterial, findings: &mut Findings) -> Material {
        let file = raw.file.as_str();
        let value = |stated: Stated<Rgb>, has_map: bool| stated.map_or(if has_map { Rgb::WHITE } else { Rgb::BLACK }, |(_, v)| v);
        let mut diffuse = value(raw.diffuse, raw.diffuse_map.is_some());
        let emission = value(raw.emission, raw.emission_map.is_some());
        let (mut specular, lobe) = reflection(raw);
        if let Some((line, opacity)) = raw.opacity
            && opacity < 1.0
        {
            let message = format!("the material `{name}` is transparent (opacity {opacity}); it is baked opaque");
            findings.warn(At::line(file, line), message);
        }
        if let (Some((line, kd)), Some(_)) = (raw.diffuse, &raw.diffuse_map)
            && kd.is_black()
        {
            findings
                .warn(At::line(file, line), format!("Kd of `{name}` is 0, so its map_Kd stays black; 1 1 1 shows the texture as it is"));
        }
        let scale = energy_scale(diffuse, specular);
        if scale < 1.0 {
            let line = raw.specular.map(|(l, _)| l).or(raw.diffuse.map(|(l, _)| l)).unwrap_or(raw.line);
            let total = (diffuse + specular).max_channel();
            let message =
                format!("the material `{name}` reflects {total} times the light it receives (Kd + Ks); both were scaled by {scale}");
            findings.warn(At::line(file, line), message);
            (diffuse, specular) = (diffuse * scale, specular * scale);
        }
        let layer = |texture| TextureLayer { texture: TextureRef::plain(texture, 0), mode: LayerMode::Modulate { scale: 1.0 } };
        let layers = self.texture(raw, raw.diffuse_map.as_ref(), findings).map(layer).into_iter().collect();
        let emission_texture = self.texture(raw, raw.emission_map.as_ref(), findings).map(|t| TextureRef::plain(t, 0));
        let phong = Phong { layers, specular, lobe, ..Phong::matt(diffuse) };
        Material { emission, emission_texture, ..Material::new(name, Reflection::Phong(phong)) }
    }

    /// The texture that a map names; `None` also where it was refused, which is then an error.
    fn texture(&mut self, raw: &RawMaterial, map: Option<&(u32, Map)>, findings: &mut Findings) -> Option<u32> {
        let (line, map) = map?;
        let at = At::line(raw.file.as_str(), *line);
        let path = match self.bundle.find(&raw.file, &map.file) {
            Some(Found::Exact(path)) => path,
            Some(Found::Near(path)) => {
                findings.warn(at, format!("the texture `{}` is not in the bundle; `{path}` is used instead", map.file));
                path
            }
            None => {
                findings.error(at, format!("the texture `{}` is not in the bundle", map.file));
                return None;
            }
        };
        let wanted = Wanted { coding: Coding::Srgb, alpha: false };
        let image = self.images.file(self.bundle, path, wanted, at, findings)?;
        if image.transparent {
            let message = format!("the texture `{path}` has transparent pixels; they are baked opaque");
            findings.warn_once(at, &format!("transparent {path}"), message);
        }
        Some(image.id)
    }
}

/// Ks and the shape of its lobe. Models 0 and 1 have no highlights; 3 and 5 ask for ray-traced reflection, which is a mirror where the
/// exponent is missing or very high, and a Phong lobe otherwise.
fn reflection(raw: &RawMaterial) -> (Rgb, Lobe) {
    let exponent = raw.exponent.map(|(_, n)| n);
    let phong = Lobe::Phong { exponent: exponent.unwrap_or(1.0) };
    let specular = raw.specular.map_or(Rgb::BLACK, |(_, ks)| ks);
    match raw.model.map(|(_, m)| m) {
        Some(0 | 1) => (Rgb::BLACK, Lobe::Phong { exponent: 1.0 }),
        Some(3 | 5) if exponent.is_none_or(|n| n >= MIRROR_EXPONENT) && !specular.is_black() => (specular, Lobe::Mirror),
        _ => (specular, phong),
    }
}

/// What faces without a material are made of.
fn default_material() -> Material {
    Material::matt("default", Rgb::splat(0.5))
}
