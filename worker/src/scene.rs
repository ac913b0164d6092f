//! A scene made ready for tracing: flat arrays of primitives, the hierarchy over them, materials and lights.
//!
//! It depends on the scene alone, not on a job's settings, so that a worker keeps it across leases and jobs.

use crate::{
    accel::{Accel, Hit, Ray, RayCount},
    bsdf::{Bsdf, Specular, power::Exponent, texture},
    light::{self, Emitter, LightPoint, Lights},
    sampling::warp,
    simd::{Kernel, Simd},
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    frame::Frame,
    scene::{InvalidScene, Lobe, Material, Part, Phong, Reflection, Scene, TextureRef},
    texel::SurfacePoint,
    units::Rgb,
};

/// How far rays start off a surface, relative to the largest coordinate of its triangle: 32 units in the last place, ten times the error of
/// an interpolated position. Relative, so that a scene a thousand times smaller bakes the same.
const LIFT: f32 = 32.0 * f32::EPSILON;

/// How far they start from the triangle's edges, in units of the lift: rounding must not carry a point at an edge beyond the wall that
/// stands there, nor lifting one in a corner that is narrower than a right angle (down to 30 degrees).
const INSET: f32 = 2.0;

/// A triangle with what a path needs to know of it.
#[derive(Debug, Clone, Copy)]
pub struct Prim {
    /// World corners, metres.
    pub corners: [Vec3; 3],
    /// Normal from the winding, and two axes that complete it; no texture follows them.
    pub frame: Frame,
    /// Metres by which points on it are lifted before rays leave them.
    pub lift: f32,
    /// Index of the material.
    pub material: u32,
    /// Number of its part, counted over all surfaces.
    pub part: u32,
    /// Its index among the lights' emitters.
    pub emitter: Option<u32>,
    /// The author's texture coordinates.
    pub uv: [[f32; 2]; 3],
}

/// A point on a primitive, seen from its front.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// The primitive.
    pub prim: u32,
    /// World position lifted off the surface, metres: where rays start.
    pub lifted: Vec3,
    /// World frame.
    pub frame: Frame,
    /// How it reflects there.
    pub bsdf: Bsdf,
}

/// A scene ready for tracing.
#[derive(Debug)]
pub struct BakeScene {
    scene: Scene,
    prims: Vec<Prim>,
    /// The first primitive of each surface.
    first: Vec<u32>,
    /// Surface and index of each part.
    parts: Vec<(u32, u32)>,
    accel: Accel,
    /// The hierarchy of what casts shadows, where that is not everything.
    casters: Option<Accel>,
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
        let (mut prims, mut first) = (Vec::with_capacity(scene.triangle_count()), Vec::with_capacity(scene.surfaces.len()));
        let mut parts = Vec::with_capacity(scene.surfaces.len());
        for (number, surface) in scene.surfaces.iter().enumerate() {
            first.push(prims.len() as u32);
            let before = parts.len();
            parts.extend((0..surface.parts.len()).map(|part| (number as u32, part as u32)));
            for (index, (t, part)) in surface.triangles.iter().zip(surface.part_of_triangles()).enumerate() {
                let uv = surface.uv(0, index).unwrap_or_default();
                prims.push(prim(scene.corners(t), uv, surface.parts[part].material, (before + part) as u32));
            }
        }
        let soup: Vec<[Vec3; 3]> = prims.iter().map(|p| p.corners).collect();
        let accel = Accel::build(&soup);
        let lights = lights(&scene, &prims);
        for (index, emitter) in lights.emitters().list().iter().enumerate() {
            prims[emitter.prim as usize].emitter = Some(index as u32);
        }
        let mut scene = Self { scene, prims, first, parts, accel, casters: None, reach: 0.0, lights, kernel: Kernel::select(simd) };
        scene.casters = scene.build_casters();
        scene.reach = 2.0 * light::diameter(&scene.scene);
        Ok(scene)
    }

    /// A hierarchy without the parts that cast no shadow, where there are such parts and lights that it matters to.
    fn build_casters(&self) -> Option<Accel> {
        let all = self.scene.surfaces.iter().flat_map(|s| &s.parts).all(|p| p.casts_shadows);
        let casting = self.prims.iter().filter(|p| self.part(p).casts_shadows);
        (!all && !self.scene.lights.is_empty()).then(|| Accel::build(&casting.map(|p| p.corners).collect::<Vec<_>>()))
    }

    /// The part that a primitive belongs to.
    #[must_use]
    #[inline]
    pub fn part(&self, prim: &Prim) -> &Part {
        let (surface, part) = self.parts[prim.part as usize];
        &self.scene.surfaces[surface as usize].parts[part as usize]
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

    /// The material of a surface.
    #[must_use]
    pub fn material(&self, surface: usize) -> &Material {
        &self.scene.materials[self.scene.surfaces[surface].parts[0].material as usize]
    }

    /// The nearest hit of a ray.
    #[inline]
    pub fn closest(&self, ray: &Ray, rays: &mut RayCount) -> Option<Hit> {
        self.accel.closest(ray, rays)
    }

    /// Whether light travels between two lifted points.
    #[inline]
    pub fn visible(&self, from: Vec3, to: Vec3, rays: &mut RayCount) -> bool {
        !self.accel.occluded(&Ray { origin: from, direction: to - from, tmax: 1.0 }, rays)
    }

    /// The same for a shadow ray of a light without area, which parts that cast no shadow do not block.
    #[inline]
    pub fn unshadowed(&self, from: Vec3, to: Vec3, rays: &mut RayCount) -> bool {
        !self.casters.as_ref().unwrap_or(&self.accel).occluded(&Ray { origin: from, direction: to - from, tmax: 1.0 }, rays)
    }

    /// The point of a primitive with these weights of its second and third corner, lifted off its front.
    #[inline]
    pub fn lifted(&self, prim: u32, bary: [f32; 2]) -> Vec3 {
        let p = self.prim(prim);
        p.lift(p.corners[0] * (1.0 - bary[0] - bary[1]) + p.corners[1] * bary[0] + p.corners[2] * bary[1])
    }

    /// What leaves the front of a primitive by itself, W/(sr m²).
    #[inline]
    pub fn emission(&self, prim: u32, bary: [f32; 2]) -> Rgb {
        let p = self.prim(prim);
        let material = &self.scene.materials[p.material as usize];
        match material.emission_texture {
            Some(t) if material.is_emissive() => material.emission * self.look_up(&t, p.uv_at(bary)),
            _ => material.emission,
        }
    }

    /// How a primitive reflects at a point.
    #[inline]
    pub fn bsdf(&self, prim: u32, bary: [f32; 2]) -> Bsdf {
        let p = self.prim(prim);
        let material = &self.scene.materials[p.material as usize];
        let Some(phong) = phong(material) else { return Bsdf { diffuse: Rgb::BLACK, specular: Specular::None } };
        let uv = p.uv_at(bary);
        let diffuse = phong.layers.iter().fold(phong.diffuse, |c, layer| c * self.look_up(&layer.texture, uv));
        Bsdf { diffuse, specular: specular(material) }
    }

    fn look_up(&self, texture: &TextureRef, uv: [f32; 2]) -> Rgb {
        texture::lookup(&self.scene.textures[texture.texture as usize], uv)
    }

    /// The vertex of a path where a ray met a primitive.
    #[inline]
    pub fn vertex(&self, hit: &Hit) -> Vertex {
        let bary = [hit.u, hit.v];
        let frame = self.prim(hit.prim).frame;
        Vertex { prim: hit.prim, lifted: self.lifted(hit.prim, bary), frame, bsdf: self.bsdf(hit.prim, bary) }
    }

    /// The vertex at a point of a surface, in the frame of its texel.
    #[inline]
    pub fn vertex_at(&self, surface: usize, point: &SurfacePoint, frame: Frame) -> Vertex {
        let prim = self.prim_of(surface, point.triangle);
        let lifted = self.prim(prim).lift(point.position);
        Vertex { prim, lifted, frame, bsdf: self.bsdf(prim, point.bary) }
    }
}

