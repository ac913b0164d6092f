//! The pictures of an environment's textures: images, numbers and high dynamic range, and what shape they have.
//!
//! Faces of 8 bits stay what they are until they are looked at: as radiance they would take four times the memory. A panorama becomes the
//! map itself. They are no textures of the scene, so they do not go through its list of images.

use super::{
    super::{
        address::{self, Target},
        pixels::{is_empty, pixels},
    },
    cube::{Cube, Face, NAMES},
    map::{self, Source},
};
use crate::import::{
    Bundle,
    environment::{
        picture::{self, EnvironmentError, Picture},
        settle,
    },
    findings::{At, Findings},
    texture::{self, TextureError},
    uri,
    x3d::{NodeId, NodeRef},
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
    rc::Rc,
    sync::{Arc, OnceLock},
};

/// A picture, row 0 at the bottom.
#[derive(Debug)]
pub(super) enum Pixels {
    /// 8 bits a channel, sRGB, without alpha.
    Coded(Texture),
    /// Radiance.
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
            Self::Linear(picture) => Rgb::from(picture.rgb[row * picture.width + column]),
        }
    }

    /// The radiance of all of them.
    fn radiance(&self) -> Vec<[f32; 3]> {
        let [width, height] = self.size();
        (0..height).flat_map(|row| (0..width).map(move |column| self.at(column, row).to_array())).collect()
    }
}

/// A map of all pixels that looks toward -Z, where the front of a cube is. Radiance that nobody else needs is not copied.
fn panorama(pixels: Arc<Pixels>) -> Environment {
    let size = pixels.size().map(|v| v as u32);
    let rgb = match Arc::try_unwrap(pixels) {
        Ok(Pixels::Linear(picture)) => picture.rgb,
        Ok(coded) => coded.radiance(),
        Err(shared) => shared.radiance(),
    };
    Environment { rotation: FRAC_PI_2, ..map::plain(size, rgb) }
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

/// Reads the textures of the lights of one scene, each once: a light that stands in many places says once what is wrong with its picture.
pub(super) struct Reader<'b> {
    bundle: &'b Bundle,
    /// What textures show that another light needs.
    sources: BTreeMap<NodeId, Option<Rc<Source>>>,
    /// Pictures that have been read: several faces may use one.
    known: BTreeMap<NodeId, Option<Arc<Pixels>>>,
    /// Pixels so far.
    sum: u64,
}

impl<'b> Reader<'b> {
    pub(super) fn new(bundle: &'b Bundle) -> Self {
        Self { bundle, sources: BTreeMap::new(), known: BTreeMap::new(), sum: 0 }
    }

    /// What a texture shows by direction; `None` where it has nothing to show, which is said once. It is kept where it is wanted `again`.
    pub(super) fn source(&mut self, node: NodeRef<'_>, again: bool, findings: &mut Findings) -> Option<Rc<Source>> {
        let known = self.sources.remove(&node.id());
        let source = known.unwrap_or_else(|| self.read(node, findings).map(Rc::new));
        if again {
            self.sources.insert(node.id(), source.clone());
        }
        source
    }

    fn read(&mut self, node: NodeRef<'_>, findings: &mut Findings) -> Option<Source> {
        match node.kind() {
            _ if is_empty(node) => {
                findings.warn(node.at(), "PixelTexture has no pixels; the EnvironmentLight was left out");
                None
            }
            "ComposedCubeMapTexture" => self.composed(node, findings),
            "ImageCubeMapTexture" | "ImageTexture" | "PixelTexture" => {
                let pixels = self.pixels(node, findings)?;
                let [width, height] = pixels.size();
                if width == 2 * height {
                    // No face is as wide: whoever needs the same picture needs this source.
                    self.known.remove(&node.id());
                    return Some(Source::Map(panorama(pixels)));
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
            let texture = match face_of(node, &format!("{name}Texture")) {
                Ok(texture) => texture,
                Err((at, what)) => {
                    findings.warn(at, format!("{what}; there it is black"));
                    continue;
                }
            };
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
        let at = node.at_field("url");
        let (mut refused, mut tried) = (None, 0);
        while let Some((number, target)) = address::next(self.bundle, node, tried, findings) {
            tried = number + 1;
            let (name, bytes) = self.fetch(target, at, findings)?;
            match self.decode(&name, &bytes, at, findings) {
                Ok(pixels) => return Some(pixels),
                Err(error @ PictureError::Container(_)) => refused = refused.or(Some((name, error))),
                Err(error) => {
                    findings.error(at, format!("the image `{name}` {error}"));
                    return None;
                }
            }
        }
        let message = match refused {
            Some((name, error)) => format!("the image `{name}` {error}"),
            None if node.mf_string("url").is_empty() => format!("{} has no url", node.kind()),
            None => address::missing(node),
        };
        findings.error(at, message);
        None
    }

    /// The name and the bytes of a picture; `None` where it cannot be read, which is then an error.
    fn fetch(&self, target: Target<'b, '_>, at: At<'_>, findings: &mut Findings) -> Option<(String, Cow<'b, [u8]>)> {
        match target {
            Target::Data(data) => {
                let bytes = uri::data(data).map_err(|message| findings.error(at, message)).ok()?;
                Some(("data".to_owned(), bytes.into()))
            }
            Target::File(path) => {
                let bytes = self.bundle.read(path, limits::BUNDLE_BYTES).map_err(|problem| findings.push_error(problem)).ok()?;
                Some((path.to_string(), bytes))
            }
        }
    }

    fn decode(&mut self, name: &str, bytes: &[u8], at: At<'_>, findings: &mut Findings) -> Result<Pixels, PictureError> {
        if let Some(container) = container(bytes) {
            return Err(PictureError::Container(container));
        }
        if picture::is_map(name, bytes) {
            let [width, height] = picture::size(name, bytes)?;
            self.count(width as u64 * height as u64)?;
            let mut picture = picture::decode(name, bytes)?;
            settle(&mut picture, at, findings);
            return Ok(Pixels::Linear(picture));
        }
        let (width, height) = texture::size(name, bytes)?;
        self.count(u64::from(width) * u64::from(height))?;
        Ok(Pixels::Coded(texture::decode(name, bytes, Coding::Srgb, false)?.texture))
    }

    /// Counts the pixels of a picture before one is decoded.
    fn count(&mut self, pixels: u64) -> Result<(), PictureError> {
        self.sum += pixels;
        if self.sum > limits::ENVIRONMENT_PIXELS { Err(PictureError::TooMany) } else { Ok(()) }
    }
}

/// The texture of a face of a cube; where there is none, what is missing.
fn face_of<'d>(cube: NodeRef<'d>, field: &str) -> Result<NodeRef<'d>, (At<'d>, String)> {
    match cube.node(field) {
        None => Err((cube.at(), format!("ComposedCubeMapTexture has no {field}"))),
        Some(face) if is_empty(face) => Err((face.at(), format!("the {field} has no pixels"))),
        Some(face) if matches!(face.kind(), "ImageTexture" | "PixelTexture") => Ok(face),
        Some(other) => Err((other.at(), format!("{} cannot be the face of a cube", other.kind()))),
    }
}

/// A format of graphics hardware, by its first bytes.
fn container(bytes: &[u8]) -> Option<&'static str> {
    const KNOWN: [(&[u8], &str); 3] = [(b"DDS ", "DDS"), (b"\xabKTX 11\xbb", "KTX"), (b"\xabKTX 20\xbb", "KTX2")];
    KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, name)| *name)
}
