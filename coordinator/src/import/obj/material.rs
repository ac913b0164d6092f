//! From MTL to the canonical material: defaults, illumination models, energy, opacity, textures.
//!
//! Three kinds of material come out. What states numbers of the PBR extension (Pr, Pm and theirs) is metallic-roughness; what lets light
//! through by its illumination model is glass, a thin sheet; everything else is Phong's.

use super::{
    pictures::{Named, Pictures},
    raw::{Library, Number, RawMaterial, Role, Stated},
};
use crate::import::{
    Bundle,
    coat::{self, Coat},
    findings::{At, Findings},
    images::{Image, Images},
};
use kiln_proto::{
    scene::{
        AlphaMode, Coding, LayerMode, Lobe, Material, MetallicRoughness, NormalMap, Opacity, Phong, Reflection, TextureLayer, TextureRef,
        energy_scale,
    },
    units::Rgb,
};
use std::collections::BTreeMap;

/// Phong exponents from here on are taken for mirrors where the illumination model asks for ray-traced reflection.
const MIRROR_EXPONENT: f32 = 1000.0;
/// Where an opacity of an image is cut that is all or nothing.
const CUTOFF: f32 = 0.5;

/// Canonical materials and textures, made as faces ask for them: what no face uses never reaches the scene.
pub(super) struct Materials<'a> {
    library: &'a Library,
    ids: BTreeMap<Option<String>, u32>,
    /// The materials so far.
    pub(super) materials: Vec<Material>,
    /// The textures so far.
    pub(super) pictures: Pictures<'a>,
}

/// A texture of a material.
fn named(raw: &RawMaterial, role: Role) -> Option<Named<'_>> {
    raw.map(role).map(|(at, map)| Named { from: &raw.file, at, map })
}

