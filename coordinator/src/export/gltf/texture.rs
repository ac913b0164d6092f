//! Textures: images as PNG, samplers, and coordinates counted from the top.
//!
//! glTF fixes for each use of a texture whether its bytes are colour or numbers, and takes opacity from the image of the base colour. An
//! image that the scene holds the other way round is coded anew for that use, and opacity from an image of its own is put together with the
//! colour where both lie on the surface alike.

use super::{ExportError, number, numbers};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use kiln_proto::{
    math,
    scene::{Coding, Mapping, Scene, Texture, TextureRef, Wrap},
};
use serde_json::{Value, json};
use std::{
    collections::BTreeMap,
    f64::consts::{FRAC_PI_2, PI},
};

/// How far a transform may be, relative to its size, from what glTF's three numbers say of it.
const TOLERANCE: f64 = 1e-6;

/// What an image is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Source {
    /// The texture that gives the colour; white where there is none.
    pub(super) color: Option<u32>,
    /// The texture whose alpha channel gives the opacity; that of `color` where there is none.
    pub(super) alpha: Option<u32>,
    /// Whether the bytes are to be numbers rather than colour.
    pub(super) linear: bool,
}

/// The texture lists of a file.
pub(super) struct Textures<'s> {
    scene: &'s Scene,
    known: BTreeMap<(Source, usize), usize>,
    images: BTreeMap<Source, usize>,
    image_list: Vec<Value>,
    samplers: Vec<Value>,
    list: Vec<Value>,
}

/// A transform of coordinates as glTF says it: offset x rotation x scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Transform {
    offset: [f64; 2],
    /// Radians.
    rotation: f64,
    scale: [f64; 2],
}

impl<'s> Textures<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        Self { scene, known: BTreeMap::new(), images: BTreeMap::new(), image_list: vec![], samplers: vec![], list: vec![] }
    }

    /// The texture of an image with the sampling of `like`; `None` where colour and opacity differ in size. `store` keeps the bytes of a
    /// file.
    pub(super) fn index(
        &mut self,
        source: Source,
        like: &TextureRef,
        store: impl FnOnce(Vec<u8>) -> Result<usize, ExportError>,
    ) -> Result<Option<usize>, ExportError> {
        let sampler = self.sampler(like);
        if let Some(known) = self.known.get(&(source, sampler)) {
            return Ok(Some(*known));
        }
        let image = match self.images.get(&source) {
            Some(image) => *image,
            None => {
                let Some(texture) = composed(self.scene, source) else { return Ok(None) };
                let view = store(png(&texture)?)?;
                self.image_list.push(json!({"name": texture.name, "mimeType": "image/png", "bufferView": view}));
                self.images.insert(source, self.image_list.len() - 1);
                self.image_list.len() - 1
            }
        };
        self.list.push(json!({"source": image, "sampler": sampler}));
        self.known.insert((source, sampler), self.list.len() - 1);
        Ok(Some(self.list.len() - 1))
    }

    fn sampler(&mut self, like: &TextureRef) -> usize {
        let [s, t] = like.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 10_497,
            Wrap::Mirror => 33_648,
            Wrap::Clamp => 33_071,
        });
        let (mag, min) = if like.nearest { (9_728, 9_728) } else { (9_729, 9_987) };
        let sampler = json!({"wrapS": s, "wrapT": t, "magFilter": mag, "minFilter": min});
        self.samplers.iter().position(|known| *known == sampler).unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        })
    }

    /// Textures, images and samplers.
    pub(super) fn into_lists(self) -> [Vec<Value>; 3] {
        [self.list, self.image_list, self.samplers]
    }
}

/// The coordinate set of a texture that lies on the surface.
pub(super) fn set_of(reference: &TextureRef) -> Option<u32> {
    match reference.mapping {
        Mapping::Uv { set } => Some(set),
        Mapping::Projected { .. } => None,
    }
}

/// Pixels of a source, row 0 at the bottom; `None` where its two textures differ in size.
fn composed(scene: &Scene, source: Source) -> Option<Texture> {
    let find = |index: Option<u32>| index.map(|i| &scene.textures[i as usize]);
    let (color, alpha) = (find(source.color), find(source.alpha).filter(|a| a.has_alpha));
    let first = color.or(alpha)?;
    if [color, alpha].into_iter().flatten().any(|t| (t.width, t.height) != (first.width, first.height)) {
        return None;
    }
    let coding = if source.linear { Coding::Linear } else { Coding::Srgb };
    let recode: Vec<u8> = match color {
        Some(texture) if texture.coding != coding => (0..=255).map(|byte| recoded(byte, coding)).collect(),
        _ => (0..=255).collect(),
    };
    let opacity = alpha.or(color.filter(|c| c.has_alpha));
    let pixels = first.width as usize * first.height as usize;
    let mut texels = Vec::with_capacity(pixels * if opacity.is_some() { 4 } else { 3 });
    for pixel in 0..pixels {
        match color {
            Some(t) => texels.extend(t.texels[pixel * t.channels()..][..3].iter().map(|b| recode[usize::from(*b)])),
            None => texels.extend([255; 3]),
        }
        texels.extend(opacity.map(|t| t.texels[pixel * 4 + 3]));
    }
    Some(Texture { name: first.name.clone(), width: first.width, height: first.height, coding, has_alpha: opacity.is_some(), texels })
}

