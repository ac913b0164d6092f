//! Lights: emissive triangles and the environment, which a path may also find by itself, and lights without area, which it never does.
//!
//! The first two share one sampler ([`Lights::sample`]) whose density does not depend on the point that is lit: multiple importance
//! sampling evaluates it again for every ray that happens to see a light. Between the two the choice is by power, the environment's being
//! what falls on the sphere around the scene, with at least a quarter for each: a bright sky outside must not starve the lamps of a closed
//! room. Point, spot and directional lights ([`punctual`]) have weight 1 and are estimated beside them, with a shadow ray of their own; so
//! which of them is chosen may depend on the point. One sampler over everything would save that ray and pay with more noise than it saves.

pub mod choice;
pub mod emitter;
pub mod environment;
pub mod punctual;
pub mod shadow;

#[cfg(test)]
mod tests;

pub use emitter::{Emitter, Emitters, to_solid_angle};

use environment::Sky;
use kiln_proto::scene::Scene;
use punctual::Punctual;

/// The least share of light samples that emissive triangles and the environment get where a scene has both.
const FLOOR: f32 = 0.25;

/// What a light sample is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightPoint {
    /// A point on an emissive triangle.
    Surface {
        /// The primitive it lies on.
        prim: u32,
        /// Barycentric weights of the second and third corner.
        bary: [f32; 2],
        /// The density with which it was chosen, 1/m².
        pdf_area: f32,
    },
    /// A direction of the environment.
    Sky(environment::SkySample),
}

/// All lights of a scene.
#[derive(Debug, Default)]
pub struct Lights {
    emitters: Emitters,
    sky: Option<Sky>,
    /// The probability that the environment is chosen.
    sky_chance: f32,
    punctual: Vec<Punctual>,
    choice: choice::Choice,
}

impl Lights {
    /// The lights of a scene whose emissive triangles are `emitters`. Cost: linear in them and in the pixels of the environment.
    #[must_use]
    pub fn new(scene: &Scene, emitters: impl IntoIterator<Item = Emitter>) -> Self {
        let emitters = Emitters::new(emitters);
        let radius = 0.5 * diameter(scene);
        let sky = scene.environment.as_ref().and_then(Sky::new);
        let sky_power = sky.as_ref().map_or(0.0, |s| s.total() * f64::from(radius) * f64::from(radius));
        let sky_chance = match (sky_power > 0.0, emitters.power() > 0.0) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => ((sky_power / (sky_power + emitters.power())) as f32).clamp(FLOOR, 1.0 - FLOOR),
        };
        let punctual: Vec<Punctual> = scene.lights.iter().map(|light| Punctual::new(light, scene)).collect();
        let choice = choice::Choice::new(punctual.iter().map(|p| p.power(radius)));
        Self { emitters, sky, sky_chance, punctual, choice }
    }

    /// The emissive triangles.
    #[must_use]
    pub fn emitters(&self) -> &Emitters {
        &self.emitters
    }

    /// The environment, where there is one that shines.
    #[must_use]
    pub fn sky(&self) -> Option<&Sky> {
        self.sky.as_ref()
    }

    /// Lights without area, in the order of [`Scene::lights`].
    #[must_use]
    pub fn punctual(&self) -> &[Punctual] {
        &self.punctual
    }

    /// How one of the lights without area is chosen.
    #[must_use]
    pub fn choice(&self) -> &choice::Choice {
        &self.choice
    }

    /// A point on a light or a direction of the environment; `None` where there is neither.
    #[must_use]
    #[inline]
    pub fn sample(&self, scene: &Scene, mut u: [f32; 2]) -> Option<LightPoint> {
        if u[0] < self.sky_chance
            && let (Some(sky), Some(map)) = (&self.sky, &scene.environment)
        {
            u[0] /= self.sky_chance;
            let mut sample = sky.sample(map, u)?;
            sample.pdf *= self.sky_chance;
            return Some(LightPoint::Sky(sample));
        }
        // Strictly below one also where the division rounds up.
        u[0] = ((u[0] - self.sky_chance) / (1.0 - self.sky_chance)).min(1.0 - f32::EPSILON);
        let (emitter, bary) = self.emitters.sample(u)?;
        Some(LightPoint::Surface { prim: self.emitters.list()[emitter].prim, bary, pdf_area: self.pdf_area(emitter) })
    }

    /// The density with which points of the `index`-th emitter are chosen, 1/m².
    #[must_use]
    #[inline]
    pub fn pdf_area(&self, index: usize) -> f32 {
        (1.0 - self.sky_chance) * self.emitters.pdf_area(index)
    }

    /// The environment toward a unit world direction, W/(sr m²), and the density with which the direction is chosen, 1/sr.
    #[must_use]
    #[inline]
    pub fn beyond(&self, scene: &Scene, direction: glam::Vec3) -> (kiln_proto::units::Rgb, f32) {
        match (&self.sky, &scene.environment) {
            (Some(sky), Some(map)) => {
                let (radiance, pdf) = sky.eval(map, direction);
                (radiance, pdf * self.sky_chance)
            }
            _ => (kiln_proto::units::Rgb::BLACK, 0.0),
        }
    }
}

/// The diagonal of a scene's box, metres.
#[must_use]
pub fn diameter(scene: &Scene) -> f32 {
    let (low, high) = scene.bounds();
    (glam::Vec3::from_array(high) - glam::Vec3::from_array(low)).length()
}
