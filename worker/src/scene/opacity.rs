//! What rays meet and what they pass: alpha masks, blended surfaces, clear glass, both sides.
//!
//! Masks and blends are decided as triangles are met, in the traversal. A path passes a blended surface with the chance that it shows what
//! lies behind, decided by a hash of the path's number and the primitive: the same in whatever order triangles are met, on any machine. A
//! shadow ray takes the product of what its layers let through instead, which has no noise; stochastic shadows would be as right and
//! noisier. Clear glass (transmission at roughness 0) goes on coloured, so a path that passes it is weighted. Scenes without any of this
//! take a path of their own that asks nothing.

use super::{BakeScene, Prims};
use crate::{
    accel::{Hit, Ray, RayCount},
    sampling::sequence::mix,
};
use glam::Vec3;
use kiln_proto::{
    scene::{Material, Scene},
    units::Rgb,
};
use smallvec::SmallVec;

/// Partly transparent layers of one shadow ray that need no memory of their own. More are counted all the same, as paths meet them all.
const LAYERS: usize = 16;

/// Light of which less than this is left in every channel is none: layers without number must not cost without bound.
const NOTHING: f32 = 1e-30;
/// Layers after which, and after each doubling of which, it is asked whether anything is left.
const MANY: usize = 1_024;

/// What layers leave of light, each of which counts once. The product must not depend on the order in which the tree is walked, so that
/// they are multiplied in the order of primitives.
fn left(layers: &mut SmallVec<[(u32, Rgb); LAYERS]>) -> Rgb {
    layers.sort_unstable_by_key(|(prim, _)| *prim);
    layers.dedup_by_key(|(prim, _)| *prim);
    let left = layers.iter().fold(Rgb::WHITE, |product, (_, through)| product * *through);
    if left.max_channel() < NOTHING { Rgb::BLACK } else { left }
}

/// What a shadow ray can be blocked by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blockers {
    /// All there is: what a path would meet. Light that paths can find as well (emissive surfaces, the environment) needs it, or the two
    /// would not tell of the same scene.
    Everything,
    /// Only parts that cast shadows (X3D `shadowCaster`): for lights without area.
    Casters,
}

/// What a ray meets, with what the light from there is multiplied by on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    /// A primitive: the side that the ray sees.
    Hit(Hit, Rgb),
    /// What lies beyond the scene.
    Beyond(Rgb),
}

/// What must be asked where a primitive is met, in bits; 0 for most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Veil(u8);

impl Veil {
    /// It may be covered only in part.
    const COVERAGE: u8 = 1;
    /// It may be clear glass.
    const CLEAR: u8 = 2;
    /// Shadow rays do not see it.
    const NO_SHADOW: u8 = 4;

    fn of(material: &Material, casts_shadows: bool) -> u8 {
        u8::from(material.lets_through()) * Self::COVERAGE
            + u8::from(material.may_be_clear()) * Self::CLEAR
            + u8::from(!casts_shadows) * Self::NO_SHADOW
    }

    fn has(self, bit: u8) -> bool {
        self.0 & bit != 0
    }

    /// Of every primitive, both sides together; empty where nothing ever needs to be asked.
    pub(super) fn all(scene: &Scene, prims: &Prims) -> Vec<Veil> {
        let own = |surface: &kiln_proto::scene::Surface| -> Vec<u8> {
            let part = |p: &kiln_proto::scene::Part| Self::of(&scene.materials[p.material as usize], p.casts_shadows);
            let parts: Vec<u8> = surface.parts.iter().map(part).collect();
            surface.part_of_triangles().map(|p| parts[p]).collect()
        };
        let own: Vec<u8> = scene.surfaces.iter().flat_map(own).collect();
        if own.iter().all(|bits| *bits == 0) {
            return vec![];
        }
        let both = |(p, bits): (&super::Prim, &u8)| Veil(bits | p.other.map_or(0, |other| own[other as usize]));
        prims.all.iter().zip(&own).map(both).collect()
    }
}

impl BakeScene {
    /// What a ray meets first. `salt` names the ray, where anybody asks.
    #[inline]
    pub fn closest(&self, ray: &Ray, salt: impl FnOnce() -> u64, rays: &mut RayCount) -> Seen {
        if self.veils.is_empty() {
            return match self.accel.closest(ray, rays) {
                Some(hit) => Seen::Hit(self.seen(hit, ray.direction), Rgb::WHITE),
                None => Seen::Beyond(Rgb::WHITE),
            };
        }
        self.closest_veiled(ray, salt(), rays)
    }

