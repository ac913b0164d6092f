//! Textures: an image, a sampler, and how a material looks them up.
//!
//! glTF counts v from the top of an image, the canonical scene from the bottom. With v' = 1 - v at the vertices and rows turned over in the
//! image, a transform of KHR_texture_transform has to be turned over too.

use super::{buffer::Buffers, json::Json, picture::Pictures, property::ANY, report::Report};
use crate::import::{
    Bundle, BundlePath,
    images::{Image, Images, Wanted},
};
use kiln_proto::{
    limits, math,
    scene::{Coding, Mapping, TextureRef, Wrap},
};
use std::collections::BTreeMap;

/// Extensions that bring an image of their own beside the texture's `source`.
const OTHER_IMAGES: [&str; 4] = ["EXT_texture_avif", "EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"];

/// The textures of a file.
pub(super) struct Textures<'a, 'd> {
    textures: Vec<Json<'d>>,
    samplers: Vec<Json<'d>>,
    pictures: Pictures<'a, 'd>,
    /// What was read of textures and samplers, by index: thousands may refer to one that is long.
    known: Known,
    /// The decoded images.
    pub(super) images: &'a mut Images,
}

/// What was read already.
#[derive(Default)]
struct Known {
    textures: BTreeMap<usize, Option<Described>>,
    samplers: BTreeMap<usize, Sampling>,
}

/// Wrapping along u and v, and whether texels are taken as they are.
type Sampling = ([Wrap; 2], bool);

/// What a texture says: the index of its image, and how that is sampled.
#[derive(Debug, Clone, Copy)]
struct Described {
    source: usize,
    sampling: Sampling,
}

/// A texture as a material uses it, and whether it has transparent pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Use {
    pub(super) reference: TextureRef,
    pub(super) transparent: bool,
}

impl<'a, 'd> Textures<'a, 'd> {
    /// Nothing is decoded until a material asks.
    pub(super) fn new(
        bundle: &'a Bundle,
        file: &'a BundlePath,
        buffers: &'a Buffers<'a>,
        root: Json<'d>,
        images: &'a mut Images,
        report: &mut Report<'_>,
    ) -> Self {
        Self {
            textures: report.objects(root, "textures"),
            samplers: report.objects(root, "samplers"),
            pictures: Pictures::new(bundle, file, buffers, root, report),
            known: Known::default(),
            images,
        }
    }

    /// The texture that a member `name` of `owner` describes; `None` where it describes none, or a wrong one, which is an error.
    pub(super) fn find(&mut self, owner: Json<'_>, name: &str, coding: Coding, alpha: bool, report: &mut Report<'_>) -> Option<Use> {
        let info = owner.get(name)?;
        let at = report.required(info, "index")?;
        let index = report.index_at(at, "texture", self.textures.len())?;
        let Described { source, sampling: (wrap, nearest) } = self.described(index, report)?;
        let image = self.decode(source, Wanted { coding, alpha }, report)?;
        let extension = info.extension("KHR_texture_transform");
        let set = report.integer(extension.filter(|e| e.get("texCoord").is_some()).unwrap_or(info), "texCoord", 0);
        if set >= limits::UV_SETS as u64 {
            report.error(info, format!("texture coordinates of set {set} are wanted; sets 0 to {} are read", limits::UV_SETS - 1));
            return None;
        }
        let transform = extension.map_or(TextureRef::plain(0, 0).transform, |e| transform(e, report));
        let reference = TextureRef { texture: image.id, mapping: Mapping::Uv { set: set as u32 }, transform, wrap, nearest };
        Some(Use { reference, transparent: image.transparent })
    }

    /// The means over the image that a member `name` of `owner` describes, which does not become a texture of the scene (see
    /// [`Images::measure`]); `None` where it describes none, or one that cannot be read, which is told.
    pub(super) fn mean(&mut self, owner: Json<'_>, name: &str, coding: Coding, report: &mut Report<'_>) -> Option<[f32; 4]> {
        let at = report.required(owner.get(name)?, "index")?;
        let index = report.index_at(at, "texture", self.textures.len())?;
        let source = self.described(index, report)?.source;
        let Self { pictures, images, .. } = self;
        let picture = pictures.find(source, report)?;
        let place = report.place();
        let (at, findings) = report.raw(picture.json);
        images.measure(&picture.name, coding, at, findings, || pictures.read(&picture, place))
    }

    /// What a texture says; `None` where it has no image.
    fn described(&mut self, index: usize, report: &mut Report<'_>) -> Option<Described> {
        if let Some(known) = self.known.textures.get(&index) {
            return *known;
        }
        let texture = self.textures[index];
        let sampling = self.sampler(texture, report);
        let described = self.source(texture, report).map(|source| Described { source, sampling });
        self.known.textures.insert(index, described);
        described
    }

