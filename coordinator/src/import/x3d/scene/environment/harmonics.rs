//! Irradiance by nine spherical harmonics, and the radiance that gives it.
//!
//! A Lambert surface sees light through a cosine lobe, which weakens the harmonics of degree l by A_l and leaves nothing to speak of beyond
//! the second (Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps", SIGGRAPH 2001, equations 8 and 9).
//! So nine numbers a channel are an irradiance, and dividing by A_l gives a radiance that has it. Where that is negative nothing can shine
//! so; a blur of the irradiance map itself would never be, and lights every surface wrongly.

use super::map::{self, Source};
use glam::{DMat3, DVec3};
use kiln_proto::{math, units::Rgb};
use std::f32::consts::PI;

/// How the cosine lobe weakens the degrees 0, 1 and 2.
const LOBE: [f32; 3] = [PI, 2.0 * PI / 3.0, PI / 4.0];
/// The degree of each coefficient.
const DEGREES: [usize; 9] = [0, 1, 1, 1, 2, 2, 2, 2, 2];
/// A map that irradiance is read from has no more columns: it is smooth.
const COLUMNS: u32 = 1_024;

/// Coefficients in the order (l, m): (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) … (2, 2).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Harmonics([Rgb; 9]);

impl Harmonics {
    /// Nine times red, green and blue; `None` for other numbers.
    pub(super) fn read(numbers: &[f32]) -> Option<Self> {
        let (colours, []) = numbers.as_chunks::<3>() else { return None };
        let colours: [[f32; 3]; 9] = colours.try_into().ok()?;
        let is_finite = colours.as_flattened().iter().all(|v| v.is_finite());
        is_finite.then(|| Self(colours.map(Rgb::from)))
    }

    /// The coefficients of a source: its integral against each harmonic. Cost: linear in the texels of its map.
    pub(super) fn of(source: &Source) -> Self {
        let [width, height] = source.size();
        let width = width.clamp(64, COLUMNS);
        let size = [width, height.clamp(32, COLUMNS / 2)];
        let map = map::baked(source, DMat3::IDENTITY, size);
        let mut sums = [[0.0f64; 3]; 9];
        let [width, height] = size.map(f64::from);
        for (row, texels) in map.rgb.chunks_exact(size[0] as usize).enumerate() {
            let sine = |edge: f64| math::sin_cos_degrees((edge / height - 0.5) * 180.0).0;
            let (low, high) = (sine(row as f64), sine(row as f64 + 1.0));
            let solid = (high - low) * 2.0 * std::f64::consts::PI / width;
            let (sin_v, cos_v) = math::sin_cos_degrees(((row as f64 + 0.5) / height - 0.5) * 180.0);
            for (column, texel) in texels.iter().enumerate() {
                let (sin_u, cos_u) = math::sin_cos_degrees(((column as f64 + 0.5) / width - 0.5) * 360.0);
                let values = values(DVec3::new(cos_u * cos_v, sin_v, sin_u * cos_v));
                for (sum, y) in sums.iter_mut().zip(values) {
                    (0..3).for_each(|c| sum[c] += f64::from(texel[c]) * f64::from(y) * solid);
                }
            }
        }
        Self(sums.map(|s| Rgb::from(s.map(|v| v as f32))))
    }

    /// The radiance of an irradiance.
    pub(super) fn undone(irradiance: &Self) -> Self {
        Self(std::array::from_fn(|k| irradiance.0[k] * (1.0 / LOBE[DEGREES[k]])))
    }

    /// All of it, so much brighter.
    pub(super) fn times(&self, factor: f32) -> Self {
        Self(self.0.map(|c| c * factor))
    }

    /// Their sum toward a direction, unit.
    pub(super) fn at(&self, direction: DVec3) -> Rgb {
        let values = values(direction);
        self.0.iter().zip(values).fold(Rgb::BLACK, |sum, (c, y)| sum + *c * y)
    }
}

/// The real harmonics toward a direction (Ramamoorthi and Hanrahan, equation 3).
fn values(d: DVec3) -> [f32; 9] {
    let [x, y, z] = d.as_vec3().to_array();
    [
        0.282_095,
        0.488_603 * y,
        0.488_603 * z,
        0.488_603 * x,
        1.092_548 * x * y,
        1.092_548 * y * z,
        0.315_392 * (3.0 * z * z - 1.0),
        1.092_548 * x * z,
        0.546_274 * (x * x - y * y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_irradiance_of_pi_is_an_even_radiance_of_one() {
        let mut numbers = [0.0; 27];
        // E = 0.282095 E00.
        numbers[..3].fill(PI / 0.282_095);
        let radiance = Harmonics::undone(&Harmonics::read(&numbers).unwrap());
        for d in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.6, 0.0, -0.8)] {
            assert!((radiance.at(d).mean() - 1.0).abs() < 1e-5);
        }
        assert!(Harmonics::read(&numbers[..26]).is_none() && Harmonics::read(&[f32::NAN; 27]).is_none());
    }

    /// Each harmonic, sampled and found again: it alone, with its own strength.
    #[test]
    fn the_harmonics_are_orthonormal() {
        for k in 0..9 {
            let mut one = [Rgb::BLACK; 9];
            one[k] = Rgb::splat(1.0);
            let found = Harmonics::of(&Source::Harmonics(Harmonics(one)));
            for (at, c) in found.0.iter().enumerate() {
                assert!((c.r - if at == k { 1.0 } else { 0.0 }).abs() < 2e-3, "{k} {at} {c:?}");
            }
        }
    }

    /// What is undone and then seen through a cosine lobe, summed by brute force, is the irradiance again.
    #[test]
    fn a_lambert_surface_receives_the_irradiance_that_was_undone() {
        let numbers: [f32; 27] = std::array::from_fn(|i| if i < 3 { 9.0 } else { 0.25 * (i % 7) as f32 - 0.5 });
        let irradiance = Harmonics::read(&numbers).unwrap();
        let map = map::baked(&Source::Harmonics(Harmonics::undone(&irradiance)), DMat3::IDENTITY, [256, 128]);
        for n in [DVec3::X, DVec3::Y, DVec3::NEG_Z, DVec3::new(0.6, -0.8, 0.0)] {
            let mut sum = Rgb::BLACK;
            for (at, texel) in map.rgb.iter().enumerate() {
                let (sin_u, cos_u) = math::sin_cos_degrees((((at % 256) as f64 + 0.5) / 256.0 - 0.5) * 360.0);
                let (sin_v, cos_v) = math::sin_cos_degrees((((at / 256) as f64 + 0.5) / 128.0 - 0.5) * 180.0);
                let solid = cos_v * (std::f64::consts::PI / 128.0) * (std::f64::consts::PI / 128.0);
                let cosine = n.dot(DVec3::new(cos_u * cos_v, sin_v, sin_u * cos_v)).max(0.0);
                sum += Rgb::from(*texel) * (cosine * solid) as f32;
            }
            let expected = irradiance.at(n);
            for (a, b) in sum.to_array().iter().zip(expected.to_array()) {
                assert!((a - b).abs() < 5e-3, "{n}: {sum:?} {expected:?}");
            }
        }
    }
}
