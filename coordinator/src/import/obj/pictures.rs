//! The textures of MTL materials: files looked up, options turned into references, and single numbers taken out of pictures.
//!
//! The canonical material wants opacity in an alpha channel and roughness and metalness in one texture; MTL has a picture for each. So
//! textures are made, each once for all materials that ask for the same: a picture is decoded once to know it and once for each texture
//! that is made of it. The last one is kept, so that most are decoded once.

use super::{
    facts::{Facts, Plane},
    map::{Channel, Map},
};
use crate::import::{
    Bundle, BundlePath,
    bundle::Found,
    findings::{At, Findings},
    images::{self, Image, Images, Wanted},
    texture::Decoded,
};
use kiln_proto::{
    limits,
    scene::{Coding, Texture, TextureRef, Wrap},
};
use std::{collections::BTreeMap, rc::Rc};

/// One texture statement: where it stands, in which file, what it says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Named<'m> {
    pub(super) from: &'m BundlePath,
    pub(super) at: At<'m>,
    pub(super) map: &'m Map,
}

/// What one channel of a picture is wanted for: the picture, the channel, and the change of its values.
type Wish<'b> = (&'b BundlePath, Channel, Option<[f32; 2]>);

/// The textures of a file so far.
pub(super) struct Pictures<'b> {
    bundle: &'b Bundle,
    /// What is known of the pictures that were decoded; `None` of one that could not be, which was told.
    facts: BTreeMap<&'b BundlePath, Option<Facts>>,
    /// The picture that was decoded last.
    last: Option<(&'b BundlePath, Rc<Decoded>)>,
    pub(super) images: &'b mut Images,
}

impl<'b> Pictures<'b> {
    pub(super) fn new(bundle: &'b Bundle, images: &'b mut Images) -> Self {
        Self { bundle, facts: BTreeMap::new(), last: None, images }
    }

