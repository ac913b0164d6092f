//! A picture as the renderer finds it: one ray a pixel, linear radiance and what was seen.

use super::{camera::PictureSize, visibility::Seen};
use kiln_proto::units::Rgb;

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
    pixels: Vec<Pixel>,
}

/// The pixels of rays: what each sees, and its light.
pub(super) fn pixels<'a>(seen: &'a [Option<Seen>], radiance: &'a [Option<Rgb>]) -> impl Iterator<Item = Pixel> + 'a {
    seen.iter().zip(radiance).map(|(seen, light)| match seen {
        None => Pixel { radiance: BACKGROUND, chart: 0, found: false },
        Some(seen) => Pixel { radiance: light.unwrap_or(Rgb::BLACK), chart: seen.chart, found: light.is_some() },
    })
}

impl Frame {
    /// A picture of this size without any rows yet.
    pub(super) fn new(size: PictureSize) -> Self {
        Self { size, pixels: Vec::with_capacity(size.pixels()) }
    }

    /// Adds pixels.
    pub(super) fn extend(&mut self, pixels: &[Pixel]) {
        self.pixels.extend_from_slice(pixels);
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
}
