//! The gather's inner loops: many samples of incident light against many directions, eight lanes at a time.
//!
//! For every sample the lobe is raised for all directions of the grid: the sum is the mixture density of the sample, the values weight its
//! light toward each direction. Samples go in blocks, so that sums over samples stay in registers while a block's lobe values, 12 KiB for
//! 400 directions, stay in the first-level cache. All sums run in a fixed order of samples and lanes.

use super::simd::Kernel;
use crate::{bsdf::power::Exponent, sampling::warp::INV_PI};
use glam::Vec3;
use kiln_proto::units::Rgb;

/// Directions in one vector.
pub(super) const LANES: usize = 8;
/// Samples in one block.
const BLOCK: usize = 8;

/// Eight directions' worth of one number.
pub(super) type Lanes = [f32; LANES];

/// Directions as the lobes see them: mirrored about the normal, axis by axis, padded with ones that no light above the horizon can reach.
#[derive(Debug, Clone)]
pub(super) struct Mirrored {
    axes: Vec<[Lanes; 3]>,
    len: usize,
}

impl Mirrored {
    /// From local directions.
    pub(super) fn new(directions: &[Vec3]) -> Self {
        let mut axes = vec![[[0.0; LANES], [0.0; LANES], [-1.0; LANES]]; directions.len().div_ceil(LANES)];
        for (k, d) in directions.iter().enumerate() {
            let m = crate::bsdf::mirror(*d).to_array();
            for axis in 0..3 {
                axes[k / LANES][axis][k % LANES] = m[axis];
            }
        }
        Self { axes, len: directions.len() }
    }

    /// How many directions there are, padding left out.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The mirror image of the `k`-th direction.
    pub(super) fn get(&self, k: usize) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|axis| self.axes[k / LANES][axis][k % LANES]))
    }
}

/// One sample of incident light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Where it comes from (local, z > 0).
    pub(super) wi: Vec3,
    /// Emitted by what is seen there; incident and light samples both find it, W/(sr m²).
    pub(super) emitted: Rgb,
    /// Density of light sampling there, 1/sr.
    pub(super) light_pdf: f32,
    /// Reflected by what is seen there; only incident samples find it, W/(sr m²).
    pub(super) reflected: Rgb,
    /// Kd at the point of the footprint that the sample belongs to.
    pub(super) diffuse: Rgb,
}

/// The mixture of densities that the samples of a texel were drawn from: p(w) = a cos/pi + (1 - a)/D sum over k of p_k(w).
#[derive(Debug, Clone, Copy)]
pub(super) struct Mixture {
    /// M: incident samples, those that came to nothing included.
    pub(super) incident: f32,
    /// S: light samples, likewise.
    pub(super) light: f32,
    /// a: the share of cosine samples.
    pub(super) cosine: f32,
    /// n of the lobes, or `None` for a purely diffuse (or mirror) material, where a = 1.
    pub(super) lobe: Option<Exponent>,
}

impl Mixture {
    /// The share of a sample in the estimate of the integral: cosine times light over density, by the balance heuristic (Veach 1997,
    /// multi-sample model). `lobes` is the sum of the lobe values over all D directions.
    #[inline(always)]
    fn weigh(&self, sample: &Sample, lobes: f32, lobe_scale: f32) -> Rgb {
        let p = self.incident * (self.cosine * INV_PI * sample.wi.z + lobe_scale * lobes);
        let both = sample.wi.z / (p + self.light * sample.light_pdf);
        sample.emitted * both + sample.reflected * (sample.wi.z / p)
    }

    /// What the sum of lobe values is multiplied with in p, for D directions.
    fn lobe_scale(&self, directions: usize) -> f32 {
        self.lobe.map_or(0.0, |n| (1.0 - self.cosine) * n.pdf_norm() / directions as f32)
    }
}

/// Where the samples of one texel are summed.
#[derive(Debug, Clone, Default)]
pub(super) struct Sums {
    /// The diffuse part: Kd/pi times irradiance, W/(sr m²).
    pub(super) diffuse: Rgb,
    /// Per channel and direction, the sum of lobe value times weighted light.
    pub(super) lobes: [Vec<Lanes>; 3],
    /// Lobe values of a block of samples.
    block: Vec<Lanes>,
}

