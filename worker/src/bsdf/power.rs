//! cos^n without a library call: the integer part by repeated squaring in a fixed order, a fractional part by polynomials.
//!
//! Everything is straight-line f32 arithmetic, so one source serves single values and eight lanes alike and gives the same bits in both.
//! A general power per lane lost: most exponents are integers, for which seven multiplications do.

use std::f32::consts::PI;

/// A Phong exponent n >= 0, split once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponent {
    value: f32,
    whole: u32,
    fraction: f32,
}

/// Beyond this a lobe is narrower than f32 cosines can tell apart.
const LARGEST: f32 = 16_777_216.0;

impl Exponent {
    /// The exponent `n`, at most 2^24.
    #[must_use]
    pub fn new(n: f32) -> Self {
        let value = n.clamp(0.0, LARGEST);
        let whole = value as u32;
        Self { value, whole, fraction: value - whole as f32 }
    }

    /// n.
    #[must_use]
    pub fn value(self) -> f32 {
        self.value
    }

    /// (n + 2)/(2 pi): the lobe's normalisation as a reflectance, 1/sr.
    #[must_use]
    pub fn eval_norm(self) -> f32 {
        (self.value + 2.0) / (2.0 * PI)
    }

    /// (n + 1)/(2 pi): its normalisation as a density, 1/sr.
    #[must_use]
    pub fn pdf_norm(self) -> f32 {
        (self.value + 1.0) / (2.0 * PI)
    }

    /// max(0, c)^n; 0 for c <= 0 also when n = 0.
    #[must_use]
    #[inline]
    pub fn raise(self, c: f32) -> f32 {
        self.raise_lanes([c])[0]
    }

    /// [`Exponent::raise`] of several values at once.
    #[must_use]
    #[inline(always)]
    pub fn raise_lanes<const N: usize>(self, c: [f32; N]) -> [f32; N] {
        let mut base: [f32; N] = std::array::from_fn(|k| if c[k] > 0.0 { c[k] } else { 0.0 });
        let mut out: [f32; N] = std::array::from_fn(|k| if c[k] > 0.0 { 1.0 } else { 0.0 });
        if self.fraction > 0.0 {
            out = std::array::from_fn(|k| out[k] * fraction_of(base[k], self.fraction));
        }
        let mut left = self.whole;
        while left != 0 {
            if left & 1 == 1 {
                out = std::array::from_fn(|k| out[k] * base[k]);
            }
            base = std::array::from_fn(|k| base[k] * base[k]);
            left >>= 1;
        }
        out
    }
}

/// x^f for x in [0, 1] and 0 < f < 1, relative error below 1e-6 down to x = 1e-37 (below it, x itself counts as 1e-37): log2 by the atanh
/// series, 2^y by Taylor's. No branch and no table, so that lanes can share it.
#[inline(always)]
fn fraction_of(x: f32, f: f32) -> f32 {
    let x = if x < 1e-37 { 1e-37 } else { x };
    // m in [sqrt(1/2), sqrt(2)): the offset is sqrt(1/2)'s own bits.
    let shifted = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (shifted as i32) >> 23;
    let m = f32::from_bits((shifted & 0x007f_ffff).wrapping_add(0x3f35_04f3));
    let z = (m - 1.0) / (m + 1.0);
    let w = z * z;
    let series = 1.0 + w * (1.0 / 3.0 + w * (1.0 / 5.0 + w * (1.0 / 7.0 + w * (1.0 / 9.0))));
    let log2 = exponent as f32 + (2.0 * std::f32::consts::LOG2_E) * z * series;
    let y = f * log2; // in (-124, 0.01)
    let whole = (y - 0.5) as i32; // rounds to nearest for y <= 0
    let r = (y - whole as f32) * std::f32::consts::LN_2;
    let p = 1.0 + r * (1.0 + r * (1.0 / 2.0 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    p * f32::from_bits(((127 + whole) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::math;

    #[test]
    fn powers_agree_with_the_reference_function() {
        for n in [0.0, 0.37, 1.0, 15.0, 60.0, 96.078_43, 225.0, 1000.5] {
            let e = Exponent::new(n);
            for i in 1..=2000 {
                let c = i as f32 / 2000.0;
                let (got, expected) = (e.raise(c), math::pow(c, n));
                // Squaring doubles the relative rounding each time: about n units in the last place.
                assert!((got - expected).abs() <= expected * (1e-6 + n * 1.2e-7) + 1e-37, "{c}^{n}: {got} {expected}");
            }
            assert_eq!((e.raise(0.0), e.raise(-0.5)), (0.0, 0.0));
        }
    }

    #[test]
    fn lanes_give_the_bits_of_single_values() {
        let e = Exponent::new(33.3);
        let c: [f32; 8] = std::array::from_fn(|k| k as f32 / 7.0 - 0.1);
        assert_eq!(e.raise_lanes(c), c.map(|c| e.raise(c)));
    }
}
