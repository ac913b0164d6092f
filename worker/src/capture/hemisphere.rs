//! The shared gather: one set of incident samples serves all directions of a texel.
//!
//! Outgoing radiance toward w_k is L_e(w_k) + ∫ f(w, w_k) L_i(w) cos dw. Instead of a path per direction, as a camera renderer has it, M
//! incident directions are drawn once from a mixture that suits every w_k (a quarter cosine, the rest from the lobes about the mirror images
//! of the grid's directions), one path is traced for each, and the BRDF is evaluated for all directions against all of them; S = M/4 light
//! samples are shared the same way. All of it is unbiased; what the directions of a texel share is their noise. Delta lobes cannot share:
//! mirrors trace paths of their own for every direction.

use super::{
    footprint::Points,
    gather::{Mirrored, Mixture, Sample, Sums, gather},
    punctual,
};
use crate::{
    bsdf::Specular,
    path::{Incident, PathSample, Tracer},
    sampling::{Dimension, TexelKey, warp},
    scene::{BakeScene, Vertex, phong, specular},
};
use glam::Vec3;
use kiln_proto::{frame::Frame, scene::Reflection, units::Rgb};

/// Incident samples per light sample.
pub(super) const LIGHT_SHARE: u32 = 4;
/// Of so many incident samples on a glossy surface one is cosine-distributed (measured: half of them is worse on every glossy surface).
const COSINE_SHARE: u32 = 4;

/// What is gathered: a texel or a single point.
pub(crate) struct Site<'a> {
    /// Index of the surface.
    pub(crate) surface: usize,
    /// Its frame.
    pub(crate) frame: Frame,
    /// Where on the surface samples arrive.
    pub(crate) points: Points<'a>,
    /// The root of its samples.
    pub(crate) key: TexelKey,
}

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
    mixed: Mirrored,
    /// The directions to evaluate, where they are not the grid's.
    toward: Option<Mirrored>,
}

impl Views {
    /// Densities and values of the same local directions.
    pub(crate) fn grid(directions: &[Vec3]) -> Self {
        Self { mixed: Mirrored::new(directions), toward: None }
    }

    /// Densities of a grid's local directions, values of others.
    pub(crate) fn toward(grid: &[Vec3], directions: &[Vec3]) -> Self {
        Self { mixed: Mirrored::new(grid), toward: Some(Mirrored::new(directions)) }
    }

    fn targets(&self) -> &Mirrored {
        self.toward.as_ref().unwrap_or(&self.mixed)
    }
}

/// Memory that is used again from site to site.
#[derive(Default)]
pub(crate) struct Scratch {
    samples: Vec<Sample>,
    sums: Sums,
}

/// Writes the outgoing radiance of a site toward every direction of `views`, W/(sr m²), and returns the number of rays traced.
pub(crate) fn capture(scene: &BakeScene, site: &Site<'_>, budget: Budget, views: &Views, scratch: &mut Scratch, out: &mut [Rgb]) -> u64 {
    let material = scene.material(site.surface);
    let emitted = if material.is_emissive() { mean_emission(scene, site, budget.samples) } else { Rgb::BLACK };
    out.fill(emitted);
    if budget.max_depth < 2 || material.reflection == Reflection::None {
        return 0;
    }
    let mut tracer = Tracer::new(scene, budget.max_depth);
    let specular = specular(material);
    if phong(material).is_some_and(|p| !p.diffuse.is_black()) || matches!(specular, Specular::Phong { .. }) {
        let mixture = mixture(budget.samples, specular);
        draw(scene, &mut tracer, site, budget, &mixture, &views.mixed, &mut scratch.samples);
        let ambient = punctual::shine(scene, &mut tracer, site, budget, &mut scratch.samples);
        gather(scene.kernel(), &scratch.samples, &mixture, &views.mixed, views.toward.as_ref(), &mut scratch.sums);
        let diffuse = scratch.sums.diffuse + ambient;
        out.iter_mut().for_each(|l| *l += diffuse);
    }
    match specular {
        Specular::Phong { ks, exponent } => {
            let scale = ks * exponent.eval_norm();
            out.iter_mut().enumerate().for_each(|(k, l)| *l += scratch.sums.lobe(k) * scale);
        }
        Specular::Mirror { ks } => reflect(scene, &mut tracer, site, budget, views, ks, out),
        Specular::None => {}
    }
    tracer.rays.0
}

/// What one independent path per direction and sample finds, as a camera renderer would have it: the yardstick of the shared gather.
pub(crate) fn capture_each(scene: &BakeScene, site: &Site<'_>, budget: Budget, views: &Views, out: &mut [Rgb]) -> u64 {
    let emitted = mean_emission(scene, site, budget.samples);
    let mut tracer = Tracer::new(scene, budget.max_depth);
    for (k, l) in out.iter_mut().enumerate() {
        let wo = crate::bsdf::mirror(views.targets().get(k));
        let mut sum = Rgb::BLACK;
        for j in 0..budget.samples {
            let index = k as u32 * budget.samples + j;
            let vertex = vertex(scene, site, index, Dimension::footprint);
            sum += tracer.outgoing(vertex, wo, 2, PathSample { key: site.key, index });
        }
        *l = emitted + sum * (1.0 / budget.samples as f32);
    }
    tracer.rays.0
}

