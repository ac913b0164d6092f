//! Multiple importance sampling (Veach 1997, chapter 9).

/// The balance heuristic for one sample of each of two techniques: the weight of the one with density `own`.
#[must_use]
#[inline]
pub fn balance(own: f32, other: f32) -> f32 {
    own / (own + other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_of_both_techniques_sum_to_one() {
        for (a, b) in [(1.0, 3.0), (1e-20, 1e20), (0.5, 0.0)] {
            assert!((balance(a, b) + balance(b, a) - 1.0).abs() < 1e-6);
        }
    }
}
