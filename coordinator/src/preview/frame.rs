//! A picture as the renderer finds it: one ray a pixel, linear radiance and what was seen.
//!
//! Behind everything lies the environment, where the scene has one and the view shows it: light of the scene, exposed like all of it. Else
//! there is a colour that no exposure changes, so that it is told from what the scene shows.

use super::{camera::PictureSize, visibility::Looked};
use kiln_proto::units::Rgb;

/// What is shown where nothing is, not even an environment: linear, not exposed; #202428 in sRGB.
pub const BACKGROUND: Rgb = Rgb::new(0.0144, 0.0176, 0.0212);

/// One pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// Radiance toward the eye, W/(sr m²); black where the light field has none. What is seen of environment or background is in it.
    pub radiance: Rgb,
    /// How much of [`BACKGROUND`] is seen, per channel: white where nothing else is, black before an environment.
    pub background: Rgb,
    /// The nearest chart that is seen, numbered over the whole scene from 1; 0 for environment and background.
    pub chart: u32,
    /// Whether the light field has light of everything that is seen.
    pub found: bool,
}

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    size: PictureSize,
    pixels: Vec<Pixel>,
}

impl Pixel {
    /// A ray that has seen nothing yet.
    pub(super) const UNSEEN: Pixel = Pixel { radiance: Rgb::BLACK, background: Rgb::WHITE, chart: 0, found: false };
}

/// Adds the light of the next layers of rays, the nearest first, each over what is seen of the next.
pub(super) fn add(pixels: &mut [Pixel], looked: &Looked, radiance: &[Option<Rgb>]) {
    let mut from = 0;
    for (pixel, count) in pixels.iter_mut().zip(&looked.counts) {
        let layers = from..from + usize::from(*count);
        from = layers.end;
        for (seen, light) in looked.layers[layers.clone()].iter().zip(&radiance[layers]) {
            let is_first = pixel.chart == 0;
            pixel.chart = if is_first { seen.chart } else { pixel.chart };
            pixel.found = light.is_some() && (is_first || pixel.found);
            pixel.radiance += pixel.background * light.unwrap_or(Rgb::BLACK) * seen.veil.own;
            pixel.background = pixel.background * seen.veil.through;
        }
    }
}

/// Adds what lies behind all layers: what a ray finds of an environment by `behind`, or else the background.
pub(super) fn finish(pixels: &mut [Pixel], behind: impl Fn(usize) -> Option<Rgb>) {
    for (ray, pixel) in pixels.iter_mut().enumerate() {
        let behind = if pixel.background.is_black() { None } else { behind(ray) };
        pixel.radiance += behind.unwrap_or(BACKGROUND) * pixel.background;
        if behind.is_some() {
            pixel.background = Rgb::BLACK;
        }
    }
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
