//! The environment: a lat-long map and what it is toward a direction, one look-up for worker and pictures.
//!
//! The map is bilinear between texel centres, wraps around and is constant beyond the centres of its first and last row, like a texture
//! with linear filtering. Longitudes are f64: a map of 16,384 texels that was turned a thousand times still has its sun in one place.

use crate::{math, units::Rgb};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Light from infinitely far away, all around: a lat-long map of radiance, W/(sr m²).
///
/// Direction (x, y, z) is looked up at u = 1/2 + atan2(z, x)/(2 pi), v = 1/2 + asin(y)/pi after a turn by `-rotation` about +Y; row 0 is v
/// = 0, straight down. The middle of the picture is what lies toward +X.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// The file it came from.
    pub name: String,
    /// Texels around.
    pub width: u32,
    /// Texels from bottom to top.
    pub height: u32,
    /// Linear radiance.
    pub rgb: Vec<[f32; 3]>,
    /// Radians about +Y.
    pub rotation: f32,
    /// Factor on all of it.
    pub intensity: f32,
}

/// A place in a map: the cell between four texel centres, and where in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyPlace {
    /// Row of cells, from 0 below the first texels to the height above the last.
    pub row: usize,
    /// Column of the texels on its left.
    pub column: usize,
    /// From the left and lower to the right and upper texel centre, [0, 1].
    pub at: [f32; 2],
    /// Cosine of the latitude.
    pub cos: f32,
}

impl Environment {
    /// By how many turns it is turned about +Y.
    #[must_use]
    pub fn turns(&self) -> f64 {
        f64::from(self.rotation) / (2.0 * PI)
    }

    /// Radiance toward a unit world direction, W/(sr m²).
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        let place = self.place(direction);
        bilinear(&self.corners(place.row, place.column), place.at) * self.intensity
    }

    /// Where a unit world direction lies in the map.
    #[must_use]
    #[inline]
    pub fn place(&self, d: Vec3) -> SkyPlace {
        let (x, y, z) = (f64::from(d.x), f64::from(d.y), f64::from(d.z));
        let cos = (x * x + z * z).sqrt();
        let u = 0.5 + math::atan2(z, x) / (2.0 * PI) + self.turns();
        let v = (0.5 + math::atan2(y, cos) / PI).clamp(0.0, 1.0);
        let across = (u - u.floor()) * f64::from(self.width) - 0.5;
        let column = across.floor();
        let row = ((v * f64::from(self.height) + 0.5).floor()).min(f64::from(self.height));
        let (low, high) = self.limits(row as usize);
        let at = [(across - column) as f32, ((v - low) / (high - low)).clamp(0.0, 1.0) as f32];
        SkyPlace { row: row as usize, column: (column as i64).rem_euclid(i64::from(self.width)) as usize, at, cos: cos as f32 }
    }

    /// The v of the lower and upper edge of a row of cells.
    #[must_use]
    pub fn limits(&self, row: usize) -> (f64, f64) {
        let height = f64::from(self.height);
        (((row as f64 - 0.5) / height).max(0.0), ((row as f64 + 0.5) / height).min(1.0))
    }

    /// The texels around a cell, without the intensity: lower left, lower right, upper left, upper right.
    #[must_use]
    #[inline]
    pub fn corners(&self, row: usize, column: usize) -> [Rgb; 4] {
        let (width, height) = (self.width as usize, self.height as usize);
        let (lower, upper) = (row.saturating_sub(1), row.min(height - 1));
        let right = if column + 1 == width { 0 } else { column + 1 };
        [(lower, column), (lower, right), (upper, column), (upper, right)].map(|(r, c)| Rgb::from(self.rgb[r * width + c]))
    }
}

/// What lies between four corners: lower left, lower right, upper left, upper right.
#[must_use]
#[inline]
pub fn bilinear(c: &[Rgb; 4], [x, y]: [f32; 2]) -> Rgb {
    (c[0] * (1.0 - x) + c[1] * x) * (1.0 - y) + (c[2] * (1.0 - x) + c[3] * x) * y
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each texel has its own colours: column and row.
    fn map(rotation: f32) -> Environment {
        let rgb = (0..2).flat_map(|row| (0..4).map(move |column| [column as f32, row as f32, 1.0])).collect();
        Environment { name: "sky".into(), width: 4, height: 2, rgb, rotation, intensity: 2.0 }
    }

    #[test]
    fn directions_find_their_texels_and_what_lies_between() {
        let at = |rotation: f32, longitude: f64, latitude: f64| {
            let ((sin, cos), (up, out)) = (math::sin_cos_degrees(longitude), math::sin_cos_degrees(latitude));
            map(rotation).radiance(Vec3::new((cos * out) as f32, up as f32, (sin * out) as f32)).to_array()
        };
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        // Centres: longitudes -135, -45, 45 and 135 degrees from +X toward +Z, latitudes -45 and 45; everything is twice as bright.
        assert!(near(at(0.0, -135.0, -45.0), [0.0, 0.0, 2.0]) && near(at(0.0, 45.0, 45.0), [4.0, 2.0, 2.0]));
        assert!(near(at(0.0, 0.0, 0.0), [3.0, 1.0, 2.0]), "the middle of the map is +X on the horizon");
        assert!(near(at(0.0, 180.0, 80.0), [3.0, 2.0, 2.0]), "the seam between the last and the first column");
        // A quarter turn about +Y takes +X to -Z.
        assert!(near(at(std::f32::consts::FRAC_PI_2, -45.0, 45.0), [4.0, 2.0, 2.0]));
    }
}