impl<'a> Materials<'a> {
    pub(super) fn new(bundle: &'a Bundle, library: &'a Library, images: &'a mut Images) -> Self {
        Self { library, ids: BTreeMap::new(), materials: vec![], pictures: Pictures::new(bundle, images) }
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
            None => Material::matt("default", Rgb::splat(0.5)),
        };
        let id = self.materials.len() as u32;
        self.materials.push(material);
        self.ids.insert(key, id);
        id
    }

    fn convert(&mut self, name: &str, raw: &RawMaterial, findings: &mut Findings) -> Material {
        let base = named(raw, Role::Diffuse).and_then(|n| self.pictures.picture(n, Coding::Srgb, findings));
        say_black_factor(name, raw, findings);
        let mut opacity = self.opacity(name, raw, base, findings);
        let diffuse = factor(raw.diffuse, base.is_some());
        let layer = |texture| TextureLayer { texture, mode: LayerMode::Modulate { scale: 1.0 } };
        let layers: Vec<TextureLayer> = base.map(|(_, texture)| layer(texture)).into_iter().collect();
        let through = transmission(raw, &opacity);
        let reflection = if through > 0.0 || is_physical(raw) {
            let mut physical = self.physical(raw, diffuse, layers, findings);
            if through > 0.0 {
                glass(name, raw, through, &mut physical, findings);
                opacity = Opacity::OPAQUE;
            }
            // Over the glass, whose roughness is another.
            self.coat(raw, &mut physical, findings);
            Reflection::MetallicRoughness(physical)
        } else {
            Reflection::Phong(Phong { layers, ..self.phong(name, raw, diffuse, findings) })
        };
        let emission_texture = named(raw, Role::Emission).and_then(|n| self.pictures.picture(n, Coding::Srgb, findings)).map(|(_, t)| t);
        let emission = factor(raw.emission, emission_texture.is_some());
        let normal_map = self.normal_map(raw, findings);
        Material { emission, emission_texture, opacity, normal_map, ..Material::new(name, reflection) }
    }

    fn phong(&mut self, name: &str, raw: &RawMaterial, diffuse: Rgb, findings: &mut Findings) -> Phong {
        let shines = !matches!(raw.model, Some((_, 0 | 1)));
        let map = named(raw, Role::Specular).filter(|_| shines);
        let specular_texture = map.and_then(|n| self.pictures.picture(n, Coding::Srgb, findings)).map(|(_, t)| t);
        let specular = if shines { factor(raw.specular, specular_texture.is_some()) } else { Rgb::BLACK };
        let mut lobe = lobe(raw, specular);
        if let (Lobe::Phong { exponent }, Some(n)) = (&mut lobe, named(raw, Role::Exponent).filter(|_| !specular.is_black()))
            && let Some(mean) = self.pictures.mean(n, findings)
        {
            *exponent *= mean;
            findings.warn(n.at, format!("map_Ns is approximated by its mean: the exponent of `{name}` is {exponent} everywhere"));
        }
        let scale = energy_scale(diffuse, specular);
        if scale < 1.0 {
            let line = raw.specular.map(|(l, _)| l).or(raw.diffuse.map(|(l, _)| l)).unwrap_or(raw.line);
            let total = (diffuse + specular).max_channel();
            let message =
                format!("the material `{name}` reflects {total} times the light it receives (Kd + Ks); both were scaled by {scale}");
            findings.warn(At::line(raw.file.as_str(), line), message);
        }
        Phong { specular: specular * scale, specular_texture, lobe, ..Phong::matt(diffuse * scale) }
    }

    /// The PBR extension. Roughness that is not stated follows from the highlight, or is middling.
    fn physical(&mut self, raw: &RawMaterial, diffuse: Rgb, layers: Vec<TextureLayer>, findings: &mut Findings) -> MetallicRoughness {
        let (roughness, metalness) = (named(raw, Role::Roughness), named(raw, Role::Metallic));
        let texture = self.pictures.surface(roughness, metalness, findings);
        let metallic = raw.number(Number::Metallic).unwrap_or(if metalness.is_some() { 1.0 } else { 0.0 });
        let from_highlight = || raw.number(Number::Exponent).map_or(0.5, roughness_of);
        let rough = raw.number(Number::Roughness).unwrap_or_else(|| if roughness.is_some() { 1.0 } else { from_highlight() });
        let whole = if diffuse.max_channel() > 1.0 { diffuse * (1.0 / diffuse.max_channel()) } else { diffuse };
        if whole != diffuse {
            let at = At::line(raw.file.as_str(), raw.diffuse.map_or(raw.line, |(l, _)| l));
            findings.warn(at, "Kd exceeds 1; it was scaled to reflect no more light than there is");
        }
        let plain = MetallicRoughness::plain(whole, metallic, rough);
        let mut physical = MetallicRoughness { layers, metallic_roughness_texture: texture, ..plain };
        if let Some(ior) = raw.number(Number::Refraction).filter(|n| *n >= 1.0) {
            physical.ior = ior;
        }
        if is_physical(raw) && (raw.specular.is_some_and(|(_, ks)| !ks.is_black()) || raw.map(Role::Specular).is_some()) {
            let line = raw.specular.map_or(raw.line, |(l, _)| l);
            let message = "Ks and Ns of materials with numbers of the PBR extension were ignored (said once)";
            findings.warn_once(At::line(raw.file.as_str(), line), "Ks", message);
        }
        physical
    }

    /// Folds the coat that a material states into what lies below it.
    fn coat(&mut self, raw: &RawMaterial, below: &mut MetallicRoughness, findings: &mut Findings) {
        let Some(strength) = raw.number(Number::Coat).filter(|c| *c > 0.0) else { return };
        let message = "clear coats (Pc) are folded into the specular lobe below them (said once)";
        findings.warn_once(raw.at(Number::Coat), "coat", message);
        let coat = Coat { strength, roughness: raw.number(Number::CoatRoughness).unwrap_or(0.0) };
        coat::fold(below, coat, self.pictures.images);
    }

    /// `d`, else 1 - `Tr`, times map_d, else times the alpha channel of map_Kd.
    fn opacity(&mut self, name: &str, raw: &RawMaterial, base: Option<(Image, TextureRef)>, findings: &mut Findings) -> Opacity {
        let (d, inverse) = (raw.number(Number::Opacity), raw.number(Number::Transparency).map(|tr| 1.0 - tr));
        if let (Some(d), Some(inverse)) = (d, inverse)
            && (d - inverse).abs() > 1e-3
        {
            let message = format!("the material `{name}` is {d} opaque by `d` and {inverse} by `Tr`; `d` counts");
            findings.warn(raw.at(Number::Transparency), message);
        }
        let factor = d.or(inverse).unwrap_or(1.0);
        if factor == 0.0 {
            let at = raw.at(if d.is_some() { Number::Opacity } else { Number::Transparency });
            findings.warn(at, format!("the material `{name}` is invisible: its opacity is 0"));
        }
        let texture = match named(raw, Role::Opacity) {
            Some(map) if base.is_some_and(|(image, _)| !image.transparent) && is_colour_again(raw, map) => {
                let message =
                    format!("map_d is the picture of map_Kd, `{}`, which has no transparent pixels; it was ignored", map.map.file);
                findings.warn(map.at, message);
                None
            }
            Some(map) => self.pictures.opacity(map, findings),
            None => base,
        };
        let texture = texture.filter(|(image, _)| image.transparent);
        let mode = self.pictures.images.alpha_mode(factor, texture.map(|(image, _)| image), CUTOFF);
        if let (None, Some((image, _)), Some(map)) = (raw.map(Role::Opacity), texture, named(raw, Role::Diffuse)) {
            let how = if matches!(mode, AlphaMode::Mask { .. }) { "cut out" } else { "blended" };
            let path = &self.pictures.images.textures[image.id as usize].name;
            let message = format!("the texture `{path}` has transparent pixels; they are taken as opacity and {how}");
            findings.warn_once(map.at, &format!("transparent {path}"), message);
        }
        if mode == AlphaMode::Opaque { Opacity::OPAQUE } else { Opacity { mode, factor, texture: texture.map(|(_, t)| t) } }
    }

    /// `norm`, else a bump map that holds normals.
    fn normal_map(&mut self, raw: &RawMaterial, findings: &mut Findings) -> Option<NormalMap> {
        let (texture, map) = match (named(raw, Role::Normal), named(raw, Role::Bump)) {
            (Some(n), _) => (self.pictures.picture(n, Coding::Linear, findings)?.1, n.map),
            (None, Some(n)) => (self.pictures.bump(n, findings)?, n.map),
            (None, None) => return None,
        };
        Some(NormalMap { texture, scale: map.bump.unwrap_or(1.0) })
    }
}

