//! The textures of MTL materials: files looked up, options turned into references, and single numbers taken out of pictures.
//!
//! The canonical material wants opacity in an alpha channel and roughness and metalness in one texture; MTL has a picture for each. So
//! textures are made: decoded once more, for the channel that counts, which costs the time of a decoding.

use super::map::{Channel, Map};
use crate::import::{
    Bundle, BundlePath,
    bundle::Found,
    findings::{At, Findings},
    images::{Image, Images, Wanted},
    texture::{self, Decoded},
};
use kiln_proto::{
    limits,
    scene::{Coding, Texture, TextureRef, Wrap},
};

/// One texture statement: where it stands, in which file, what it says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Named<'m> {
    pub(super) from: &'m BundlePath,
    pub(super) at: At<'m>,
    pub(super) map: &'m Map,
}

/// Single numbers in [0, 255], from the lower left.
struct Plane {
    width: u32,
    height: u32,
    values: Vec<u8>,
}

/// The textures of a file so far.
pub(super) struct Pictures<'b> {
    bundle: &'b Bundle,
    pub(super) images: Images,
}

impl<'b> Pictures<'b> {
    pub(super) fn new(bundle: &'b Bundle) -> Self {
        Self { bundle, images: Images::default() }
    }

    /// The file that a map names; `None` where there is none, which is then an error.
    fn path(&self, named: Named<'_>, findings: &mut Findings) -> Option<&'b BundlePath> {
        let file = &named.map.file;
        match self.bundle.find(named.from, file) {
            Some(Found::Exact(path)) => Some(path),
            Some(Found::Near(path)) => {
                findings.warn(named.at, format!("the texture `{file}` is not in the bundle; `{path}` is used instead"));
                Some(path)
            }
            None => {
                findings.error(named.at, format!("the texture `{file}` is not in the bundle"));
                None
            }
        }
    }

    /// A picture as it is.
    pub(super) fn picture(&mut self, named: Named<'_>, coding: Coding, findings: &mut Findings) -> Option<(Image, TextureRef)> {
        let path = self.path(named, findings)?;
        let wanted = Wanted { coding, alpha: coding == Coding::Srgb };
        let image = self.images.file(self.bundle, path, wanted, named.at, findings)?;
        Some((image, reference(image, named.map)))
    }

    /// A picture of opacity: its alpha channel where it has transparent pixels, else its luminance.
    pub(super) fn opacity(&mut self, named: Named<'_>, findings: &mut Findings) -> Option<(Image, TextureRef)> {
        let path = self.path(named, findings)?;
        let map = named.map;
        let decoded = self.decode(path, named.at, findings)?;
        if decoded.transparent && matches!(map.channel, None | Some(Channel::Matte)) && map.range.is_none() {
            let wanted = Wanted { coding: Coding::Srgb, alpha: true };
            let image = self.images.file(self.bundle, path, wanted, named.at, findings)?;
            return Some((image, reference(image, map)));
        }
        let channel = map.channel.unwrap_or(if decoded.transparent { Channel::Matte } else { Channel::Luminance });
        let recipe = format!("opacity\n{path}\n{channel:?}\n{:?}", map.range);
        let image = self.images.made(&recipe, named.at, findings, |_| {
            let plane = plane(&decoded.texture, channel, map.range);
            let transparent = plane.values.iter().any(|a| *a < 255);
            let texels = plane.values.iter().flat_map(|a| [255, 255, 255, *a]).collect();
            Some(Decoded { texture: texture(path, &plane, Coding::Srgb, true, texels), transparent })
        })?;
        Some((image, reference(image, map)))
    }

    /// One texture of roughness (green) and metalness (blue). A picture in colour that is named for both is taken to hold them there; of any
    /// other the luminance counts.
    pub(super) fn surface(
        &mut self,
        roughness: Option<Named<'_>>,
        metalness: Option<Named<'_>>,
        findings: &mut Findings,
    ) -> Option<TextureRef> {
        let first = roughness.or(metalness)?;
        let packed = roughness.zip(metalness).is_some_and(|(r, m)| r.map.file == m.map.file);
        let mut recipe = String::from("surface");
        let mut planes = [None, None];
        for ((slot, named), own) in planes.iter_mut().zip([roughness, metalness]).zip([Channel::Green, Channel::Blue]) {
            let Some(named) = named else { continue };
            if reference_of(named.map) != reference_of(first.map) {
                findings.warn(named.at, "map_Pm lies otherwise on the surface than map_Pr; it was laid like map_Pr");
            }
            let Some(path) = self.path(named, findings) else { continue };
            let Some(decoded) = self.decode(path, named.at, findings) else { continue };
            let channel = named.map.channel.unwrap_or(if packed && is_colourful(&decoded.texture) { own } else { Channel::Luminance });
            recipe += &format!("\n{path}\n{channel:?}\n{:?}", named.map.range);
            *slot = Some((path, plane(&decoded.texture, channel, named.map.range)));
        }
        recipe += if roughness.is_none() { "\nmetal only" } else { "" };
        let image = self.images.made(&recipe, first.at, findings, |_| {
            let size = |p: &Option<(&BundlePath, Plane)>| p.as_ref().map_or(0, |(_, p)| u64::from(p.width) * u64::from(p.height));
            let larger = if size(&planes[1]) > size(&planes[0]) { &planes[1] } else { &planes[0] };
            let (path, shape) = larger.as_ref()?;
            let texels = (0..shape.height).flat_map(|y| (0..shape.width).map(move |x| (x, y))).flat_map(|at| {
                let [r, m] = [0, 1].map(|k| planes[k].as_ref().map_or(255, |(_, p)| p.near(at, shape)));
                [255, r, m]
            });
            let texels = texels.collect();
            Some(Decoded { texture: texture(path, shape, Coding::Linear, false, texels), transparent: false })
        })?;
        Some(reference(image, first.map))
    }

    /// The mean of the numbers in a picture, [0, 1].
    pub(super) fn mean(&mut self, named: Named<'_>, findings: &mut Findings) -> Option<f32> {
        let path = self.path(named, findings)?;
        let decoded = self.decode(path, named.at, findings)?;
        let plane = plane(&decoded.texture, named.map.channel.unwrap_or(Channel::Luminance), named.map.range);
        let sum: u64 = plane.values.iter().map(|v| u64::from(*v)).sum();
        Some((sum as f64 / (255.0 * plane.values.len() as f64)) as f32)
    }

    /// The normal map in a picture that is named as a bump map, as exporters do; `None` where it is one of heights or missing, which is said.
    pub(super) fn bump(&mut self, named: Named<'_>, findings: &mut Findings) -> Option<TextureRef> {
        let file = &named.map.file;
        let Some(Found::Exact(path) | Found::Near(path)) = self.bundle.find(named.from, file) else {
            findings.warn(named.at, format!("the bump map `{file}` is not in the bundle; the surface is baked smooth"));
            return None;
        };
        let decoded = self.decode(path, named.at, findings)?;
        if !holds_normals(&decoded.texture) {
            findings.warn(named.at, format!("the bump map `{path}` holds heights, which are not supported; the surface is baked smooth"));
            return None;
        }
        findings.warn(named.at, format!("the bump map `{path}` holds normals and is used as a normal map"));
        self.picture(named, Coding::Linear, findings).map(|(_, reference)| reference)
    }

    fn decode(&self, path: &BundlePath, at: At<'_>, findings: &mut Findings) -> Option<Decoded> {
        let bytes = self.bundle.read(path, limits::BUNDLE_BYTES).map_err(|problem| findings.push_error(problem)).ok()?;
        let decoded = texture::decode(path.as_str(), &bytes, Coding::Linear, true);
        decoded.map_err(|e| findings.error(at, format!("the image `{path}` {e}"))).ok()
    }
}

impl Plane {
    /// The number at a place of another plane.
    fn near(&self, (x, y): (u32, u32), of: &Plane) -> u8 {
        let scaled = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(from)) as usize;
        self.values[scaled(y, of.height, self.height) * self.width as usize + scaled(x, of.width, self.width)]
    }
}

