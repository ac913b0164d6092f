//! The textures of a scene: each image is decoded once for each meaning that its bytes have, whoever asks for it.
//!
//! The bounds are those of `texture`, and all images together are bounded too. An image keeps its alpha channel only where somebody uses
//! it: the first who does has it decoded again in place, which costs time rarely instead of memory always.

use super::{
    Bundle, BundlePath,
    findings::{At, Findings},
    texture::{self, Decoded},
};
use crate::records::Problem;
use kiln_proto::{
    limits, math,
    scene::{AlphaMode, Coding, Texture},
};
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

/// What an image is wanted for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// What its bytes mean.
    pub(super) coding: Coding,
    /// Whether its alpha channel is used.
    pub(super) alpha: bool,
}

/// An image in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Image {
    /// Index into [`Images::textures`].
    pub(super) id: u32,
    /// Whether some pixel is not opaque.
    pub(super) transparent: bool,
}

/// The textures of a scene so far.
#[derive(Debug, Default)]
pub(super) struct Images {
    images: BTreeMap<(String, bool), Option<Image>>,
    bytes: u64,
    /// Which textures are meant to be cut out.
    cut_outs: BTreeSet<u32>,
    /// Means of textures, with and without alpha.
    means: BTreeMap<(u32, bool), [f32; 4]>,
    /// Means of images that are no textures of the scene, by name and coding, and the bytes that were decoded for them.
    measured: BTreeMap<(String, bool), [f32; 4]>,
    measured_bytes: u64,
    /// The textures.
    pub(super) textures: Vec<Texture>,
}

impl Images {
    /// The texture of an image file; `None` where it was refused, which is then an error at the first place that asks.
    pub(super) fn file(
        &mut self,
        bundle: &Bundle,
        path: &BundlePath,
        wanted: Wanted,
        at: At<'_>,
        findings: &mut Findings,
    ) -> Option<Image> {
        self.bytes(path.as_str(), wanted, at, findings, || bundle.read(path, limits::BUNDLE_BYTES))
    }

    /// What became of an image that somebody has asked for before; `None` where it has to be decoded.
    pub(super) fn known(&self, name: &str, wanted: Wanted) -> Option<Option<Image>> {
        let image = *self.images.get(&key(name, wanted))?;
        let serves = |image: Image| !wanted.alpha || !image.transparent || self.textures[image.id as usize].has_alpha;
        image.is_none_or(serves).then_some(image)
    }

    /// The texture of image bytes under a name that stands for exactly these bytes.
    pub(super) fn bytes<'b>(
        &mut self,
        name: &str,
        wanted: Wanted,
        at: At<'_>,
        findings: &mut Findings,
        read: impl FnOnce() -> Result<Cow<'b, [u8]>, Problem>,
    ) -> Option<Image> {
        if let Some(known) = self.known(name, wanted) {
            return known;
        }
        if self.is_full() || findings.is_full() {
            return None;
        }
        let key = key(name, wanted);
        let place = self.images.get(&key).copied().flatten().map(|image| image.id);
        let Some(decoded) = decode(name, wanted, at, findings, read) else {
            self.refuse(name);
            return None;
        };
        let image = self.keep(decoded, place, at, findings);
        self.images.insert(key, image);
        image
    }

    /// The means over a texture: red, green and blue in linear light, and alpha, each in [0, 1]; ones where there is no such texture.
    pub(super) fn mean(&mut self, id: u32) -> [f32; 4] {
        let Some(texture) = self.textures.get(id as usize) else { return [1.0; 4] };
        *self.means.entry((id, texture.has_alpha)).or_insert_with(|| mean(texture))
    }

    /// The means (as [`Images::mean`] has them, without alpha) over an image that does not become a texture of the scene; `None` where it
    /// was refused, or where more has been decoded for such means than the textures of a scene may have.
    pub(super) fn measure<'b>(
        &mut self,
        name: &str,
        coding: Coding,
        at: At<'_>,
        findings: &mut Findings,
        read: impl FnOnce() -> Result<Cow<'b, [u8]>, Problem>,
    ) -> Option<[f32; 4]> {
        let wanted = Wanted { coding, alpha: false };
        if let Some(known) = self.known(name, wanted) {
            return known.map(|image| self.mean(image.id));
        }
        let key = key(name, wanted);
        if let Some(known) = self.measured.get(&key) {
            return Some(*known);
        }
        if self.measured_bytes > limits::BUNDLE_BYTES || findings.is_full() {
            return None;
        }
        let Some(decoded) = decode(name, wanted, at, findings, read) else {
            self.refuse(name);
            return None;
        };
        self.measured_bytes += decoded.texture.texels.len() as u64;
        let mean = mean(&decoded.texture);
        self.measured.insert(key, mean);
        Some(mean)
    }

    /// Remembers that an image cannot be had, which was told: it is not asked for again, whatever its bytes were to mean.
    fn refuse(&mut self, name: &str) {
        for coding in [Coding::Srgb, Coding::Linear] {
            self.images.insert(key(name, Wanted { coding, alpha: false }), None);
        }
    }

    /// Whether the textures together were too large already, which was told: nothing more is decoded only to be refused.
    fn is_full(&self) -> bool {
        self.bytes > limits::BUNDLE_BYTES
    }

    /// Puts a texture into the list, or in the place of what it was without alpha.
    fn keep(&mut self, decoded: Decoded, place: Option<u32>, at: At<'_>, findings: &mut Findings) -> Option<Image> {
        let Decoded { texture, transparent } = decoded;
        self.bytes += texture.texels.len() as u64;
        self.bytes -= place.map_or(0, |id| self.textures[id as usize].texels.len() as u64);
        if self.is_full() {
            findings.error(at, format!("the textures together exceed {} bytes; scale them down", limits::BUNDLE_BYTES));
            return None;
        }
        let id = place.unwrap_or(self.textures.len() as u32);
        if transparent && is_cut_out(&texture) {
            self.cut_outs.insert(id);
        }
        match self.textures.get_mut(id as usize) {
            Some(slot) => *slot = texture,
            None => self.textures.push(texture),
        }
        Some(Image { id, transparent })
    }
}