/// What a texture multiplies: one where the material leaves it out beside a texture, else nothing.
fn factor(stated: Stated<Rgb>, has_map: bool) -> Rgb {
    stated.map_or(if has_map { Rgb::WHITE } else { Rgb::BLACK }, |(_, v)| v)
}

fn say_black_factor(name: &str, raw: &RawMaterial, findings: &mut Findings) {
    if let (Some((line, kd)), Some(_)) = (raw.diffuse, raw.map(Role::Diffuse))
        && kd.is_black()
    {
        let message = format!("Kd of `{name}` is 0, so its map_Kd stays black; 1 1 1 shows the texture as it is");
        findings.warn(At::line(raw.file.as_str(), line), message);
    }
}

/// The shape of the lobe. Models 3 and 5 ask for ray-traced reflection, which is a mirror where the exponent is missing or very high, and a
/// Phong lobe otherwise.
fn lobe(raw: &RawMaterial, specular: Rgb) -> Lobe {
    let exponent = raw.number(Number::Exponent);
    match raw.model.map(|(_, m)| m) {
        Some(0 | 1) => Lobe::Phong { exponent: 1.0 },
        Some(3 | 5) if exponent.is_none_or(|n| n >= MIRROR_EXPONENT) && !specular.is_black() => Lobe::Mirror,
        _ => Lobe::Phong { exponent: exponent.unwrap_or(1.0) },
    }
}

/// Whether a map of opacity is the picture of the colour as it is: exporters name it so for its alpha channel, whether it has one or not.
fn is_colour_again(raw: &RawMaterial, opacity: Named<'_>) -> bool {
    let is_same = raw.map(Role::Diffuse).is_some_and(|(_, colour)| colour.file == opacity.map.file);
    is_same && opacity.map.channel.is_none() && opacity.map.range.is_none()
}

fn is_physical(raw: &RawMaterial) -> bool {
    let numbers = [Number::Roughness, Number::Metallic, Number::Coat];
    numbers.iter().any(|n| raw.number(*n).is_some()) || raw.map(Role::Roughness).is_some() || raw.map(Role::Metallic).is_some()
}

/// The roughness of a lobe as wide as the highlight of this exponent.
fn roughness_of(exponent: f32) -> f32 {
    let lobe = if exponent >= MIRROR_EXPONENT { Lobe::Mirror } else { Lobe::Phong { exponent } };
    lobe.roughness()
}

/// The share of light that goes through as through glass: where the illumination model is one of glass or refraction (4, 6, 7, 9) and the
/// material is not opaque, or is one of refraction (6, 7) with a filter and an index above that of air. A filter alone says nothing: Maya
/// writes `illum 4` and `Tf 1 1 1` for everything.
fn transmission(raw: &RawMaterial, opacity: &Opacity) -> f32 {
    let model = raw.model.map(|(_, m)| m);
    let refracts = matches!(model, Some(6 | 7))
        && raw.filter.is_some_and(|(_, tf)| !tf.is_black())
        && raw.number(Number::Refraction).is_some_and(|n| n > 1.0);
    match model {
        Some(4 | 6 | 7 | 9) if opacity.texture.is_none() && opacity.factor < 1.0 => 1.0 - opacity.factor,
        _ if refracts && opacity.texture.is_none() => 1.0,
        _ => 0.0,
    }
}

/// Makes a thin sheet of glass of a material: what goes through is tinted by Tf.
fn glass(name: &str, raw: &RawMaterial, through: f32, physical: &mut MetallicRoughness, findings: &mut Findings) {
    let line = raw.model.map_or(raw.line, |(l, _)| l);
    let message = format!("the material `{name}` is glass; it is baked as a thin sheet, so light goes through it straight on");
    findings.warn(At::line(raw.file.as_str(), line), message);
    let tint = raw.filter.map_or(Rgb::WHITE, |(_, tf)| Rgb::from(tf.to_array().map(|c| c.min(1.0))));
    physical.base_color = physical.base_color * (1.0 - through) + tint * through;
    physical.transmission = through;
    physical.metallic = 0.0;
    if raw.number(Number::Roughness).is_none() && raw.map(Role::Roughness).is_none() {
        physical.roughness = raw.number(Number::Exponent).map_or(0.0, roughness_of);
    }
}
