//! Light paths: what arrives at a point from a direction, and what leaves a vertex toward one.
//!
//! A ray that leaves the scene sees the environment. Next-event estimation and continuation share every vertex by the balance heuristic. Depth counts as in Mitsuba: light that a texel emits
//! has depth 1, direct light depth 2. There is no Russian roulette: `max_depth` bounds the cost, and roulette would trade it for noise that
//! all directions of a texel share. Surfaces are one-sided: backs block, reflect nothing and emit nothing.

mod next_event;

pub use next_event::{Connection, Shine};

use crate::{
    accel::{Ray, RayCount},
    light::to_solid_angle,
    sampling::{Dimension, TexelKey, mis},
    scene::{BakeScene, Vertex},
};
use glam::Vec3;
use kiln_proto::units::Rgb;

/// The numbers that one path is made of: a row of the texel's sequences.
#[derive(Debug, Clone, Copy)]
pub struct PathSample {
    /// The texel's key.
    pub key: TexelKey,
    /// Number of the path.
    pub index: u32,
}

/// Light from one direction, kept apart by how else it could have been sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Emitted by what the ray sees, W/(sr m²): depth 2.
    pub emitted: Rgb,
    /// The density with which sampling the lights would have chosen the direction, 1/sr.
    pub light_pdf: f32,
    /// Reflected by what the ray sees, W/(sr m²): depth 3 and beyond.
    pub reflected: Rgb,
}

impl Incident {
    const NOTHING: Incident = Incident { emitted: Rgb::BLACK, light_pdf: 0.0, reflected: Rgb::BLACK };

    /// Whether no light arrives at all.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.emitted.is_black() && self.reflected.is_black()
    }
}

/// Traces paths and counts rays.
#[derive(Debug)]
pub struct Tracer<'a> {
    scene: &'a BakeScene,
    max_depth: u32,
    /// Rays traced so far.
    pub rays: RayCount,
}

impl<'a> Tracer<'a> {
    /// A tracer of paths up to `max_depth`.
    #[must_use]
    pub fn new(scene: &'a BakeScene, max_depth: u32) -> Self {
        Self { scene, max_depth, rays: RayCount::default() }
    }

    /// What arrives at the lifted point `from` from the unit world `direction`, where its emission counts as `depth`.
    pub fn incident(&mut self, from: Vec3, direction: Vec3, depth: u32, sample: PathSample) -> Incident {
        let Some(hit) = self.scene.closest(&Ray::unbounded(from, direction), &mut self.rays) else {
            let (emitted, light_pdf) = self.scene.beyond(direction);
            return Incident { emitted, light_pdf, reflected: Rgb::BLACK };
        };
        let prim = self.scene.prim(hit.prim);
        let cos = -prim.frame.normal.dot(direction);
        if cos <= 0.0 {
            return Incident::NOTHING;
        }
        let light_pdf = prim.emitter.map_or(0.0, |e| to_solid_angle(self.scene.lights().pdf_area(e as usize), hit.t * hit.t, cos));
        let emitted = self.scene.emission(hit.prim, [hit.u, hit.v]);
        let reflected = if depth < self.max_depth {
            let vertex = self.scene.vertex(&hit);
            self.outgoing(vertex, vertex.frame.to_local(-direction), depth + 1, sample)
        } else {
            Rgb::BLACK
        };
        Incident { emitted, light_pdf, reflected }
    }

    /// What `vertex` reflects toward the local direction `wo`, where direct light counts as `depth`.
    pub fn outgoing(&mut self, mut vertex: Vertex, mut wo: Vec3, depth: u32, sample: PathSample) -> Rgb {
        let (mut sum, mut throughput) = (Rgb::BLACK, Rgb::WHITE);
        for depth in depth..=self.max_depth {
            if vertex.bsdf.is_black() || wo.z <= 0.0 {
                break;
            }
            if vertex.bsdf.is_smooth() {
                sum += throughput * self.next_event(&vertex, wo, sample.key.pair(Dimension::next_event(depth), sample.index));
                sum += throughput * self.punctual(&vertex, wo, sample.key.pair(Dimension::punctual(depth), sample.index));
            }
            let Some(bounce) = vertex.bsdf.sample(wo, sample.key.pair(Dimension::bounce(depth), sample.index)) else { break };
            throughput = throughput * bounce.weight;
            let direction = vertex.frame.to_world(bounce.wi);
            let shared = |light_pdf: f32| bounce.pdf.map_or(1.0, |pdf| mis::balance(pdf, light_pdf));
            let Some(hit) = self.scene.closest(&Ray::unbounded(vertex.lifted, direction), &mut self.rays) else {
                let (radiance, light_pdf) = self.scene.beyond(direction);
                sum += throughput * radiance * shared(light_pdf);
                break;
            };
            let prim = self.scene.prim(hit.prim);
            let cos = -prim.frame.normal.dot(direction);
            if cos <= 0.0 {
                break;
            }
            if let Some(emitter) = prim.emitter {
                let light_pdf = to_solid_angle(self.scene.lights().pdf_area(emitter as usize), hit.t * hit.t, cos);
                sum += throughput * self.scene.emission(hit.prim, [hit.u, hit.v]) * shared(light_pdf);
            }
            vertex = self.scene.vertex(&hit);
            wo = vertex.frame.to_local(-direction);
        }
        sum
    }
}
