//! Texture nodes: images and pixels become textures of the scene, MultiTexture a stack of layers (ISO/IEC 19775-1: 18).
//!
//! A texture multiplies the colour beneath it, also where X3D 3 lets an RGB texture replace the material's: that is what version 4 of the
//! standard says and what browsers do.

use super::{
    address::{self, Target},
    coordinates::{Coordinates, Source},
    pixels::{is_empty, is_stand_in, pixels},
};
use crate::import::{
    Bundle,
    findings::{At, Findings},
    images::{Image, Images, Wanted},
    uri,
    x3d::{NodeId, NodeRef},
};
use crate::records::Problem;
use kiln_proto::{
    math,
    scene::{Coding, LayerMode, Mapping, TextureRef, Wrap},
};
use std::{collections::BTreeMap, rc::Rc};

/// Layers of one MultiTexture: twice what the texture units of most graphics hardware hold.
const MOST_LAYERS: usize = 16;

/// One texture of an appearance with what the scene makes of it.
#[derive(Clone, Copy)]
pub(super) struct Layer<'d> {
    /// The texture, with its coordinates still to be joined.
    pub(super) image: Image,
    pub(super) texture: TextureRef,
    /// The `alphaChannel` of its node.
    pub(super) channel: &'d str,
    pub(super) source: Source<'d>,
    pub(super) mode: LayerMode,
}

/// What the `texture` field of an appearance holds.
#[derive(Clone, Default)]
pub(super) struct Stack<'d> {
    /// Layers in order.
    pub(super) layers: Vec<Layer<'d>>,
    /// GeneratedShadowMap nodes.
    pub(super) shadow_maps: Rc<[NodeRef<'d>]>,
}