impl Sums {
    /// The sum for direction `k`.
    pub(super) fn lobe(&self, k: usize) -> Rgb {
        Rgb::from(std::array::from_fn(|c| self.lobes[c][k / LANES][k % LANES]))
    }
}

/// Sums `samples` for the directions `toward`; densities are those of the grid `mixed`. `None` for `toward` means the grid itself.
pub(super) fn gather(kernel: Kernel, samples: &[Sample], mixture: &Mixture, mixed: &Mirrored, toward: Option<&Mirrored>, sums: &mut Sums) {
    match kernel {
        Kernel::Portable => body(samples, mixture, mixed, toward, sums),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a `Kernel::Avx2` exists only after the CPU was found to have AVX2.
        Kernel::Avx2(_) => unsafe { body_avx2(samples, mixture, mixed, toward, sums) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn body_avx2(samples: &[Sample], mixture: &Mixture, mixed: &Mirrored, toward: Option<&Mirrored>, sums: &mut Sums) {
    body(samples, mixture, mixed, toward, sums);
}

#[inline(always)]
fn body(samples: &[Sample], mixture: &Mixture, mixed: &Mirrored, toward: Option<&Mirrored>, sums: &mut Sums) {
    let targets = toward.unwrap_or(mixed).axes.len();
    sums.diffuse = Rgb::BLACK;
    for channel in &mut sums.lobes {
        channel.clear();
        channel.resize(if mixture.lobe.is_some() { targets } else { 0 }, [0.0; LANES]);
    }
    let scale = mixture.lobe_scale(mixed.len);
    let Some(exponent) = mixture.lobe else {
        for sample in samples {
            sums.diffuse += sample.diffuse * mixture.weigh(sample, 0.0, 0.0) * INV_PI;
        }
        return;
    };
    let width = mixed.axes.len().max(targets);
    sums.block.clear();
    sums.block.resize(BLOCK * width, [0.0; LANES]);
    for block in samples.chunks(BLOCK) {
        let mut light = [Rgb::BLACK; BLOCK];
        for (b, sample) in block.iter().enumerate() {
            let values = &mut sums.block[b * width..(b + 1) * width];
            let total = raise_all(mixed, sample.wi, exponent, values);
            light[b] = mixture.weigh(sample, total, scale);
            if let Some(toward) = toward {
                raise_all(toward, sample.wi, exponent, values);
            }
            sums.diffuse += sample.diffuse * light[b] * INV_PI;
        }
        accumulate(&sums.block, width, &light, block.len(), &mut sums.lobes);
    }
}

/// Writes the lobe value of every direction and returns their sum.
#[inline(always)]
fn raise_all(directions: &Mirrored, wi: Vec3, exponent: Exponent, values: &mut [Lanes]) -> f32 {
    let mut total = [0.0f32; LANES];
    for (axes, out) in directions.axes.iter().zip(values) {
        let cos: Lanes = std::array::from_fn(|k| axes[0][k] * wi.x + axes[1][k] * wi.y + axes[2][k] * wi.z);
        let value = exponent.raise_lanes(cos);
        for k in 0..LANES {
            total[k] += value[k];
        }
        *out = value;
    }
    ((total[0] + total[4]) + (total[2] + total[6])) + ((total[1] + total[5]) + (total[3] + total[7]))
}

/// Adds a block of samples to every direction's sum.
#[inline(always)]
fn accumulate(block: &[Lanes], width: usize, light: &[Rgb; BLOCK], count: usize, lobes: &mut [Vec<Lanes>; 3]) {
    let [red, green, blue] = lobes;
    for (at, ((r, g), b)) in red.iter_mut().zip(green).zip(blue).enumerate() {
        for (s, l) in light.iter().enumerate().take(count) {
            let value = &block[s * width + at];
            for k in 0..LANES {
                r[k] += value[k] * l.r;
                g[k] += value[k] * l.g;
                b[k] += value[k] * l.b;
            }
        }
    }
}
