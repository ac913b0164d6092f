//! The gather's inner loops: many samples of incident light against many directions.
//!
//! For every sample the lobe is raised for all directions that share it: the sum is the mixture density of the sample, the values weight
//! its light toward each direction. Every step is one pass over arrays of directions that stay in the first-level cache (1.6 KiB each for
//! 400), which the compiler turns into vector code of whatever width the function is compiled for. Lanes held in small fixed arrays lost:
//! the compiler takes them apart into scalars. All sums run in a fixed order, whatever the width. Microfacets have loops of their own
//! ([`facets`](super::facets)).

use super::{
    directions::{Axes, LANES, LobeSet, bend_all, reflect},
    facets::{self, FacetScratch},
};
use crate::{
    bsdf::{Bsdf, Specular, power::Exponent},
    sampling::warp::INV_PI,
    simd::Kernel,
};
use glam::Vec3;
use kiln_proto::units::Rgb;

/// One sample of incident light; directions and normals are local to the surface at its own point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Where it comes from; from behind where z < 0.
    pub(super) wi: Vec3,
    /// The same on the viewer's side of the texel's mean normal: where the density looks.
    pub(super) mixed: Vec3,
    /// The same on the viewer's side of its own normal: where the value looks.
    pub(super) own: Vec3,
    /// Its own normal.
    pub(super) normal: Vec3,
    /// Emitted by what is seen there; incident and light samples both find it, W/(sr m²).
    pub(super) emitted: Rgb,
    /// Density of light sampling there, 1/sr.
    pub(super) light_pdf: f32,
    /// Reflected by what is seen there; only incident samples find it, W/(sr m²).
    pub(super) reflected: Rgb,
    /// What a light without area sends from there, divided by the number of points that ask for it: irradiance of a surface that faces it,
    /// W/m².
    pub(super) direct: Rgb,
    /// How the point of the footprint that the sample belongs to reflects.
    pub(super) bsdf: Bsdf,
}

/// The shape of the lobes of a texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Shape {
    /// Purely diffuse.
    Matte,
    /// Normalised Phong.
    Phong(Exponent),
    /// Microfacets of this mean width; 0 for a perfect mirror, whose base is gathered and whose image is not.
    Facets(f32),
}

/// The mixture of densities that the samples of a texel were drawn from: p(w) = a cos/pi + (1 - a)/G sum over k of p_k(w), G lobes sharing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mixture {
    /// M: incident samples of this side, those that came to nothing included.
    pub(super) incident: f32,
    /// S: light samples, likewise; both sides share them.
    pub(super) light: f32,
    /// a: the share of cosine samples; 1 where there are no lobes to draw from.
    pub(super) cosine: f32,
    /// What the lobes look like.
    pub(super) shape: Shape,
    /// The mean normal that they are about.
    pub(super) normal: Vec3,
}

impl Mixture {
    /// The share of a sample in the estimate of the integral: cosine times light over density, by the balance heuristic (Veach 1997,
    /// multi-sample model), or light without area as it is. `lobes` is the sum of the lobe values over all directions that share.
    #[inline(always)]
    pub(super) fn weigh(&self, sample: &Sample, lobes: f32, lobe_scale: f32) -> Rgb {
        let p = self.incident * (self.cosine * INV_PI * sample.wi.z.abs() + lobe_scale * lobes);
        let cos = sample.normal.dot(sample.own);
        let both = cos / (p + self.light * sample.light_pdf);
        sample.emitted * both + sample.reflected * (cos / p) + sample.direct * cos
    }

    /// What the sum of lobe values is multiplied with in p, for so many lobes.
    pub(super) fn lobe_scale(&self, directions: usize) -> f32 {
        let norm = if let Shape::Phong(n) = self.shape { n.pdf_norm() } else { 1.0 };
        (1.0 - self.cosine) * norm / directions.max(1) as f32
    }
}

/// Where the samples of one texel are summed.
#[derive(Debug, Clone, Default)]
pub(super) struct Sums {
    /// The diffuse part that is the same toward every direction, W/(sr m²).
    pub(super) base: Rgb,
    /// Per channel and direction, what depends on the direction: for Phong to be multiplied with the lobe's norm.
    pub(super) lobes: [Vec<f32>; 3],
    pub(super) facets: FacetScratch,
    pub(super) folded: Vec<f32>,
    cosines: Vec<f32>,
    values: Vec<f32>,
    bent: [Vec<f32>; 3],
}