/// A stack without coordinates, with the place of each layer among the textures of its node.
#[derive(Default)]
struct Sheaf<'d> {
    layers: Vec<(usize, Layer<'d>)>,
    shadow_maps: Rc<[NodeRef<'d>]>,
}

/// What a texture node comes to; `None` where it has no image, which is said.
type Found = Option<(Image, TextureRef)>;

/// The textures of a document. What has been looked at is remembered, so that a fault is told once however many shapes share the node.
pub(super) struct Textures<'b, 'd> {
    bundle: &'b Bundle,
    pub(super) images: &'b mut Images,
    pixels: BTreeMap<(NodeId, bool), Option<Image>>,
    /// By texture, transform and whether its bytes are linear.
    known: BTreeMap<(NodeId, Option<NodeId>, bool), Found>,
    /// By texture and transform.
    sheaves: BTreeMap<(NodeId, Option<NodeId>), Rc<Sheaf<'d>>>,
}

impl<'b, 'd> Textures<'b, 'd> {
    pub(super) fn new(bundle: &'b Bundle, images: &'b mut Images) -> Self {
        Self { bundle, images, pixels: BTreeMap::new(), known: BTreeMap::new(), sheaves: BTreeMap::new() }
    }

    /// The stack of an appearance's `texture` field.
    pub(super) fn stack(
        &mut self,
        node: NodeRef<'d>,
        transform: Option<NodeRef<'d>>,
        coordinates: &Coordinates<'d>,
        findings: &mut Findings,
    ) -> Stack<'d> {
        let key = (node.id(), transform.map(NodeRef::id));
        let sheaf = match self.sheaves.get(&key) {
            Some(known) => Rc::clone(known),
            None => {
                let made = Rc::new(self.sheaf(node, transform, findings));
                self.sheaves.insert(key, Rc::clone(&made));
                made
            }
        };
        let layers = sheaf.layers.iter().map(|(place, layer)| Layer { source: coordinates.at(*place), ..*layer }).collect();
        Stack { layers, shadow_maps: Rc::clone(&sheaf.shadow_maps) }
    }

    fn sheaf(&mut self, node: NodeRef<'d>, transform: Option<NodeRef<'d>>, findings: &mut Findings) -> Sheaf<'d> {
        let (mut layers, mut shadow_maps) = (vec![], vec![]);
        let (nodes, modes): (Vec<_>, _) = if node.kind() == "MultiTexture" {
            if !node.mf_string("function").is_empty() || node.mf_string("source").iter().any(|s| !s.is_empty()) {
                findings.count(node.at(), "MultiTexture.function and .source are not supported, layers take the colour beneath them");
            }
            (node.children("texture").collect(), node.mf_string("mode"))
        } else {
            (vec![node], &[][..])
        };
        for (place, texture) in nodes.into_iter().enumerate() {
            if texture.kind() == "GeneratedShadowMap" {
                shadow_maps.push(texture);
                continue;
            }
            // Alone it stands for nothing but itself.
            if texture.id() != node.id() && is_stand_in(texture) {
                continue;
            }
            if layers.len() >= MOST_LAYERS {
                findings.warn_once(
                    node.at(),
                    &format!("layers {:?}", node.place()),
                    format!("{} has more than {MOST_LAYERS} textures; the first {MOST_LAYERS} count", node.kind()),
                );
                continue;
            }
            let Some(mode) = mode(modes.get(place).map_or("MODULATE", |m| m), node.at_field("mode"), findings) else { continue };
            if let Some((image, reference)) = self.texture(texture, transform_at(transform, place), Coding::Srgb, findings) {
                let channel = texture.string("alphaChannel");
                layers.push((place, Layer { image, texture: reference, channel, source: Source::Automatic, mode }));
            }
        }
        Sheaf { layers, shadow_maps: shadow_maps.into() }
    }

    /// The texture of one node; `None` where it has none, which is said.
    pub(super) fn texture(&mut self, node: NodeRef<'_>, transform: Option<NodeRef<'_>>, coding: Coding, findings: &mut Findings) -> Found {
        let key = (node.id(), transform.map(NodeRef::id), coding == Coding::Linear);
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let made = self.look_up(node, transform, coding, findings);
        self.known.insert(key, made);
        made
    }

    fn look_up(&mut self, node: NodeRef<'_>, transform: Option<NodeRef<'_>>, coding: Coding, findings: &mut Findings) -> Found {
        // Colours alone have an opacity; numbers in a texture have none.
        let wanted = Wanted { coding, alpha: coding == Coding::Srgb && node.string("alphaChannel") != "NONE" };
        let image = match node.kind() {
            "ImageTexture" => self.file(node, wanted, findings)?,
            "PixelTexture" => self.pixel_texture(node, wanted, findings)?,
            other => {
                findings.warn(node.at(), format!("textures of the kind {other} are not supported; the shape is baked without"));
                return None;
            }
        };
        let mut reference = TextureRef::plain(image.id, 0);
        reference.wrap = wraps(node, findings);
        reference.nearest = node.node("textureProperties").is_some_and(|p| p.string("magnificationFilter") == "NEAREST_PIXEL");
        if let Some(transform) = transform {
            reference.transform = affine(transform, findings);
        }
        if node.has("flipVertically") && node.bool("flipVertically") {
            let [_, v] = &mut reference.transform;
            *v = [-v[0], -v[1], 1.0 - v[2]];
        }
        Some((image, reference))
    }

    /// The first of the addresses that the bundle has.
    fn file(&mut self, node: NodeRef<'_>, wanted: Wanted, findings: &mut Findings) -> Option<Image> {
        let at = node.at_field("url");
        if node.mf_string("url").is_empty() {
            findings.warn(at, "ImageTexture has no url; the shape is baked without");
            return None;
        }
        match address::next(self.bundle, node, 0, findings) {
            Some((number, Target::Data(data))) => self.data(data, number, wanted, node, findings),
            Some((_, Target::File(path))) => self.images.file(self.bundle, path, wanted, at, findings),
            None => {
                findings.error(at, address::missing(node));
                None
            }
        }
    }

    /// An image inside the file, told from others by the place of the value, which instances of a prototype have each to themselves, and
    /// its number there.
    fn data(&mut self, data: &str, number: usize, wanted: Wanted, node: NodeRef<'_>, findings: &mut Findings) -> Option<Image> {
        let (at, place) = (node.at_field("url"), node.place_of("url"));
        let name = format!("{}:{}:{}:{number}", node.file_of("url"), place.line, place.column);
        self.images.bytes(&name, wanted, at, findings, || match uri::data(data) {
            Ok(bytes) => Ok(bytes.into()),
            Err(message) => Err(Problem { message, file: Some(node.file_of("url").to_string()), line: Some(place.line) }),
        })
    }

    fn pixel_texture(&mut self, node: NodeRef<'_>, wanted: Wanted, findings: &mut Findings) -> Option<Image> {
        let key = (node.id(), wanted.coding == Coding::Linear);
        if let Some(known) = self.pixels.get(&key) {
            return *known;
        }
        if is_empty(node) {
            findings.warn(node.at(), "PixelTexture has no pixels; the shape is baked without");
        }
        let name = node.def().unwrap_or("PixelTexture").to_owned();
        let image = pixels(node, wanted.coding, name, findings).and_then(|t| {
            let transparent = t.has_alpha && t.texels.chunks_exact(4).any(|p| p[3] < 255);
            self.images.push(t, transparent, node.at(), findings)
        });
        self.pixels.insert(key, image);
        image
    }
}

