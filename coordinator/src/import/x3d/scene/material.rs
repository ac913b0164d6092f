//! Materials (ISO/IEC 19775-1: 12, and 17.2 for what they mean): Material, PhysicalMaterial, UnlitMaterial, TwoSidedMaterial.
//!
//! X3D's highlight is specularColor (N·H)^(128 shininess), not normalised. It becomes the normalised Phong lobe that is as wide (a lobe about
//! the mirror direction is about a quarter as sharp as one about the half vector) and as bright in its middle: Ks = 2 specularColor/(n + 2).
//! A lobe that keeps the number of Ks instead would be n/2 times too bright.

use super::{
    coordinates::{Coordinates, Source},
    texture::{Layer, Textures, mapping},
};
use crate::import::{
    findings::{At, Findings},
    images::Image,
    x3d::NodeRef,
};
use kiln_proto::{
    limits,
    scene::{
        AlphaMode, Coding, Lobe, Material, MetallicRoughness, NormalMap, Opacity, Phong, Reflection, TextureLayer, TextureRef, energy_scale,
    },
    units::Rgb,
};

/// Highest exponent that `shininess` stands for, about the half vector.
const SHARPEST: f32 = 128.0;
/// A lobe about the mirror direction is as wide as one of this many times its exponent about the half vector.
const HALF_VECTOR: f32 = 4.0;

/// What a shape's material is made from.
pub(super) struct Shape<'d, 'a> {
    pub(super) appearance: Option<NodeRef<'d>>,
    pub(super) layers: &'a [Layer<'d>],
    pub(super) coordinates: &'a Coordinates<'d>,
    /// Whether vertices have colours, which take the place of the material's.
    pub(super) has_colours: bool,
    /// Index of the projector of each node that projects.
    pub(super) projectors: &'a dyn Fn(NodeRef<'d>) -> Option<u32>,
}

/// The two sides of a shape.
pub(super) struct Sides {
    pub(super) front: Material,
    /// The back, where it is another material.
    pub(super) back: Option<Material>,
}

/// Converts the material of a shape.
pub(super) fn convert(shape: &Shape<'_, '_>, textures: &mut Textures<'_>, findings: &mut Findings) -> Sides {
    let node = shape.appearance.and_then(|a| a.node("material"));
    let mut maker = Maker { shape, textures, findings };
    let Some(node) = node else {
        return Sides { front: maker.unlit("unlit", Rgb::WHITE, None), back: None };
    };
    let front = maker.side(node, "");
    let back = match shape.appearance.and_then(|a| a.node("backMaterial")) {
        Some(back) => Some(maker.side(back, "")),
        None if node.kind() == "TwoSidedMaterial" && node.bool("separateBackColor") => Some(maker.side(node, "back")),
        None => None,
    };
    Sides { front, back }
}

struct Maker<'m, 'd, 'a, 'b> {
    shape: &'m Shape<'d, 'a>,
    textures: &'m mut Textures<'b>,
    findings: &'m mut Findings,
}

impl Maker<'_, '_, '_, '_> {
    /// The material of a node; `prefix` picks the fields of a TwoSidedMaterial's back.
    fn side(&mut self, node: NodeRef<'_>, prefix: &str) -> Material {
        let name = node.def().unwrap_or(node.kind());
        let mut material = match node.kind() {
            "UnlitMaterial" => {
                let texture = self.own_texture(node, "emissiveTexture", Coding::Srgb);
                let emission = colour(node, "emissiveColor", self.findings);
                self.unlit(name, emission, texture)
            }
            "PhysicalMaterial" => self.physical(node, name),
            _ => self.phong(node, name, prefix),
        };
        if node.kind() != "UnlitMaterial" {
            material.emission = colour(node, &field(prefix, "emissiveColor"), self.findings);
            material.emission_texture = self.own_texture(node, "emissiveTexture", Coding::Srgb).map(|(_, t)| t);
        }
        if node.has("normalTexture") {
            let map = self.own_texture(node, "normalTexture", Coding::Linear);
            material.normal_map = map.map(|(_, texture)| NormalMap { texture, scale: node.float("normalScale") });
        }
        if ["occlusionTexture", "ambientTexture", "shininessTexture"].iter().any(|f| node.has(f) && node.node(f).is_some()) {
            self.findings.count(node.at(), "occlusion, ambient and shininess textures were ignored");
        }
        material.opacity = self.opacity(node.float(&field(prefix, "transparency")), base_texture(node));
        material
    }

