//! The textures of a scene: each image is decoded once for each meaning that its bytes have, whoever asks for it.
//!
//! The bounds are those of `texture`, and all images together are bounded too. An image keeps its alpha channel only where somebody uses it:
//! the first who does has it decoded again in place, which costs time rarely instead of memory always.

use super::{
    Bundle, BundlePath,
    findings::{At, Findings},
    texture::{self, Decoded},
};
use crate::records::Problem;
use kiln_proto::{
    limits,
    scene::{Coding, Texture},
};
use std::{borrow::Cow, collections::BTreeMap};

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
        let key = key(name, wanted);
        let place = self.images.get(&key).copied().flatten().map(|image| image.id);
        let bytes = read().map_err(|problem| findings.push_error(problem)).ok();
        let decoded = bytes.and_then(|bytes| {
            let decoded = texture::decode(name, &bytes, wanted.coding, wanted.alpha);
            decoded.map_err(|e| findings.error(at, format!("the image `{name}` {e}"))).ok()
        });
        let image = decoded.and_then(|decoded| self.keep(decoded, place, at, findings));
        self.images.insert(key, image);
        image
    }

    /// Puts a texture into the list, or in the place of what it was without alpha.
    fn keep(&mut self, decoded: Decoded, place: Option<u32>, at: At<'_>, findings: &mut Findings) -> Option<Image> {
        let Decoded { texture, transparent } = decoded;
        self.bytes += texture.texels.len() as u64;
        self.bytes -= place.map_or(0, |id| self.textures[id as usize].texels.len() as u64);
        if self.bytes > limits::BUNDLE_BYTES {
            findings.error(at, format!("the textures together exceed {} bytes; scale them down", limits::BUNDLE_BYTES));
            return None;
        }
        let id = place.unwrap_or(self.textures.len() as u32);
        match self.textures.get_mut(id as usize) {
            Some(slot) => *slot = texture,
            None => self.textures.push(texture),
        }
        Some(Image { id, transparent })
    }
}

fn key(name: &str, wanted: Wanted) -> (String, bool) {
    (name.to_owned(), wanted.coding == Coding::Linear)
}

impl Images {
    /// Adds a texture that an importer made itself; transparent where it says so.
    pub(super) fn push(&mut self, texture: Texture, transparent: bool, at: At<'_>, findings: &mut Findings) -> Option<Image> {
        self.keep(Decoded { texture, transparent }, None, at, findings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
    use std::io::Cursor;

    fn png() -> Vec<u8> {
        let mut out = Cursor::new(vec![]);
        DynamicImage::from(RgbaImage::from_pixel(2, 1, Rgba([1, 2, 3, 9]))).write_to(&mut out, ImageFormat::Png).unwrap();
        out.into_inner()
    }

    #[test]
    fn an_image_is_decoded_once_for_each_meaning_and_keeps_alpha_on_demand() {
        let (mut images, mut findings, bytes) = (Images::default(), Findings::default(), png());
        let mut ask = |coding, alpha| {
            let wanted = Wanted { coding, alpha };
            let image = images.bytes("a.png", wanted, At::file("s"), &mut findings, || Ok(Cow::Borrowed(&bytes))).unwrap();
            (image.id, image.transparent, images.textures[image.id as usize].has_alpha)
        };
        assert_eq!(ask(Coding::Srgb, false), (0, true, false));
        assert_eq!(ask(Coding::Linear, false), (1, true, false));
        assert_eq!(ask(Coding::Srgb, true), (0, true, true));
        assert_eq!(ask(Coding::Srgb, false), (0, true, true));
        assert_eq!((images.textures.len(), images.bytes), (2, 8 + 6));
        assert_eq!((images.textures[0].coding, images.textures[1].coding), (Coding::Srgb, Coding::Linear));
    }

    #[test]
    fn a_broken_image_is_told_once() {
        let (mut images, mut findings) = (Images::default(), Findings::default());
        for _ in 0..2 {
            let wanted = Wanted { coding: Coding::Srgb, alpha: false };
            assert!(images.bytes("a.png", wanted, At::line("s", 3), &mut findings, || Ok(Cow::Borrowed(&[1, 2]))).is_none());
        }
        let errors = findings.into_errors("s");
        assert_eq!((errors.len(), errors[0].line), (1, Some(3)));
    }
}
