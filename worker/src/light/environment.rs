//! The environment as a light: radiance interpolated between the texels of a lat-long map, and directions sampled in proportion to it.
//!
//! The map is looked up as [`Environment`] has it. Its cells, the rectangles between four texel centres, are chosen by mean radiance times
//! solid angle (two cumulative tables); within a cell the point follows the bilinear radiance exactly (Pharr, Jakob and Humphreys,
//! "Physically Based Rendering", 4th ed., A.5). So a sun of one texel costs no noise: value over density varies with the cosine of the
//! latitude across one cell, and no more. A table over texels as constant squares is simpler, but what interpolation spreads into dark
//! neighbours would then be found by chance only.

use super::emitter::{chance, choose, cumulative};
use glam::Vec3;
use kiln_proto::{
    math,
    scene::{
        Environment,
        environment::{SkyPlace, bilinear},
    },
    units::Rgb,
};
use std::f64::consts::PI;

/// A direction of the environment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkySample {
    /// Unit world direction toward it.
    pub direction: Vec3,
    /// Density, 1/sr.
    pub pdf: f32,
    /// Radiance, W/(sr m²).
    pub radiance: Rgb,
}

/// What sampling an environment needs beside its map. Memory: 4 bytes a texel.
#[derive(Debug)]
pub struct Sky {
    /// Over the height + 1 rows of cells.
    rows: Vec<f32>,
    /// Over the cells of each row, row after row; a row without light has zeros.
    cells: Vec<f32>,
    /// Mean over channels of radiance, integrated over directions, W/m².
    total: f64,
}

impl Sky {
    /// Tables for an environment, or `None` for one without light. Cost: linear in pixels.
    #[must_use]
    pub fn new(map: &Environment) -> Option<Self> {
        let (width, height) = (map.width as usize, map.height as usize);
        let mut cells = Vec::with_capacity((height + 1) * width);
        let mut sums = Vec::with_capacity(height + 1);
        for row in 0..=height {
            let weight = |column| f64::from(mean(&map.corners(row, column)));
            let sum: f64 = (0..width).map(weight).sum();
            if sum > 0.0 {
                cells.extend(cumulative((0..width).map(weight), sum));
            } else {
                cells.extend(std::iter::repeat_n(0.0, width));
            }
            sums.push(sum * band(map, row));
        }
        let total: f64 = sums.iter().sum();
        if !(total > 0.0 && map.intensity > 0.0) {
            return None;
        }
        let integral = total * 2.0 * PI / width as f64 * f64::from(map.intensity);
        Some(Self { rows: cumulative(sums.into_iter(), total), cells, total: integral })
    }

    /// Radiance integrated over all directions, the mean of the channels, W/m².
    #[must_use]
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Radiance toward a unit world direction, W/(sr m²), and the density with which [`Sky::sample`] chooses it, 1/sr.
    #[must_use]
    #[inline]
    pub fn eval(&self, map: &Environment, direction: Vec3) -> (Rgb, f32) {
        let place = map.place(direction);
        let corners = map.corners(place.row, place.column);
        (bilinear(&corners, place.at) * map.intensity, self.pdf(map, &place, &corners))
    }

    /// A direction with a density in proportion to radiance; `None` only where rounding leads into a cell without light.
    #[must_use]
    #[inline]
    pub fn sample(&self, map: &Environment, u: [f32; 2]) -> Option<SkySample> {
        let width = map.width as usize;
        let (row, v) = choose(&self.rows, u[1])?;
        let (column, u) = choose(&self.cells[row * width..(row + 1) * width], u[0])?;
        let corners = map.corners(row, column);
        let at = bilinear_point(&corners.map(Rgb::mean), [u, v]);
        // A sample's latitude: half a cell less in the two rows at the poles.
        let (low, high) = map.limits(row);
        let latitude = (low + (high - low) * f64::from(at[1]) - 0.5) * 0.5;
        let longitude = (column as f64 + 0.5 + f64::from(at[0])) / f64::from(map.width) - 0.5 - map.turns();
        // Whole turns are taken off before the sum is rounded: many of them would leave no bits for the rest.
        let longitude = longitude - longitude.floor();
        let ((sin_v, cos_v), (sin_u, cos_u)) = (math::sin_cos_turns(latitude as f32), math::sin_cos_turns(longitude as f32));
        let place = SkyPlace { row, column, at, cos: cos_v };
        let pdf = self.pdf(map, &place, &corners);
        let direction = Vec3::new(cos_u * cos_v, sin_v, sin_u * cos_v);
        (pdf > 0.0).then(|| SkySample { direction, pdf, radiance: bilinear(&corners, at) * map.intensity })
    }

    fn pdf(&self, map: &Environment, place: &SkyPlace, corners: &[Rgb; 4]) -> f32 {
        let width = map.width as usize;
        let weights = corners.map(Rgb::mean);
        let mean = mean(corners);
        if mean <= 0.0 {
            return 0.0;
        }
        let cell = chance(&self.rows, place.row) * chance(&self.cells[place.row * width..(place.row + 1) * width], place.column);
        let (low, high) = map.limits(place.row);
        let inside = bilinear(&weights.map(Rgb::splat), place.at).r / mean * f64::from(map.width) as f32 / (high - low) as f32;
        // du dv = dw / (2 pi² cos); at the poles themselves the density is without bound, and bounded here.
        cell * inside / (2.0 * (PI * PI) as f32 * place.cos.max(1e-6))
    }
}

/// The difference of the sines of latitude between the edges of a row of cells: solid angle over 2 pi.
fn band(map: &Environment, row: usize) -> f64 {
    let (low, high) = map.limits(row);
    let sine = |v: f64| math::sin_cos_degrees((v - 0.5) * 180.0).0;
    sine(high) - sine(low)
}

fn mean(corners: &[Rgb; 4]) -> f32 {
    0.25 * corners.iter().map(|c| c.mean()).sum::<f32>()
}

/// A point of the unit square with a density in proportion to what is interpolated between its corners.
fn bilinear_point(w: &[f32; 4], u: [f32; 2]) -> [f32; 2] {
    let y = linear_point(w[0] + w[1], w[2] + w[3], u[1]);
    [linear_point(w[0] * (1.0 - y) + w[2] * y, w[1] * (1.0 - y) + w[3] * y, u[0]), y]
}

/// A point of the unit interval with a density that goes linearly from `a` to `b`.
fn linear_point(a: f32, b: f32, u: f32) -> f32 {
    if a + b <= 0.0 {
        return u;
    }
    let root = (a * a * (1.0 - u) + b * b * u).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).min(1.0) } else { 0.0 }
}
