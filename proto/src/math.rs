//! Deterministic elementary functions.
//!
//! A baked byte may not depend on the machine's C library, so nothing here calls one: only `+ - * /`, square roots (exact by IEEE 754)
//! and integer operations, in f64 where that is the simplest way to an f32 result that is right to the last bit or two. Clippy bans
//! `f32::sin`, `powf` and their kin elsewhere. The alternative, a portable `libm` crate, is as deterministic but three times slower in
//! the sampling loops and cannot be vectorised by the compiler.

use std::f64::consts::{LN_2, LOG2_E, PI};

/// 2^x, relative error below 1e-7; 0 below -150, infinity above 128.
#[must_use]
#[inline]
pub fn exp2(x: f32) -> f32 {
    exp2_f64(f64::from(x)) as f32
}

/// log2(x) for x > 0, absolute error below 1e-7 · max(1, |log2 x|); -infinity at 0, NaN below.
#[must_use]
#[inline]
pub fn log2(x: f32) -> f32 {
    log2_f64(f64::from(x)) as f32
}

/// x^y for x >= 0, relative error about 1e-7. 0^0 is 1.
#[must_use]
#[inline]
pub fn pow(x: f32, y: f32) -> f32 {
    if y == 0.0 {
        return 1.0;
    }
    if x <= 0.0 {
        return if y > 0.0 { 0.0 } else { f32::INFINITY };
    }
    exp2_f64(f64::from(y) * log2_f64(f64::from(x))) as f32
}

/// (sin, cos) of 2·pi·`turns` for |turns| < 2^20.
#[must_use]
#[inline]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let (s, c) = sin_cos_turns_f64(f64::from(turns));
    (s as f32, c as f32)
}

/// (sin, cos) of an angle in degrees, exact at multiples of 90.
#[must_use]
pub fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    sin_cos_turns_f64(degrees / 360.0)
}

/// The arc cosine of x in [-1, 1], radians, absolute error below 1e-9 (Newton's method on the cosine from a cubic first guess).
#[must_use]
pub fn acos(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    if x < 0.0 {
        return PI - acos(-x);
    }
    // acos(x) = 2 asin(sqrt((1-x)/2)); the half-angle form keeps its digits near x = 1.
    let h = ((1.0 - x) * 0.5).sqrt();
    let mut a = h * (1.0 + h * h * (1.0 / 6.0 + h * h * 0.075));
    for _ in 0..4 {
        let (s, c) = sin_cos_turns_f64(a / (2.0 * PI));
        a += (h - s) / c.max(0.5);
    }
    2.0 * a
}

