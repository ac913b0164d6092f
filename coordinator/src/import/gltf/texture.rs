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
use crate::records::Problem;
use kiln_proto::{
    limits, math,
    scene::{Coding, Mapping, TextureRef, Wrap},
};
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

/// Extensions that bring an image of their own beside the texture's `source`.
const OTHER_IMAGES: [&str; 4] = ["EXT_texture_avif", "EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"];

/// Times that the bytes of the buffers are looked at for images that materials use, and as often for those that nothing uses: views of one
/// buffer may overlap.
const LOOKS: u64 = 4;

/// The textures of a file.
pub(super) struct Textures<'a, 'd> {
    bundle: &'a Bundle,
    file: &'a BundlePath,
    buffers: &'a Buffers<'a>,
    textures: Vec<Json<'d>>,
    sources: Vec<Json<'d>>,
    samplers: Vec<Json<'d>>,
    /// What was read of textures, samplers and images: thousands may refer to one that is long.
    known: Known<'a, 'd>,
    /// Bytes of views that may still be looked at.
    left: u64,
    /// The decoded images.
    pub(super) images: &'a mut Images,
}

/// What was read already, by index.
#[derive(Default)]
struct Known<'a, 'd> {
    textures: BTreeMap<usize, Option<Described>>,
    samplers: BTreeMap<usize, Sampling>,
    /// The images that materials use; `None` where one cannot be had.
    images: BTreeMap<usize, Option<Located<'a, 'd>>>,
    /// The first image of each view.
    views: BTreeMap<View, usize>,
    /// Means of images, linear or not.
    means: BTreeMap<(usize, bool), Option<[f32; 4]>>,
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
            bundle,
            file,
            buffers,
            textures: report.objects(root, "textures"),
            sources: report.objects(root, "images"),
            samplers: report.objects(root, "samplers"),
            known: Known::default(),
            left: buffers.total().saturating_mul(LOOKS),
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
        let key = (source, coding == Coding::Linear);
        if let Some(known) = self.known.means.get(&key) {
            return *known;
        }
        let mean = self.measure(source, coding, report);
        self.known.means.insert(key, mean);
        mean
    }

    fn measure(&mut self, index: usize, coding: Coding, report: &mut Report<'_>) -> Option<[f32; 4]> {
        let located = self.locate(index, report)?;
        let (name, bytes) = (self.image_name(index, located), self.bytes(index, located, report)?);
        let (at, findings) = report.raw(self.sources[index]);
        self.images.measure(&name, coding, at, findings, || bytes)
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
        report.index(texture, "source", "image", self.sources.len())
    }

    /// A name that stands for the bytes of an image.
    fn image_name(&self, index: usize, located: Located<'_, '_>) -> String {
        let inside = |index: usize| format!("{}#/images/{index}", self.file);
        match located {
            Located::File(path) => path.to_string(),
            Located::View(view) => inside(self.known.views.get(&view.bytes()).copied().unwrap_or(index)),
            Located::Data(_) => inside(index),
        }
    }

    fn decode(&mut self, index: usize, wanted: Wanted, report: &mut Report<'_>) -> Option<Image> {
        let located = self.locate(index, report)?;
        let name = self.image_name(index, located);
        if let Some(known) = self.images.known(&name, wanted) {
            return known;
        }
        let bytes = self.bytes(index, located, report)?;
        let (at, findings) = report.raw(self.sources[index]);
        self.images.bytes(&name, wanted, at, findings, || bytes)
    }

    /// The bytes of an image that a material uses; `None` where they are none, which is told once.
    fn bytes(&mut self, index: usize, located: Located<'a, 'd>, report: &mut Report<'_>) -> Option<Result<Cow<'a, [u8]>, Problem>> {
        let bytes = self.read(located, report);
        if bytes.is_none() {
            self.known.images.insert(index, None);
        }
        bytes
    }

    fn read(&self, located: Located<'a, 'd>, report: &mut Report<'_>) -> Option<Result<Cow<'a, [u8]>, Problem>> {
        Some(match located {
            Located::File(path) => self.bundle.read(path, limits::BUNDLE_BYTES),
            Located::View(view) => Ok(Cow::Borrowed(self.buffers.bytes(view))),
            Located::Data(at) => match uri::resolve(self.bundle, self.file, at, report)? {
                Target::Data(bytes) => Ok(Cow::Owned(bytes)),
                Target::File(path) => self.bundle.read(path, limits::BUNDLE_BYTES),
            },
        })
    }

    /// Where the bytes of an image that a material uses are.
    fn locate(&mut self, index: usize, report: &mut Report<'_>) -> Option<Located<'a, 'd>> {
        if let Some(known) = self.known.images.get(&index) {
            return *known;
        }
        let located = self.find_image(self.sources[index], report).filter(|located| self.may_look(index, *located, report));
        self.known.images.insert(index, located);
        located
    }

    /// Whether the bytes of views up to this one are not too many; those that are the same count once.
    fn may_look(&mut self, index: usize, located: Located<'_, '_>, report: &mut Report<'_>) -> bool {
        let Located::View(view) = located else { return true };
        if self.known.views.contains_key(&view.bytes()) {
            return true;
        }
        let Some(left) = self.left.checked_sub(view.len as u64) else {
            let message =
                format!("the views of the images up to this one have more than {LOOKS} times the bytes of all buffers: they overlap");
            report.error(self.sources[index], message);
            return false;
        };
        self.left = left;
        self.known.views.insert(view.bytes(), index);
        true
    }

    /// Where the bytes of an image are; those in the text itself are not decoded yet.
    fn find_image(&self, source: Json<'d>, report: &mut Report<'_>) -> Option<Located<'a, 'd>> {
        match (source.get("uri"), source.get("bufferView")) {
            (Some(at), None) if uri::is_data(at) => Some(Located::Data(at)),
            (Some(at), None) => match uri::resolve(self.bundle, self.file, at, report)? {
                Target::Data(_) => Some(Located::Data(at)),
                Target::File(path) => Some(Located::File(path)),
            },
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
        let (mut files, mut views, mut left) = (BTreeSet::new(), BTreeSet::new(), self.buffers.total().saturating_mul(LOOKS));
        for source in self.sources.iter().enumerate().filter(|(i, _)| !self.known.images.contains_key(i)).map(|(_, source)| *source) {
            if report.is_full() {
                return;
            }
            let Some(located) = self.find_image(source, report) else { continue };
            let is_new = match located {
                Located::File(path) => files.insert(path),
                Located::View(view) => view.len as u64 <= left && views.insert(view.bytes()),
                Located::Data(_) => true,
            };
            if let (true, Located::View(view)) = (is_new, located) {
                left -= view.len as u64;
            }
            let Some(bytes) = (if is_new { self.read(located, report) } else { None }) else { continue };
            match bytes.map(|bytes| texture::size("image", &bytes)) {
                Err(problem) => report.push_error(problem),
                Ok(Err(e)) => report.warn(source, format!("the image {e}; no material uses it")),
                Ok(Ok(_)) => {}
            }
        }
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

/// Where the bytes of an image are: the URI of those in the text.
#[derive(Clone, Copy)]
enum Located<'a, 'd> {
    File(&'a BundlePath),
    View(View),
    Data(Json<'d>),
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
