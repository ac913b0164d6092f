//! The pictures of an environment's textures: images, numbers and high dynamic range, and what shape they have.
//!
//! Pixels of 8 bits stay what they are until they are looked at: as radiance they would take four times the memory. They are no textures of
//! the scene, so they do not go through its list of images.

use super::{
    super::pixels::pixels,
    cube::{Cube, Face, NAMES},
    map::{self, Source},
};
use crate::import::{
    Bundle,
    bundle::Found,
    environment::{
        picture::{self, EnvironmentError, Picture},
        settle,
    },
    findings::{At, Findings},
    texture::{self, TextureError},
    uri,
    x3d::{self, NodeId, NodeRef},
};
use kiln_proto::{
    limits, math,
    scene::{Coding, Environment, Texture},
    units::Rgb,
};
use std::{
    borrow::Cow,
    collections::BTreeMap,
    f32::consts::FRAC_PI_2,
    sync::{Arc, OnceLock},
};

/// A picture, row 0 at the bottom.
#[derive(Debug)]
pub(super) enum Pixels {
    /// 8 bits a channel, sRGB, without alpha.
    Coded(Texture),
    /// Radiance, from the top row down.
    Linear(Picture),
}

impl Pixels {
    /// Width and height.
    pub(super) fn size(&self) -> [usize; 2] {
        match self {
            Self::Coded(texture) => [texture.width as usize, texture.height as usize],
            Self::Linear(picture) => [picture.width, picture.height],
        }
    }

    /// The radiance of a pixel, from the left and from the bottom.
    pub(super) fn at(&self, column: usize, row: usize) -> Rgb {
        match self {
            Self::Coded(texture) => {
                let at = (row * texture.width as usize + column) * texture.channels();
                let linear = linear();
                Rgb::from(std::array::from_fn(|c| linear[usize::from(texture.texels[at + c])]))
            }
            Self::Linear(picture) => Rgb::from(picture.rgb[(picture.height - 1 - row) * picture.width + column]),
        }
    }

    /// All of them as a map that looks toward -Z, where the front of a cube is.
    fn panorama(&self) -> Environment {
        let [width, height] = self.size();
        let rgb = (0..height).flat_map(|row| (0..width).map(move |column| self.at(column, row).to_array())).collect();
        Environment { rotation: FRAC_PI_2, ..map::plain([width as u32, height as u32], rgb) }
    }
}

/// The radiance of every value of 8 bits.
fn linear() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|v| math::srgb_eotf(v as f32 / 255.0)))
}