fn transform_at(node: Option<NodeRef<'_>>, place: usize) -> Option<NodeRef<'_>> {
    let node = node?;
    if node.kind() == "MultiTextureTransform" { node.children("textureTransform").nth(place) } else { Some(node) }
}

/// Tc' = -C S R C T Tc (ISO/IEC 19775-1: 18.4.8).
fn affine(node: NodeRef<'_>, findings: &mut Findings) -> [[f32; 3]; 2] {
    const AS_IS: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    if node.kind() != "TextureTransform" {
        findings.warn(node.at(), format!("{} is not supported; textures lie as their coordinates say", node.kind()));
        return AS_IS;
    }
    let [[cx, cy], [sx, sy], [tx, ty]] = ["center", "scale", "translation"].map(|f| node.vec2(f));
    let (sin, cos) = math::sin_cos_degrees(f64::from(node.float("rotation")).to_degrees());
    let (sin, cos) = (sin as f32, cos as f32);
    let rows = [[sx * cos, -sx * sin], [sy * sin, sy * cos]];
    let row = |[a, b]: [f32; 2], c: f32| [a, b, a * (tx + cx) + b * (ty + cy) - c];
    let out = [row(rows[0], cx), row(rows[1], cy)];
    if out.as_flattened().iter().all(|v| v.is_finite()) { out } else { AS_IS }
}

fn wraps(node: NodeRef<'_>, findings: &mut Findings) -> [Wrap; 2] {
    let properties = node.node("textureProperties");
    let one = |field: &str, repeat: &str, findings: &mut Findings| match properties {
        None if node.bool(repeat) => Wrap::Repeat,
        None => Wrap::Clamp,
        Some(p) => match p.string(field) {
            "REPEAT" => Wrap::Repeat,
            "MIRRORED_REPEAT" => Wrap::Mirror,
            "CLAMP" | "CLAMP_TO_EDGE" => Wrap::Clamp,
            other => {
                findings.warn(p.at_field(field), format!("the {field} `{other}` is not supported; CLAMP_TO_EDGE is used"));
                Wrap::Clamp
            }
        },
    };
    [one("boundaryModeS", "repeatS", findings), one("boundaryModeT", "repeatT", findings)]
}

/// How a layer acts; `None` for one that is off. `A / B` gives colour and alpha apart; the colour's counts.
fn mode(word: &str, at: At<'_>, findings: &mut Findings) -> Option<LayerMode> {
    let word = word.split('/').next().unwrap_or_default().trim();
    Some(match word {
        "" | "MODULATE" => LayerMode::Modulate { scale: 1.0 },
        "MODULATE2X" => LayerMode::Modulate { scale: 2.0 },
        "MODULATE4X" => LayerMode::Modulate { scale: 4.0 },
        "REPLACE" | "SELECTARG1" => LayerMode::Replace,
        "ADD" => LayerMode::Add,
        "ADDSIGNED" => LayerMode::AddSigned,
        "SUBTRACT" => LayerMode::Subtract,
        "BLENDTEXTUREALPHA" => LayerMode::Blend,
        "OFF" | "SELECTARG2" => return None,
        other => {
            findings.warn(at, format!("the MultiTexture mode `{other}` is not supported; MODULATE is used"));
            LayerMode::Modulate { scale: 1.0 }
        }
    })
}

/// The mapping of a source, given where projectors are.
pub(super) fn mapping(source: Source<'_>, automatic_set: u32, projector: Option<u32>) -> Mapping {
    match (source, projector) {
        (Source::Projected(_), Some(projector)) => Mapping::Projected { projector },
        (Source::Set(set), _) => Mapping::Uv { set },
        _ => Mapping::Uv { set: automatic_set },
    }
}
