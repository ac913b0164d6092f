//! Materials: how a surface reflects, emits and lets light through, with the textures that vary it.
//!
//! Two reflection models cover what scene formats mean: Phong's (MTL, X3D Material) and glTF's metallic-roughness. What a format says in
//! other words is converted at import. One universal model with every parameter would make each consumer handle combinations that no file
//! has.

use crate::units::Rgb;
use serde::{Deserialize, Serialize};

/// What a part of a surface is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// The author's name.
    pub name: String,
    /// How it reflects.
    pub reflection: Reflection,
    /// Emitted radiance of the front side, W/(sr m²), multiplied with the texture where there is one.
    pub emission: Rgb,
    /// Varies the emission.
    pub emission_texture: Option<TextureRef>,
    /// How much of what lies behind is covered.
    pub opacity: Opacity,
    /// Tilts the normal that reflection sees; never the hemisphere of the light field.
    pub normal_map: Option<NormalMap>,
}

/// A model of reflection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Reflection {
    /// None at all (glTF unlit, X3D UnlitMaterial): it only emits.
    None,
    /// Lambert plus a normalised Phong lobe or a perfect mirror.
    Phong(Phong),
    /// glTF 2.0, appendix B.
    MetallicRoughness(MetallicRoughness),
}

/// A material of Wavefront MTL's kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phong {
    /// Kd: diffuse reflectance, before layers and vertex colours.
    pub diffuse: Rgb,
    /// Textures applied to the diffuse reflectance one after the other.
    pub layers: Vec<TextureLayer>,
    /// Ks: reflectance of the lobe at normal incidence, or of the mirror.
    pub specular: Rgb,
    /// Multiplies Ks.
    pub specular_texture: Option<TextureRef>,
    /// What shape the specular part has.
    pub lobe: Lobe,
    /// Share of the diffuse colour that answers to a light's ambient term (X3D `ambientIntensity` of the material), [0, 1].
    pub ambient: f32,
}

/// The shape of a material's specular part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Lobe {
    /// Normalised modified Phong of this exponent (Ns), at least 0.
    Phong {
        /// Ns.
        exponent: f32,
    },
    /// A delta lobe about the mirror direction.
    Mirror,
}

impl Lobe {
    /// glTF's roughness of a lobe as wide: alpha² = 2/(n + 2) (Walter et al. 2007, section 5.2: the Beckmann and Phong distributions), and
    /// alpha is the square of the roughness.
    #[must_use]
    pub fn roughness(self) -> f32 {
        match self {
            Self::Phong { exponent } => (2.0 / (exponent + 2.0)).sqrt().sqrt(),
            Self::Mirror => 0.0,
        }
    }
}

/// glTF 2.0's metallic-roughness material with the extensions that are kept; names as there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetallicRoughness {
    /// baseColorFactor, linear.
    pub base_color: Rgb,
    /// Textures applied to the base colour one after the other (glTF has at most one, a Modulate).
    pub layers: Vec<TextureLayer>,
    /// metallicFactor, [0, 1].
    pub metallic: f32,
    /// roughnessFactor (perceptual: alpha is its square), [0, 1].
    pub roughness: f32,
    /// Green multiplies the roughness, blue the metallic factor; linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// KHR_materials_ior, at least 1; 0 means a Fresnel term of one everywhere. 1.5 by default.
    pub ior: f32,
    /// KHR_materials_specular: specularFactor, [0, 1].
    pub specular: f32,
    /// Its alpha channel multiplies `specular`.
    pub specular_texture: Option<TextureRef>,
    /// KHR_materials_specular: specularColorFactor, linear.
    pub specular_color: Rgb,
    /// Multiplies `specular_color`.
    pub specular_color_texture: Option<TextureRef>,
    /// KHR_materials_transmission: share of the diffuse part that goes through instead, thin-walled, tinted with the base colour; [0, 1].
    pub transmission: f32,
    /// Its red channel multiplies `transmission`.
    pub transmission_texture: Option<TextureRef>,
}

/// One texture of a stack (X3D MultiTexture).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TextureLayer {
    /// The texture.
    pub texture: TextureRef,
    /// How it changes the colour so far.
    pub mode: LayerMode,
}

/// How a texture changes a colour c; t is the texture's colour, a its alpha.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum LayerMode {
    /// c t s.
    Modulate {
        /// s: 1, 2 or 4.
        scale: f32,
    },
    /// t.
    Replace,
    /// c + t.
    Add,
    /// c + t - 1/2.
    AddSigned,
    /// c - t.
    Subtract,
    /// t a + c (1 - a).
    Blend,
}