/// Reads and decodes an image; `None` where that fails, which is told.
pub(super) fn decode<'b>(
    name: &str,
    wanted: Wanted,
    at: At<'_>,
    findings: &mut Findings,
    read: impl FnOnce() -> Result<Cow<'b, [u8]>, Problem>,
) -> Option<Decoded> {
    let bytes = read().map_err(|problem| findings.push_error(problem)).ok()?;
    let decoded = texture::decode(name, &bytes, wanted.coding, wanted.alpha);
    decoded.map_err(|e| findings.error(at, format!("the image `{name}` {e}"))).ok()
}

/// The means over a texture's texels, of colours in linear light; alpha is one where it has none.
fn mean(texture: &Texture) -> [f32; 4] {
    let linear: [f64; 256] = std::array::from_fn(|v| match texture.coding {
        Coding::Srgb => f64::from(math::srgb_eotf(v as f32 / 255.0)),
        Coding::Linear => v as f64 / 255.0,
    });
    let mut counts = [[0u64; 256]; 4];
    for texel in texture.texels.chunks_exact(texture.channels()) {
        texel.iter().zip(&mut counts).for_each(|(v, of)| of[usize::from(*v)] += 1);
    }
    let texels = (u64::from(texture.width) * u64::from(texture.height)).max(1) as f64;
    let sum = |of: &[u64; 256], value: &dyn Fn(usize) -> f64| of.iter().enumerate().map(|(v, n)| *n as f64 * value(v)).sum::<f64>();
    let [r, g, b, a] = &counts;
    let colour = |of: &[u64; 256]| (sum(of, &|v| linear[v]) / texels) as f32;
    let alpha = if texture.has_alpha { (sum(a, &|v| v as f64 / 255.0) / texels) as f32 } else { 1.0 };
    [colour(r), colour(g), colour(b), alpha]
}

fn key(name: &str, wanted: Wanted) -> (String, bool) {
    (name.to_owned(), wanted.coding == Coding::Linear)
}

/// Whether a texture's alpha is nearly all or nothing. Asked once for each texture: a thousand materials may share it.
fn is_cut_out(texture: &Texture) -> bool {
    let alphas = || texture.texels.chunks_exact(4).map(|p| p[3]).filter(|a| *a < 255);
    texture.has_alpha && alphas().filter(|a| (16..240).contains(a)).count() * CUT_OUT <= alphas().count()
}

/// No path has a line break, so a recipe is no file.
fn made_key(recipe: &str) -> (String, bool) {
    (format!("made\n{recipe}"), true)
}

/// Share of an image's transparent pixels that may be half transparent in an image meant to be cut out.
const CUT_OUT: usize = 20;

impl Images {
    /// Adds a texture that an importer made itself; transparent where it says so.
    pub(super) fn push(&mut self, texture: Texture, transparent: bool, at: At<'_>, findings: &mut Findings) -> Option<Image> {
        self.keep(Decoded { texture, transparent }, None, at, findings)
    }

    /// Adds what an importer made of other images by a recipe, or could not make, which it said.
    pub(super) fn keep_made(&mut self, recipe: &str, made: Option<Decoded>, at: At<'_>, findings: &mut Findings) -> Option<Image> {
        let image = made.and_then(|decoded| self.keep(decoded, None, at, findings));
        self.images.insert(made_key(recipe), image);
        image
    }

    /// What an importer made by a recipe before; nothing, where the textures are too large already. `None` where it has to be made.
    pub(super) fn known_made(&self, recipe: &str) -> Option<Option<Image>> {
        self.images.get(&made_key(recipe)).copied().or_else(|| self.is_full().then_some(None))
    }

    /// A linear texture made of the texels of another one by a recipe, which is also what it is called.
    pub(super) fn derive(
        &mut self,
        recipe: &str,
        source: u32,
        texel: impl Fn(&[u8]) -> [u8; 3],
        at: At<'_>,
        findings: &mut Findings,
    ) -> Option<Image> {
        if let Some(known) = self.known_made(recipe) {
            return known;
        }
        let from = self.textures.get(source as usize)?;
        let texels = from.texels.chunks_exact(from.channels()).flat_map(texel).collect();
        let texture = Texture { name: recipe.to_owned(), coding: Coding::Linear, has_alpha: false, texels, ..*from };
        self.keep_made(recipe, Some(Decoded { texture, transparent: false }), at, findings)
    }

    /// How opacity is meant where a file does not say: a factor below one blends, an image that is nearly all or nothing is cut out at
    /// `cutoff`, and any other blends.
    pub(super) fn alpha_mode(&self, factor: f32, image: Option<Image>, cutoff: f32) -> AlphaMode {
        match image.filter(|i| i.transparent) {
            _ if factor < 1.0 => AlphaMode::Blend,
            Some(image) if self.cut_outs.contains(&image.id) => AlphaMode::Mask { cutoff },
            Some(_) => AlphaMode::Blend,
            None => AlphaMode::Opaque,
        }
    }
}

#[cfg(test)]
mod tests;