fn mixture(samples: u32, specular: Specular) -> Mixture {
    let lobe = if let Specular::Phong { exponent, .. } = specular { Some(exponent) } else { None };
    let cosine = if lobe.is_some() { samples.div_ceil(COSINE_SHARE) } else { samples };
    Mixture { incident: samples as f32, light: (samples / LIGHT_SHARE) as f32, cosine: cosine as f32 / samples as f32, lobe }
}

/// Draws the incident and light samples of a site; those that carry no light are left out.
fn draw(
    scene: &BakeScene,
    tracer: &mut Tracer<'_>,
    site: &Site<'_>,
    budget: Budget,
    mixture: &Mixture,
    mixed: &Mirrored,
    samples: &mut Vec<Sample>,
) {
    samples.clear();
    let cosine = (mixture.cosine * mixture.incident + 0.5) as u32;
    let lobes = Lobes { first: cosine, count: budget.samples - cosine, shift: site.key.pair(Dimension::LOBE_SHIFT, 0)[0] };
    for index in 0..budget.samples {
        let wi = match mixture.lobe {
            Some(exponent) if index >= cosine => {
                let axis = mixed.get(lobes.choose(index, mixed.len()));
                warp::power_lobe(axis, exponent.value(), site.key.pair(Dimension::LOBE, index - cosine))
            }
            _ => warp::cosine_hemisphere(site.key.pair(Dimension::COSINE, index)),
        };
        if wi.z <= 0.0 {
            continue;
        }
        let vertex = vertex(scene, site, index, Dimension::footprint);
        let light = tracer.incident(vertex.lifted, site.frame.to_world(wi), 2, PathSample { key: site.key, index });
        if !light.is_black() {
            let Incident { emitted, light_pdf, reflected } = light;
            samples.push(Sample { emitted, light_pdf, reflected, ..Sample::dark(wi, vertex.bsdf.diffuse) });
        }
    }
    for index in 0..budget.samples / LIGHT_SHARE {
        let vertex = vertex(scene, site, index, Dimension::light_footprint);
        let Some(light) = tracer.connect(vertex.lifted, site.key.pair(Dimension::LIGHT, index)) else { continue };
        let wi = site.frame.to_local(light.direction);
        if wi.z > 0.0 && !light.emitted.is_black() && tracer.reaches(vertex.lifted, &light) {
            samples.push(Sample { emitted: light.emitted, light_pdf: light.pdf, ..Sample::dark(wi, vertex.bsdf.diffuse) });
        }
    }
}

/// Which lobe each lobe sample comes from: systematic with a random start, so that every lobe is expected count/D times (which makes the
/// mixture density exact) and no lobe is more than one sample off.
struct Lobes {
    first: u32,
    count: u32,
    shift: f32,
}

impl Lobes {
    fn choose(&self, index: u32, directions: usize) -> usize {
        let at = (f64::from(index - self.first) + f64::from(self.shift)) / f64::from(self.count);
        ((at * directions as f64) as usize).min(directions - 1)
    }
}

/// Mirrors see one image per direction; samples beyond one per direction go round again.
fn reflect(scene: &BakeScene, tracer: &mut Tracer<'_>, site: &Site<'_>, budget: Budget, views: &Views, ks: Rgb, out: &mut [Rgb]) {
    let paths = (budget.samples / views.mixed.len() as u32).max(1);
    for (k, l) in out.iter_mut().enumerate() {
        let direction = site.frame.to_world(views.targets().get(k));
        let mut sum = Rgb::BLACK;
        for j in 0..paths {
            // Beyond the diffuse part's own numbers, so that the two are independent.
            let index = budget.samples + k as u32 * paths + j;
            let vertex = vertex(scene, site, index, Dimension::footprint);
            let light = tracer.incident(vertex.lifted, direction, 2, PathSample { key: site.key, index });
            sum += light.emitted + light.reflected;
        }
        *l += ks * sum * (1.0 / paths as f32);
    }
}

fn mean_emission(scene: &BakeScene, site: &Site<'_>, samples: u32) -> Rgb {
    let material = scene.material(site.surface);
    if material.emission_texture.is_none() || !material.is_emissive() {
        return material.emission;
    }
    let mut sum = Rgb::BLACK;
    for index in 0..samples {
        let point = site.points.at(site.key, index, Dimension::footprint);
        sum += scene.emission(scene.prim_of(site.surface, point.triangle), point.bary);
    }
    sum * (1.0 / samples as f32)
}

pub(super) fn vertex(scene: &BakeScene, site: &Site<'_>, index: u32, dimension: fn(u32) -> Dimension) -> Vertex {
    scene.vertex_at(site.surface, &site.points.at(site.key, index, dimension), site.frame)
}