    /// The image that stands behind a texture.
    fn source(&self, texture: Json<'_>, report: &mut Report<'_>) -> Option<usize> {
        let other = OTHER_IMAGES.iter().find(|name| texture.extension(name).is_some());
        match (texture.get("source"), other) {
            (None, Some(name)) => {
                report
                    .error(texture, format!("the texture has an image of {name} only, which is not decoded; export images as PNG or JPEG"));
                return None;
            }
            (None, None) => {
                report.count(texture, "textures without an image were left out");
                return None;
            }
            (Some(_), Some(name)) => {
                report.warn_once(texture, name, format!("{name} is not decoded; the image beside it is used (said once)"));
            }
            (Some(_), None) => {}
        }
        report.index(texture, "source", "image", self.pictures.len())
    }

    fn decode(&mut self, index: usize, wanted: Wanted, report: &mut Report<'_>) -> Option<Image> {
        let Self { pictures, images, .. } = self;
        let picture = pictures.find(index, report)?;
        let place = report.place();
        let (at, findings) = report.raw(picture.json);
        images.bytes(&picture.name, wanted, at, findings, || pictures.read(&picture, place))
    }

    /// The roughness, in green, that belongs to the glossiness in the alpha channel of a texture.
    pub(super) fn roughness_of(&mut self, at: Json<'_>, gloss: TextureRef, factor: f32, report: &mut Report<'_>) -> Option<TextureRef> {
        let name = format!("{}~roughness of glossiness {factor}", self.images.textures.get(gloss.texture as usize)?.name);
        let texel = |texel: &[u8]| {
            let rough = 255.0 - factor * f32::from(texel.get(3).copied().unwrap_or(255));
            [0, (rough + 0.5) as u8, 0]
        };
        let (at, findings) = report.raw(at);
        let image = self.images.derive(&name, gloss.texture, texel, at, findings)?;
        Some(TextureRef { texture: image.id, ..gloss })
    }

    /// Checks what a texture info refers to, without decoding anything.
    pub(super) fn check(&self, info: Json<'_>, report: &mut Report<'_>) {
        if let Some(at) = report.required(info, "index") {
            report.index_at(at, "texture", self.textures.len());
        }
    }

    /// Checks what textures refer to that no material uses, and looks at unused images.
    pub(super) fn check_unused(&self, report: &mut Report<'_>) {
        for texture in &self.textures {
            let others = OTHER_IMAGES.iter().filter_map(|name| texture.extension(name));
            for owner in [*texture].into_iter().chain(others) {
                report.index(owner, "source", "image", self.pictures.len());
            }
            report.index(*texture, "sampler", "sampler", self.samplers.len());
        }
        self.pictures.check_unused(report);
    }

    /// How a texture is sampled.
    fn sampler(&mut self, texture: Json<'_>, report: &mut Report<'_>) -> Sampling {
        let Some(index) = report.index(texture, "sampler", "sampler", self.samplers.len()) else { return ([Wrap::Repeat; 2], false) };
        if let Some(known) = self.known.samplers.get(&index) {
            return *known;
        }
        let sampler = self.samplers[index];
        let wrap = ["wrapS", "wrapT"].map(|name| match report.integer(sampler, name, 10_497) {
            33_071 => Wrap::Clamp,
            33_648 => Wrap::Mirror,
            10_497 => Wrap::Repeat,
            other => {
                report.error(sampler, format!("`{name}` is {other}; it may be 33071, 33648 or 10497"));
                Wrap::Repeat
            }
        });
        let nearest = match report.integer(sampler, "magFilter", 9_729) {
            9_728 => true,
            9_729 => false,
            other => {
                report.error(sampler, format!("`magFilter` is {other}; it may be 9728 or 9729"));
                false
            }
        };
        self.known.samplers.insert(index, (wrap, nearest));
        (wrap, nearest)
    }
}

/// KHR_texture_transform (offset x rotation x scale) for coordinates whose v counts up.
fn transform(extension: Json<'_>, report: &mut Report<'_>) -> [[f32; 3]; 2] {
    let [x, y] = report.vector(extension, "offset", &ANY).unwrap_or([0.0; 2]);
    let [u, v] = report.vector(extension, "scale", &ANY).unwrap_or([1.0; 2]);
    let (sine, cosine) = math::sin_cos_degrees(report.number(extension, "rotation", 0.0, &ANY).to_degrees());
    turned_over([[cosine * u, sine * v, x], [-sine * u, cosine * v, y]])
}

/// F m F, where F takes (u, v) to (u, 1 - v).
fn turned_over([[a, b, x], [c, d, y]]: [[f64; 3]; 2]) -> [[f32; 3]; 2] {
    [[a, -b, b + x], [-c, d, 1.0 - d - y]].map(|row| row.map(|v| v as f32 + 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_turned_over_acts_alike_on_coordinates_turned_over() {
        let m = [[0.6, 0.8, 0.25], [-1.6, 1.2, -0.5]];
        let apply = |m: [[f64; 3]; 2], [u, v]: [f64; 2]| m.map(|[a, b, c]| a * u + b * v + c);
        let over = turned_over(m).map(|row| row.map(f64::from));
        for [u, v] in [[0.0, 0.0], [0.3, 0.9], [2.0, -1.0]] {
            let ([x, y], [s, t]) = (apply(m, [u, v]), apply(over, [u, 1.0 - v]));
            assert!((x - s).abs() < 1e-6 && (1.0 - y - t).abs() < 1e-6);
        }
    }
}
