//! Drawing a site's samples: cosine-distributed ones, ones from the lobes about views, and points on lights.

use super::{
    directions::{LobeSet, across, reflect},
    gather::{Sample, Shape},
    site::{Mean, Site},
};
use crate::{
    bsdf::coat::visible_lobe,
    path::{PathSample, Tracer},
    sampling::{Dimension, warp},
    scene::BakeScene,
};
use glam::Vec3;
use std::ops::Range;

/// Which side of a surface samples come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Front,
    Behind,
}

impl Side {
    /// What the numbers of its samples begin with, so that those of both sides are different points of the same sequences.
    fn first(self) -> u32 {
        match self {
            Side::Front => 0,
            Side::Behind => 1 << 30,
        }
    }

    fn holds(self, wi: Vec3) -> bool {
        match self {
            Side::Front => wi.z > 0.0,
            Side::Behind => wi.z < 0.0,
        }
    }
}

/// Draws samples of a site; those that carry no light are left out.
pub(super) struct Drawing<'a, 's> {
    pub(super) scene: &'s BakeScene,
    pub(super) tracer: &'a mut Tracer<'s>,
    pub(super) site: &'a Site<'a>,
    pub(super) mean: &'a Mean,
}

impl Drawing<'_, '_> {
    /// Cosine-distributed samples, the first `count` of a side.
    pub(super) fn cosine(&mut self, side: Side, count: u32, samples: &mut Vec<Sample>) {
        for index in side.first()..side.first() + count {
            let wi = warp::cosine_hemisphere(self.site.key.pair(Dimension::COSINE, index));
            let wi = if side == Side::Front { wi } else { across(wi, Vec3::Z) };
            samples.extend(self.trace(side, wi, index));
        }
    }

    /// Samples of the lobes of a set. `after` so many cosine samples, they have `numbers` among all lobe samples of the side.
    ///
    /// Which lobe each comes from is systematic with a random start, so that every lobe is expected count/G times (which makes the mixture
    /// density exact) and no lobe is more than one sample off.
    pub(super) fn lobes(&mut self, side: Side, set: &LobeSet, after: u32, numbers: Range<u32>, samples: &mut Vec<Sample>) {
        let (count, lobes) = (f64::from(numbers.end - numbers.start), set.views.len());
        let shift = f64::from(self.site.key.pair(Dimension::LOBE_SHIFT, side.first() + numbers.start)[0]);
        let basis = warp::basis(self.mean.normal);
        for number in numbers.clone() {
            let at = (f64::from(number - numbers.start) + shift) / count;
            let view = set.views.get(((at * lobes as f64) as usize).min(lobes - 1));
            let u = self.site.key.pair(Dimension::LOBE, side.first() + number);
            let wi = self.lobe(view, basis, u);
            let wi = if side == Side::Front { wi } else { across(wi, self.mean.normal) };
            samples.extend(self.trace(side, wi, side.first() + after + number));
        }
    }

    /// A direction of the lobe about one view.
    fn lobe(&self, view: Vec3, (x, y): (Vec3, Vec3), u: [f32; 2]) -> Vec3 {
        let n = self.mean.normal;
        match self.mean.shape {
            Shape::Phong(exponent) => warp::power_lobe(reflect(view, n), exponent.value(), u),
            Shape::Facets(alpha) => {
                let w = visible_lobe(alpha, Vec3::new(x.dot(view), y.dot(view), n.dot(view)), u);
                x * w.x + y * w.y + n * w.z
            }
            Shape::Matte => n,
        }
    }

    fn trace(&mut self, side: Side, wi: Vec3, index: u32) -> Option<Sample> {
        if !side.holds(wi) {
            return None;
        }
        let vertex = self.site.vertex(self.scene, index, Dimension::footprint);
        let sample = Sample::arriving(&vertex, wi, self.mean.normal)?;
        let path = PathSample { key: self.site.key, index };
        let light = self.tracer.incident(&vertex, vertex.frame.to_world(wi), 2, path);
        (!light.is_black()).then_some(Sample { emitted: light.emitted, light_pdf: light.light_pdf, reflected: light.reflected, ..sample })
    }

    /// Samples of points on lights, sorted by the side that they shine on.
    pub(super) fn lights(&mut self, count: u32, front: &mut Vec<Sample>, behind: &mut Vec<Sample>) {
        for index in 0..count {
            let vertex = self.site.vertex(self.scene, index, Dimension::light_footprint);
            let Some(light) = self.tracer.connect(&vertex, self.site.key.pair(Dimension::LIGHT, index)) else { continue };
            let Some(sample) = Sample::arriving(&vertex, vertex.frame.to_local(light.direction), self.mean.normal) else { continue };
            if light.emitted.is_black() {
                continue;
            }
            let emitted = light.emitted * self.tracer.reaches(&light);
            if !emitted.is_black() {
                let to = if sample.wi.z > 0.0 { &mut *front } else { &mut *behind };
                to.push(Sample { emitted, light_pdf: light.pdf, ..sample });
            }
        }
    }
}
