//! Materials (ISO/IEC 19775-1: 12, and 17.2 for what they mean): Material, PhysicalMaterial, UnlitMaterial, TwoSidedMaterial.
//!
//! X3D's highlight is specularColor (N·H)^(128 shininess), not normalised. It becomes the normalised Phong lobe that is as wide (a lobe
//! about the mirror direction is about a quarter as sharp as one about the half vector) and as bright in its middle:
//! Ks = 2 specularColor/(n + 2). A lobe that keeps the number of Ks instead would be n/2 times too bright.

use super::{
    colours::Colours,
    coordinates::{Coordinates, Source},
    own,
    texture::{Layer, Textures, mapping},
};
use crate::import::{
    findings::{At, Findings},
    images::Image,
    x3d::{NodeId, NodeRef},
};
use kiln_proto::{
    limits,
    scene::{
        AlphaMode, Coding, LayerMode, Lobe, Material, MetallicRoughness, NormalMap, Opacity, Phong, Reflection, TextureLayer, TextureRef,
        energy_scale,
    },
    units::Rgb,
};

/// Highest exponent that `shininess` stands for, about the half vector.
const SHARPEST: f32 = 128.0;
/// A lobe about the mirror direction is as wide as one of this many times its exponent about the half vector.
const HALF_VECTOR: f32 = 4.0;

/// What a shape's material is made from.
pub(super) struct Shape<'d, 'a> {
    pub(super) at: At<'d>,
    pub(super) appearance: Option<NodeRef<'d>>,
    pub(super) layers: &'a [Layer<'d>],
    pub(super) coordinates: &'a Coordinates<'d>,
    /// The colours of its vertices, which take the place of the material's.
    pub(super) colours: Option<Colours>,
    /// Index of the projector of each node that projects.
    pub(super) projectors: &'a dyn Fn(NodeId) -> Option<u32>,
    /// Whether what a light projects colours the light and not the shape.
    pub(super) colours_lights: bool,
}

/// The two sides of a shape.
pub(super) struct Sides {
    pub(super) front: Material,
    /// The back, where it is another material.
    pub(super) back: Option<Material>,
}

/// What the fields of a material are called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Names {
    /// As in Material.
    Plain,
    /// As those of the back in TwoSidedMaterial.
    Back,
    /// As in CommonSurfaceShader, X3DOM's and Castle's material in the form of a shader.
    Factors,
}

impl Names {
    /// The name of a field of Material here.
    fn of(self, name: &str) -> String {
        match (self, name.split_at_checked(1)) {
            (Self::Back, Some((first, rest))) => format!("back{}{rest}", first.to_uppercase()),
            (Self::Factors, _) => format!("{}Factor", name.trim_end_matches("Color")),
            _ => name.to_owned(),
        }
    }
}

/// The material of a shape's front. A shader that describes one comes before the material that viewers without it draw.
pub(super) fn front(appearance: NodeRef<'_>) -> Option<NodeRef<'_>> {
    appearance.children("shaders").find(|s| s.kind() == "CommonSurfaceShader").or_else(|| appearance.node("material"))
}

/// Whether some side of a shape is drawn in its colour whatever light there is.
pub(super) fn is_unlit(appearance: Option<NodeRef<'_>>) -> bool {
    let Some(appearance) = appearance else { return true };
    let is_unlit = |m: NodeRef<'_>| m.kind() == "UnlitMaterial";
    let has_shader = appearance.node("shaders").is_some();
    front(appearance).map_or(!has_shader, is_unlit) || appearance.node("backMaterial").is_some_and(is_unlit)
}

/// Converts the material of a shape.
pub(super) fn convert<'d>(shape: &Shape<'d, '_>, textures: &mut Textures<'_, 'd>, findings: &mut Findings) -> Sides {
    let node = shape.appearance.and_then(front);
    let shader = shape.appearance.and_then(|a| a.children("shaders").find(|s| s.kind() != "CommonSurfaceShader"));
    let mut maker = Maker { shape, textures, findings };
    if let Some(shader) = shader {
        maker.findings.count(shader.at(), "shaders do not run in a bake; their shapes were given what else their appearance says");
    }
    let Some(node) = node else {
        let mut front = match shader {
            // Whatever the shader draws, it is hardly white light.
            Some(_) => maker.grey(),
            None => maker.unlit("unlit", Rgb::WHITE, Held::Nothing),
        };
        front.opacity = maker.opacity(0.0, Held::Nothing);
        return Sides { front, back: None };
    };
    let names = if node.kind() == "CommonSurfaceShader" { Names::Factors } else { Names::Plain };
    let front = maker.side(node, names);
    let back = match shape.appearance.and_then(|a| a.node("backMaterial")) {
        Some(back) => Some(maker.side(back, Names::Plain)),
        None if node.kind() == "TwoSidedMaterial" && node.bool("separateBackColor") => Some(maker.side(node, Names::Back)),
        None => None,
    };
    Sides { front, back }
}

/// A texture in a field of a material, as the material uses it.
#[derive(Clone, Copy)]
struct Own<'d> {
    image: Image,
    texture: TextureRef,
    /// The `alphaChannel` of its node.
    channel: &'d str,
}

