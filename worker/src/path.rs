//! Light paths: what arrives at a point from a direction, and what leaves a vertex toward one.
//!
//! Next-event estimation and continuation share every vertex by the balance heuristic. Depth counts as in Mitsuba: light that a texel emits
//! has depth 1, direct light depth 2. There is no Russian roulette: `max_depth` bounds the cost, and roulette would trade it for noise that
//! all directions of a texel share. Surfaces are one-sided: backs block, reflect nothing and emit nothing.

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

/// A light sample as a vertex sees it, unshadowed.
#[derive(Debug, Clone, Copy)]
pub struct Connection {
    /// Unit world direction toward the light.
    pub direction: Vec3,
    /// The lifted point on the light.
    pub target: Vec3,
    /// Density of the direction, 1/sr.
    pub pdf: f32,
    /// Emitted radiance, W/(sr m²).
    pub emitted: Rgb,
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
        let Some(hit) = self.scene.closest(&Ray::unbounded(from, direction), &mut self.rays) else { return Incident::NOTHING };
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
            }
            let Some(bounce) = vertex.bsdf.sample(wo, sample.key.pair(Dimension::bounce(depth), sample.index)) else { break };
            throughput = throughput * bounce.weight;
            let direction = vertex.frame.to_world(bounce.wi);
            let Some(hit) = self.scene.closest(&Ray::unbounded(vertex.lifted, direction), &mut self.rays) else { break };
            let prim = self.scene.prim(hit.prim);
            let cos = -prim.frame.normal.dot(direction);
            if cos <= 0.0 {
                break;
            }
            if let Some(emitter) = prim.emitter {
                let light_pdf = to_solid_angle(self.scene.lights().pdf_area(emitter as usize), hit.t * hit.t, cos);
                let weight = bounce.pdf.map_or(1.0, |pdf| mis::balance(pdf, light_pdf));
                sum += throughput * self.scene.emission(hit.prim, [hit.u, hit.v]) * weight;
            }
            vertex = self.scene.vertex(&hit);
            wo = vertex.frame.to_local(-direction);
        }
        sum
    }

    /// A light sample seen from a lifted point; `None` where the light turns its back.
    #[inline]
    pub fn connect(&self, from: Vec3, u: [f32; 2]) -> Option<Connection> {
        let point = self.scene.lights().sample(u)?;
        let target = self.scene.lifted(point.prim, point.bary);
        let toward = target - from;
        let distance_squared = toward.length_squared();
        let direction = toward / distance_squared.sqrt();
        let cos = -self.scene.prim(point.prim).frame.normal.dot(direction);
        let pdf = to_solid_angle(point.pdf_area, distance_squared, cos);
        // A light that touches the point has no direction, and its density overflows or vanishes.
        let usable = cos > 0.0 && pdf > 0.0 && pdf.is_finite();
        usable.then(|| Connection { direction, target, pdf, emitted: self.scene.emission(point.prim, point.bary) })
    }

    /// Whether a connection is not blocked.
    #[inline]
    pub fn reaches(&mut self, from: Vec3, connection: &Connection) -> bool {
        self.scene.visible(from, connection.target, &mut self.rays)
    }

    fn next_event(&mut self, vertex: &Vertex, wo: Vec3, u: [f32; 2]) -> Rgb {
        let Some(light) = self.connect(vertex.lifted, u) else { return Rgb::BLACK };
        let wi = vertex.frame.to_local(light.direction);
        if wi.z <= 0.0 || light.emitted.is_black() || !self.reaches(vertex.lifted, &light) {
            return Rgb::BLACK;
        }
        let weight = mis::balance(light.pdf, vertex.bsdf.pdf(wi, wo));
        vertex.bsdf.eval(wi, wo) * light.emitted * (wi.z * weight / light.pdf)
    }
}
