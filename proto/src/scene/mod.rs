//! The canonical scene: geometry, materials, textures and surfaces, validated and content-addressed.
//!
//! Importers of every format end here, and the worker begins here. A scene says nothing of texture sizes or charts: those depend on a
//! job's settings and live in its [`Plan`](crate::plan::Plan). Positions are metres, right-handed, +Y up; triangles are counter-clockwise
//! seen from their front, and only the front reflects or emits.

mod validate;

pub use validate::{InvalidScene, energy_scale};

use crate::{
    ids::SceneHash,
    limits,
    units::Rgb,
    wire::{self, DecodeError},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The version of the canonical form; a change of any type below is a new version.
pub const SCENE_VERSION: u32 = 1;

/// A validated scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// [`SCENE_VERSION`] when it was written.
    pub version: u32,
    /// Vertex positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Named polygon groups, in the order of the file.
    pub surfaces: Vec<Surface>,
    /// What surfaces are made of.
    pub materials: Vec<Material>,
    /// Decoded images that materials refer to.
    pub textures: Vec<Texture>,
}

/// A named polygon group with one material: what gets a light field of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// The author's name, unique within the scene.
    pub name: String,
    /// The name made safe for a file, unique within the scene also on file systems that ignore case.
    pub file_stem: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Triangles without zero area.
    pub triangles: Vec<Triangle>,
}

/// One triangle of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Triangle {
    /// Indices into [`Scene::positions`], counter-clockwise from the front.
    pub corners: [u32; 3],
    /// The author's texture coordinates (v up) where the file has them.
    pub uv: Option<[[f32; 2]; 3]>,
    /// The polygon of the file that this triangle was cut from, counted within its surface.
    pub polygon: u32,
}

/// A material of Wavefront MTL's kind: Lambert plus a normalised Phong lobe or a perfect mirror, and emission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// The author's name.
    pub name: String,
    /// Kd: diffuse reflectance, multiplied with the texture where there is one.
    pub diffuse: Rgb,
    /// map_Kd: index into [`Scene::textures`].
    pub diffuse_texture: Option<u32>,
    /// Ks: reflectance of the lobe at normal incidence, or of the mirror.
    pub specular: Rgb,
    /// What shape the specular part has.
    pub lobe: Lobe,
    /// Ke: emitted radiance of the front side, W/(sr m²), multiplied with the texture where there is one.
    pub emission: Rgb,
    /// map_Ke: index into [`Scene::textures`].
    pub emission_texture: Option<u32>,
}

/// The shape of a material's specular part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Lobe {
    /// Normalised modified Phong of this exponent (Ns), at least 0.
    Phong {
        /// Ns.
        exponent: f32,
    },
    /// A delta lobe about the mirror direction.
    Mirror,
}

impl Material {
    /// Whether the surface gives light of its own.
    #[must_use]
    #[inline]
    pub fn is_emissive(&self) -> bool {
        self.emission.max_channel() > 0.0
    }

    /// Whether its outgoing light depends on the direction.
    #[must_use]
    #[inline]
    pub fn is_specular(&self) -> bool {
        self.specular.max_channel() > 0.0
    }
}

/// An image, 8 bits a channel, sRGB-coded, row 0 at v = 0 (the bottom).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Texture {
    /// The file it came from, for messages.
    pub name: String,
    /// Texels along u.
    pub width: u32,
    /// Texels along v.
    pub height: u32,
    /// 3 x width x height bytes: red, green, blue.
    pub rgb: Vec<u8>,
}

impl Scene {
    /// The three corners of a triangle, metres.
    #[must_use]
    pub fn corners(&self, triangle: &Triangle) -> [DVec3; 3] {
        triangle.corners.map(|c| glam::Vec3::from_array(self.positions[c as usize]).as_dvec3())
    }

    /// The material of a surface.
    #[must_use]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.materials[surface.material as usize]
    }

    /// The surface of this name.
    #[must_use]
    pub fn surface(&self, name: &str) -> Option<(usize, &Surface)> {
        self.surfaces.iter().enumerate().find(|(_, s)| s.name == name)
    }

    /// Triangles over all surfaces.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.surfaces.iter().map(|s| s.triangles.len()).sum()
    }

    /// The smallest box around all positions that triangles use: (low, high).
    #[must_use]
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let mut bounds = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let used = self.surfaces.iter().flat_map(|s| &s.triangles).flat_map(|t| t.corners);
        for p in used.map(|c| self.positions[c as usize]) {
            for axis in 0..3 {
                bounds.0[axis] = bounds.0[axis].min(p[axis]);
                bounds.1[axis] = bounds.1[axis].max(p[axis]);
            }
        }
        bounds
    }

    /// The canonical bytes: what is hashed, stored and sent (compressed) to workers.
    ///
    /// # Errors
    /// Only where the scene exceeds [`limits::SCENE_BYTES`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, DecodeError> {
        wire::encode(self, limits::SCENE_BYTES)
    }

    /// Reads [`Scene::to_bytes`] back and validates it: nothing that came over a wire is believed.
    ///
    /// # Errors
    /// Bytes that are not a scene of this version, and scenes that are not valid.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SceneError> {
        let scene: Scene = wire::decode(bytes, limits::SCENE_BYTES)?;
        scene.validate()?;
        Ok(scene)
    }

    /// The content address of these canonical bytes.
    #[must_use]
    pub fn hash_of(bytes: &[u8]) -> SceneHash {
        SceneHash::of(bytes)
    }
}

/// Why bytes are not a usable scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// Not the canonical form.
    #[error("the scene cannot be decoded")]
    Decode(#[from] DecodeError),
    /// The canonical form of something impossible.
    #[error("the scene is not valid")]
    Invalid(#[from] InvalidScene),
}
