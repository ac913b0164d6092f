//! Which of many lights without area a vertex asks: resampled importance sampling (Talbot, Cline and Egbert 2005).
//!
//! Up to [`CANDIDATES`] lights are drawn by power, and one of them by what it would send here unshadowed; where there are no more lights
//! than that, all are candidates and the choice is exact. Only the chosen one needs a shadow ray. Choosing by power alone would ask lights
//! whose range or cone ends elsewhere; a tree of lights (Conty and Kulla 2018) pays off in scenes of thousands that all reach.

use super::emitter::{chance, choose, cumulative};

/// Lights that are looked at for one choice.
pub const CANDIDATES: usize = 32;
/// Of the mean power, what every light has at least: none starves because its power was underestimated.
const FLOOR: f64 = 0.1;

/// Lights by estimated power.
#[derive(Debug, Default)]
pub struct Choice {
    cumulative: Vec<f32>,
}

impl Choice {
    /// From the estimated power of each light, W.
    #[must_use]
    pub fn new(powers: impl IntoIterator<Item = f64>) -> Self {
        let powers: Vec<f64> = powers.into_iter().collect();
        let floor = (powers.iter().sum::<f64>() * FLOOR / powers.len().max(1) as f64).max(f64::MIN_POSITIVE);
        let total = powers.iter().sum::<f64>() + floor * powers.len() as f64;
        Self { cumulative: cumulative(powers.iter().map(|p| p + floor), total) }
    }

    /// Chooses a light in proportion to `contribution` (at least 0) of each, estimated from candidates. Returns its index and what its
    /// light is to be multiplied with; `None` where no candidate contributes.
    #[must_use]
    #[inline]
    pub fn pick(&self, u: [f32; 2], contribution: impl Fn(usize) -> f32) -> Option<(usize, f32)> {
        let lights = self.cumulative.len();
        let candidates = lights.min(CANDIDATES);
        let mut weights = [0.0f32; CANDIDATES];
        let mut chosen = [0usize; CANDIDATES];
        let mut total = 0.0;
        for k in 0..candidates {
            let (light, factor) = self.candidate(k, u[0], candidates, lights)?;
            chosen[k] = light;
            weights[k] = contribution(light) * factor;
            total += weights[k];
        }
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut left = u[1] * total;
        let mut last = None;
        for k in (0..candidates).filter(|k| weights[*k] > 0.0) {
            last = Some(k);
            left -= weights[k];
            if left < 0.0 {
                break;
            }
        }
        // The chance of the chosen one is its weight over the total; its weight is its contribution times the candidate's factor.
        last.map(|k| (chosen[k], total / contribution(chosen[k])))
    }

    /// The `k`-th candidate and one over the expected number of times it is drawn. All of them are the lights themselves; of more lights,
    /// they are spread evenly over the distribution.
    fn candidate(&self, k: usize, u: f32, candidates: usize, lights: usize) -> Option<(usize, f32)> {
        if candidates == lights {
            return Some((k, 1.0));
        }
        let at = ((k as f32 + u) / candidates as f32).min(1.0 - f32::EPSILON);
        let (light, _) = choose(&self.cumulative, at)?;
        Some((light, 1.0 / (chance(&self.cumulative, light) * candidates as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What many picks estimate of the sum over all lights.
    fn estimate(powers: &[f64], contribution: &dyn Fn(usize) -> f32) -> f64 {
        let choice = Choice::new(powers.iter().copied());
        let n = 1 << 16;
        let pair = |i: u32| [(i as f32 + 0.5) / n as f32, (i.reverse_bits() >> 8) as f32 / 16_777_216.0];
        let picks = (0..n).filter_map(|i| choice.pick(pair(i), contribution));
        picks.map(|(light, factor)| f64::from(contribution(light) * factor)).sum::<f64>() / f64::from(n)
    }

    #[test]
    fn the_sum_over_lights_is_estimated_without_bias_whatever_their_power() {
        // Few lights: exact. Many: also those that were thought to have no power, and those that contribute nothing.
        assert!((estimate(&[1.0, 9.0], &|k| [3.0, 1.0][k]) - 4.0).abs() < 1e-4);
        let powers: Vec<f64> = (0..100).map(|k| f64::from(k % 7)).collect();
        let contribution = |k: usize| if k.is_multiple_of(3) { 0.0 } else { 1.0 + (k % 10) as f32 };
        let expected: f64 = (0..100).map(|k| f64::from(contribution(k))).sum();
        let found = estimate(&powers, &contribution);
        assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
    }

    #[test]
    fn a_choice_follows_the_contribution() {
        let choice = Choice::new([1.0, 1.0, 1.0]);
        let picked: Vec<usize> =
            (0..100).filter_map(|i| choice.pick([0.5, (i as f32 + 0.5) / 100.0], |k| [1.0, 0.0, 3.0][k])).map(|p| p.0).collect();
        assert_eq!((picked.iter().filter(|k| **k == 0).count(), picked.iter().filter(|k| **k == 2).count()), (25, 75));
        assert_eq!(choice.pick([0.5, 0.5], |_| 0.0), None);
        assert_eq!(Choice::new([]).pick([0.5, 0.5], |_| 1.0), None);
    }
}
