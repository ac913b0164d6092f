//! The shared gather: one set of incident samples serves all directions of a texel.
//!
//! Outgoing radiance toward w_k is L_e(w_k) + ∫ f(w, w_k) L_i(w) cos dw. Instead of a path per direction, as a camera renderer has it, M
//! incident directions are drawn once from a mixture that suits every w_k (a quarter cosine, the rest from the lobes that the grid's
//! directions see), one path is traced for each, and the BRDF is evaluated for all directions against all of them; S = M/4 light samples
//! are shared the same way. It is unbiased but for what docs/light-transport.md lists; what the directions of a texel share is their noise.
//!
//! Narrow lobes overlap few others, so that few of M samples would fall into each. They get samples of their own: runs of eight
//! neighbouring directions share them, with the density of exactly those eight lobes, beside M cosine and S light samples that all runs
//! share. Delta lobes cannot share at all: mirrors trace paths of their own for every direction.
//!
//! What is stored is the light that the surface itself emits, reflects and scatters through, of a blended surface as if it were opaque:
//! whoever shows it covers what lies behind by its opacity. Light that goes straight on, through a blend or through clear glass, is not
//! part of it, for it comes from another place than the texel: the picture behind is blended in. Light that rough glass scatters is part of
//! it.

use super::{
    directions::{Directions, LobeSet},
    draw::{Drawing, Side},
    gather::{Mixture, Sample, Shape, Sums, gather},
    punctual,
    site::{Mean, Site},
};
use crate::{
    bsdf::{Specular, mirror},
    path::{PathSample, Tracer},
    sampling::Dimension,
    scene::BakeScene,
};
use glam::Vec3;
use kiln_proto::units::Rgb;
use std::ops::Range;

/// Incident samples per light sample.
pub(super) const LIGHT_SHARE: u32 = 4;
/// Of so many incident samples on a glossy surface one is cosine-distributed (measured: half of them is worse on every glossy surface).
const COSINE_SHARE: u32 = 4;
/// Neighbouring directions of narrow lobes that share samples: one vector of the inner loops.
const SHARING: usize = 8;
/// Incident samples per sample of each direction's own narrow lobe: a tenth of a light's image in 16 samples is seen at 1,024.
const SHARP_SHARE: u32 = 64;

/// What the numbers of mirror paths begin with: beyond those of all gathered samples, so that the two are independent.
const MIRRORS: u32 = 1 << 29;

/// How much work a site is worth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    /// M.
    pub(crate) samples: u32,
    /// Longest path.
    pub(crate) max_depth: u32,
}

/// The directions of a gather.
pub(crate) struct Views {
    /// The grid whose lobes make the mixture density.
    mixed: Directions,
    /// The directions to evaluate, where they are not the grid's.
    toward: Option<Directions>,
}

impl Views {
    /// Densities and values of the same local directions.
    pub(crate) fn grid(directions: &[Vec3]) -> Self {
        Self { mixed: Directions::new(directions), toward: None }
    }

    /// Densities of a grid's local directions, values of others.
    pub(crate) fn toward(grid: &[Vec3], directions: &[Vec3]) -> Self {
        Self { mixed: Directions::new(grid), toward: Some(Directions::new(directions)) }
    }

    fn targets(&self) -> &Directions {
        self.toward.as_ref().unwrap_or(&self.mixed)
    }
}

/// Memory that is used again from site to site.
#[derive(Default)]
pub(crate) struct Scratch {
    front: Vec<Sample>,
    behind: Vec<Sample>,
    set: LobeSet,
    sums: Sums,
}

/// How the samples of one side are divided.
struct Counts {
    /// Cosine samples, which all sets share.
    cosine: u32,
    /// Lobe samples over all sets.
    lobes: u32,
}