/// What a field of a material holds that is there for a texture.
#[derive(Clone, Copy)]
enum Held<'d> {
    /// Nothing: for the colour the texture of the appearance counts.
    Nothing,
    /// A texture that does not show on the shape: it colours a light instead, or has no picture, which is said.
    Hidden,
    /// A texture.
    Shown(Own<'d>),
}

impl Held<'_> {
    fn texture(self) -> Option<TextureRef> {
        if let Self::Shown(own) = self { Some(own.texture) } else { None }
    }
}

struct Maker<'m, 'd, 'a, 'b> {
    shape: &'m Shape<'d, 'a>,
    textures: &'m mut Textures<'b, 'd>,
    findings: &'m mut Findings,
}

impl<'d> Maker<'_, 'd, '_, '_> {
    /// The material of a node.
    fn side(&mut self, node: NodeRef<'d>, names: Names) -> Material {
        let name = node.def().unwrap_or(node.kind());
        let emissive = self.own(node, "emissiveTexture", Coding::Srgb);
        // The texture that carries the opacity (X3D 4: 12.4) is that of the colour.
        let base = self.own(node, own::of_colour(node.kind()), Coding::Srgb);
        let emission = colour(node, &names.of("emissiveColor"), self.findings);
        let mut material = match node.kind() {
            "UnlitMaterial" => self.unlit(name, emission, base),
            "PhysicalMaterial" => self.physical(node, name, base),
            _ => self.phong(node, name, names, base),
        };
        if node.kind() != "UnlitMaterial" {
            (material.emission, material.emission_texture) = (emission, emissive.texture());
        }
        let normals = self.own(node, "normalTexture", Coding::Linear);
        let scale = if node.has("normalScale") { node.float("normalScale") } else { 1.0 };
        material.normal_map = normals.texture().map(|texture| NormalMap { texture, scale });
        if ["occlusionTexture", "ambientTexture", "shininessTexture"].iter().any(|f| node.has(f) && node.node(f).is_some()) {
            self.findings.count(node.at(), "occlusion, ambient and shininess textures were ignored");
        }
        if node.has("mirror") && node.float("mirror") > 0.0 {
            self.findings.count(node.at_field("mirror"), "the `mirror` of materials was ignored");
        }
        let transparency = if names == Names::Factors { 1.0 - node.float("alphaFactor") } else { node.float(&names.of("transparency")) };
        material.opacity = self.opacity(transparency, base);
        material
    }

    fn phong(&mut self, node: NodeRef<'d>, name: &str, names: Names, base: Held<'d>) -> Material {
        let has_colours = self.shape.colours.is_some();
        let mut diffuse = if has_colours { Rgb::WHITE } else { colour(node, &names.of("diffuseColor"), self.findings) };
        let (ks, shininess) = (colour(node, &names.of("specularColor"), self.findings), node.float(&names.of("shininess")));
        let exponent = shininess.clamp(0.0, 1.0) * SHARPEST / HALF_VECTOR;
        let mut specular = ks * (2.0 / (exponent + 2.0));
        let scale = energy_scale(diffuse, specular);
        (diffuse, specular) = (diffuse * scale, specular * scale);
        let ambient = match names {
            Names::Factors => Rgb::from(node.vec3("ambientFactor")).mean(),
            _ => node.float(&names.of("ambientIntensity")),
        };
        let layers = self.layers(base);
        let specular_texture = self.own(node, "specularTexture", Coding::Srgb).texture();
        let lobe = Lobe::Phong { exponent };
        Material::new(
            name,
            Reflection::Phong(Phong { diffuse, layers, specular, specular_texture, lobe, ambient: ambient.clamp(0.0, 1.0) }),
        )
    }

    fn physical(&mut self, node: NodeRef<'d>, name: &str, base: Held<'d>) -> Material {
        let has_colours = self.shape.colours.is_some();
        let color = if has_colours { Rgb::WHITE } else { colour(node, "baseColor", self.findings) };
        let share = |field| node.float(field).clamp(0.0, 1.0);
        let layers = self.layers(base);
        let texture = self.own(node, "metallicRoughnessTexture", Coding::Linear).texture();
        let pbr = MetallicRoughness::plain(color, share("metallic"), share("roughness"));
        Material::new(name, Reflection::MetallicRoughness(MetallicRoughness { layers, metallic_roughness_texture: texture, ..pbr }))
    }

    /// What a Material looks like of which nothing is said, with the textures of the appearance.
    fn grey(&self) -> Material {
        let diffuse = if self.shape.colours.is_some() { Rgb::WHITE } else { Rgb::splat(0.8) };
        Material::new("shader", Reflection::Phong(Phong { layers: self.layers(Held::Nothing), ..Phong::matt(diffuse) }))
    }

    /// Something that is drawn in its colour whatever light there is: it gives that colour as light. Emission does not vary with vertices:
    /// of several colours it is the mean, as for glTF's unlit materials.
    fn unlit(&mut self, name: &str, emission: Rgb, own: Held<'d>) -> Material {
        let emission = self.shape.colours.map_or(emission, |colours| {
            if colours.vary {
                self.findings.count(self.shape.at, "unlit shapes with several vertex colours were given the mean of them");
            }
            colours.mean
        });
        let texture = self.layers(own).first().map(|l| l.texture);
        Material { emission_texture: texture, ..Material::new(name, Reflection::None).emitting(emission) }
    }

    /// The layers of a colour: the material's own texture, or those of the appearance where its field is empty.
    fn layers(&self, own: Held<'d>) -> Vec<TextureLayer> {
        match own {
            Held::Nothing => {
                self.shape.layers.iter().map(|l| TextureLayer { texture: self.join(l.texture, l.source), mode: l.mode }).collect()
            }
            Held::Hidden => vec![],
            Held::Shown(own) => vec![TextureLayer { texture: own.texture, mode: LayerMode::Modulate { scale: 1.0 } }],
        }
    }

    /// A texture in a field of the material itself (X3D 4).
    fn own(&mut self, node: NodeRef<'d>, field: &str, coding: Coding) -> Held<'d> {
        let Some(found) = own::find(node, field, self.shape.appearance, self.shape.coordinates) else { return Held::Nothing };
        if let Some(wrapper) = found.masked {
            let what = "SurfaceShaderTexture nodes have a channelMask, which is not supported: all channels are used";
            self.findings.count(wrapper.at_field("channelMask"), what);
        }
        if self.shape.colours_lights && found.colours_light() {
            return Held::Hidden;
        }
        match self.textures.texture(found.texture, found.transform, coding, self.findings) {
            Some((image, reference)) => {
                let channel = found.texture.string("alphaChannel");
                Held::Shown(Own { image, texture: self.join(reference, found.source), channel })
            }
            None => Held::Hidden,
        }
    }

    /// A texture with its coordinates.
    fn join(&self, texture: TextureRef, source: Source<'_>) -> TextureRef {
        let projector = if let Source::Projected(node) = source { (self.shape.projectors)(node.id()) } else { None };
        TextureRef { mapping: mapping(source, self.shape.coordinates.automatic, projector), ..texture }
    }

    /// Opacity of the material and of the texture of its colour, or the first layer that has any. `alphaMode` decides what it means
    /// (X3D 4: 12.4.1), but for an appearance's `alphaChannel NONE`, which makes the shape opaque; with AUTO `alphaChannel` does where it says
    /// something, else what is nearly all or nothing is cut out and the rest is blended. The alpha of ColorRGBA replaces the transparency.
    fn opacity(&mut self, transparency: f32, own: Held<'d>) -> Opacity {
        let replaced = self.shape.colours.is_some_and(|c| c.has_alpha);
        let factor = if transparency.is_finite() && !replaced { 1.0 - transparency.clamp(0.0, 1.0) } else { 1.0 };
        let appearance = self.shape.appearance;
        let texture = match own {
            Held::Shown(own) => Some(own),
            Held::Hidden => None,
            Held::Nothing => {
                let layer = self.shape.layers.iter().find(|l| l.image.transparent && l.channel != "NONE");
                layer.map(|l| Own { image: l.image, texture: self.join(l.texture, l.source), channel: l.channel })
            }
        };
        let texture = texture.filter(|own| own.image.transparent && own.channel != "NONE");
        let (word, cutoff) = appearance.map_or(("AUTO", 0.5), |a| (a.string("alphaMode"), a.float("alphaCutoff").max(0.0)));
        let channel = appearance.map(|a| a.string("alphaChannel")).filter(|c| *c != "AUTO");
        let channel = channel.or(texture.map(|own| own.channel)).unwrap_or("AUTO");
        let transparent = self.shape.colours.is_some_and(|c| c.transparent);
        let mode = match (word, channel) {
            ("OPAQUE", _) | (_, "NONE") => AlphaMode::Opaque,
            ("MASK", _) => AlphaMode::Mask { cutoff },
            ("BLEND", _) => AlphaMode::Blend,
            (_, "TEST") => AlphaMode::Mask { cutoff },
            (_, "BLENDING") => AlphaMode::Blend,
            _ if transparent => AlphaMode::Blend,
            _ => self.textures.images.alpha_mode(factor, texture.map(|own| own.image), cutoff),
        };
        if mode == AlphaMode::Opaque {
            return Opacity::OPAQUE;
        }
        Opacity { mode, factor, texture: texture.map(|own| own.texture) }
    }
}

/// A colour brought to [0, 1] where it reflects; emission may be brighter.
fn colour(node: NodeRef<'_>, field: &str, findings: &mut Findings) -> Rgb {
    let given = Rgb::from(node.vec3(field));
    let most = if field.to_lowercase().contains("emissive") { limits::BRIGHTEST } else { 1.0 };
    let usable = Rgb::from(given.to_array().map(|c| if c.is_finite() { c.clamp(0.0, most) } else { 0.0 }));
    if usable != given {
        let key = format!("{field} {:?}", node.place_of(field));
        let message = format!("{} has a {field} outside [0, {most:?}]; it was brought inside", node.kind());
        findings.warn_once(node.at_field(field), &key, message);
    }
    usable
}
