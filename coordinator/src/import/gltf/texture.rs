//! Textures: an image, a sampler, and how a material looks them up.
//!
//! glTF counts v from the top of an image, the canonical scene from the bottom. With v' = 1 - v at the vertices and rows turned over in the
//! image, a transform of KHR_texture_transform has to be turned over too.

use super::{
    buffer::{Buffers, View},
    json::Json,
    property::ANY,
    report::Report,
    uri::{self, Target},
};
use crate::import::{
    Bundle, BundlePath,
    images::{Image, Images, Wanted},
    texture,
};
use kiln_proto::{
    limits, math,
    scene::{Coding, Mapping, TextureRef, Wrap},
};
use std::{borrow::Cow, collections::BTreeSet};

/// Extensions that bring an image of their own beside the texture's `source`.
const OTHER_IMAGES: [&str; 4] = ["EXT_texture_avif", "EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"];

/// Times that the bytes of the buffers are looked at for images that nothing uses; views of one buffer may overlap.
const UNUSED_LOOKS: u64 = 4;

/// The textures of a file.
pub(super) struct Textures<'a, 'd> {
    bundle: &'a Bundle,
    file: &'a BundlePath,
    buffers: &'a Buffers<'a>,
    textures: Vec<Json<'d>>,
    sources: Vec<Json<'d>>,
    samplers: Vec<Json<'d>>,
    used: BTreeSet<usize>,
    /// The decoded images.
    pub(super) images: &'a mut Images,
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
            bundle,
            file,
            buffers,
            textures: report.objects(root, "textures"),
            sources: report.objects(root, "images"),
            samplers: report.objects(root, "samplers"),
            used: BTreeSet::new(),
            images,
        }
    }

    /// The texture that a member `name` of `owner` describes; `None` where it describes none, or a wrong one, which is an error.
    pub(super) fn find(&mut self, owner: Json<'_>, name: &str, coding: Coding, alpha: bool, report: &mut Report<'_>) -> Option<Use> {
        let info = owner.get(name)?;
        let at = report.required(info, "index")?;
        let index = report.index_at(at, "texture", self.textures.len())?;
        let texture = self.textures[index];
        let (wrap, nearest) = self.sampler(texture, report);
        let source = self.source(texture, report)?;
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
        let source = self.source(self.textures[index], report)?;
        let (json, image) = (self.sources[source], self.image_name(source));
        let located = self.locate(json, report)?;
        let (at, findings) = report.raw(json);
        let (bundle, buffers) = (self.bundle, self.buffers);
        match located {
            Located::File(path) => self.images.measure(path.as_str(), coding, at, findings, || bundle.read(path, limits::BUNDLE_BYTES)),
            Located::View(view) => self.images.measure(&image, coding, at, findings, || Ok(Cow::Borrowed(buffers.bytes(view)))),
            Located::Data(bytes) => self.images.measure(&image, coding, at, findings, || Ok(Cow::Owned(bytes))),
        }
    }

    /// The image that stands behind a texture.
    fn source(&mut self, texture: Json<'_>, report: &mut Report<'_>) -> Option<usize> {
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
        let index = report.index(texture, "source", "image", self.sources.len())?;
        self.used.insert(index);
        Some(index)
    }

    /// A name that stands for the bytes of an image inside the file.
    fn image_name(&self, index: usize) -> String {
        format!("{}#/images/{index}", self.file)
    }

    fn decode(&mut self, index: usize, wanted: Wanted, report: &mut Report<'_>) -> Option<Image> {
        let source = self.sources[index];
        let name = self.image_name(index);
        if let Some(known) = self.images.known(&name, wanted) {
            return known;
        }
        match self.locate(source, report)? {
            Located::File(path) => {
                let (at, findings) = report.raw(source);
                self.images.file(self.bundle, path, wanted, at, findings)
            }
            Located::View(view) => {
                let (at, findings) = report.raw(source);
                self.images.bytes(&name, wanted, at, findings, || Ok(Cow::Borrowed(self.buffers.bytes(view))))
            }
            Located::Data(bytes) => {
                let (at, findings) = report.raw(source);
                self.images.bytes(&name, wanted, at, findings, || Ok(Cow::Owned(bytes)))
            }
        }
    }

    /// Where the bytes of an image are.
    fn locate(&self, source: Json<'_>, report: &mut Report<'_>) -> Option<Located<'a>> {
        match (source.get("uri"), source.get("bufferView")) {
            (Some(at), None) => Some(match uri::resolve(self.bundle, self.file, at, report)? {
                Target::Data(bytes) => Located::Data(bytes),
                Target::File(path) => Located::File(path),
            }),
            (None, Some(at)) => {
                let view = report.index_at(at, "buffer view", self.buffers.view_count())?;
                Some(Located::View(self.buffers.view_of(view)?))
            }
            _ => {
                report.error(source, "an image has either a `uri` or a `bufferView`");
                None
            }
        }
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
        report.index(info, "index", "texture", self.textures.len());
    }

    /// Looks at the images that no material uses, once at each file and view: what is wrong with them does no harm, but is said.
    pub(super) fn check_unused(&self, report: &mut Report<'_>) {
        for texture in &self.textures {
            report.index(*texture, "source", "image", self.sources.len());
            report.index(*texture, "sampler", "sampler", self.samplers.len());
        }
        let (mut files, mut views, mut left) = (BTreeSet::new(), BTreeSet::new(), self.buffers.total().saturating_mul(UNUSED_LOOKS));
        for source in self.sources.iter().enumerate().filter(|(i, _)| !self.used.contains(i)).map(|(_, source)| *source) {
            if report.is_full() {
                return;
            }
            let bytes = match self.locate(source, report) {
                None => continue,
                Some(Located::File(path)) if files.insert(path) => self.bundle.read(path, limits::BUNDLE_BYTES),
                Some(Located::View(view)) if views.insert(view) && view.len as u64 <= left => {
                    left -= view.len as u64;
                    Ok(Cow::Borrowed(self.buffers.bytes(view)))
                }
                Some(Located::Data(bytes)) => Ok(Cow::Owned(bytes)),
                Some(Located::File(_) | Located::View(_)) => continue,
            };
            match bytes.map(|bytes| texture::size("image", &bytes)) {
                Err(problem) => report.push_error(problem),
                Ok(Err(e)) => report.warn(source, format!("the image {e}; no material uses it")),
                Ok(Ok(_)) => {}
            }
        }
    }

    /// Wrapping along u and v, and whether texels are taken as they are.
    fn sampler(&self, texture: Json<'_>, report: &mut Report<'_>) -> ([Wrap; 2], bool) {
        let Some(index) = report.index(texture, "sampler", "sampler", self.samplers.len()) else { return ([Wrap::Repeat; 2], false) };
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
        (wrap, nearest)
    }
}

/// The bytes of an image.
enum Located<'a> {
    File(&'a BundlePath),
    View(View),
    Data(Vec<u8>),
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