impl Counts {
    fn new(samples: u32, budget: Budget, mean: &Mean, directions: usize) -> Self {
        if !mean.has_lobes() || samples == 0 {
            return Self { cosine: samples, lobes: 0 };
        }
        if mean.is_sharp() {
            return Self { cosine: samples, lobes: (budget.samples / SHARP_SHARE).max(1) * directions as u32 };
        }
        let cosine = samples.div_ceil(COSINE_SHARE);
        Self { cosine, lobes: samples - cosine }
    }
}

/// Writes the outgoing radiance of a site toward every direction of `views`, W/(sr m²), and returns the number of rays traced.
pub(crate) fn capture(scene: &BakeScene, site: &Site<'_>, budget: Budget, views: &Views, scratch: &mut Scratch, out: &mut [Rgb]) -> u64 {
    let emitted = site.emission(scene, budget.samples);
    out.fill(emitted);
    if budget.max_depth < 2 {
        return 0;
    }
    let mean = Mean::of(scene, site);
    let mut tracer = Tracer::new(scene, budget.max_depth);
    if mean.is_gathered {
        let mut drawing = Drawing { scene, tracer: &mut tracer, site, mean: &mean };
        // A side that light comes from has at least one sample.
        let behind = if mean.behind > 0.0 { ((mean.behind * budget.samples as f32) as u32).max(1) } else { 0 };
        let front = budget.samples.saturating_sub(behind).max(1);
        let [front, behind] = [front, behind].map(|n| Counts::new(n, budget, &mean, views.targets().len()));
        scratch.front.clear();
        scratch.behind.clear();
        drawing.cosine(Side::Front, front.cosine, &mut scratch.front);
        drawing.cosine(Side::Behind, behind.cosine, &mut scratch.behind);
        drawing.lights(budget.samples / LIGHT_SHARE, &mut scratch.front, &mut scratch.behind);
        let ambient = punctual::shine(&mut drawing, budget, &mut scratch.front, &mut scratch.behind);
        out.iter_mut().for_each(|l| *l += ambient);
        gather_side(&mut drawing, Side::Front, &front, budget, views, scratch, out);
        if mean.behind > 0.0 {
            gather_side(&mut drawing, Side::Behind, &behind, budget, views, scratch, out);
        }
    }
    if mean.is_mirror {
        reflect_each(scene, &mut tracer, site, budget, views, out);
    }
    tracer.rays.0
}

/// Adds what arrives from one side: set by set, each with the samples that all share and those of its own lobes.
fn gather_side(
    drawing: &mut Drawing<'_, '_>,
    side: Side,
    counts: &Counts,
    budget: Budget,
    views: &Views,
    scratch: &mut Scratch,
    out: &mut [Rgb],
) {
    let (mean, kernel) = (*drawing.mean, drawing.scene.kernel());
    let Scratch { front, behind, set, sums } = scratch;
    let samples = if side == Side::Front { front } else { behind };
    let (shared, light) = (samples.len(), (budget.samples / LIGHT_SHARE) as f32);
    let (targets, alpha) = (views.targets(), if let Shape::Facets(alpha) = mean.shape { Some(alpha) } else { None });
    let sharp = mean.is_sharp();
    if sharp && matches!(mean.shape, Shape::Phong(_)) {
        // The diffuse part is one number for all sets.
        let mixture = Mixture { incident: counts.cosine as f32, light, cosine: 1.0, shape: Shape::Matte, normal: mean.normal };
        gather(kernel, samples, &mixture, set, None, sums);
        out.iter_mut().for_each(|l| *l += sums.base);
    }
    for (run, numbers) in sets(targets.len(), if sharp { SHARING } else { targets.len() }, counts.lobes) {
        // One set of everything has the densities of the grid, whatever it is evaluated toward.
        let (lobes, own) = if sharp { (targets, run.clone()) } else { (&views.mixed, 0..views.mixed.len()) };
        set.fill(lobes, own, mean.normal, alpha);
        let incident = (counts.cosine + numbers.end - numbers.start) as f32;
        drawing.lobes(side, set, counts.cosine, numbers, samples);
        let cosine = if counts.lobes == 0 { 1.0 } else { counts.cosine as f32 / incident };
        let mixture = Mixture { incident, light, cosine, shape: mean.shape, normal: mean.normal };
        let toward = views.toward.as_ref().map(|t| t.run(&run));
        gather(kernel, samples, &mixture, set, toward, sums);
        samples.truncate(shared);
        add_sums(sums, mean.shape, sharp, &mut out[run]);
    }
}

