//! Lights without area, the environment, cameras and projectors, with the shadow and projector fields of X3D (Kamburelis).
//!
//! Intensities are radiometric and linear. Photometric numbers of a format (glTF's candela and lux) are taken as they are, like the
//! emission of its materials: a scene keeps its balance, and exposure does the rest.

use crate::units::Rgb;
use serde::{Deserialize, Serialize};

/// A light without area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// The author's name, unique among lights.
    pub name: String,
    /// Where it is and where it shines.
    pub shape: LightShape,
    /// Point and spot: W/sr. Directional: W/m² on a surface that faces it.
    pub intensity: Rgb,
    /// How distance weakens point and spot lights.
    pub falloff: Falloff,
    /// X3D's ambient term: added, times a material's ambient share and diffuse colour, to what a point that the light reaches reflects,
    /// W/(sr m²).
    pub ambient: Rgb,
    /// Whether shapes throw its shadows on everything (X3D 4 `shadows`); acts with strict shadows only.
    pub casts_shadows: bool,
    /// X3D 4 `shadowIntensity`: how dark its shadows are, [0, 1]; acts with strict shadows only, 1 elsewhere.
    pub shadow_intensity: f32,
    /// The light as a camera.
    pub projection: Projection,
    /// X3D `defaultShadowMap`, or its defaults where a shadow of this light is wanted.
    pub shadow_map: Option<ShadowMap>,
    /// A texture that colours what it emits, looked up through the projector whose index is in the mapping (`--x3d-projectors light`).
    pub texture: Option<super::TextureRef>,
}

impl Light {
    /// A light that shines by the inverse square without end, throws shadows and says nothing else.
    #[must_use]
    pub fn new(name: impl Into<String>, shape: LightShape, intensity: Rgb) -> Self {
        Self {
            name: name.into(),
            shape,
            intensity,
            falloff: Falloff::InverseSquare { range: None },
            ambient: Rgb::BLACK,
            casts_shadows: true,
            shadow_intensity: 1.0,
            projection: Projection::default(),
            shadow_map: None,
            texture: None,
        }
    }
}

/// Where a light is and where it shines; directions are unit and point away from the light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum LightShape {
    /// Into all directions.
    Point {
        /// Metres.
        position: [f32; 3],
    },
    /// Into a cone.
    Spot {
        /// Metres.
        position: [f32; 3],
        /// The axis of the cone.
        direction: [f32; 3],
        /// Half angle of the cone, radians.
        cut_off: f32,
        /// Half angle up to which it has its full intensity, radians.
        beam_width: f32,
        /// How it fades between the two.
        profile: SpotProfile,
    },
    /// From infinitely far away.
    Directional {
        /// Where its light travels to.
        direction: [f32; 3],
    },
}

/// How a spot light fades from its full intensity to its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpotProfile {
    /// (cut_off - angle)/(cut_off - beam_width) (ISO/IEC 19775-1, 17.2.2.1).
    Linear,
    /// The square of that quotient taken of cosines (KHR_lights_punctual).
    SquaredCosine,
}

/// How distance d, metres, weakens a light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Falloff {
    /// 1/d², within a range by KHR_lights_punctual: max(min(1 - (d/range)⁴, 1), 0)/d².
    InverseSquare {
        /// Metres.
        range: Option<f32>,
    },
    /// 1/max(a0 + a1 d + a2 d², 1) within the radius, nothing beyond (ISO/IEC 19775-1, 17.2.2.4).
    Polynomial {
        /// a0, a1, a2.
        attenuation: [f32; 3],
        /// Metres.
        radius: f32,
    },
}

/// A light or viewpoint as a camera (Kamburelis 4.1); automatic values are filled in at import.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Projection {
    /// projectionNear, metres; 0 means automatic in the file.
    pub near: f32,
    /// projectionFar, metres.
    pub far: f32,
    /// up, unit and orthogonal to the direction.
    pub up: [f32; 3],
    /// Directional: projectionRectangle left, bottom, right, top, metres. Zero otherwise.
    pub rectangle: [f32; 4],
    /// Directional: projectionLocation, metres. The light's position otherwise.
    pub location: [f32; 3],
    /// Spot: projectionAngle, radians. Zero otherwise.
    pub angle: f32,
    /// Which of near, far, rectangle and angle the file left to be found: bits 1, 2, 4, 8.
    pub automatic: u8,
}

/// GeneratedShadowMap (Kamburelis 4.3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShadowMap {
    /// When it is made.
    pub update: ShadowUpdate,
    /// Texels a side.
    pub size: u32,
    /// Slope factor of the polygon offset.
    pub scale: f32,
    /// Constant factor of the polygon offset.
    pub bias: f32,
    /// What a look-up answers.
    pub compare: ShadowCompare,
}

/// GeneratedShadowMap.update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ShadowUpdate {
    /// NONE.
    None,
    /// NEXT_FRAME_ONLY.
    NextFrameOnly,
    /// ALWAYS.
    Always,
}

/// GeneratedShadowMap.compareMode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ShadowCompare {
    /// COMPARE_R_LEQUAL: lit where nearer than the map.
    LessEqual,
    /// COMPARE_R_GEQUAL.
    GreaterEqual,
    /// NONE: the depth itself.
    None,
}

/// A light or viewpoint that projects a texture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Projector {
    /// The author's name of the light or viewpoint.
    pub name: String,
    /// The light, where it is one: index into [`Scene::lights`](super::Scene::lights), unless that light does not shine.
    pub light: Option<u32>,
    /// Rows of the matrix from world position (x, y, z, 1) to (s q, t q, r q, q): s, t in [0, 1] inside the frustum; points with q <= 0 are
    /// not reached.
    pub matrix: [[f32; 4]; 4],
}

/// A camera of the author's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The author's name.
    pub name: String,
    /// Metres.
    pub eye: [f32; 3],
    /// Unit direction of view.
    pub forward: [f32; 3],
    /// Unit, orthogonal to `forward`.
    pub up: [f32; 3],
    /// What it projects like.
    pub lens: Lens,
}

/// How a camera projects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Lens {
    /// Perspective.
    Perspective {
        /// Radians, along the vertical; of the smaller side where `of_smaller` (X3D Viewpoint).
        fov: f32,
        /// See `fov`.
        of_smaller: bool,
    },
    /// Orthographic: half the height of what it shows, metres.
    Orthographic {
        /// Metres.
        half_height: f32,
    },
}
