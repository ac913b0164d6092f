//! Lights without area in the shared gather: each sends every direction of a texel the same light, so all are asked, from several points of
//! the footprint, and only their shadows have noise. Of more than [`ALL`] lights each sample asks one.

use super::{
    footprint::Points,
    gather::Sample,
    hemisphere::{Budget, LIGHT_SHARE, Site, vertex},
};
use crate::{path::Tracer, sampling::Dimension, scene::BakeScene};
use kiln_proto::units::Rgb;

/// The most lights that are all asked.
const ALL: usize = 64;
/// The fewest points of a footprint from which lights are asked: so finely are the edges of shadows resolved where there are many lights.
const POINTS: u32 = 16;

/// Adds the light samples of a site and returns what their ambient terms reflect toward every direction, W/(sr m²).
pub(super) fn shine(scene: &BakeScene, tracer: &mut Tracer<'_>, site: &Site<'_>, budget: Budget, samples: &mut Vec<Sample>) -> Rgb {
    let lights = scene.lights().punctual().len();
    let (all, shared) = (lights <= ALL, (budget.samples / LIGHT_SHARE).max(1));
    let points = match site.points {
        _ if lights == 0 => 0,
        Points::Fixed(_) if all => 1,
        _ if all => (shared / lights as u32).max(POINTS.min(shared)),
        _ => shared,
    };
    let mut ambient = Rgb::BLACK;
    for index in 0..points {
        let vertex = vertex(scene, site, index, Dimension::punctual_footprint);
        for light in 0..if all { lights } else { 1 } {
            let (shine, factor) = if all {
                (tracer.shine(&vertex, light), 1.0)
            } else {
                tracer.shine_one(&vertex, site.key.pair(Dimension::PUNCTUAL, index)).map_or((None, 0.0), |(s, f)| (Some(s), f))
            };
            let Some(shine) = shine else { continue };
            let share = factor / points as f32;
            ambient += shine.ambient * share;
            let wi = site.frame.to_local(shine.direction);
            if wi.z > 0.0 && !shine.light.is_black() {
                samples.push(Sample { direct: shine.light * share, ..Sample::dark(wi, vertex.bsdf.diffuse) });
            }
        }
    }
    ambient
}