    fn phong(&mut self, node: NodeRef<'_>, name: &str, prefix: &str) -> Material {
        let mut diffuse = if self.shape.has_colours { Rgb::WHITE } else { colour(node, &field(prefix, "diffuseColor"), self.findings) };
        let (ks, shininess) = (colour(node, &field(prefix, "specularColor"), self.findings), node.float(&field(prefix, "shininess")));
        let exponent = shininess.clamp(0.0, 1.0) * SHARPEST / HALF_VECTOR;
        let mut specular = ks * (2.0 / (exponent + 2.0));
        let scale = energy_scale(diffuse, specular);
        (diffuse, specular) = (diffuse * scale, specular * scale);
        let ambient = node.float(&field(prefix, "ambientIntensity")).clamp(0.0, 1.0);
        let layers = match self.own_layer(node, "diffuseTexture") {
            Some(own) => vec![own],
            None => self.layers(),
        };
        let specular_texture = self.own_texture(node, "specularTexture", Coding::Srgb).map(|(_, t)| t);
        let lobe = Lobe::Phong { exponent };
        Material::new(name, Reflection::Phong(Phong { diffuse, layers, specular, specular_texture, lobe, ambient }))
    }

    fn physical(&mut self, node: NodeRef<'_>, name: &str) -> Material {
        let base = if self.shape.has_colours { Rgb::WHITE } else { colour(node, "baseColor", self.findings) };
        let share = |field| node.float(field).clamp(0.0, 1.0);
        let layers = match self.own_layer(node, "baseTexture") {
            Some(own) => vec![own],
            None => self.layers(),
        };
        let texture = self.own_texture(node, "metallicRoughnessTexture", Coding::Linear).map(|(_, t)| t);
        let pbr = MetallicRoughness::plain(base, share("metallic"), share("roughness"));
        Material::new(name, Reflection::MetallicRoughness(MetallicRoughness { layers, metallic_roughness_texture: texture, ..pbr }))
    }

    /// Something that is drawn in its colour whatever light there is: it gives that colour as light.
    fn unlit(&mut self, name: &str, emission: Rgb, texture: Option<(Image, TextureRef)>) -> Material {
        if self.shape.has_colours {
            let at = self.shape.appearance.map_or(At::file(""), |a| a.at());
            self.findings.count(at, "vertex colours of unlit shapes were ignored");
        }
        let texture = texture.map(|(_, t)| t).or_else(|| self.layers().first().map(|l| l.texture));
        let mut material = Material::new(name, Reflection::None).emitting(emission);
        material.emission_texture = texture;
        material.opacity = self.opacity(0.0, None);
        material
    }

    /// The layers of the appearance's own texture.
    fn layers(&self) -> Vec<TextureLayer> {
        self.shape.layers.iter().map(|l| TextureLayer { texture: self.join(l.texture, l.source), mode: l.mode }).collect()
    }

    /// A texture in a field of the material itself (X3D 4).
    fn own_texture(&mut self, node: NodeRef<'_>, field: &str, coding: Coding) -> Option<(Image, TextureRef)> {
        let texture = node.has(field).then(|| node.node(field)).flatten()?;
        let transform = self.shape.appearance.and_then(|a| a.node("textureTransform"));
        let (image, reference) = self.textures.texture(texture, transform, coding, true, self.findings)?;
        let source = self.shape.coordinates.named(node.string(&format!("{field}Mapping")));
        Some((image, self.join(reference, source)))
    }

