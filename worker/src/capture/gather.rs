//! The gather's inner loops: many samples of incident light against many directions.
//!
//! For every sample the lobe is raised for all directions of the grid: the sum is the mixture density of the sample, the values weight its
//! light toward each direction. Every step is one pass over arrays of directions that stay in the first-level cache (1.6 KiB each for 400),
//! which the compiler turns into vector code of whatever width the function is compiled for. Lanes held in small fixed arrays lost: the
//! compiler takes them apart into scalars. All sums run in a fixed order, whatever the width.

use crate::simd::Kernel;
use crate::{bsdf::power::Exponent, sampling::warp::INV_PI};
use glam::Vec3;
use kiln_proto::units::Rgb;

/// Directions are padded to a multiple of this: the widest vector in use.
const LANES: usize = 8;

/// Directions as the lobes see them: mirrored about the normal, axis by axis, padded with ones that no light above the horizon can reach.
#[derive(Debug, Clone)]
pub(super) struct Mirrored {
    axes: [Vec<f32>; 3],
    len: usize,
}

impl Mirrored {
    /// From local directions.
    pub(super) fn new(directions: &[Vec3]) -> Self {
        let padding = directions.len().next_multiple_of(LANES) - directions.len();
        let mirrored = directions.iter().map(|d| crate::bsdf::mirror(*d)).chain(std::iter::repeat_n(-Vec3::Z, padding));
        let mut axes: [Vec<f32>; 3] = Default::default();
        for m in mirrored {
            (0..3).for_each(|axis| axes[axis].push(m[axis]));
        }
        Self { axes, len: directions.len() }
    }

    /// How many directions there are, padding left out.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The mirror image of the `k`-th direction.
    pub(super) fn get(&self, k: usize) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|axis| self.axes[axis][k]))
    }

    /// How many there are with padding.
    fn padded(&self) -> usize {
        self.axes[0].len()
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
    /// What a light without area sends from there, divided by the number of points that ask for it: irradiance of a surface that faces it, W/m².
    pub(super) direct: Rgb,
    /// Kd at the point of the footprint that the sample belongs to.
    pub(super) diffuse: Rgb,
}

impl Sample {
    /// A direction from which nothing arrives yet.
    pub(super) fn dark(wi: Vec3, diffuse: Rgb) -> Self {
        Self { wi, emitted: Rgb::BLACK, light_pdf: 0.0, reflected: Rgb::BLACK, direct: Rgb::BLACK, diffuse }
    }
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
    /// multi-sample model), or light without area as it is. `lobes` is the sum of the lobe values over all D directions.
    #[inline(always)]
    fn weigh(&self, sample: &Sample, lobes: f32, lobe_scale: f32) -> Rgb {
        let p = self.incident * (self.cosine * INV_PI * sample.wi.z + lobe_scale * lobes);
        let both = sample.wi.z / (p + self.light * sample.light_pdf);
        sample.emitted * both + sample.reflected * (sample.wi.z / p) + sample.direct * sample.wi.z
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
    lobes: [Vec<f32>; 3],
    cosines: Vec<f32>,
    values: Vec<f32>,
    folded: Vec<f32>,
}

impl Sums {
    /// The sum for direction `k`.
    pub(super) fn lobe(&self, k: usize) -> Rgb {
        Rgb::from(std::array::from_fn(|c| self.lobes[c][k]))
    }

    fn clear(&mut self, mixed: usize, targets: usize) {
        self.diffuse = Rgb::BLACK;
        for sums in &mut self.lobes {
            sums.clear();
            sums.resize(targets, 0.0);
        }
        for scratch in [&mut self.cosines, &mut self.values, &mut self.folded] {
            scratch.resize(mixed.max(targets), 0.0);
        }
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
    let Some(exponent) = mixture.lobe else {
        sums.clear(0, 0);
        for sample in samples {
            sums.diffuse += sample.diffuse * mixture.weigh(sample, 0.0, 0.0) * INV_PI;
        }
        return;
    };
    sums.clear(mixed.padded(), toward.unwrap_or(mixed).padded());
    let scale = mixture.lobe_scale(mixed.len);
    let [red, green, blue] = &mut sums.lobes;
    for sample in samples {
        raise(mixed, sample.wi, exponent, &mut sums.cosines, &mut sums.values);
        let light = mixture.weigh(sample, total(&sums.values[..mixed.padded()], &mut sums.folded), scale);
        if let Some(toward) = toward {
            raise(toward, sample.wi, exponent, &mut sums.cosines, &mut sums.values);
        }
        sums.diffuse += sample.diffuse * light * INV_PI;
        for (((v, r), g), b) in sums.values.iter().zip(&mut *red).zip(&mut *green).zip(&mut *blue) {
            *r += v * light.r;
            *g += v * light.g;
            *b += v * light.b;
        }
    }
}

/// Writes the lobe value of every direction.
#[inline(always)]
fn raise(directions: &Mirrored, wi: Vec3, exponent: Exponent, cosines: &mut [f32], values: &mut [f32]) {
    let [x, y, z] = &directions.axes;
    for (((c, x), y), z) in cosines.iter_mut().zip(x).zip(y).zip(z) {
        *c = x * wi.x + y * wi.y + z * wi.z;
    }
    let count = directions.padded();
    exponent.raise_all(&mut cosines[..count], &mut values[..count]);
}

/// The sum of the values: the upper half is folded onto the lower one until one vector is left, then lane by lane.
#[inline(always)]
fn total(values: &[f32], folded: &mut [f32]) -> f32 {
    let mut half = (values.len() / 2).next_multiple_of(LANES);
    let (low, high) = values.split_at(half);
    folded[..half].copy_from_slice(low);
    folded.iter_mut().zip(high).for_each(|(f, v)| *f += v);
    while half > LANES {
        let count = half;
        half = (count / 2).next_multiple_of(LANES);
        let (low, high) = folded[..count].split_at_mut(half);
        low.iter_mut().zip(high).for_each(|(l, h)| *l += *h);
    }
    folded[..half].iter().sum()
}