impl Sums {
    /// The sum for direction `k` of the run.
    pub(super) fn lobe(&self, k: usize) -> Rgb {
        Rgb::from(std::array::from_fn(|c| self.lobes[c][k]))
    }

    pub(super) fn clear(&mut self, targets: usize) {
        self.base = Rgb::BLACK;
        for sums in &mut self.lobes {
            sums.clear();
            sums.resize(targets, 0.0);
        }
    }
}

/// Sums `samples` toward the directions `toward`; densities are those of the lobes of `set`. `None` for `toward` means those of the set.
pub(super) fn gather(kernel: Kernel, samples: &[Sample], mixture: &Mixture, set: &LobeSet, toward: Option<Axes<'_>>, sums: &mut Sums) {
    match kernel {
        Kernel::Portable => body(samples, mixture, set, toward, sums),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a `Kernel::Avx2` exists only after the CPU was found to have AVX2.
        Kernel::Avx2(_) => unsafe { body_avx2(samples, mixture, set, toward, sums) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn body_avx2(samples: &[Sample], mixture: &Mixture, set: &LobeSet, toward: Option<Axes<'_>>, sums: &mut Sums) {
    body(samples, mixture, set, toward, sums);
}

#[inline(always)]
fn body(samples: &[Sample], mixture: &Mixture, set: &LobeSet, toward: Option<Axes<'_>>, sums: &mut Sums) {
    match mixture.shape {
        Shape::Matte => {
            sums.clear(0);
            for sample in samples {
                sums.base += sample.bsdf.diffuse * mixture.weigh(sample, 0.0, 0.0) * INV_PI;
            }
        }
        Shape::Phong(exponent) => phong(samples, mixture, set, toward, exponent, sums),
        Shape::Facets(alpha) => facets::body(samples, mixture, set, toward, alpha, sums),
    }
}

#[inline(always)]
fn phong(samples: &[Sample], mixture: &Mixture, set: &LobeSet, toward: Option<Axes<'_>>, exponent: Exponent, sums: &mut Sums) {
    let views = set.views.all();
    sums.clear(toward.unwrap_or(views)[0].len());
    let scale = mixture.lobe_scale(set.views.len());
    let Sums { base, lobes: [red, green, blue], folded, cosines, values, bent, .. } = sums;
    for sample in samples {
        raise(views, reflect(sample.mixed, mixture.normal), exponent, cosines, values);
        let light = mixture.weigh(sample, total(values, folded), scale);
        let tilted = sample.normal != mixture.normal;
        if tilted || toward.is_some() {
            bend_all(toward.unwrap_or(views), sample.normal, bent);
            let axes = std::array::from_fn(|axis| bent[axis].as_slice());
            raise(axes, reflect(sample.own, sample.normal), exponent, cosines, values);
        }
        *base += sample.bsdf.diffuse * light * INV_PI;
        let Specular::Phong { ks, .. } = sample.bsdf.specular else { continue };
        let light = light * ks;
        for (((v, r), g), b) in values.iter().zip(&mut *red).zip(&mut *green).zip(&mut *blue) {
            *r += v * light.r;
            *g += v * light.g;
            *b += v * light.b;
        }
    }
}

/// Writes the lobe value of every direction about an axis.
#[inline(always)]
fn raise(directions: Axes<'_>, axis: Vec3, exponent: Exponent, cosines: &mut Vec<f32>, values: &mut Vec<f32>) {
    let [x, y, z] = directions;
    cosines.resize(x.len(), 0.0);
    values.resize(x.len(), 0.0);
    for (((c, x), y), z) in cosines.iter_mut().zip(x).zip(y).zip(z) {
        *c = x * axis.x + y * axis.y + z * axis.z;
    }
    exponent.raise_all(cosines, values);
}

/// The sum of the values: the upper half is folded onto the lower one until one vector is left, then lane by lane.
#[inline(always)]
pub(super) fn total(values: &[f32], folded: &mut Vec<f32>) -> f32 {
    let mut half = (values.len() / 2).next_multiple_of(LANES);
    let (low, high) = values.split_at(half);
    folded.clear();
    folded.extend_from_slice(low);
    folded.iter_mut().zip(high).for_each(|(f, v)| *f += v);
    while half > LANES {
        let count = half;
        half = (count / 2).next_multiple_of(LANES);
        let (low, high) = folded[..count].split_at_mut(half);
        low.iter_mut().zip(high).for_each(|(l, h)| *l += *h);
    }
    folded[..half].iter().sum()
}
