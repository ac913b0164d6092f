//! Light paths: what arrives at a point from a direction, and what leaves a vertex toward one.
//!
//! Next-event estimation and continuation share every vertex by the balance heuristic. Depth counts as in Mitsuba: light that a texel emits
//! has depth 1, direct light depth 2. There is no Russian roulette: `max_depth` bounds the cost, and roulette would trade it for noise that
//! all directions of a texel share. Surfaces are one-sided: backs block, reflect nothing and emit nothing, unless the scene has a surface for them.

use crate::{
    accel::{Ray, RayCount},
    light::to_solid_angle,
    sampling::{Dimension, TexelKey, mis},
    scene::{BakeScene, Blockers, Hit, Vertex},
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
    /// The density with which sampling the lights would have chosen the direction, 1/sr; 0 where it could not.
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

/// The front, or a surface's own back, that a ray meets.
struct Arrival {
    hit: Hit,
    /// Where the ray went in the end.
    direction: Vec3,
    /// Cosine at the front that was hit, > 0.
    cos: f32,
    /// By what light from there is multiplied on its way.
    weight: Rgb,
    /// Whether the ray was turned, so that no light sample could have gone its way.
    turned: bool,
}

impl PathSample {
    /// A name of the ray that leaves this path's vertex at `depth`.
    fn salt(self, depth: u32) -> u64 {
        self.key.salt(self.index, depth)
    }
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

    /// What arrives at a vertex from the unit world `direction`, where its emission counts as `depth`.
    pub fn incident(&mut self, from: &Vertex, direction: Vec3, depth: u32, sample: PathSample) -> Incident {
        let Some(arrival) = self.meet(from, direction, sample.salt(depth)) else { return Incident::NOTHING };
        let (emitted, light_pdf) = self.emitted(&arrival);
        let reflected = if depth < self.max_depth {
            let vertex = self.scene.vertex(&arrival.hit);
            self.outgoing(vertex, vertex.toward(-arrival.direction), depth + 1, sample)
        } else {
            Rgb::BLACK
        };
        Incident { emitted: emitted * arrival.weight, light_pdf, reflected: reflected * arrival.weight }
    }

    /// What `vertex` reflects toward `wo`, local as reflection sees it and above the horizon, where direct light counts as `depth`.
    pub fn outgoing(&mut self, mut vertex: Vertex, mut wo: Vec3, depth: u32, sample: PathSample) -> Rgb {
        let (mut sum, mut throughput) = (Rgb::BLACK, Rgb::WHITE);
        for depth in depth..=self.max_depth {
            if vertex.bsdf.is_black() {
                break;
            }
            if vertex.bsdf.is_smooth() {
                sum += throughput * self.next_event(&vertex, wo, sample.key.pair(Dimension::next_event(depth), sample.index));
            }
            let Some(bounce) = vertex.bsdf.sample(wo, sample.key.pair(Dimension::bounce(depth), sample.index)) else { break };
            let direction = vertex.shading.to_world(bounce.wi);
            if vertex.arriving(direction).is_none() {
                break;
            }
            let Some(arrival) = self.meet(&vertex, direction, sample.salt(depth)) else { break };
            throughput = throughput * bounce.weight * arrival.weight;
            let (emitted, light_pdf) = self.emitted(&arrival);
            if !emitted.is_black() {
                sum += throughput * emitted * bounce.pdf.map_or(1.0, |pdf| mis::balance(pdf, light_pdf));
            }
            vertex = self.scene.vertex(&arrival.hit);
            wo = vertex.toward(-arrival.direction);
        }
        sum
    }

    /// What a ray from a vertex meets, if it is a front.
    ///
    /// In hollows of a smooth surface a direction above the horizon of the interpolated normal may lie below that of the triangle, which a flat
    /// triangle then meets itself. There is nothing to see there: such a ray goes on as its mirror image above the triangle, so that a furnace
    /// keeps its light.
    fn meet(&mut self, from: &Vertex, direction: Vec3, salt: u64) -> Option<Arrival> {
        let origin = from.origin(direction);
        let (mut hit, mut weight) = self.scene.closest(&Ray::unbounded(origin, direction), salt, &mut self.rays)?;
        let own = self.scene.prim(from.prim);
        let (mut direction, mut turned) = (direction, false);
        if own.smooth.is_some() && (hit.prim == from.prim || Some(hit.prim) == own.other) {
            direction -= own.frame.normal * (2.0 * own.frame.normal.dot(direction));
            (hit, weight) = self.scene.closest(&Ray::unbounded(origin, direction), salt, &mut self.rays)?;
            turned = true;
        }
        let cos = -self.scene.prim(hit.prim).frame.normal.dot(direction);
        (cos > 0.0).then_some(Arrival { hit, direction, cos, weight, turned })
    }

    /// What is emitted where a ray arrived, and the density with which a light sample would have gone there.
    fn emitted(&self, arrival: &Arrival) -> (Rgb, f32) {
        let hit = &arrival.hit;
        let emitted = self.scene.emission(hit.prim, [hit.u, hit.v]);
        let emitter = self.scene.prim(hit.prim).emitter.filter(|_| !arrival.turned);
        let pdf = emitter.map_or(0.0, |e| to_solid_angle(self.scene.lights().pdf_area(e as usize), hit.t * hit.t, arrival.cos));
        (emitted, pdf)
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
        let emitted = || self.scene.emission(point.prim, point.bary) * self.scene.coverage(point.prim, point.bary);
        usable.then(|| Connection { direction, target, pdf, emitted: emitted() })
    }

    /// What share of a connection's light reaches a vertex.
    #[inline]
    pub fn reaches(&mut self, from: &Vertex, connection: &Connection) -> Rgb {
        self.scene.visible(from.origin(connection.direction), connection.target, Blockers::Everything, &mut self.rays)
    }

    fn next_event(&mut self, vertex: &Vertex, wo: Vec3, u: [f32; 2]) -> Rgb {
        let Some(light) = self.connect(vertex.lifted, u) else { return Rgb::BLACK };
        let Some(wi) = vertex.arriving(light.direction) else { return Rgb::BLACK };
        let value = vertex.bsdf.eval(wi, wo);
        if value.is_black() || light.emitted.is_black() {
            return Rgb::BLACK;
        }
        let reaches = self.reaches(vertex, &light);
        let weight = mis::balance(light.pdf, vertex.bsdf.pdf(wi, wo));
        value * light.emitted * reaches * (wi.z.abs() * weight / light.pdf)
    }
}
