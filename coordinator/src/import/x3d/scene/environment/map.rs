//! Radiance by direction, and its lat-long map.
//!
//! A texel of the map is the mean of four places within it, each read bilinearly, so that a sun of one texel keeps its light when it comes
//! to lie between texels. Rows are made in parallel; each depends on itself alone, so the bytes are the same on every machine.

use super::{cube::Cube, harmonics::Harmonics};
use glam::{DMat3, DVec3};
use kiln_proto::{math, scene::Environment, units::Rgb};
use rayon::prelude::*;
use std::{f64::consts::PI, rc::Rc};

/// The widest map that is made of a cube, pixels: 400 MB.
const WIDEST: u32 = 8_192;

/// The narrowest, pixels: faces of one pixel have edges.
const NARROWEST: u32 = 256;

/// Places along each side of a texel.
const PLACES: usize = 2;

/// Radiance by direction in the space of a light.
#[derive(Debug)]
pub(super) enum Source {
    /// A panorama, or the same light from everywhere.
    Map(Environment),
    /// Six faces.
    Cube(Cube),
    /// Nine numbers a channel.
    Harmonics(Harmonics),
}

impl Source {
    /// The radiance 1 from everywhere.
    pub(super) fn even() -> Self {
        Self::Map(plain([2, 1], vec![[1.0; 3]; 2]))
    }

    /// Radiance toward a direction, unit; negative where harmonics overshoot.
    pub(super) fn at(&self, direction: DVec3) -> Rgb {
        match self {
            Self::Map(map) => look_up(map, direction),
            Self::Cube(cube) => cube.at(direction),
            Self::Harmonics(harmonics) => harmonics.at(direction),
        }
    }

    /// Width and height of a map that keeps its texels: of a cube four faces around, which are finer than the map at their edges only, and
    /// no less than what shows where one face ends.
    pub(super) fn wanted(&self) -> [u32; 2] {
        match self {
            Self::Map(map) => [map.width, map.height],
            Self::Cube(cube) => around(cube.side()),
            Self::Harmonics(_) => [128, 64],
        }
    }

    /// The same, within bounds.
    pub(super) fn size(&self) -> [u32; 2] {
        let Self::Cube(cube) = self else { return self.wanted() };
        around(cube.side().min(WIDEST / 4))
    }
}

/// The size of a map around a cube.
fn around(side: u32) -> [u32; 2] {
    let side = side.max(NARROWEST / 4);
    [4 * side, 2 * side]
}

/// A map that looks as its texels lie.
pub(super) fn plain([width, height]: [u32; 2], rgb: Vec<[f32; 3]>) -> Environment {
    Environment { name: String::new(), width, height, rgb, rotation: 0.0, intensity: 1.0 }
}

/// The map that a source is, copied only where somebody else holds it too; the source itself where it is none.
pub(super) fn kept(source: Rc<Source>) -> Result<Environment, Rc<Source>> {
    match Rc::try_unwrap(source) {
        Ok(Source::Map(map)) => Ok(map),
        Ok(other) => Err(Rc::new(other)),
        Err(shared) => match &*shared {
            Source::Map(map) => Ok(map.clone()),
            _ => Err(shared),
        },
    }
}

/// The map of a source that `to_source` leads to from the map's directions. Cost: four readings a texel.
pub(super) fn baked(source: &Source, to_source: DMat3, size: [u32; 2]) -> Environment {
    let [width, height] = size.map(|v| v as usize);
    let turns = |place: usize, places: usize| (place as f64 + 0.5) / places as f64 - 0.5;
    let around: Vec<(f64, f64)> = (0..width * PLACES).map(|place| math::sin_cos_degrees(360.0 * turns(place, width * PLACES))).collect();
    let mut rgb = vec![[0.0; 3]; width * height];
    rgb.par_chunks_mut(width).enumerate().for_each(|(row, texels)| {
        let rows: [(f64, f64); PLACES] = std::array::from_fn(|k| math::sin_cos_degrees(180.0 * turns(row * PLACES + k, height * PLACES)));
        for (texel, around) in texels.iter_mut().zip(around.chunks_exact(PLACES)) {
            let mut sum = Rgb::BLACK;
            for (sin_v, cos_v) in rows {
                for (sin_u, cos_u) in around {
                    sum += source.at(to_source * DVec3::new(cos_u * cos_v, sin_v, sin_u * cos_v));
                }
            }
            *texel = (sum * (1.0 / (PLACES * PLACES) as f32)).to_array();
        }
    });
    plain(size, rgb)
}

/// The radiance of a map toward a direction, as [`Environment`] says: bilinear between texel centres, around and around, constant at the
/// poles.
fn look_up(map: &Environment, d: DVec3) -> Rgb {
    let (width, height) = (map.width as usize, map.height as usize);
    let u = 0.5 + (math::atan2(d.z, d.x) + f64::from(map.rotation)) / (2.0 * PI);
    let v = 0.5 + math::atan2(d.y, (d.x * d.x + d.z * d.z).sqrt()) / PI;
    let (across, up) = ((u - u.floor()) * width as f64 - 0.5, (v * height as f64 - 0.5).clamp(0.0, (height - 1) as f64));
    let (column, row) = (across.floor(), up as usize);
    let columns = [column, column + 1.0].map(|c| (c as i64).rem_euclid(width as i64) as usize);
    let texel = |row: usize, k: usize| Rgb::from(map.rgb[row.min(height - 1) * width + columns[k]]);
    let along = (across - column) as f32;
    let [lower, upper] = [row, row + 1].map(|row| between(texel(row, 0), texel(row, 1), along));
    between(lower, upper, (up - row as f64) as f32) * map.intensity
}

/// From `a` to `b`; exactly `a` where both are the same.
pub(super) fn between(a: Rgb, b: Rgb, share: f32) -> Rgb {
    a + (b + a * -1.0) * share
}
