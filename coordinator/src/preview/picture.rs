//! The picture as an eye gets it: 3 bytes a pixel under the display curve, each pixel the mean of a square of rays.
//!
//! The mean is one of linear light, the background included, before the curve: a pixel half covered by white is then half as bright, and
//! not half as many levels. Only bytes are kept, and rays for no longer than a band lasts: kept for the whole picture, they would take from
//! seven to a hundred times the memory. Whoever needs radiance itself has [`super::render`].

use super::{
    camera::PictureSize,
    frame::{BACKGROUND, Pixel},
};
use image::{ExtendedColorType, ImageEncoder, ImageError, codecs::png::PngEncoder};
use kiln_proto::{
    math,
    units::{Exposure, Rgb},
};
use rayon::prelude::*;

/// A picture to look at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    size: PictureSize,
    rgb: Vec<[u8; 3]>,
    without_light: usize,
}

/// From rays to bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Display {
    /// What radiance is multiplied with.
    factor: f32,
    /// Rays along each side of a pixel.
    rays: u32,
}

impl Display {
    /// Light under this exposure and `stops` more, from `rays` x `rays` rays a pixel.
    pub(super) fn new(exposure: Exposure, stops: f32, rays: u32) -> Self {
        Self { factor: exposure.factor() * math::exp2(stops), rays }
    }

    /// The bytes of the pixel in column `x` of some rows of rays, each `width` long; and whether a ray met a surface without light.
    fn pixel(self, rows: &[Pixel], width: usize, x: usize) -> ([u8; 3], bool) {
        let side = self.rays as usize;
        let rays = rows.chunks(width).flat_map(|row| &row[x * side..(x + 1) * side]);
        let (mut sum, mut dark) = (Rgb::BLACK, false);
        for ray in rays {
            // The background, unlike an environment, is not of the scene: its colour stays under every exposure.
            let ground = BACKGROUND * ray.background;
            sum += (ray.radiance + ground * -1.0) * self.factor + ground;
            dark |= ray.chart > 0 && !ray.found;
        }
        let mean = sum * (1.0 / (side * side) as f32);
        let byte = |linear: f32| (math::srgb_oetf(linear.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8;
        (mean.to_array().map(byte), dark)
    }
}

impl Picture {
    /// A picture of this size without any rows yet.
    pub(super) fn new(size: PictureSize) -> Self {
        Self { size, rgb: Vec::with_capacity(size.pixels()), without_light: 0 }
    }

    /// Adds whole rows of pixels from their rays, row of rays by row of rays.
    pub(super) fn extend(&mut self, rays: &[Pixel], display: Display) {
        let (columns, side) = (self.size.width as usize, display.rays as usize);
        let width = columns * side;
        let row = |rows: &[Pixel]| (0..columns).map(|x| display.pixel(rows, width, x)).collect::<Vec<_>>();
        let pixels: Vec<([u8; 3], bool)> = rays.par_chunks(width * side).flat_map_iter(row).collect();
        self.without_light += pixels.iter().filter(|(_, dark)| *dark).count();
        self.rgb.extend(pixels.iter().map(|(rgb, _)| *rgb));
    }

    /// Its size.
    #[must_use]
    pub fn size(&self) -> PictureSize {
        self.size
    }

    /// The pixels in sRGB, row by row from the upper left one.
    #[must_use]
    pub fn rgb(&self) -> &[[u8; 3]] {
        &self.rgb
    }

    /// Pixels of which some ray meets a surface where the light field has nothing, and finds it black.
    #[must_use]
    pub fn without_light(&self) -> usize {
        self.without_light
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// What the encoder says; writing to memory gives it no reason to.
    pub fn to_png(&self) -> Result<Vec<u8>, ImageError> {
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(self.rgb.as_flattened(), self.size.width, self.size.height, ExtendedColorType::Rgb8)?;
        Ok(png)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_covered_pixel_is_the_mean_of_what_its_rays_show() {
        let (lit, ground) = (Rgb::new(0.2, 0.1, 0.4), BACKGROUND);
        let surface = Pixel { radiance: lit, background: Rgb::BLACK, chart: 3, found: true };
        let (dark, background) = (
            Pixel { radiance: Rgb::BLACK, background: Rgb::BLACK, chart: 3, found: false },
            Pixel { radiance: ground, background: Rgb::WHITE, chart: 0, found: false },
        );
        // Two pixels of 2 x 2 rays: background above a surface, and a surface with one hole in its light.
        let rays = [background, background, surface, surface, surface, surface, surface, dark];
        let mut picture = Picture::new(PictureSize { width: 2, height: 1 });
        picture.extend(&rays, Display::new(Exposure { eighths: 8 }, 1.0, 2));
        let coded = |linear: Rgb| linear.to_array().map(|v| kiln_proto::units::radiance_to_byte(v, 1.0));
        let shown = lit * 4.0; // One stop of the bake and one of the viewer.
        assert_eq!(picture.rgb(), [coded((shown + ground) * 0.5), coded(shown * 0.75)]);
        assert_eq!(picture.without_light(), 1);
    }
}
