//! What a manifest says of a surface: its parts, its encoding and what that costs.

use crate::{
    grid::{SphericalGrid, Walk},
    plan::ChartSource,
    settings::{Codec, Rule, TextureSize},
};
use serde::{Deserialize, Serialize};

/// One surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceRecord {
    /// The author's name.
    pub name: String,
    /// The name of its files without extension.
    pub file_stem: String,
    /// Texels of its texture.
    pub size: TextureSize,
    /// Where its charts came from.
    pub charts: ChartSource,
    /// Texels that lie on a chart.
    pub covered: u64,
    /// The index of the surface whose back this is.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub back_of: Option<u32>,
    /// What it consists of.
    pub parts: Vec<PartRecord>,
    /// Its direction grid.
    pub grid: SphericalGrid,
    /// Its codec.
    pub codec: Codec,
    /// How samples were picked.
    pub rule: Rule,
    /// The order that directions are walked in.
    pub walk: Walk,
    /// What the encoding costs and what it saves.
    pub encoding: Encoding,
    /// Tiles that could not be baked, in order: what their texels hold was borrowed. Absent where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub holes: Vec<HoleRecord>,
}

/// A tile that could not be baked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HoleRecord {
    /// Its number among the tiles of its surface, from 0.
    pub tile: u32,
    /// Its first column in the texture.
    pub x: u32,
    /// Its first row in the texture.
    pub y: u32,
    /// Columns of the texture that it has.
    pub width: u32,
    /// Rows of the texture that it has.
    pub height: u32,
    /// Texels of it that lie on a chart.
    pub covered: u32,
    /// How it failed: a predicate without a full stop, such as `failed 3 times on 2 workers, the last time with: out of memory`.
    pub reason: String,
}

/// Sizes and errors of an encoded surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Encoding {
    /// Kept samples, those of gutter texels included.
    pub kept_samples: u64,
    /// Colours in the colour map; 0 where colours are direct.
    pub colours: u32,
    /// Bits of a colour in `.mtnc`: 16 for an index, 24 for a direct colour.
    pub colour_bits: u16,
    /// 3 bytes x D x covered texels.
    pub raw_bytes: u64,
    /// Bytes of `.mtsp`, `.mti`, `.mtnc` and `.mtm`, headers included.
    pub coded_bytes: u64,
    /// `raw_bytes / coded_bytes`.
    pub ratio: f64,
    /// Whether the encoding is larger than the raw samples: noisy glossy data can grow.
    pub grew: bool,
    /// Errors over the covered texels, those of holes left out.
    pub errors: ErrorSummary,
}

/// Errors of the decoded against the original 8-bit samples, in levels of 1/255. A sample is one direction of one covered texel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorSummary {
    /// Mean absolute error over all samples and channels.
    pub average: f64,
    /// The same over the samples that differ in some channel (thesis, eq. 2.16).
    pub average_differing: f64,
    /// 99.9 % of the samples have no channel with a larger error.
    pub p99_9: u8,
    /// The largest error of any channel.
    pub max: u8,
    /// Samples that differ in some channel.
    pub differing: u64,
}

impl From<&crate::codec::pwl::ErrorStats> for ErrorSummary {
    fn from(e: &crate::codec::pwl::ErrorStats) -> Self {
        Self { average: e.average(), average_differing: e.average_differing(), p99_9: e.p99_9(), max: e.max(), differing: e.differing() }
    }
}

/// A part of a surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartRecord {
    /// The author's name.
    pub name: String,
    /// Its triangles.
    pub triangles: u32,
    /// What it is made of.
    pub material: MaterialRecord,
}

/// What a part is made of, in brief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialRecord {
    /// The author's name.
    pub name: String,
    /// How it reflects.
    pub reflection: ReflectionRecord,
    /// The images that vary its colour.
    pub textures: Vec<String>,
    /// Ke, W/(sr m²).
    pub emission: [f32; 3],
    /// Whether light may pass through it.
    pub lets_through: bool,
}

/// A model of reflection with its main numbers, before textures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "model")]
pub enum ReflectionRecord {
    /// It only emits.
    None,
    /// Lambert plus a Phong lobe or a mirror.
    Phong {
        /// Kd.
        diffuse: [f32; 3],
        /// Ks.
        specular: [f32; 3],
        /// Ns; absent for a mirror.
        exponent: Option<f32>,
    },
    /// glTF's.
    MetallicRoughness {
        /// baseColorFactor.
        base_color: [f32; 3],
        /// metallicFactor.
        metallic: f32,
        /// roughnessFactor.
        roughness: f32,
        /// transmissionFactor.
        transmission: f32,
    },
}
