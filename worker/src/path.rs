//! Light paths: what arrives at a point from a direction, and what leaves a vertex toward one.
//!
//! A ray that leaves the scene sees the environment. Next-event estimation and continuation share every vertex by the balance heuristic.
//! Depth counts as in Mitsuba: light that a texel emits has depth 1, direct light depth 2. There is no Russian roulette: `max_depth` bounds
//! the cost, and roulette would trade it for noise that all directions of a texel share. Surfaces are one-sided: backs block, reflect
//! nothing and emit nothing, unless the scene has a surface for them.

mod next_event;

pub use next_event::{Connection, Shine};

use crate::{
    accel::{Ray, RayCount},
    light::to_solid_angle,
    sampling::{Dimension, TexelKey, mis},
    scene::{BakeScene, Hit, Seen, Vertex},
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

/// What a ray meets in the end.
enum Met {
    /// A front, or the back of a surface that has one.
    Front(Arrival),
    /// The environment, which is black where there is none.
    Sky { radiance: Rgb, light_pdf: f32 },
    /// What neither reflects nor shines.
    Nothing,
}

/// Where a ray met a front.
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
        let arrival = match self.meet(from, direction, depth, sample) {
            Met::Front(arrival) => arrival,
            Met::Sky { radiance, light_pdf } => return Incident { emitted: radiance, light_pdf, reflected: Rgb::BLACK },
            Met::Nothing => return Incident::NOTHING,
        };
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
                if !self.scene.lights().punctual().is_empty() {
                    sum += throughput * self.punctual(&vertex, wo, sample.key.pair(Dimension::punctual(depth), sample.index));
                }
            }
            let Some(bounce) = vertex.bsdf.sample(wo, sample.key.pair(Dimension::bounce(depth), sample.index)) else { break };
            let direction = vertex.shading.to_world(bounce.wi);
            if vertex.arriving(direction).is_none() {
                break;
            }
            throughput = throughput * bounce.weight;
            let shared = |light_pdf: f32| bounce.pdf.map_or(1.0, |pdf| mis::balance(pdf, light_pdf));
            let arrival = match self.meet(&vertex, direction, depth, sample) {
                Met::Front(arrival) => arrival,
                Met::Sky { radiance, light_pdf } => {
                    sum += throughput * radiance * shared(light_pdf);
                    break;
                }
                Met::Nothing => break,
            };
            throughput = throughput * arrival.weight;
            let (emitted, light_pdf) = self.emitted(&arrival);
            if !emitted.is_black() {
                sum += throughput * emitted * shared(light_pdf);
            }
            vertex = self.scene.vertex(&arrival.hit);
            wo = vertex.toward(-arrival.direction);
        }
        sum
    }

    /// What a ray from a vertex meets.
    ///
    /// In hollows of a smooth surface a direction above the horizon of the interpolated normal may lie below that of the triangle, which a
    /// flat triangle then meets itself. There is nothing to see there: such a ray goes on as its mirror image above the triangle, so that a
    /// furnace keeps its light.
    fn meet(&mut self, from: &Vertex, mut direction: Vec3, depth: u32, sample: PathSample) -> Met {
        let origin = from.origin(direction);
        let mut seen = self.scene.closest(&Ray::unbounded(origin, direction), || sample.salt(depth), &mut self.rays);
        let (own, mut turned) = (self.scene.prim(from.prim), false);
        if own.smooth.is_some() && matches!(&seen, Seen::Hit(hit, _) if hit.prim == from.prim || Some(hit.prim) == own.other) {
            direction -= own.frame.normal * (2.0 * own.frame.normal.dot(direction));
            seen = self.scene.closest(&Ray::unbounded(origin, direction), || sample.salt(depth), &mut self.rays);
            turned = true;
        }
        match seen {
            Seen::Hit(hit, weight) => {
                let cos = -self.scene.prim(hit.prim).frame.normal.dot(direction);
                if cos > 0.0 { Met::Front(Arrival { hit, direction, cos, weight, turned }) } else { Met::Nothing }
            }
            Seen::Beyond(weight) => {
                let (radiance, light_pdf) = self.scene.beyond(direction);
                Met::Sky { radiance: radiance * weight, light_pdf: if turned { 0.0 } else { light_pdf } }
            }
        }
    }

    /// What is emitted where a ray arrived, and the density with which a light sample would have gone there.
    fn emitted(&self, arrival: &Arrival) -> (Rgb, f32) {
        let hit = &arrival.hit;
        let emitted = self.scene.emission(hit.prim, [hit.u, hit.v]);
        if emitted.is_black() {
            return (emitted, 0.0);
        }
        let emitter = self.scene.prim(hit.prim).emitter.filter(|_| !arrival.turned);
        let pdf = emitter.map_or(0.0, |e| to_solid_angle(self.scene.lights().pdf_area(e as usize), hit.t * hit.t, arrival.cos));
        (emitted, pdf)
    }
}