impl Prim {
    /// A point on it lifted off its front, and a little toward its middle.
    #[inline]
    fn lift(&self, at: Vec3) -> Vec3 {
        let inward = (self.corners[0] + self.corners[1] + self.corners[2]) * (1.0 / 3.0) - at;
        let distance = inward.length();
        let step = if distance > 0.0 { (INSET * self.lift).min(distance) / distance } else { 0.0 };
        at + inward * step + self.frame.normal * self.lift
    }

    /// The author's texture coordinates at these weights of the second and third corner.
    #[inline]
    fn uv_at(&self, [b, c]: [f32; 2]) -> [f32; 2] {
        std::array::from_fn(|k| self.uv[0][k] * (1.0 - b - c) + self.uv[1][k] * b + self.uv[2][k] * c)
    }
}

/// A material as Phong's, where it is one.
#[must_use]
pub fn phong(material: &Material) -> Option<&Phong> {
    if let Reflection::Phong(phong) = &material.reflection { Some(phong) } else { None }
}

/// The specular part of a material.
#[must_use]
pub fn specular(material: &Material) -> Specular {
    let Some(phong) = phong(material) else { return Specular::None };
    match phong.lobe {
        _ if phong.specular.max_channel() <= 0.0 => Specular::None,
        Lobe::Phong { exponent } => Specular::Phong { ks: phong.specular, exponent: Exponent::new(exponent) },
        Lobe::Mirror => Specular::Mirror { ks: phong.specular },
    }
}

fn prim(corners: [DVec3; 3], uv: [[f32; 2]; 3], material: u32, part: u32) -> Prim {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize().unwrap_or(DVec3::Y).as_vec3();
    let (tangent, bitangent) = warp::basis(normal);
    let corners = corners.map(|c| c.as_vec3());
    let largest = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max);
    Prim { corners, frame: Frame { tangent, bitangent, normal }, lift: LIFT * largest, material, part, emitter: None, uv }
}

fn lights(scene: &Scene, prims: &[Prim]) -> Lights {
    let radiance = |m: &Material| match m.emission_texture {
        Some(t) if m.is_emissive() => (m.emission * texture::mean(&scene.textures[t.texture as usize])).mean(),
        _ => m.emission.mean(),
    };
    let radiance: Vec<f32> = scene.materials.iter().map(radiance).collect();
    let emitters = prims.iter().enumerate().map(|(index, p)| {
        let area = 0.5 * (p.corners[1] - p.corners[0]).cross(p.corners[2] - p.corners[0]).length();
        Emitter { prim: index as u32, area, radiance: radiance[p.material as usize] }
    });
    Lights::new(scene, emitters)
}