    fn closest_veiled(&self, ray: &Ray, salt: u64, rays: &mut RayCount) -> Seen {
        let (mut weight, mut last) = (Rgb::WHITE, (0.0, 0));
        // Every pane is passed with a chance of a half at most, so that few of many are.
        loop {
            let met = |hit: &Hit| (hit.t, hit.prim) > last && self.meets(hit, ray.direction, salt);
            let Some(hit) = self.accel.closest_where(ray, rays, met) else { return Seen::Beyond(weight) };
            let seen = self.seen(hit, ray.direction);
            let clear = if self.veils[hit.prim as usize].has(Veil::CLEAR) { self.clear_along(&seen, ray.direction) } else { Rgb::BLACK };
            if clear.is_black() {
                return Seen::Hit(seen, weight);
            }
            // Either the glass itself or what lies behind, each as often as it is bright.
            let pass = clear.max_channel() / (1.0 + clear.max_channel());
            if chance(salt ^ !0, hit.prim) >= pass {
                return Seen::Hit(seen, weight * (1.0 / (1.0 - pass)));
            }
            weight = weight * clear * (1.0 / pass);
            last = (hit.t, hit.prim);
        }
    }

    /// What share of light travels between two lifted points, per channel: 0 where something opaque lies between.
    #[inline]
    pub fn visible(&self, from: Vec3, to: Vec3, blockers: Blockers, rays: &mut RayCount) -> Rgb {
        self.transmittance(&Ray { origin: from, direction: to - from, tmax: 1.0 }, blockers, rays)
    }

    /// What share of light travels along a ray, per channel.
    #[inline]
    pub fn transmittance(&self, ray: &Ray, blockers: Blockers, rays: &mut RayCount) -> Rgb {
        if self.veils.is_empty() {
            return if self.accel.occluded(ray, rays) { Rgb::BLACK } else { Rgb::WHITE };
        }
        self.transmittance_veiled(ray, blockers, rays)
    }

    fn transmittance_veiled(&self, ray: &Ray, blockers: Blockers, rays: &mut RayCount) -> Rgb {
        let mut layers: SmallVec<[(u32, Rgb); LAYERS]> = SmallVec::new();
        let blocked = self.accel.occluded_where(ray, rays, |hit| {
            let through = self.shadow(hit, ray.direction, blockers);
            if through != Rgb::WHITE {
                layers.push((hit.prim, through));
            }
            // What is left falls with every layer, and the end is judged by the same measure.
            through.is_black() || (layers.len() >= MANY && layers.len().is_power_of_two() && left(&mut layers).is_black())
        });
        if blocked { Rgb::BLACK } else { left(&mut layers) }
    }

    /// The share of a surface that is there at a point, [0, 1]: what its emission is worth to those who see it.
    #[must_use]
    #[inline]
    pub fn coverage(&self, prim: u32, bary: [f32; 2]) -> f32 {
        let opacity = &self.material_of(prim).opacity;
        if self.veils.is_empty() { 1.0 } else { self.scene.coverage_at(opacity, &self.place(prim, bary)) }
    }

    /// Whether a path meets a primitive of the hierarchy instead of passing it.
    fn meets(&self, hit: &Hit, direction: Vec3, salt: u64) -> bool {
        if !self.veils[hit.prim as usize].has(Veil::COVERAGE) {
            return true;
        }
        let seen = self.seen(*hit, direction);
        let coverage = self.coverage(seen.prim, [seen.u, seen.v]);
        coverage >= 1.0 || (coverage > 0.0 && chance(salt, hit.prim) < coverage)
    }

    /// What a primitive lets through of a shadow ray.
    fn shadow(&self, hit: &Hit, direction: Vec3, blockers: Blockers) -> Rgb {
        let veil = self.veils[hit.prim as usize];
        if veil.0 == 0 {
            return Rgb::BLACK;
        }
        if blockers == Blockers::Casters && veil.has(Veil::NO_SHADOW) {
            return Rgb::WHITE;
        }
        let seen = self.seen(*hit, direction);
        let coverage = self.coverage(seen.prim, [seen.u, seen.v]);
        let clear = if veil.has(Veil::CLEAR) && coverage > 0.0 { self.clear_along(&seen, direction) } else { Rgb::BLACK };
        Rgb::splat(1.0 - coverage) + clear * coverage
    }

    fn clear_along(&self, seen: &Hit, direction: Vec3) -> Rgb {
        let cos = self.prim(seen.prim).frame.normal.dot(direction).abs() / direction.length();
        self.clear(seen.prim, [seen.u, seen.v], cos)
    }

    /// Whether a ray meets any front, however little of it is covered; of what is in one place with a back, too.
    pub fn meets_front(&self, ray: &Ray, rays: &mut RayCount) -> bool {
        self.accel.occluded_where(ray, rays, |hit| {
            let p = self.prim(hit.prim);
            p.other.is_some() || p.frame.normal.dot(ray.direction) < 0.0
        })
    }

    /// A hit of the hierarchy as the side that the ray sees: the back's own primitive where it comes from behind and there is one. The
    /// second and third corner of a back are exchanged.
    #[inline]
    fn seen(&self, hit: Hit, direction: Vec3) -> Hit {
        let p = self.prim(hit.prim);
        match p.other {
            Some(back) if p.frame.normal.dot(direction) > 0.0 => Hit { prim: back, u: hit.v, v: hit.u, ..hit },
            _ => hit,
        }
    }
}

/// A number in [0, 1) from the names of a ray and of a primitive.
fn chance(salt: u64, prim: u32) -> f32 {
    (mix(salt ^ (u64::from(prim) << 20)) >> 40) as f32 * (1.0 / 16_777_216.0)
}
