//! What an encoding costs in accuracy, as integers: sums over tiles are exact and the same in any order.

use super::Sample;

/// Errors of decoded against original 8-bit samples. A *sample* is one direction of one texel; its error is the largest of its channels,
/// in levels of 1/255.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ErrorStats {
    /// How many samples have each error.
    histogram: Box<[u64; 256]>,
    /// Sum of the absolute errors of all channels.
    sum: u64,
}

/// Statistics that no set of samples can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BadErrorStats {
    /// The histogram counts another number of samples.
    #[error("the error histogram counts {found} samples; expected {expected}")]
    Samples {
        /// Samples counted.
        found: u64,
        /// Samples there are.
        expected: u64,
    },
    /// The sum is below one channel's worth of the histogram, or above three.
    #[error("the sum of errors {sum} does not fit its histogram")]
    Sum {
        /// The sum found.
        sum: u64,
    },
}

impl Default for ErrorStats {
    fn default() -> Self {
        Self { histogram: Box::new([0; 256]), sum: 0 }
    }
}

impl ErrorStats {
    /// Statistics from their parts, checked against each other and against the number of samples they should count.
    ///
    /// # Errors
    /// Counts or a sum that do not fit.
    pub fn from_parts(counts: &[(u8, u64)], sum: u64, samples: u64) -> Result<Self, BadErrorStats> {
        let mut out = Self { sum, ..Self::default() };
        counts.iter().for_each(|(error, n)| out.histogram[usize::from(*error)] = out.histogram[usize::from(*error)].saturating_add(*n));
        let found = out.histogram.iter().fold(0u64, |all, n| all.saturating_add(*n));
        if found != samples {
            return Err(BadErrorStats::Samples { found, expected: samples });
        }
        let least: u128 = out.histogram.iter().enumerate().map(|(e, n)| e as u128 * u128::from(*n)).sum();
        if (least..=3 * least).contains(&u128::from(sum)) { Ok(out) } else { Err(BadErrorStats::Sum { sum }) }
    }

    /// Compares decoded samples with their originals.
    pub fn measure(&mut self, original: &[Sample], decoded: &[Sample]) {
        for (a, b) in original.iter().zip(decoded) {
            let error: [u8; 3] = std::array::from_fn(|c| a[c].abs_diff(b[c]));
            self.histogram[usize::from(error[0].max(error[1]).max(error[2]))] += 1;
            self.sum += error.iter().map(|e| u64::from(*e)).sum::<u64>();
        }
    }

    /// Adds the statistics of other samples.
    pub fn add(&mut self, other: &ErrorStats) {
        self.histogram.iter_mut().zip(other.histogram.iter()).for_each(|(a, b)| *a += b);
        self.sum += other.sum;
    }

    /// The errors that occur, ascending, with their counts.
    pub fn counts(&self) -> impl Iterator<Item = (u8, u64)> + '_ {
        self.histogram.iter().enumerate().filter(|(_, n)| **n > 0).map(|(e, n)| (e as u8, *n))
    }

    /// Sum of the absolute errors of all channels, levels.
    #[must_use]
    pub fn sum(&self) -> u64 {
        self.sum
    }

    /// Samples compared.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.histogram.iter().sum()
    }

    /// Samples that differ in some channel.
    #[must_use]
    pub fn differing(&self) -> u64 {
        self.samples() - self.histogram[0]
    }

    /// The mean absolute error over all samples and channels, levels.
    #[must_use]
    pub fn average(&self) -> f64 {
        mean(self.sum, self.samples())
    }

    /// The mean absolute error over the channels of samples that differ (thesis, eq. 2.16), levels.
    #[must_use]
    pub fn average_differing(&self) -> f64 {
        mean(self.sum, self.differing())
    }

    /// The smallest error that at least 99.9 % of the samples stay within, levels.
    #[must_use]
    pub fn p99_9(&self) -> u8 {
        let target = (u128::from(self.samples()) * 999).div_ceil(1000);
        let mut within = 0u128;
        let reaches = |n: &u64| {
            within += u128::from(*n);
            within >= target
        };
        self.histogram.iter().position(reaches).unwrap_or(0) as u8
    }

    /// The largest error, levels.
    #[must_use]
    pub fn max(&self) -> u8 {
        self.histogram.iter().rposition(|n| *n > 0).unwrap_or(0) as u8
    }
}

fn mean(sum: u64, samples: u64) -> f64 {
    if samples == 0 { 0.0 } else { sum as f64 / (3.0 * samples as f64) }
}
