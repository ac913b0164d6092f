//! The canonical scene: geometry, materials, textures, lights and cameras, validated and content-addressed.
//!
//! Importers of every format end here, and the worker begins here. A scene says nothing of texture sizes or charts: those depend on a
//! job's settings and live in its [`Plan`](crate::plan::Plan). Positions are metres, right-handed, +Y up; triangles are counter-clockwise
//! seen from their front, and only the front reflects or emits. Everything is in world space: instances, skins and animations are flattened
//! at import, because every copy needs a light field of its own anyway.
//!
//! A surface is what owns a texture. It consists of parts with a material each: usually one, but many small objects may share the texture
//! of one surface. What is seen from both sides is two surfaces, the second of which names the first ([`Surface::back_of`]).

pub mod environment;
mod light;
mod material;
mod sample;
mod texture;
mod uses;
mod validate;
mod veil;

pub use environment::Environment;
pub use light::{Camera, Falloff, Lens, Light, LightShape, Projection, Projector, ShadowCompare, ShadowMap, ShadowUpdate, SpotProfile};
pub use material::{
    AlphaMode, LayerMode, Lobe, Mapping, Material, MetallicRoughness, NormalMap, Opacity, Phong, Reflection, TextureLayer, TextureRef, Wrap,
};
pub use sample::Place;
pub use texture::{Coding, Texture};
pub use validate::{InvalidScene, energy_scale};
pub use veil::{LEAST_ALPHA, Veil, alpha_of, fifth};

use crate::{
    ids::SceneHash,
    limits,
    wire::{self, DecodeError},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The version of the canonical form; a change of any type below is a new version.
///
/// 1: surfaces of one MTL material. 2: parts, both sides, normals, several coordinate sets, vertex colours, metallic-roughness, opacity,
/// lights beside emissive triangles, environment, projectors, cameras.
/// 3: tangents.
pub const SCENE_VERSION: u32 = 3;

/// A validated scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// [`SCENE_VERSION`] when it was written.
    pub version: u32,
    /// Vertex positions, metres; equal positions are one vertex.
    pub positions: Vec<[f32; 3]>,
    /// Unit vertex normals that [`Surface::normals`] refers to.
    pub normals: Vec<[f32; 3]>,
    /// Unit vertex tangents that [`Surface::tangents`] refers to, and 1 or -1: the bitangent is that times normal x tangent. Zero,
    /// with either side, stands for a corner without a tangent.
    pub tangents: Vec<[f32; 4]>,
    /// Linear vertex colours with opacity that [`Surface::colors`] refers to, [0, 1].
    pub colors: Vec<[f32; 4]>,
    /// Named polygon groups, in the order of the file.
    pub surfaces: Vec<Surface>,
    /// What surfaces are made of.
    pub materials: Vec<Material>,
    /// Decoded images that materials refer to.
    pub textures: Vec<Texture>,
    /// Lights beside emissive surfaces and the environment.
    pub lights: Vec<Light>,
    /// What is seen, and shines, where a ray leaves the scene.
    pub environment: Option<Environment>,
    /// Cameras and lights through which textures are projected.
    pub projectors: Vec<Projector>,
    /// The author's cameras, the one to begin with first.
    pub cameras: Vec<Camera>,
    /// How the author's shadow fields are to be understood.
    pub rules: ShadowRules,
}

/// How X3D's shadow fields act in a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ShadowRules {
    /// Strict: a light throws shadows only on parts whose `receive_shadows` names it, or where it [casts](Light::casts_shadows) them
    /// itself. Otherwise every light throws shadows on everything.
    pub strict: bool,
    /// Strict shadows only: points outside a light's shadow map are in shadow (Kamburelis 5.2) rather than lit.
    pub outside_is_shadowed: bool,
}

/// A named polygon group: what gets a texture, and so a light field, of its own.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Surface {
    /// The author's name, unique within the scene.
    pub name: String,
    /// The name made safe for a file, unique within the scene also on file systems that ignore case.
    pub file_stem: String,
    /// For the back of a two-sided surface: index of its front. Triangle i of the back is triangle i of the front with its second and third
    /// corner exchanged (and all that belongs to corners), with normals and the sides of bitangents reversed.
    pub back_of: Option<u32>,
    /// What its triangles are made of: runs of triangles, in order, that together are all of them.
    pub parts: Vec<Part>,
    /// Triangles without zero area.
    pub triangles: Vec<Triangle>,
    /// The author's texture coordinates (v up): sets of one entry per triangle. Set 1, where there is one, is meant for light.
    pub uv_sets: Vec<Vec<Option<[[f32; 2]; 3]>>>,
    /// Indices into [`Scene::normals`] of each triangle's corners; empty for a surface that is flat in each triangle.
    pub normals: Vec<[u32; 3]>,
    /// Indices into [`Scene::tangents`] of each triangle's corners: what normal maps lie along. Empty where each triangle has the tangent
    /// of its texture coordinates, as on surfaces that are flat in each.
    pub tangents: Vec<[u32; 3]>,
    /// Indices into [`Scene::colors`] of each triangle's corners; empty for a surface without vertex colours.
    pub colors: Vec<[u32; 3]>,
}