/// Runs of directions with the numbers of their lobe samples, in proportion to their length.
fn sets(directions: usize, length: usize, samples: u32) -> impl Iterator<Item = (Range<usize>, Range<u32>)> {
    let number = move |k: usize| (u64::from(samples) * k as u64 / directions.max(1) as u64) as u32;
    (0..directions).step_by(length.max(1)).map(move |start| {
        let end = (start + length).min(directions);
        (start..end, number(start)..number(end))
    })
}

fn add_sums(sums: &Sums, shape: Shape, sharp: bool, out: &mut [Rgb]) {
    match shape {
        Shape::Matte => out.iter_mut().for_each(|l| *l += sums.base),
        Shape::Phong(exponent) => {
            let (base, norm) = (if sharp { Rgb::BLACK } else { sums.base }, exponent.eval_norm());
            out.iter_mut().enumerate().for_each(|(k, l)| *l += base + sums.lobe(k) * norm);
        }
        Shape::Facets(_) => out.iter_mut().enumerate().for_each(|(k, l)| *l += sums.base + sums.lobe(k)),
    }
}

/// What one independent path per direction and sample finds, as a camera renderer would have it: the yardstick of the shared gather.
pub(crate) fn capture_each(scene: &BakeScene, site: &Site<'_>, budget: Budget, views: &Views, out: &mut [Rgb]) -> u64 {
    let emitted = site.emission(scene, budget.samples);
    let mut tracer = Tracer::new(scene, budget.max_depth);
    for (k, l) in out.iter_mut().enumerate() {
        let view = views.targets().get(k);
        let mut sum = Rgb::BLACK;
        for j in 0..budget.samples {
            let index = k as u32 * budget.samples + j;
            let vertex = site.vertex(scene, index, Dimension::footprint);
            sum += tracer.outgoing(vertex, vertex.toward(vertex.frame.to_world(view)), 2, PathSample { key: site.key, index });
        }
        *l = emitted + sum * (1.0 / budget.samples as f32);
    }
    tracer.rays.0
}

/// Mirrors see one image per direction; samples beyond one per direction go round again. Points that are rough, where a texture mixes both,
/// count as black here and are gathered.
fn reflect_each(scene: &BakeScene, tracer: &mut Tracer<'_>, site: &Site<'_>, budget: Budget, views: &Views, out: &mut [Rgb]) {
    let paths = (budget.samples / views.mixed.len() as u32).max(1);
    for (k, l) in out.iter_mut().enumerate() {
        let view = views.targets().get(k);
        let mut sum = Rgb::BLACK;
        for j in 0..paths {
            let index = MIRRORS + k as u32 * paths + j;
            let vertex = site.vertex(scene, index, Dimension::footprint);
            let wo = vertex.toward(vertex.frame.to_world(view));
            let reflectance = match vertex.bsdf.specular {
                Specular::Mirror { ks } => ks,
                Specular::Coat(coat) if coat.alpha <= 0.0 => coat.mirrored(wo.z),
                Specular::Coat(_) | Specular::None | Specular::Phong { .. } => continue,
            };
            let direction = vertex.shading.to_world(mirror(wo));
            if vertex.arriving(direction).is_some() {
                let light = tracer.incident(&vertex, direction, 2, PathSample { key: site.key, index });
                sum += reflectance * (light.emitted + light.reflected);
            }
        }
        *l += sum * (1.0 / paths as f32);
    }
}
