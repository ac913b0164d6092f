//! Quantities with their units: colours that are linear, exposures that are whole eighths of a stop.

use crate::math;
use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Mul};

/// Three linear Rec. 709 channels. The field or function that holds one names the unit: reflectance has none, radiance is W/(sr m²).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// No light at all.
    pub const BLACK: Rgb = Rgb::splat(0.0);
    /// One in every channel.
    pub const WHITE: Rgb = Rgb::splat(1.0);

    /// From three channels.
    #[must_use]
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// The same value in every channel.
    #[must_use]
    #[inline]
    pub const fn splat(v: f32) -> Self {
        Self { r: v, g: v, b: v }
    }

    /// The three channels in the order red, green, blue.
    #[must_use]
    #[inline]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }

    /// The largest channel.
    #[must_use]
    #[inline]
    pub fn max_channel(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The mean of the channels.
    #[must_use]
    #[inline]
    pub fn mean(self) -> f32 {
        (self.r + self.g + self.b) / 3.0
    }

    /// Whether every channel is exactly zero.
    #[must_use]
    #[inline]
    pub fn is_black(self) -> bool {
        self == Self::BLACK
    }

    /// Whether every channel is finite.
    #[must_use]
    #[inline]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline]
    fn from([r, g, b]: [f32; 3]) -> Self {
        Self { r, g, b }
    }
}

impl Add for Rgb {
    type Output = Rgb;
    #[inline]
    fn add(self, o: Rgb) -> Rgb {
        Rgb::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}

impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, o: Rgb) {
        *self = *self + o;
    }
}

impl Mul for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, o: Rgb) -> Rgb {
        Rgb::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}

impl Mul<f32> for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, k: f32) -> Rgb {
        Rgb::new(self.r * k, self.g * k, self.b * k)
    }
}

/// Exposure in eighths of a stop: radiance is multiplied by 2^(eighths/8) before it is coded to 8 bits. Whole eighths, so that the
/// exposure a job settles on is an integer that every worker reads alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Exposure {
    /// Eighths of a stop.
    pub eighths: i16,
}

impl Exposure {
    /// The exposure nearest to `stops`, or `None` where it is not finite or beyond ±64 stops.
    #[must_use]
    pub fn from_stops(stops: f32) -> Option<Self> {
        (stops.is_finite() && stops.abs() <= 64.0).then(|| Self { eighths: (stops * 8.0).round() as i16 })
    }

    /// Stops (EV).
    #[must_use]
    pub fn stops(self) -> f32 {
        f32::from(self.eighths) / 8.0
    }

    /// The factor on radiance, 2^stops.
    #[must_use]
    pub fn factor(self) -> f32 {
        math::exp2(self.stops())
    }
}

/// Radiance in one channel to 8 bits: `round(255 · sRGB_OETF(clamp(L · 2^exposure, 0, 1)))` (formats: `pwl`, `.mtex`).
#[must_use]
pub fn radiance_to_byte(radiance: f32, exposure_factor: f32) -> u8 {
    // `round` of a value in [0, 255]; NaN cannot reach here (texels are checked for finite values), and would become 0.
    (math::srgb_oetf((radiance * exposure_factor).clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// The radiance in the middle of the interval that [`radiance_to_byte`] maps to `byte`, in one channel.
#[must_use]
pub fn byte_to_radiance(byte: u8, exposure_factor: f32) -> f32 {
    math::srgb_eotf(f32::from(byte) / 255.0) / exposure_factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_trip_to_radiance_and_back() {
        for eighths in [-80, -3, 0, 5, 64] {
            let factor = Exposure { eighths }.factor();
            for byte in 0..=255u8 {
                assert_eq!(radiance_to_byte(byte_to_radiance(byte, factor), factor), byte, "at {eighths} eighths");
            }
        }
    }

    #[test]
    fn radiance_beyond_the_range_is_clamped() {
        assert_eq!(radiance_to_byte(-1.0, 1.0), 0);
        assert_eq!(radiance_to_byte(f32::INFINITY, 1.0), 255);
        assert_eq!(Exposure::from_stops(f32::NAN), None);
        assert_eq!(Exposure::from_stops(-1.55), Some(Exposure { eighths: -12 }));
    }
}
