//! Pearson's chi-square test of a sampler of directions against its density: a million samples in 80 x 160 bins of (cos, azimuth), expected
//! counts by Gauss quadrature of the density, significance 0.01 with Šidák's correction over the cases of one test (quality.md).

#![allow(clippy::disallowed_methods)] // The C library may serve a test.

use glam::Vec3;
use kiln_proto::math;
use std::f64::consts::PI;

const SAMPLES: u32 = 1_000_000;
const BINS: (usize, usize) = (80, 160);
const ALPHA: f64 = 0.01;
/// Bins that expect fewer samples are pooled.
const POOL: f64 = 5.0;

/// A sampler (a direction from two uniform numbers, a zero vector for "no sample") and the density it claims, 1/sr.
pub(crate) struct Case<'a> {
    name: &'static str,
    sample: &'a dyn Fn([f32; 2]) -> Vec3,
    pdf: &'a dyn Fn(Vec3) -> f32,
}

impl<'a> Case<'a> {
    pub(crate) fn new(name: &'static str, sample: &'a dyn Fn([f32; 2]) -> Vec3, pdf: &'a dyn Fn(Vec3) -> f32) -> Self {
        Self { name, sample, pdf }
    }
}

/// Fails for the first sampler that does not follow its density.
pub(crate) fn check(cases: &[Case<'_>]) {
    let alpha = 1.0 - (1.0 - ALPHA).powf(1.0 / cases.len() as f64);
    for case in cases {
        let (expected, observed) = (expected(case), observed(case));
        let (mut statistic, mut bins) = (0.0, 0usize);
        let (mut pooled_expected, mut pooled_observed) = (0.0, 0.0);
        for (e, o) in expected.iter().zip(&observed) {
            if *e < POOL {
                pooled_expected += e;
                pooled_observed += o;
            } else {
                statistic += (o - e) * (o - e) / e;
                bins += 1;
            }
        }
        if pooled_expected >= POOL {
            statistic += (pooled_observed - pooled_expected).powi(2) / pooled_expected;
            bins += 1;
        } else {
            assert!(pooled_observed < 40.0, "{}: {pooled_observed} samples where {pooled_expected} are expected", case.name);
        }
        let (dof, limit) = (bins as f64 - 1.0, 1.0 - alpha);
        assert!(chi_square_cdf(statistic, dof) < limit, "{}: chi-square {statistic} with {dof} degrees of freedom", case.name);
    }
}

fn observed(case: &Case<'_>) -> Vec<f64> {
    let mut bins = vec![0.0; BINS.0 * BINS.1];
    let mut state = 0x1234_5678u64;
    let mut next = || {
        state = state.wrapping_add(1);
        (super::sequence::mix(state) >> 40) as f32 / 16_777_216.0
    };
    for _ in 0..SAMPLES {
        let w = (case.sample)([next(), next()]);
        if w == Vec3::ZERO {
            continue;
        }
        assert!((w.length() - 1.0).abs() < 1e-4, "{}: {w} is not a unit vector", case.name);
        let z = ((f64::from(w.z) * 0.5 + 0.5) * BINS.0 as f64).clamp(0.0, BINS.0 as f64 - 1.0) as usize;
        let turns = f64::from(w.y).atan2(f64::from(w.x)) / (2.0 * PI);
        let phi = (turns.rem_euclid(1.0) * BINS.1 as f64).min(BINS.1 as f64 - 1.0) as usize;
        bins[z * BINS.1 + phi] += 1.0;
    }
    bins
}

/// Six-point quadrature along both sides of a bin, which is exact enough where a density has a kink only at bin borders.
fn expected(case: &Case<'_>) -> Vec<f64> {
    const STEPS: usize = 6;
    let mut bins = Vec::with_capacity(BINS.0 * BINS.1);
    for (i, j) in (0..BINS.0).flat_map(|i| (0..BINS.1).map(move |j| (i, j))) {
        let mut sum = 0.0;
        for (a, b) in (0..STEPS).flat_map(|a| (0..STEPS).map(move |b| (a, b))) {
            let z = ((i as f64 + (a as f64 + 0.5) / STEPS as f64) / BINS.0 as f64) * 2.0 - 1.0;
            let (sin, cos) = math::sin_cos_degrees((j as f64 + (b as f64 + 0.5) / STEPS as f64) / BINS.1 as f64 * 360.0);
            let r = (1.0 - z * z).sqrt();
            sum += f64::from((case.pdf)(Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32)));
        }
        let area = 4.0 * PI / (BINS.0 * BINS.1 * STEPS * STEPS) as f64;
        bins.push(sum * area * f64::from(SAMPLES));
    }
    bins
}

/// Wilson and Hilferty's approximation, good to 1e-3 for the thousands of degrees of freedom here.
fn chi_square_cdf(x: f64, dof: f64) -> f64 {
    let k = 2.0 / (9.0 * dof);
    let z = ((x / dof).cbrt() - (1.0 - k)) / k.sqrt();
    // The logistic-free normal distribution by Abramowitz and Stegun 26.2.17.
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let poly = t * (0.319_381_530 + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * z * z).exp() / (2.0 * PI).sqrt() * poly;
    if z > 0.0 { 1.0 - tail } else { tail }
}
