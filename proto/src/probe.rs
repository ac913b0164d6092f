//! What a tile of the Probe phase reports, and how reports become the job's exposure and walks.
//!
//! Everything is an integer that is summed, so that the result does not depend on which worker reported what in which order.

use crate::{
    grid::Walk,
    math,
    plan::PhaseResults,
    settings::{ExposureMode, WalkMode},
    units::Exposure,
};
use serde::{Deserialize, Serialize};

/// Bins of the histogram: eighths of a stop from 2^-32 to 2^32, and one below for black.
pub const BINS: usize = 1 + 64 * 8;

/// Sums over the texels of one or more Probe tiles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProbeSums {
    /// How many (texel, direction) values have their largest channel in each bin; surfaces that emit are left out.
    pub histogram: Vec<u64>,
    /// Per surface: variation along the walk, for (phi fastest, theta fastest), in 2^-16 of the square root of radiance.
    pub variation: Vec<(u64, u64)>,
}

impl ProbeSums {
    /// No texel yet.
    #[must_use]
    pub fn new(surfaces: usize) -> Self {
        Self { histogram: vec![0; BINS], variation: vec![(0, 0); surfaces] }
    }

    /// Whether these sums have the shape of a job with `surfaces` surfaces; sums from outside must be asked before they are added.
    #[must_use]
    pub fn fits(&self, surfaces: usize) -> bool {
        self.histogram.len() == BINS && self.variation.len() == surfaces
    }

    /// Counts one value, W/(sr m²).
    pub fn count(&mut self, radiance: f32) {
        self.histogram[bin(radiance)] += 1;
    }

    /// Adds another tile's sums of the same shape.
    pub fn add(&mut self, other: &ProbeSums) {
        self.histogram.iter_mut().zip(&other.histogram).for_each(|(a, b)| *a = a.saturating_add(*b));
        for (a, b) in self.variation.iter_mut().zip(&other.variation) {
            *a = (a.0.saturating_add(b.0), a.1.saturating_add(b.1));
        }
    }

    /// The results that the barrier puts into the plan. A job without any light has exposure 0.
    #[must_use]
    pub fn results(&self, exposure: ExposureMode, walk: WalkMode) -> PhaseResults {
        let exposure = match exposure {
            ExposureMode::Fixed(e) => e,
            ExposureMode::Auto => self.auto_exposure(),
        };
        let total: u64 = self.histogram.iter().sum();
        // Values in bin b lie within an eighth above 2^((b - 1 - 256)/8); those at or above 2^-exposure are clipped.
        let first_clipped = (257 - i32::from(exposure.eighths)).clamp(0, BINS as i32) as usize;
        let clipped: u64 = self.histogram[first_clipped..].iter().sum();
        let clipped_ppm = (u128::from(clipped) * 1_000_000 / u128::from(total.max(1))) as u32;
        let pick = |(phi, theta): &(u64, u64)| walk.fixed().unwrap_or(if theta < phi { Walk::Theta } else { Walk::Phi });
        PhaseResults { exposure, walks: self.variation.iter().map(pick).collect(), clipped_ppm }
    }

    /// The 98th percentile becomes 1.0, to 1/8 stop: the upper edge of its bin, so that nothing of that bin is clipped. Black counts: an
    /// image that is half black keeps its highlights. Where less than 2 % is lit at all, the percentile is that of what is lit.
    fn auto_exposure(&self) -> Exposure {
        let lit: u64 = self.histogram[1..].iter().sum();
        let black = self.histogram[0];
        let percentile = |n: u64| (u128::from(n) * 98).div_ceil(100) as u64;
        let target = match percentile(lit + black) {
            all if all > black => all - black,
            _ => percentile(lit),
        };
        let mut below = 0;
        for (b, n) in self.histogram.iter().enumerate().skip(1) {
            below += n;
            if *n > 0 && below >= target {
                return Exposure { eighths: (256 - b as i32) as i16 };
            }
        }
        Exposure::default()
    }
}

fn bin(radiance: f32) -> usize {
    if radiance <= 0.0 || !radiance.is_finite() {
        return 0;
    }
    let eighth = (f64::from(math::log2(radiance)) * 8.0).floor() as i32 + 256;
    1 + eighth.clamp(0, BINS as i32 - 2) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_98th_percentile_becomes_one() {
        let mut sums = ProbeSums::new(1);
        for k in 0..1000 {
            sums.count(if k < 980 { 0.25 } else { 100.0 });
        }
        let results = sums.results(ExposureMode::Auto, WalkMode::Auto);
        // 0.25 lies in the eighth that begins at 2^-2: two stops less an eighth bring its upper edge to one.
        assert_eq!(results.exposure, Exposure { eighths: 15 });
        assert_eq!(results.clipped_ppm, 20_000, "only what lies above the percentile is clipped");
        assert_eq!(sums.results(ExposureMode::Fixed(Exposure { eighths: 0 }), WalkMode::Auto).clipped_ppm, 20_000);
    }

    #[test]
    fn a_scene_that_is_nearly_all_black_is_exposed_for_its_light() {
        let mut sums = ProbeSums::new(1);
        for k in 0..10_000u16 {
            sums.count(if k < 9_900 { 0.0 } else { f32::from(k - 9_899) });
        }
        // A hundred lit values, 1 to 100: the 98th is 98, which lies in the eighth from 2^6.5 to 2^6.625.
        assert_eq!(sums.results(ExposureMode::Auto, WalkMode::Auto).exposure, Exposure { eighths: -53 });
    }

    #[test]
    fn a_job_without_light_has_no_exposure_and_order_does_not_matter() {
        let mut black = ProbeSums::new(2);
        black.count(0.0);
        assert_eq!(black.results(ExposureMode::Auto, WalkMode::Auto).exposure, Exposure::default());
        let (mut a, mut b) = (ProbeSums::new(2), ProbeSums::new(2));
        a.count(1.5);
        a.variation[1] = (9, 3);
        b.count(0.1);
        let (mut ab, mut ba) = (a.clone(), b.clone());
        ab.add(&b);
        ba.add(&a);
        assert_eq!(ab, ba);
        assert_eq!(ab.results(ExposureMode::Auto, WalkMode::Auto).walks, [Walk::Phi, Walk::Theta]);
        assert_eq!(ab.results(ExposureMode::Auto, WalkMode::Phi).walks, [Walk::Phi, Walk::Phi]);
    }
}