/// Why a picture was refused.
#[derive(Debug, thiserror::Error)]
enum PictureError {
    /// Formats of graphics hardware.
    #[error("is a {0} file, which is not read: give six images, a panorama (2:1) or a cross of faces as PNG, JPEG, HDR or EXR")]
    Container(&'static str),
    /// Too many pixels together.
    #[error("brings the pictures of one environment beyond {} pixels; scale them down", limits::ENVIRONMENT_PIXELS)]
    TooMany,
    /// An image of 8 bits.
    #[error(transparent)]
    Image(#[from] TextureError),
    /// HDR or EXR.
    #[error(transparent)]
    Map(#[from] EnvironmentError),
}

/// Reads the textures of one light.
pub(super) struct Reader<'b> {
    bundle: &'b Bundle,
    /// Nodes that have been read: several faces may use one.
    known: BTreeMap<NodeId, Option<Arc<Pixels>>>,
    /// Pixels so far.
    sum: u64,
}

impl<'b> Reader<'b> {
    pub(super) fn new(bundle: &'b Bundle) -> Self {
        Self { bundle, known: BTreeMap::new(), sum: 0 }
    }

    /// What a texture shows by direction; `None` where it has nothing to show, which is said.
    pub(super) fn source(&mut self, node: NodeRef<'_>, findings: &mut Findings) -> Option<Source> {
        match node.kind() {
            "ComposedCubeMapTexture" => self.composed(node, findings),
            "ImageCubeMapTexture" | "ImageTexture" | "PixelTexture" => {
                let pixels = self.pixels(node, findings)?;
                let [width, height] = pixels.size();
                if width == 2 * height {
                    return Some(Source::Map(pixels.panorama()));
                }
                if let Some(cube) = Cube::of_cross(&pixels) {
                    return Some(Source::Cube(cube));
                }
                let message =
                    format!("the picture of the environment has {width}x{height} pixels: it is no panorama (2:1) and no cross (4:3, 3:4)");
                findings.error(node.at(), message);
                None
            }
            other => {
                findings.warn(node.at(), format!("{other} cannot be an environment; the EnvironmentLight was left out"));
                None
            }
        }
    }

    fn composed(&mut self, node: NodeRef<'_>, findings: &mut Findings) -> Option<Source> {
        let mut faces: [Option<Face>; 6] = std::array::from_fn(|_| None);
        let mut first: Option<(&str, [usize; 2])> = None;
        for (name, face) in NAMES.into_iter().zip(&mut faces) {
            let Some(texture) = node.node(&format!("{name}Texture")) else {
                findings.warn(node.at(), format!("ComposedCubeMapTexture has no {name}Texture; there it is black"));
                continue;
            };
            if !matches!(texture.kind(), "ImageTexture" | "PixelTexture") {
                findings.warn(texture.at(), format!("{} cannot be the face of a cube; there it is black", texture.kind()));
                continue;
            }
            let pixels = self.pixels(texture, findings)?;
            let size @ [width, height] = pixels.size();
            if width != height {
                findings.error(texture.at(), format!("the {name}Texture has {width}x{height} pixels; faces of a cube are square"));
                return None;
            }
            match first {
                Some((other, [side, _])) if side != width => {
                    let message = format!(
                        "the {name}Texture has {width}x{height} pixels, the {other}Texture {side}x{side}; faces of a cube are equal"
                    );
                    findings.error(texture.at(), message);
                    return None;
                }
                _ => first = first.or(Some((name, size))),
            }
            *face = Some(Face { pixels, corner: [0, 0], turned: false });
        }
        let Some((_, [side, _])) = first else {
            findings.warn(node.at(), "ComposedCubeMapTexture has no faces; the EnvironmentLight was left out");
            return None;
        };
        Some(Source::Cube(Cube::new(faces, side as u32)))
    }

    fn pixels(&mut self, node: NodeRef<'_>, findings: &mut Findings) -> Option<Arc<Pixels>> {
        if let Some(known) = self.known.get(&node.id()) {
            return known.clone();
        }
        if node.has("flipVertically") && node.bool("flipVertically") {
            findings.count(node.at(), "flipVertically was not used in pictures of an environment");
        }
        let read = if node.kind() == "PixelTexture" {
            pixels(node, Coding::Srgb, String::new(), findings).map(Pixels::Coded)
        } else {
            self.file(node, findings)
        };
        let read = read.map(Arc::new);
        self.known.insert(node.id(), read.clone());
        read
    }

    /// The first of the addresses that there is and that can be read; of formats that are known and not read, the next one is tried.
    fn file(&mut self, node: NodeRef<'_>, findings: &mut Findings) -> Option<Pixels> {
        let (at, urls) = (node.at_field("url"), node.mf_string("url"));
        let mut refused = None;
        for url in urls {
            let Some((name, bytes)) = self.fetch(node, url.trim(), findings)? else { continue };
            match self.decode(&name, &bytes, at, findings) {
                Ok(pixels) => return Some(pixels),
                Err(error @ PictureError::Container(_)) => refused = refused.or(Some((name, error))),
                Err(error) => {
                    findings.error(at, format!("the image `{name}` {error}"));
                    return None;
                }
            }
        }
        let listed: Vec<&str> = urls.iter().map(AsRef::as_ref).take(5).collect();
        let message = match refused {
            Some((name, error)) => format!("the image `{name}` {error}"),
            None if urls.is_empty() => format!("{} has no url", node.kind()),
            None => format!("the image `{}` is not in the bundle; nothing is fetched from elsewhere", listed.join("`, `")),
        };
        findings.error(at, message);
        None
    }

    /// The name and the bytes of an address, nothing where the bundle has no such file; `None` where it cannot be read, which is then an error.
    fn fetch(&self, node: NodeRef<'_>, url: &str, findings: &mut Findings) -> Option<Option<(String, Cow<'b, [u8]>)>> {
        let (at, from) = (node.at_field("url"), node.file_of("url"));
        if uri::is_data(url) {
            let bytes = uri::data(&url[5..]).map_err(|message| findings.error(at, message)).ok()?;
            return Some(Some(("data".to_owned(), bytes.into())));
        }
        let found = x3d::find(self.bundle, from, url);
        let Some(Found::Exact(path) | Found::Near(path)) = found else { return Some(None) };
        if let Some(Found::Near(_)) = found {
            findings.warn(at, format!("the image `{url}` is not in the bundle; `{path}` is used instead"));
        }
        let bytes = self.bundle.read(path, limits::BUNDLE_BYTES).map_err(|problem| findings.push_error(problem)).ok()?;
        Some(Some((path.to_string(), bytes)))
    }

    fn decode(&mut self, name: &str, bytes: &[u8], at: At<'_>, findings: &mut Findings) -> Result<Pixels, PictureError> {
        if let Some(container) = container(bytes) {
            return Err(PictureError::Container(container));
        }
        if picture::is_map(name, bytes) {
            let mut picture = picture::decode(name, bytes)?;
            self.count(picture.rgb.len() as u64)?;
            settle(&mut picture, at, findings);
            return Ok(Pixels::Linear(picture));
        }
        // Before a pixel is decoded.
        let (width, height) = texture::size(name, bytes)?;
        self.count(u64::from(width) * u64::from(height))?;
        Ok(Pixels::Coded(texture::decode(name, bytes, Coding::Srgb, false)?.texture))
    }

    fn count(&mut self, pixels: u64) -> Result<(), PictureError> {
        self.sum += pixels;
        if self.sum > limits::ENVIRONMENT_PIXELS { Err(PictureError::TooMany) } else { Ok(()) }
    }
}

/// A format of graphics hardware, by its first bytes.
fn container(bytes: &[u8]) -> Option<&'static str> {
    const KNOWN: [(&[u8], &str); 3] = [(b"DDS ", "DDS"), (b"\xabKTX 11\xbb", "KTX"), (b"\xabKTX 20\xbb", "KTX2")];
    KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, name)| *name)
}