/// A texture as a material uses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TextureRef {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: u32,
    /// Where its coordinates come from.
    pub mapping: Mapping,
    /// Rows of an affine map of the coordinates (v up): u' = m[0][0] u + m[0][1] v + m[0][2], and v' by the second row.
    pub transform: [[f32; 3]; 2],
    /// What lies beyond the unit square, along u and v.
    pub wrap: [Wrap; 2],
    /// Whether texels are taken as they are instead of being interpolated.
    pub nearest: bool,
}

/// Where texture coordinates come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mapping {
    /// A coordinate set of the surface; (0, 0) where it has none.
    Uv {
        /// Index into [`Surface::uv_sets`](super::Surface::uv_sets).
        set: u32,
    },
    /// The world position through a projector; where the projector does not reach, the layer leaves the colour as it is.
    Projected {
        /// Index into [`Scene::projectors`](super::Scene::projectors).
        projector: u32,
    },
}

/// What lies beyond the unit square of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Wrap {
    /// It repeats.
    #[default]
    Repeat,
    /// Every other copy is mirrored.
    Mirror,
    /// Its border goes on.
    Clamp,
}

/// A tangent-space normal map (glTF: x along +u, y along +v, z the normal; byte 128 about 0).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NormalMap {
    /// The map, linear.
    pub texture: TextureRef,
    /// Multiplies x and y.
    pub scale: f32,
}

/// How much of what lies behind a surface is covered: factor x alpha of the texture x alpha of the vertex colour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Opacity {
    /// How the number is used.
    pub mode: AlphaMode,
    /// [0, 1].
    pub factor: f32,
    /// Its alpha channel multiplies the factor.
    pub texture: Option<TextureRef>,
}

/// How opacity is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum AlphaMode {
    /// Not at all.
    Opaque,
    /// There where it is at least the cutoff, nothing elsewhere.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// That share of light is met, the rest passes.
    Blend,
}

impl TextureRef {
    /// A texture over a coordinate set as it is, repeating.
    #[must_use]
    pub fn plain(texture: u32, set: u32) -> Self {
        Self {
            texture,
            mapping: Mapping::Uv { set },
            transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }
}

impl Opacity {
    /// Nothing shows through.
    pub const OPAQUE: Opacity = Opacity { mode: AlphaMode::Opaque, factor: 1.0, texture: None };
}

impl Phong {
    /// A matt material.
    #[must_use]
    pub fn matt(diffuse: Rgb) -> Self {
        Self { diffuse, layers: vec![], specular: Rgb::BLACK, specular_texture: None, lobe: Lobe::Phong { exponent: 1.0 }, ambient: 0.0 }
    }
}

impl MetallicRoughness {
    /// A material of this base colour with the extensions at their defaults.
    #[must_use]
    pub fn plain(base_color: Rgb, metallic: f32, roughness: f32) -> Self {
        Self {
            base_color,
            layers: vec![],
            metallic,
            roughness,
            metallic_roughness_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Rgb::WHITE,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
        }
    }
}

impl Material {
    /// An opaque material that does not emit.
    #[must_use]
    pub fn new(name: impl Into<String>, reflection: Reflection) -> Self {
        Self { name: name.into(), reflection, emission: Rgb::BLACK, emission_texture: None, opacity: Opacity::OPAQUE, normal_map: None }
    }

    /// A matt, opaque material.
    #[must_use]
    pub fn matt(name: impl Into<String>, diffuse: Rgb) -> Self {
        Self::new(name, Reflection::Phong(Phong::matt(diffuse)))
    }

    /// The same, giving light, W/(sr m²).
    #[must_use]
    pub fn emitting(mut self, emission: Rgb) -> Self {
        self.emission = emission;
        self
    }

    /// Whether the surface gives light of its own.
    #[must_use]
    #[inline]
    pub fn is_emissive(&self) -> bool {
        self.emission.max_channel() > 0.0
    }

    /// Whether its outgoing light depends on the direction.
    #[must_use]
    #[inline]
    pub fn is_view_dependent(&self) -> bool {
        match &self.reflection {
            Reflection::None => false,
            Reflection::Phong(p) => p.specular.max_channel() > 0.0,
            Reflection::MetallicRoughness(_) => true,
        }
    }

    /// Whether light may pass through it without being deflected.
    #[must_use]
    #[inline]
    pub fn lets_through(&self) -> bool {
        self.opacity.mode != AlphaMode::Opaque
    }
}
