//! Lights without area in the shared gather: each sends every direction of a texel the same light, so all are asked, from several points of
//! the footprint, and only their shadows have noise. Of more than [`ALL`] lights each sample asks one.

use super::{
    draw::Drawing,
    footprint::Points,
    gather::Sample,
    hemisphere::{Budget, LIGHT_SHARE},
};
use crate::sampling::Dimension;
use kiln_proto::units::Rgb;

/// The most lights that are all asked.
const ALL: usize = 64;
/// The fewest points of a footprint from which lights are asked: so finely are the edges of shadows resolved where there are many lights.
const POINTS: u32 = 16;

/// Adds the light samples of a site, sorted by the side that they shine on, and returns what their ambient terms reflect toward every
/// direction, W/(sr m²).
pub(super) fn shine(drawing: &mut Drawing<'_, '_>, budget: Budget, front: &mut Vec<Sample>, behind: &mut Vec<Sample>) -> Rgb {
    let (scene, site) = (drawing.scene, drawing.site);
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
        let vertex = site.vertex(scene, index, Dimension::punctual_footprint);
        for light in 0..if all { lights } else { 1 } {
            let (shine, factor) = if all {
                (drawing.tracer.shine(&vertex, light), 1.0)
            } else {
                let u = site.key.pair(Dimension::PUNCTUAL, index);
                drawing.tracer.shine_one(&vertex, u).map_or((None, 0.0), |(s, f)| (Some(s), f))
            };
            let Some(shine) = shine else { continue };
            let share = factor / points as f32;
            ambient += shine.ambient * share;
            if shine.light.is_black() {
                continue;
            }
            if let Some(sample) = Sample::arriving(&vertex, vertex.frame.to_local(shine.direction), drawing.mean.normal) {
                let to = if sample.wi.z > 0.0 { &mut *front } else { &mut *behind };
                to.push(Sample { direct: shine.light * share, ..sample });
            }
        }
    }
    ambient
}
