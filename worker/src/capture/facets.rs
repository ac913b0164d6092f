//! The gather's inner loops for microfacets: every sample against every direction, in two passes over arrays.
//!
//! The first finds D about the texel's mean normal and roughness for all lobes that share samples: their sum is the density of the sample.
//! The second adds the light, by each sample's own roughness and normal, so that textures within a texel's footprint are exact and only the
//! density is a mean. Where the two agree, the second takes D from the first. A point that is a perfect mirror has a base and no lobe: its
//! image is not gathered. Appendix B is linear in (1 - v·h)^5, which leaves four numbers a channel to the loop. No fused operations and one
//! order of sums: the same bits at any vector width.

use super::{
    directions::{Axes, LobeSet, bend_all},
    gather::{Mixture, Sample, Sums, total},
};
use crate::{
    bsdf::{
        Specular,
        coat::{Coat, smith},
    },
    sampling::warp::INV_PI,
};
use glam::Vec3;
use kiln_proto::units::Rgb;

/// Memory of the loops.
#[derive(Debug, Clone, Default)]
pub(super) struct FacetScratch {
    /// D of each direction.
    spread: Vec<f32>,
    /// What is summed.
    terms: Vec<f32>,
    bent: [Vec<f32>; 3],
}

/// One sample's light against its own material.
struct Light {
    /// Where it comes from, on the viewer's side.
    own: Vec3,
    normal: Vec3,
    alpha2: f32,
    /// What D V is multiplied with, and what it is multiplied with beside the fifth power.
    lobe: [Rgb; 2],
    /// What the base loses with the fifth power.
    lost: Rgb,
}

/// Sums `samples` into `sums`; `alpha` is the width of the lobes that they were drawn from, 0 for a perfect mirror, which has none.
#[inline(always)]
pub(super) fn body(samples: &[Sample], mixture: &Mixture, set: &LobeSet, toward: Option<Axes<'_>>, alpha: f32, sums: &mut Sums) {
    let views = set.views.all();
    let targets = toward.unwrap_or(views);
    sums.clear(targets[0].len());
    let Sums { lobes: [red, green, blue], facets: scratch, folded, base, .. } = sums;
    let scale = mixture.lobe_scale(set.views.len());
    for sample in samples {
        let lobes = if mixture.cosine < 1.0 {
            distribution(views, sample.mixed, mixture.normal, alpha * alpha, &mut scratch.spread);
            scratch.terms.clear();
            scratch.terms.extend(scratch.spread.iter().zip(&set.norms).map(|(d, n)| d * n));
            total(&scratch.terms, folded)
        } else {
            0.0
        };
        let weighted = mixture.weigh(sample, lobes, scale);
        let Some((light, kept)) = Light::new(sample, weighted) else { continue };
        *base += kept;
        let tilted = sample.normal != mixture.normal;
        let axes = if tilted || toward.is_some() {
            bend_all(toward.unwrap_or(views), sample.normal, &mut scratch.bent);
            std::array::from_fn(|axis| scratch.bent[axis].as_slice())
        } else {
            views
        };
        let is_rough = light.alpha2 > 0.0;
        if is_rough && (tilted || toward.is_some() || light.alpha2 != alpha * alpha || mixture.cosine >= 1.0) {
            distribution(axes, light.own, light.normal, light.alpha2, &mut scratch.spread);
        }
        if is_rough {
            light.add(axes, &scratch.spread, red, green, blue);
        } else {
            light.add_base(axes, red, green, blue);
        }
    }
}

impl Light {
    /// The parts of a sample's light, and what of it the base reflects whatever the direction; `None` where the material has no coat.
    #[inline(always)]
    fn new(sample: &Sample, weighted: Rgb) -> Option<(Self, Rgb)> {
        let Specular::Coat(coat) = sample.bsdf.specular else { return None };
        let Coat { normal, rise, kept, lost, through, .. } = coat;
        let (lobe, diffuse) = if sample.wi.z > 0.0 {
            ([weighted * normal, weighted * rise], weighted * sample.bsdf.diffuse * INV_PI)
        } else {
            ([weighted * through * kept, weighted * through * -lost], Rgb::BLACK)
        };
        let light = Self { own: sample.own, normal: sample.normal, alpha2: coat.alpha * coat.alpha, lobe, lost: diffuse * lost };
        Some((light, diffuse * kept))
    }

    #[inline(always)]
    fn add(&self, axes: Axes<'_>, spread: &[f32], red: &mut [f32], green: &mut [f32], blue: &mut [f32]) {
        let (wi, n, [at, rise], lost) = (self.own, self.normal, self.lobe, self.lost);
        let smith_i = smith(n.dot(wi), self.alpha2);
        let views = axes[0].iter().zip(axes[1]).zip(axes[2]).zip(spread);
        for ((((x, y), z), d), ((r, g), b)) in views.zip(red.iter_mut().zip(green).zip(blue)) {
            let (sx, sy, sz) = (x + wi.x, y + wi.y, z + wi.z);
            let cos_o = x * n.x + y * n.y + z * n.z;
            let visible = smith_i * smith(cos_o, self.alpha2);
            let p = grazing(sx * sx + sy * sy + sz * sz);
            let dv = d * visible;
            *r += dv * (at.r + rise.r * p) - lost.r * p;
            *g += dv * (at.g + rise.g * p) - lost.g * p;
            *b += dv * (at.b + rise.b * p) - lost.b * p;
        }
    }

    /// The base alone, under a perfect mirror.
    #[inline(always)]
    fn add_base(&self, axes: Axes<'_>, red: &mut [f32], green: &mut [f32], blue: &mut [f32]) {
        let (wi, lost) = (self.own, self.lost);
        let views = axes[0].iter().zip(axes[1]).zip(axes[2]);
        for (((x, y), z), ((r, g), b)) in views.zip(red.iter_mut().zip(green).zip(blue)) {
            let (sx, sy, sz) = (x + wi.x, y + wi.y, z + wi.z);
            let p = grazing(sx * sx + sy * sy + sz * sz);
            *r -= lost.r * p;
            *g -= lost.g * p;
            *b -= lost.b * p;
        }
    }
}

/// (1 - v·h)^5, where v·h is half the length of the sum of both directions, given squared.
#[inline(always)]
fn grazing(length_squared: f32) -> f32 {
    let m = 1.0 - 0.5 * length_squared.sqrt();
    let m = if m > 0.0 { m } else { 0.0 };
    let square = m * m;
    square * square * m
}

/// D of GGX halfway between `wi` and each direction; 0 for facets that face away.
#[inline(always)]
fn distribution(axes: Axes<'_>, wi: Vec3, n: Vec3, alpha2: f32, out: &mut Vec<f32>) {
    out.resize(axes[0].len(), 0.0);
    let scale = alpha2 * INV_PI;
    for (((x, y), z), d) in axes[0].iter().zip(axes[1]).zip(axes[2]).zip(out) {
        let (sx, sy, sz) = (x + wi.x, y + wi.y, z + wi.z);
        let along = sx * n.x + sy * n.y + sz * n.z;
        // Beside the normal, taken as a vector: one minus a squared cosine would lose the digits that sharp lobes live by.
        let (tx, ty, tz) = (sx - n.x * along, sy - n.y * along, sz - n.z * along);
        let ratio = (sx * sx + sy * sy + sz * sz) / (tx * tx + ty * ty + tz * tz + alpha2 * along * along);
        *d = if along > 0.0 { scale * ratio * ratio } else { 0.0 };
    }
}