/// A run of triangles of one material within a surface.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Part {
    /// The author's name of it; a surface's own name where the surface has only this part.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// How many triangles.
    pub triangles: u32,
    /// Whether it is seen by the shadow rays of lights (X3D `shadowCaster`, `castShadow`). Paths always see it.
    pub casts_shadows: bool,
    /// Lights whose shadows it receives by `receiveShadows` or a GeneratedShadowMap of its own: indices into [`Scene::lights`].
    pub receive_shadows: Vec<u32>,
    /// Lights that do not shine on it (X3D `global FALSE` elsewhere): indices into [`Scene::lights`], ascending.
    pub unlit_by: Vec<u32>,
    /// GeneratedShadowMap textures of its appearance: light and parameters.
    pub shadow_maps: Vec<(u32, ShadowMap)>,
}

/// One triangle of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Triangle {
    /// Indices into [`Scene::positions`], counter-clockwise from the front.
    pub corners: [u32; 3],
    /// The polygon of the file that this triangle was cut from, counted within its surface.
    pub polygon: u32,
}

impl Part {
    /// A part that shares light and shadow like everything else.
    #[must_use]
    pub fn plain(name: impl Into<String>, material: u32, triangles: usize) -> Self {
        Self { name: name.into(), material, triangles: triangles as u32, casts_shadows: true, ..Self::default() }
    }
}

impl Surface {
    /// A surface of one part and at most one set of texture coordinates, flat in each triangle.
    #[must_use]
    pub fn plain(name: impl Into<String>, material: u32, triangles: Vec<(Triangle, Option<[[f32; 2]; 3]>)>) -> Self {
        let name: String = name.into();
        let (triangles, uv): (Vec<Triangle>, Vec<_>) = triangles.into_iter().unzip();
        let parts = vec![Part::plain(name.clone(), material, triangles.len())];
        let uv_sets = if uv.iter().any(Option::is_some) { vec![uv] } else { vec![] };
        Self { file_stem: name.clone(), name, parts, triangles, uv_sets, ..Self::default() }
    }

    /// The part of each triangle: its index into [`Surface::parts`].
    pub fn part_of_triangles(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().enumerate().flat_map(|(index, part)| std::iter::repeat_n(index, part.triangles as usize))
    }

    /// The part of one triangle. Cost: linear in parts.
    #[must_use]
    pub fn part_of(&self, triangle: usize) -> Option<&Part> {
        let mut end = 0;
        self.parts.iter().find(|part| {
            end += part.triangles as usize;
            triangle < end
        })
    }

    /// The coordinates of a set at a triangle's corners, where there are any.
    #[must_use]
    #[inline]
    pub fn uv(&self, set: usize, triangle: usize) -> Option<[[f32; 2]; 3]> {
        self.uv_sets.get(set)?.get(triangle).copied().flatten()
    }
}

impl Scene {
    /// A scene with nothing in it, which is not valid until it has a triangle.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            version: SCENE_VERSION,
            positions: vec![],
            normals: vec![],
            tangents: vec![],
            colors: vec![],
            surfaces: vec![],
            materials: vec![],
            textures: vec![],
            lights: vec![],
            environment: None,
            projectors: vec![],
            cameras: vec![],
            rules: ShadowRules::default(),
        }
    }

    /// The three corners of a triangle, metres.
    #[must_use]
    pub fn corners(&self, triangle: &Triangle) -> [DVec3; 3] {
        triangle.corners.map(|c| glam::Vec3::from_array(self.positions[c as usize]).as_dvec3())
    }

    /// The materials of a surface, one per part.
    pub fn materials_of(&self, surface: &Surface) -> impl Iterator<Item = &Material> {
        surface.parts.iter().map(|p| &self.materials[p.material as usize])
    }

    /// Whether some part of a surface gives light of its own.
    #[must_use]
    pub fn is_emissive(&self, surface: &Surface) -> bool {
        self.materials_of(surface).any(Material::is_emissive)
    }

    /// Whether the outgoing light of some part of a surface depends on the direction.
    #[must_use]
    pub fn is_view_dependent(&self, surface: &Surface) -> bool {
        self.materials_of(surface).any(Material::is_view_dependent)
    }

    /// Whether anything gives light.
    #[must_use]
    pub fn has_light(&self) -> bool {
        !self.lights.is_empty() || self.environment.is_some() || self.surfaces.iter().any(|s| self.is_emissive(s))
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