/// The angle of the point (x, y), radians in [-pi, pi], absolute error below 1e-10; 0 at the origin. The octant is taken off first, then an
/// eighth of a turn, so that the series of the arc tangent runs up to tan(pi/8) only.
#[must_use]
pub fn atan2(y: f64, x: f64) -> f64 {
    const TAN_PI_8: f64 = std::f64::consts::SQRT_2 - 1.0;
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    if high == 0.0 {
        return 0.0;
    }
    let t = low / high;
    let (base, t) = if t > TAN_PI_8 { (PI / 4.0, (t - 1.0) / (t + 1.0)) } else { (0.0, t) };
    let w = t * t;
    // 1 - w/3 + w²/5 - …, from the innermost term out.
    let series = (1..=12).rev().fold(0.0, |sum, k| w * (1.0 / f64::from(2 * k + 1) - sum));
    let octant = base + t * (1.0 - series);
    let quadrant = if ax < ay { PI / 2.0 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    if y < 0.0 { -half } else { half }
}

/// The sRGB opto-electronic transfer function (IEC 61966-2-1), [0, 1] to [0, 1].
#[must_use]
pub fn srgb_oetf(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * pow(linear, 1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_oetf`].
#[must_use]
pub fn srgb_eotf(coded: f32) -> f32 {
    if coded <= 0.040_45 { coded / 12.92 } else { pow((coded + 0.055) / 1.055, 2.4) }
}

#[inline]
fn exp2_f64(x: f64) -> f64 {
    if x < -150.0 {
        return 0.0;
    }
    if x > 128.0 {
        return f64::INFINITY;
    }
    let whole = (x + 0.5).floor();
    let r = (x - whole) * LN_2; // |r| <= 0.347; the series below is right to 1e-13 there.
    let p = 1.0
        + r * (1.0
            + r * (1.0 / 2.0
                + r * (1.0 / 6.0
                    + r * (1.0 / 24.0
                        + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * (1.0 / 40_320.0 + r / 362_880.0))))))));
    // `whole` is within [-150, 128]: the exponent field stays normal in f64.
    p * f64::from_bits(((1023 + whole as i64) as u64) << 52)
}

#[inline]
fn log2_f64(x: f64) -> f64 {
    if x <= 0.0 {
        return if x == 0.0 { f64::NEG_INFINITY } else { f64::NAN };
    }
    if !x.is_finite() {
        return x;
    }
    let bits = x.to_bits();
    // Every positive f32, denormals included, is a normal f64, so the exponent field is the exponent.
    let mut exponent = ((bits >> 52) & 0x7ff) as i64 - 1023;
    let mut m = f64::from_bits((bits & 0x000f_ffff_ffff_ffff) | 0x3ff0_0000_0000_0000);
    if m > std::f64::consts::SQRT_2 {
        m *= 0.5;
        exponent += 1;
    }
    // ln(m) = 2 atanh(z), z = (m-1)/(m+1), |z| <= 0.172.
    let z = (m - 1.0) / (m + 1.0);
    let w = z * z;
    let series =
        1.0 + w * (1.0 / 3.0 + w * (1.0 / 5.0 + w * (1.0 / 7.0 + w * (1.0 / 9.0 + w * (1.0 / 11.0 + w * (1.0 / 13.0 + w / 15.0))))));
    exponent as f64 + 2.0 * z * series * LOG2_E
}

#[inline]
fn sin_cos_turns_f64(turns: f64) -> (f64, f64) {
    // Quarter turns are split off exactly, so that the axes come out exactly.
    let quarters = (turns * 4.0 + 0.5).floor();
    let r = (turns * 4.0 - quarters) * (PI / 2.0); // |r| <= pi/4
    let w = r * r;
    let s = r
        * (1.0
            - w * (1.0 / 6.0
                - w * (1.0 / 120.0 - w * (1.0 / 5040.0 - w * (1.0 / 362_880.0 - w * (1.0 / 39_916_800.0 - w / 6_227_020_800.0))))));
    let c =
        1.0 - w * (1.0 / 2.0 - w * (1.0 / 24.0 - w * (1.0 / 720.0 - w * (1.0 / 40_320.0 - w * (1.0 / 3_628_800.0 - w / 479_001_600.0)))));
    match (quarters as i64).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)] // The C library is the oracle here, and nowhere else.
mod tests {
    use super::*;

    #[test]
    fn elementary_functions_agree_with_the_c_library() {
        for i in -4000..4000 {
            let x = i as f32 * 0.0173;
            assert!((exp2(x) / x.exp2() - 1.0).abs() < 3e-7, "exp2({x})");
            let (s, c) = sin_cos_turns(x);
            let angle = f64::from(x) * 2.0 * PI;
            assert!((f64::from(s) - angle.sin()).abs() < 1e-7 && (f64::from(c) - angle.cos()).abs() < 1e-7, "sin_cos({x})");
            let y = (i as f32).abs() * 0.37 + 1e-6;
            assert!((log2(y) - y.log2()).abs() < 2e-7 * y.log2().abs().max(1.0), "log2({y})");
            let u = f64::from(i) / 4000.0;
            assert!((acos(u) - u.acos()).abs() < 1e-9, "acos({u})");
            let (y, x) = (u * 3.0, f64::from((i * 37) % 101) * 0.03);
            assert!((atan2(y, x) - y.atan2(x)).abs() < 1e-10, "atan2({y}, {x})");
            assert!((atan2(y, -x - 1e-3) - y.atan2(-x - 1e-3)).abs() < 1e-10, "atan2({y}, -{x})");
        }
        for (x, y) in [(0.5, 60.0), (0.999, 1000.0), (0.1, 1.0 / 2.4), (3.0, -2.5)] {
            assert!((pow(x, y) / x.powf(y) - 1.0).abs() < 1e-6, "pow({x}, {y})");
        }
    }

    #[test]
    fn the_axes_are_exact_and_the_edges_defined() {
        assert_eq!(
            [sin_cos_turns(0.0), sin_cos_turns(0.25), sin_cos_turns(0.5), sin_cos_turns(-0.25)],
            [(0.0, 1.0), (1.0, -0.0), (-0.0, -1.0), (-1.0, 0.0)]
        );
        assert_eq!((pow(0.0, 0.0), pow(0.0, 3.0), pow(1.0, 1e9)), (1.0, 0.0, 1.0));
        assert_eq!((atan2(0.0, 1.0), atan2(0.0, 0.0), atan2(1.0, 0.0), atan2(0.0, -1.0)), (0.0, 0.0, PI / 2.0, PI));
        assert_eq!((exp2(-1e9), log2(0.0)), (0.0, f32::NEG_INFINITY));
        assert_eq!((srgb_oetf(0.0), srgb_eotf(1.0)), (0.0, 1.0));
    }
}
