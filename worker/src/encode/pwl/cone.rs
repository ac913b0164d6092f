//! The slopes that a segment may have: a cone from its first corner, narrowed by every sample that it passes.
//!
//! A skipped sample x at distance t from the corner p is decoded as floor(p + s t + 1/2). That stays within x - e .. x + e exactly when
//! 2 (x - p) - 2e - 1 <= 2 s t < 2 (x - p) + 2e + 1. The bounds are kept as fractions and compared by cross multiplication, so the test
//! *is* the decoder's rounding, not an approximation of it with a slack. Numerators stay below 2^13 and denominators below 2^12, products
//! below 2^26.

/// A fraction with a positive denominator.
#[derive(Debug, Clone, Copy)]
struct Fraction {
    num: i32,
    den: i32,
}

impl Fraction {
    fn is_less_than(self, other: Fraction) -> bool {
        self.num * other.den < other.num * self.den
    }
}

/// Twice the slopes that keep every sample so far within its error: `low <= 2 s < high`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    low: Fraction,
    high: Fraction,
}

impl Cone {
    /// Every slope between two 8-bit values.
    pub(super) const OPEN: Cone = Cone { low: Fraction { num: -511, den: 1 }, high: Fraction { num: 511, den: 1 } };

    /// Narrows the cone by a sample at `distance` steps that lies `rise` above the corner and may be off by `error`.
    pub(super) fn narrow(&mut self, distance: usize, rise: i32, error: i32) {
        let den = distance as i32; // below 4,096
        let low = Fraction { num: 2 * rise - 2 * error - 1, den };
        let high = Fraction { num: 2 * rise + 2 * error + 1, den };
        if self.low.is_less_than(low) {
            self.low = low;
        }
        if high.is_less_than(self.high) {
            self.high = high;
        }
    }

    /// Whether no slope is left: no longer segment can pass the samples so far.
    pub(super) fn is_empty(&self) -> bool {
        !self.low.is_less_than(self.high)
    }

    /// The whole rises at `distance` that lie in the cone: first and last, with the first above the last where there is none.
    pub(super) fn rises(&self, distance: usize) -> (i32, i32) {
        let d = distance as i32;
        // low <= 2 r / d  <=>  r >= low d / 2; and 2 r / d < high  <=>  r < high d / 2.
        let first = -(-self.low.num * d).div_euclid(2 * self.low.den);
        let last = (self.high.num * d - 1).div_euclid(2 * self.high.den);
        (first, last)
    }
}
