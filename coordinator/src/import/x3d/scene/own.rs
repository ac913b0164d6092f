//! Textures in fields of a material itself (X3D 4: 12.4): which texture, moved by which transform, over which coordinates.

use super::{
    coordinates::{Coordinates, Source},
    material::front,
    shadow::can_project,
};
use crate::import::x3d::NodeRef;

/// The field of this type of material whose texture is the colour that a shape is seen in: there it takes the place of the appearance's.
pub(in crate::import::x3d) fn of_colour(material: &str) -> &'static str {
    match material {
        "PhysicalMaterial" => "baseTexture",
        "UnlitMaterial" => "emissiveTexture",
        _ => "diffuseTexture",
    }
}

/// The fields; those of the colour, which a light can be given, first.
const FIELDS: [&str; 6] =
    ["diffuseTexture", "baseTexture", "emissiveTexture", "normalTexture", "specularTexture", "metallicRoughnessTexture"];

/// A texture in a field of a material.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnTexture<'d> {
    pub(super) texture: NodeRef<'d>,
    pub(super) transform: Option<NodeRef<'d>>,
    pub(super) source: Source<'d>,
    /// The node around it whose `channelMask` is not used.
    pub(super) masked: Option<NodeRef<'d>>,
    /// Whether it is the colour that the shape is seen in.
    is_colour: bool,
}

impl OwnTexture<'_> {
    /// Whether it colours the light that projects it, where that is what projected textures do.
    pub(super) fn colours_light(self) -> bool {
        self.is_colour && matches!(self.source, Source::Projected(node) if can_project(node))
    }
}

/// The texture in this field of a material; `None` where the field is missing or empty.
pub(super) fn find<'d>(
    material: NodeRef<'d>,
    field: &str,
    appearance: Option<NodeRef<'d>>,
    coordinates: &Coordinates<'d>,
) -> Option<OwnTexture<'d>> {
    let texture = material.has(field).then(|| material.node(field)).flatten()?;
    let mapping = material.string(&format!("{field}Mapping"));
    let is_colour = field == of_colour(material.kind());
    // X3DOM's CommonSurfaceShader may wrap its textures.
    if texture.kind() == "SurfaceShaderTexture" {
        let (wrapper, set) = (texture, usize::try_from(texture.int("textureCoordinatesId")).unwrap_or_default());
        return Some(OwnTexture {
            texture: wrapper.node("texture")?,
            transform: wrapper.node("textureTransform"),
            source: coordinates.at(set),
            masked: Some(wrapper).filter(|w| w.string("channelMask") != "DEFAULT"),
            is_colour,
        });
    }
    let transform = appearance.and_then(|a| a.node("textureTransform")).and_then(|t| named(t, mapping));
    Some(OwnTexture { texture, transform, source: coordinates.named(mapping), masked: None, is_colour })
}

/// All textures in fields of an appearance's materials.
pub(super) fn all<'d>(appearance: NodeRef<'d>, coordinates: &Coordinates<'d>) -> Vec<OwnTexture<'d>> {
    let materials = front(appearance).into_iter().chain(appearance.node("backMaterial"));
    materials.flat_map(|m| FIELDS.into_iter().filter_map(move |field| find(m, field, Some(appearance), coordinates))).collect()
}

/// The transform of this mapping name; the first where none has the name, as for coordinates.
fn named<'d>(transform: NodeRef<'d>, mapping: &str) -> Option<NodeRef<'d>> {
    if transform.kind() != "MultiTextureTransform" {
        return Some(transform);
    }
    let all = || transform.children("textureTransform");
    all().find(|t| !mapping.is_empty() && t.has("mapping") && t.string("mapping") == mapping).or_else(|| all().next())
}