/// A byte of the other coding in this one.
fn recoded(byte: u8, coding: Coding) -> u8 {
    let value = f32::from(byte) / 255.0;
    let value = match coding {
        Coding::Srgb => math::srgb_oetf(value),
        Coding::Linear => math::srgb_eotf(value),
    };
    (255.0 * value + 0.5) as u8
}

/// A texture as a PNG file, its first row at the top.
fn png(texture: &Texture) -> Result<Vec<u8>, ExportError> {
    let row = texture.width as usize * texture.channels();
    let upright: Vec<u8> = texture.texels.rchunks_exact(row.max(1)).flatten().copied().collect();
    let color = if texture.has_alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    let mut file = vec![];
    let written = PngEncoder::new(&mut file).write_image(&upright, texture.width, texture.height, color);
    written.map_err(|source| ExportError::Image { name: texture.name.clone(), source })?;
    Ok(file)
}

/// A map of coordinates whose v counts up as the transform of coordinates whose v counts down; `None` where it has a shear, for which
/// KHR_texture_transform has no number.
pub(super) fn transform([[a, b, x], [c, d, y]]: [[f32; 3]; 2]) -> Option<Transform> {
    let [a, b, x, c, d, y] = [a, b, x, c, d, y].map(f64::from);
    // F m F, where F takes (u, v) to (u, 1 - v).
    let (b, x, c, y) = (-b, x + b, -c, 1.0 - d - y);
    let (across, up) = ((a * a + c * c).sqrt(), (b * b + d * d).sqrt());
    let (cosine, sine) = if across > 0.0 {
        (a / across, -c / across)
    } else if up > 0.0 {
        (d / up, b / up)
    } else {
        (1.0, 0.0)
    };
    let along = b * sine + d * cosine;
    let shear = b * cosine - d * sine;
    let fits = shear.abs() <= TOLERANCE * up.max(f64::MIN_POSITIVE);
    fits.then(|| Transform { offset: [x, y], rotation: angle(cosine, sine), scale: [across, along] })
}

/// The angle of a direction of length one, from the better conditioned of the two.
fn angle(cosine: f64, sine: f64) -> f64 {
    if sine == 0.0 {
        // The common case, and exact.
        if cosine > 0.0 { 0.0 } else { PI }
    } else if sine.abs() < cosine.abs() {
        let from_axis = FRAC_PI_2 - math::acos(sine);
        if cosine > 0.0 { from_axis } else { PI - from_axis }
    } else if sine > 0.0 {
        math::acos(cosine)
    } else {
        -math::acos(cosine)
    }
}

impl Transform {
    /// As KHR_texture_transform; `None` for the one that changes nothing.
    pub(super) fn to_json(self) -> Option<Value> {
        let [x, y] = self.offset.map(|v| v as f32);
        let scale = self.scale.map(|v| v as f32);
        let rotation = self.rotation as f32;
        let is_identity = [x, y, rotation] == [0.0; 3] && scale == [1.0; 2];
        (!is_identity).then(|| json!({"offset": numbers(&[x, y]), "rotation": number(rotation), "scale": numbers(&scale)}))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_without_shear_comes_back_and_one_with_shear_is_not_said() {
        for (degrees, scale) in [(0.0, [1.0, 1.0]), (30.0, [2.0, -0.5]), (-135.0, [0.25, 3.0]), (1e-4, [1.0, 1.0]), (180.0, [1.0, 4.0])] {
            let (s, c) = math::sin_cos_degrees(degrees);
            let [[a, b], [e, d]] = [[c * scale[0], s * scale[1]], [-s * scale[0], c * scale[1]]];
            // In coordinates whose v counts up: F m F.
            let up = [[a, -b, b + 0.5], [-e, d, 1.0 - d - 0.75]].map(|row| row.map(|v| v as f32));
            let found = transform(up).unwrap();
            let (s2, c2) = math::sin_cos_degrees(found.rotation.to_degrees());
            let [u, v] = found.scale;
            for (x, y) in [(c2 * u, a), (s2 * v, b), (-s2 * u, e), (c2 * v, d), (found.offset[0], 0.5), (found.offset[1], 0.75)] {
                assert!((x - y).abs() < 1e-6, "{degrees}: {x} {y}");
            }
        }
        assert_eq!(transform([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0]]), None);
        assert_eq!(transform(TextureRef::plain(0, 0).transform).unwrap().to_json(), None);
    }

    #[test]
    fn opacity_joins_colour_of_the_same_size_only() {
        let texture = |width: u32, coding, texels: &[u8]| Texture {
            name: "t".into(),
            width,
            height: 1,
            coding,
            has_alpha: texels.len() == 4 * width as usize,
            texels: texels.to_vec(),
        };
        let scene = Scene {
            textures: vec![
                texture(1, Coding::Srgb, &[10, 20, 30]),
                texture(1, Coding::Srgb, &[0, 0, 0, 77]),
                texture(2, Coding::Srgb, &[0, 0, 0, 1, 0, 0, 0, 2]),
                texture(1, Coding::Linear, &[0, 128, 255]),
            ],
            ..Scene::empty()
        };
        let of = |color, alpha| composed(&scene, Source { color, alpha, linear: false }).map(|t| t.texels);
        assert_eq!(of(Some(0), Some(1)), Some(vec![10, 20, 30, 77]));
        assert_eq!(of(None, Some(2)), Some(vec![255, 255, 255, 1, 255, 255, 255, 2]));
        assert_eq!(of(Some(0), Some(2)), None);
        assert_eq!(of(Some(3), None), Some(vec![0, 188, 255]), "numbers become colour");
    }
}
