//! cos^n without a library call: the integer part octal digit by octal digit in a fixed order, a fractional part by polynomials.
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
        let (mut base, mut out) = ([c], [0.0]);
        self.raise_all(&mut base, &mut out);
        out[0]
    }

    /// [`Exponent::raise`] of many values into as many others; negative values are set to zero in place. Each octal digit of n is one pass
    /// of straight-line code over the slices, which the compiler turns into vector code: out = out^8 · c^digit.
    #[inline(always)]
    pub fn raise_all(self, values: &mut [f32], out: &mut [f32]) {
        for (c, o) in values.iter_mut().zip(&mut *out) {
            *o = if *c > 0.0 { 1.0 } else { 0.0 };
            *c = if *c > 0.0 { *c } else { 0.0 };
        }
        let mut digits = (32 - self.whole.leading_zeros()).div_ceil(3);
        let mut first = true;
        while digits > 0 {
            digits -= 1;
            pass((self.whole >> (3 * digits)) & 7, first, values, out);
            first = false;
        }
        if self.fraction > 0.0 {
            for (c, o) in values.iter().zip(out) {
                *o *= fraction_of(*c, self.fraction);
            }
        }
    }
}

/// One octal digit of the exponent. The first needs no eighth power: `out` holds ones and zeros.
#[inline(always)]
fn pass(digit: u32, first: bool, values: &[f32], out: &mut [f32]) {
    macro_rules! each {
        ($c:ident, $power:expr) => {
            if first {
                values.iter().zip(out).for_each(|(&$c, o)| *o *= $power);
            } else {
                values.iter().zip(out).for_each(|(&$c, o)| *o = eighth_power(*o) * $power);
            }
        };
    }
    let cube = |c: f32| (c * c) * c;
    match digit {
        0 => out.iter_mut().for_each(|o| *o = eighth_power(*o)),
        1 => each!(c, c),
        2 => each!(c, c * c),
        3 => each!(c, cube(c)),
        4 => each!(c, (c * c) * (c * c)),
        5 => each!(c, ((c * c) * (c * c)) * c),
        6 => each!(c, cube(c) * cube(c)),
        _ => each!(c, (cube(c) * cube(c)) * c),
    }
}

#[inline(always)]
fn eighth_power(x: f32) -> f32 {
    let fourth = (x * x) * (x * x);
    fourth * fourth
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
    fn many_values_give_the_bits_of_single_ones() {
        for n in [0.0, 8.0, 33.3, 64.0] {
            let e = Exponent::new(n);
            let mut c: [f32; 37] = std::array::from_fn(|k| k as f32 / 30.0 - 0.2);
            let (singles, mut many) = (c.map(|c| e.raise(c)), [0.0; 37]);
            e.raise_all(&mut c, &mut many);
            assert_eq!(many, singles);
        }
    }
}