    /// The file that a map names; `None` where there is none, which is then an error.
    fn path(&self, named: Named<'_>, findings: &mut Findings) -> Option<&'b BundlePath> {
        let file = &named.map.file;
        let Some(found) = self.bundle.find(named.from, file) else {
            findings.error(named.at, format!("the texture `{file}` is not in the bundle"));
            return None;
        };
        Some(found.told("the texture", file, |message| findings.warn(named.at, message)))
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
        let transparent = self.facts(path, named.at, findings)?.transparent;
        if transparent && matches!(map.channel, None | Some(Channel::Matte)) && map.range.is_none() {
            let wanted = Wanted { coding: Coding::Srgb, alpha: true };
            let image = self.images.file(self.bundle, path, wanted, named.at, findings)?;
            return Some((image, reference(image, map)));
        }
        let channel = map.channel.unwrap_or(if transparent { Channel::Matte } else { Channel::Luminance });
        let recipe = format!("opacity\n{path}\n{channel:?}\n{:?}", map.range);
        let image = self.made(&recipe, named.at, findings, |pictures, findings| {
            let plane = pictures.plane((path, channel, map.range), named.at, findings)?;
            let transparent = plane.values.iter().any(|a| *a < 255);
            let texels = plane.values.iter().flat_map(|a| [255, 255, 255, *a]).collect();
            let texture = texture(path, [plane.width, plane.height], Coding::Srgb, true, texels);
            Some(Decoded { texture, transparent })
        })?;
        Some((image, reference(image, map)))
    }

    /// One texture of roughness (green) and metalness (blue). A picture in colour that is named for both is taken to hold them there; of
    /// any other the luminance counts.
    pub(super) fn surface(
        &mut self,
        roughness: Option<Named<'_>>,
        metalness: Option<Named<'_>>,
        findings: &mut Findings,
    ) -> Option<TextureRef> {
        let first = roughness.or(metalness)?;
        let packed = roughness.zip(metalness).is_some_and(|(r, m)| r.map.file == m.map.file);
        let mut recipe = String::from("surface");
        let mut wishes = [None, None];
        for ((slot, named), own) in wishes.iter_mut().zip([roughness, metalness]).zip([Channel::Green, Channel::Blue]) {
            let Some(named) = named else { continue };
            if reference_of(named.map) != reference_of(first.map) {
                findings.warn(named.at, "map_Pm lies otherwise on the surface than map_Pr; it was laid like map_Pr");
            }
            let Some(path) = self.path(named, findings) else { continue };
            let Some(facts) = self.facts(path, named.at, findings) else { continue };
            let channel = named.map.channel.unwrap_or(if packed && facts.colourful { own } else { Channel::Luminance });
            recipe += &format!("\n{path}\n{channel:?}\n{:?}", named.map.range);
            *slot = Some((path, channel, named.map.range));
        }
        recipe += if roughness.is_none() { "\nmetal only" } else { "" };
        let image = self.made(&recipe, first.at, findings, |pictures, findings| pictures.packed(wishes, first.at, findings))?;
        Some(reference(image, first.map))
    }

    /// Roughness and metalness side by side, at the size of the larger; ones where there is none.
    fn packed(&mut self, wishes: [Option<Wish<'b>>; 2], at: At<'_>, findings: &mut Findings) -> Option<Decoded> {
        let planes = wishes.map(|wish| wish.and_then(|wish| Some((wish.0, self.plane(wish, at, findings)?))));
        let pixels = |plane: &Option<(&BundlePath, Plane)>| plane.as_ref().map_or(0, |(_, p)| u64::from(p.width) * u64::from(p.height));
        let larger = if pixels(&planes[1]) > pixels(&planes[0]) { &planes[1] } else { &planes[0] };
        let (path, shape) = larger.as_ref()?;
        let size = [shape.width, shape.height];
        let places = (0..shape.height).flat_map(|y| (0..shape.width).map(move |x| (x, y)));
        let texels = places.flat_map(|place| {
            let [r, m] = [0, 1].map(|k| planes[k].as_ref().map_or(255, |(_, plane)| plane.near(place, size)));
            [255, r, m]
        });
        Some(Decoded { texture: texture(path, size, Coding::Linear, false, texels.collect()), transparent: false })
    }

    /// The mean of the numbers in a picture, [0, 1].
    pub(super) fn mean(&mut self, named: Named<'_>, findings: &mut Findings) -> Option<f32> {
        let path = self.path(named, findings)?;
        let map = named.map;
        Some(self.facts(path, named.at, findings)?.mean(map.channel.unwrap_or(Channel::Luminance), map.range))
    }

    /// The normal map in a picture that is named as a bump map, as exporters do; `None` where it is one of heights or missing, which is
    /// said.
    pub(super) fn bump(&mut self, named: Named<'_>, findings: &mut Findings) -> Option<TextureRef> {
        let file = &named.map.file;
        let Some(path) = self.bundle.find(named.from, file).map(Found::path) else {
            findings.warn(named.at, format!("the bump map `{file}` is not in the bundle; the surface is baked smooth"));
            return None;
        };
        if !self.facts(path, named.at, findings)?.holds_normals {
            let message = format!("the bump map `{path}` holds heights, which are not supported; the surface is baked smooth (said once)");
            findings.warn_once(named.at, &format!("heights {path}"), message);
            return None;
        }
        let message = format!("the bump map `{path}` holds normals and is used as a normal map (said once)");
        findings.warn_once(named.at, &format!("normals {path}"), message);
        self.picture(named, Coding::Linear, findings).map(|(_, reference)| reference)
    }

    /// What is known of a picture, which is decoded for that once.
    fn facts(&mut self, path: &'b BundlePath, at: At<'_>, findings: &mut Findings) -> Option<&Facts> {
        if !self.facts.contains_key(path) {
            let facts = self.decode(path, at, findings).map(|decoded| Facts::of(&decoded));
            self.facts.insert(path, facts);
        }
        self.facts.get(path)?.as_ref()
    }

    /// A texture made once for each recipe.
    fn made(
        &mut self,
        recipe: &str,
        at: At<'_>,
        findings: &mut Findings,
        make: impl FnOnce(&mut Self, &mut Findings) -> Option<Decoded>,
    ) -> Option<Image> {
        if let Some(known) = self.images.known_made(recipe) {
            return known;
        }
        let decoded = make(self, findings);
        self.images.keep_made(recipe, decoded, at, findings)
    }

    fn plane(&mut self, (path, channel, range): Wish<'b>, at: At<'_>, findings: &mut Findings) -> Option<Plane> {
        Some(Plane::of(&self.decode(path, at, findings)?.texture, channel, range))
    }

    /// A picture with all its channels, and anew only if it is not the last one.
    fn decode(&mut self, path: &'b BundlePath, at: At<'_>, findings: &mut Findings) -> Option<Rc<Decoded>> {
        if let Some((_, decoded)) = self.last.as_ref().filter(|(last, _)| *last == path) {
            return Some(decoded.clone());
        }
        self.last = None;
        if findings.is_full() {
            return None;
        }
        let (bundle, wanted) = (self.bundle, Wanted { coding: Coding::Linear, alpha: true });
        let decoded = Rc::new(images::decode(path.as_str(), wanted, at, findings, || bundle.read(path, limits::BUNDLE_BYTES))?);
        self.last = Some((path, decoded.clone()));
        Some(decoded)
    }
}

fn texture(path: &BundlePath, [width, height]: [u32; 2], coding: Coding, has_alpha: bool, texels: Vec<u8>) -> Texture {
    Texture { name: path.as_str().to_owned(), width, height, coding, has_alpha, texels }
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