    fn own_layer(&mut self, node: NodeRef<'_>, field: &str) -> Option<TextureLayer> {
        let (_, texture) = self.own_texture(node, field, Coding::Srgb)?;
        Some(TextureLayer { texture, mode: kiln_proto::scene::LayerMode::Modulate { scale: 1.0 } })
    }

    /// A texture with its coordinates.
    fn join(&self, texture: TextureRef, source: Source<'_>) -> TextureRef {
        let projector = if let Source::Projected(node) = source { self.projector(node) } else { None };
        TextureRef { mapping: mapping(source, self.shape.coordinates.automatic, projector), ..texture }
    }

    fn projector(&self, node: NodeRef<'_>) -> Option<u32> {
        let same = self.shape.layers.iter().find_map(|l| match l.source {
            Source::Projected(own) if own.id() == node.id() => Some(own),
            _ => None,
        });
        same.and_then(|own| (self.shape.projectors)(own))
    }

    /// Opacity of the material and of its first texture that has any. `alphaMode` decides what it means (X3D 4: 12.4.1); AUTO cuts out what
    /// is nearly all or nothing and blends the rest.
    fn opacity(&mut self, transparency: f32, own: Option<NodeRef<'_>>) -> Opacity {
        let factor = if transparency.is_finite() { 1.0 - transparency.clamp(0.0, 1.0) } else { 1.0 };
        let own = own.and_then(|texture| {
            let (image, reference) = self.textures.texture(texture, None, Coding::Srgb, true, self.findings)?;
            Some((image, self.join(reference, self.shape.coordinates.at(0)), texture.string("alphaChannel")))
        });
        let layered = || self.shape.layers.iter().find(|l| l.image.transparent).map(|l| (l.image, self.join(l.texture, l.source), "AUTO"));
        let texture = own.or_else(layered).filter(|(image, ..)| image.transparent);
        let (word, cutoff) = self.shape.appearance.map_or(("AUTO", 0.5), |a| (a.string("alphaMode"), a.float("alphaCutoff")));
        let channel = texture.as_ref().map_or("AUTO", |t| t.2);
        let channel = self.shape.appearance.map(|a| a.string("alphaChannel")).filter(|c| *c != "AUTO").unwrap_or(channel);
        let mask = AlphaMode::Mask { cutoff: cutoff.max(0.0) };
        let mode = match (word, channel) {
            ("OPAQUE", _) | (_, "NONE") => return Opacity::OPAQUE,
            ("MASK", _) | (_, "TEST") => mask,
            ("BLEND", _) | (_, "BLENDING") => AlphaMode::Blend,
            _ => self.textures.images.alpha_mode(factor, texture.as_ref().map(|(image, ..)| *image), cutoff.max(0.0)),
        };
        if mode == AlphaMode::Opaque {
            return Opacity::OPAQUE;
        }
        Opacity { mode, factor, texture: texture.map(|(_, t, _)| t) }
    }
}

/// The texture that carries a material's opacity (X3D 4).
fn base_texture(node: NodeRef<'_>) -> Option<NodeRef<'_>> {
    ["diffuseTexture", "baseTexture"].into_iter().filter(|f| node.has(f)).find_map(|f| node.node(f))
}

fn field(prefix: &str, name: &str) -> String {
    match name.split_at_checked(1) {
        Some((first, rest)) if !prefix.is_empty() => format!("{prefix}{}{rest}", first.to_uppercase()),
        _ => name.to_owned(),
    }
}

/// A colour brought to [0, 1] where it reflects; emission may be brighter.
fn colour(node: NodeRef<'_>, field: &str, findings: &mut Findings) -> Rgb {
    let given = Rgb::from(node.vec3(field));
    let most = if field.to_lowercase().contains("emissive") { limits::BRIGHTEST } else { 1.0 };
    let usable = Rgb::from(given.to_array().map(|c| if c.is_finite() { c.clamp(0.0, most) } else { 0.0 }));
    if usable != given {
        findings.warn(node.at_field(field), format!("{} has a {field} outside [0, {most:?}]; it was brought inside", node.kind()));
    }
    usable
}
