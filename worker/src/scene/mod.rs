//! A scene made ready for tracing: flat arrays of primitives, the hierarchy over them, materials and lights.
//!
//! It depends on the scene alone, not on a job's settings, so that a worker keeps it across leases and jobs.

mod material;
mod opacity;
mod prim;
mod vertex;

#[cfg(test)]
mod tangent_tests;
#[cfg(test)]
mod tests;

use crate::{
    accel::Accel,
    bsdf::Bsdf,
    light::{self, Emitter, LightPoint, Lights},
    simd::{Kernel, Simd},
};
use glam::Vec3;
use kiln_proto::{
    scene::{InvalidScene, Mapping, Material, Part, Scene},
    units::Rgb,
};
use opacity::Veil;
use prim::Prims;

pub use crate::accel::Hit;
pub use material::Polish;
pub use opacity::{Blockers, Seen};
pub use prim::Prim;
pub use vertex::{HORIZON, Vertex, above_horizon};

/// A scene ready for tracing.
#[derive(Debug)]
pub struct BakeScene {
    scene: Scene,
    prims: Vec<Prim>,
    /// The first primitive of each surface.
    first: Vec<u32>,
    /// Vertex normals of smooth primitives.
    normals: Vec<[Vec3; 3]>,
    /// Materials that are the same everywhere.
    constant: Vec<Option<Bsdf>>,
    /// Where each material is a perfect mirror.
    polish: Vec<Polish>,
    /// What must be asked where a primitive is met; empty where nothing must.
    veils: Vec<Veil>,
    accel: Accel,
    /// Metres that lead out of the scene from anywhere in it.
    reach: f32,
    lights: Lights,
    kernel: Kernel,
}

impl BakeScene {
    /// Validates a scene and builds what tracing needs. Cost: O(n log n) in triangles; textures stay as they are.
    ///
    /// # Errors
    /// Scenes that break a rule of the canonical form.
    pub fn new(scene: Scene, simd: Simd) -> Result<Self, InvalidScene> {
        scene.validate()?;
        let mut prims = Prims::new(&scene);
        let numbers: Vec<u32> = (0..prims.all.len() as u32).filter(|p| !prims.all[*p as usize].is_back).collect();
        let soup: Vec<[Vec3; 3]> = numbers.iter().map(|p| prims.all[*p as usize].corners).collect();
        let accel = Accel::build(&soup).numbered(&numbers);
        let lights = lights(&scene, &prims.all);
        for (index, emitter) in lights.emitters().list().iter().enumerate() {
            prims.all[emitter.prim as usize].emitter = Some(index as u32);
        }
        let constant = scene.materials.iter().map(|m| material::constant(&scene, m)).collect();
        let polish = Polish::all(&scene);
        let (veils, reach) = (Veil::all(&scene, &prims), 2.0 * light::diameter(&scene));
        let Prims { all, first, normals } = prims;
        Ok(Self { scene, prims: all, first, normals, constant, polish, veils, accel, reach, lights, kernel: Kernel::select(simd) })
    }

    /// The canonical scene behind it.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Its lights.
    #[must_use]
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Which code path the gather takes.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// A primitive.
    #[must_use]
    #[inline]
    pub fn prim(&self, index: u32) -> &Prim {
        &self.prims[index as usize]
    }

    /// The primitive of a surface's triangle.
    #[must_use]
    #[inline]
    pub fn prim_of(&self, surface: usize, triangle: u32) -> u32 {
        self.first[surface] + triangle
    }

    /// The part that a primitive belongs to.
    #[must_use]
    #[inline]
    pub fn part(&self, prim: &Prim) -> &Part {
        &self.scene.surfaces[prim.surface as usize].parts[prim.part as usize]
    }

    /// A point on an emissive triangle or a direction of the environment.
    #[must_use]
    #[inline]
    pub fn sample_light(&self, u: [f32; 2]) -> Option<LightPoint> {
        self.lights.sample(&self.scene, u)
    }

    /// What is seen where a ray leaves the scene, W/(sr m²), and the density with which sampling lights chooses the direction, 1/sr.
    #[must_use]
    #[inline]
    pub fn beyond(&self, direction: Vec3) -> (Rgb, f32) {
        self.lights.beyond(&self.scene, direction)
    }

    /// Metres that lead out of the scene from anywhere in it.
    #[must_use]
    #[inline]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Where the material of a primitive is a perfect mirror.
    #[must_use]
    pub fn polish_of(&self, prim: u32) -> Polish {
        self.polish[self.prim(prim).material as usize]
    }

    /// The material of a primitive.
    #[must_use]
    #[inline]
    pub fn material_of(&self, prim: u32) -> &Material {
        &self.scene.materials[self.prim(prim).material as usize]
    }
}

fn lights(scene: &Scene, prims: &[Prim]) -> Lights {
    let radiance = |m: &Material| match m.emission_texture {
        // A projected picture may cover any share of the surface: the factor alone is the safe estimate.
        Some(t) if m.is_emissive() && matches!(t.mapping, Mapping::Uv { .. }) => {
            (m.emission * scene.textures[t.texture as usize].mean()).mean()
        }
        _ => m.emission.mean(),
    };
    let radiance: Vec<f32> = scene.materials.iter().map(radiance).collect();
    let emitter = |(index, p): (usize, &Prim)| Emitter { prim: index as u32, area: p.area(), radiance: radiance[p.material as usize] };
    Lights::new(scene, prims.iter().enumerate().map(emitter))
}