fn texture(path: &BundlePath, shape: &Plane, coding: Coding, has_alpha: bool, texels: Vec<u8>) -> Texture {
    Texture { name: path.as_str().to_owned(), width: shape.width, height: shape.height, coding, has_alpha, texels }
}

fn plane(texture: &Texture, channel: Channel, range: Option<[f32; 2]>) -> Plane {
    let pick = |p: &[u8]| match channel {
        Channel::Red => p[0],
        Channel::Green => p[1],
        Channel::Blue => p[2],
        Channel::Matte => p.get(3).copied().unwrap_or(255),
        // Rec. 709 in 256ths.
        Channel::Luminance => ((54 * u32::from(p[0]) + 183 * u32::from(p[1]) + 19 * u32::from(p[2]) + 128) >> 8).min(255) as u8,
    };
    let [base, gain] = range.unwrap_or([0.0, 1.0]);
    let change = |v: u8| if range.is_some() { (255.0 * base + gain * f32::from(v)).clamp(0.0, 255.0).round() as u8 } else { v };
    let values = texture.texels.chunks_exact(texture.channels()).map(|p| change(pick(p))).collect();
    Plane { width: texture.width, height: texture.height, values }
}

/// Whether some pixels are no greys.
fn is_colourful(texture: &Texture) -> bool {
    texture.texels.chunks_exact(texture.channels()).any(|p| p[0].abs_diff(p[1]).max(p[1].abs_diff(p[2])) > 8)
}

/// Whether nine of ten pixels are unit vectors that look out of the surface.
fn holds_normals(texture: &Texture) -> bool {
    let is_normal = |p: &[u8]| {
        let [x, y, z] = [p[0], p[1], p[2]].map(|c| (f32::from(c) - 128.0) / 127.0);
        z > 0.0 && (x * x + y * y + z * z - 1.0).abs() < 0.2
    };
    let pixels = texture.texels.len() / texture.channels();
    texture.texels.chunks_exact(texture.channels()).filter(|p| is_normal(p)).count() * 10 >= pixels * 9
}

fn reference(image: Image, map: &Map) -> TextureRef {
    TextureRef { texture: image.id, ..reference_of(map) }
}

/// How a map lies on the surface.
fn reference_of(map: &Map) -> TextureRef {
    let ([su, sv], [ou, ov]) = (map.scale, map.offset);
    let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
    TextureRef { transform: [[su, 0.0, ou], [0.0, sv, ov]], wrap: [wrap; 2], ..TextureRef::plain(0, 0) }
}
