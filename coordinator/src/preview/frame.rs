//! The finished picture: linear radiance and what was seen, and from it bytes for the eye.

use super::{camera::PictureSize, visibility::Seen};
use image::{ExtendedColorType, ImageEncoder, ImageError, codecs::png::PngEncoder};
use kiln_proto::{
    math,
    units::{Exposure, Rgb},
};
use rayon::prelude::*;

/// What is shown where nothing is: linear, not exposed; #202428 in sRGB.
pub const BACKGROUND: Rgb = Rgb::new(0.0144, 0.0176, 0.0212);

/// One pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// Radiance toward the eye, W/(sr m²); black where the light field has none, [`BACKGROUND`] where nothing is seen.
    pub radiance: Rgb,
    /// The chart that is seen, numbered over the whole scene from 1; 0 for the background.
    pub chart: u32,
    /// Whether the light field has light there.
    pub found: bool,
}

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    size: PictureSize,
    exposure: Exposure,
    pixels: Vec<Pixel>,
}

impl Frame {
    /// A picture of this size without any rows yet, of light under this exposure.
    pub(super) fn new(size: PictureSize, exposure: Exposure) -> Self {
        Self { size, exposure, pixels: Vec::with_capacity(size.pixels()) }
    }

    /// Adds pixels: what each sees, and its light.
    pub(super) fn extend(&mut self, seen: &[Option<Seen>], radiance: &[Option<Rgb>]) {
        self.pixels.extend(seen.iter().zip(radiance).map(|(seen, light)| match seen {
            None => Pixel { radiance: BACKGROUND, chart: 0, found: false },
            Some(seen) => Pixel { radiance: light.unwrap_or(Rgb::BLACK), chart: seen.chart, found: light.is_some() },
        }));
    }

    /// Its size.
    #[must_use]
    pub fn size(&self) -> PictureSize {
        self.size
    }

    /// The pixels, row by row from the upper left one.
    #[must_use]
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// Pixels that see a surface where the light field has nothing: they are black.
    #[must_use]
    pub fn without_light(&self) -> usize {
        self.pixels.iter().filter(|p| p.chart > 0 && !p.found).count()
    }

    /// 3 bytes a pixel, sRGB, under the job's exposure and `stops` more.
    #[must_use]
    pub fn to_srgb(&self, stops: f32) -> Vec<u8> {
        let factor = self.exposure.factor() * math::exp2(stops);
        let byte = |linear: f32| (math::srgb_oetf(linear.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8;
        let coded = |p: &Pixel| {
            let shown = if p.chart == 0 { p.radiance } else { p.radiance * factor };
            shown.to_array().map(byte)
        };
        self.pixels.par_iter().map(coded).collect::<Vec<[u8; 3]>>().into_flattened()
    }

    /// The picture as a PNG file, exposed as in [`Frame::to_srgb`].
    ///
    /// # Errors
    /// What the encoder says; writing to memory gives it no reason to.
    pub fn to_png(&self, stops: f32) -> Result<Vec<u8>, ImageError> {
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(&self.to_srgb(stops), self.size.width, self.size.height, ExtendedColorType::Rgb8)?;
        Ok(png)
    }
}
