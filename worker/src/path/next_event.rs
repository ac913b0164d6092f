//! Next-event estimation: what the lights send to a vertex, each with a shadow ray of its own.

use super::Tracer;
use crate::{
    light::{
        LightPoint,
        punctual::Arrival,
        shadow::{self, Shadow},
        to_solid_angle,
    },
    sampling::mis,
    scene::{Blockers, Vertex},
};
use glam::Vec3;
use kiln_proto::{scene::Reflection, units::Rgb};

/// A light sample as a vertex sees it, unshadowed: a point on an emissive triangle or a direction of the environment.
#[derive(Debug, Clone, Copy)]
pub struct Connection {
    /// Where the vertex looks from: its front or its back, whichever the light is on.
    pub origin: Vec3,
    /// Unit world direction from there toward the light.
    pub direction: Vec3,
    /// The lifted point on the light, or one beyond the scene.
    pub target: Vec3,
    /// Density of the direction, 1/sr.
    pub pdf: f32,
    /// Emitted radiance, W/(sr m²).
    pub emitted: Rgb,
}

/// What a light without area sends to a vertex, shadows applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shine {
    /// Unit world direction toward the light.
    pub direction: Vec3,
    /// Irradiance of a surface that faces it, W/m².
    pub light: Rgb,
    /// Its ambient term as the vertex reflects it toward everywhere, W/(sr m²).
    pub ambient: Rgb,
}

impl Tracer<'_> {
    /// A light sample seen from a vertex; `None` where the light turns its back, or lies where no ray of the vertex goes.
    ///
    /// The origin is chosen first, as for rays, so that direction, density and shadow ray are those of the path that finds the same light.
    #[inline]
    pub fn connect(&self, from: &Vertex, u: [f32; 2]) -> Option<Connection> {
        match self.scene.sample_light(u)? {
            LightPoint::Surface { prim, bary, pdf_area } => {
                let target = self.scene.lifted(prim, bary);
                let origin = from.origin_toward(target)?;
                let toward = target - origin;
                let distance_squared = toward.length_squared();
                let direction = toward / distance_squared.sqrt();
                let cos = -self.scene.prim(prim).frame.normal.dot(direction);
                let pdf = to_solid_angle(pdf_area, distance_squared, cos);
                // A light that touches the point has no direction, and its density overflows or vanishes.
                let usable = cos > 0.0 && pdf > 0.0 && pdf.is_finite();
                // A point that is there in part shines in part; paths meet it as often.
                let emitted = || self.scene.emission(prim, bary) * self.scene.coverage(prim, bary);
                usable.then(|| Connection { origin, direction, target, pdf, emitted: emitted() })
            }
            LightPoint::Sky(sky) => {
                let origin = from.origin(sky.direction);
                let target = origin + sky.direction * self.scene.reach();
                Some(Connection { origin, direction: sky.direction, target, pdf: sky.pdf, emitted: sky.radiance })
            }
        }
    }

    /// What share of a connection's light reaches its vertex.
    #[inline]
    pub fn reaches(&mut self, connection: &Connection) -> Rgb {
        self.scene.visible(connection.origin, connection.target, Blockers::Everything, &mut self.rays)
    }

    /// Emissive triangles and the environment, by one sample of either.
    pub(super) fn next_event(&mut self, vertex: &Vertex, wo: Vec3, u: [f32; 2]) -> Rgb {
        let Some(light) = self.connect(vertex, u) else { return Rgb::BLACK };
        let Some(wi) = vertex.arriving(light.direction) else { return Rgb::BLACK };
        let value = vertex.bsdf.eval(wi, wo);
        if value.is_black() || light.emitted.is_black() {
            return Rgb::BLACK;
        }
        let reaches = self.reaches(&light);
        let weight = mis::balance(light.pdf, vertex.bsdf.pdf(wi, wo));
        value * light.emitted * reaches * (wi.z.abs() * weight / light.pdf)
    }

    /// Lights without area, by one of them.
    pub(super) fn punctual(&mut self, vertex: &Vertex, wo: Vec3, u: [f32; 2]) -> Rgb {
        let Some((shine, factor)) = self.shine_one(vertex, u) else { return Rgb::BLACK };
        let reflected = vertex.arriving(shine.direction).map_or(Rgb::BLACK, |wi| vertex.bsdf.eval(wi, wo) * shine.light * wi.z.abs());
        (reflected + shine.ambient) * factor
    }

    /// One of the lights without area, chosen by what it would send unshadowed, and the factor that makes it stand for all of them.
    #[inline]
    pub fn shine_one(&mut self, vertex: &Vertex, u: [f32; 2]) -> Option<(Shine, f32)> {
        let scene = self.scene;
        if scene.lights().punctual().is_empty() {
            return None;
        }
        let contribution = |light: usize| {
            self.unshadowed(vertex, light).map_or(0.0, |(_, _, s)| {
                let cos = vertex.shading.normal.dot(s.direction).abs();
                s.light.mean() * cos + s.ambient.mean()
            })
        };
        let (light, factor) = scene.lights().choice().pick(u, contribution)?;
        Some((self.shine(vertex, light)?, factor))
    }

    /// What the light without area of this index sends to a vertex; `None` where that is nothing.
    #[inline]
    pub fn shine(&mut self, vertex: &Vertex, light: usize) -> Option<Shine> {
        let (from, target, shine) = self.unshadowed(vertex, light)?;
        let part = self.scene.part(self.scene.prim(vertex.prim));
        let canonical = self.scene.scene();
        let left = match shadow::shadow(canonical.rules, &canonical.lights[light], light as u32, part, from) {
            Shadow::Known(left) => Rgb::splat(left),
            Shadow::Trace { left } => {
                let seen = self.scene.visible(from, target, Blockers::Casters, &mut self.rays);
                // Where it is blocked, `left` remains.
                seen + (Rgb::WHITE + seen * -1.0) * left
            }
        };
        (!left.is_black()).then(|| Shine { direction: shine.direction, light: shine.light * left, ambient: shine.ambient * left })
    }

    /// The ends of a light's shadow ray, and what it sends there if nothing is in between. A light from behind has only its ambient term,
    /// but for translucent surfaces, which it shines on as it is seen from there.
    fn unshadowed(&self, vertex: &Vertex, light: usize) -> Option<(Vec3, Vec3, Shine)> {
        let prim = self.scene.prim(vertex.prim);
        if self.scene.part(prim).unlit_by.binary_search(&(light as u32)).is_ok() {
            return None;
        }
        let seen_from = |origin: Vec3| self.scene.lights().punctual()[light].at(self.scene.scene(), origin);
        let height = |arrival: &Arrival| vertex.frame.normal.dot(arrival.direction);
        let above = seen_from(vertex.lifted);
        let faced = above.filter(|a| height(a) > 0.0);
        let from_behind = || seen_from(vertex.sunk).filter(|a| vertex.bsdf.is_translucent() && height(a) < 0.0);
        let (arrival, faces) = match faced.or_else(from_behind) {
            Some(arrival) => (arrival, true),
            None => (above?, false),
        };
        let share = if let Reflection::Phong(p) = &self.scene.material_of(vertex.prim).reflection { p.ambient } else { 0.0 };
        let ambient = vertex.bsdf.diffuse * arrival.ambient * share;
        let light = if faces { arrival.light } else { Rgb::BLACK };
        let shines = !(light.is_black() && ambient.is_black());
        let shine = Shine { direction: arrival.direction, light, ambient };
        shines.then(|| (vertex.origin(arrival.direction), arrival.target, shine))
    }
}
