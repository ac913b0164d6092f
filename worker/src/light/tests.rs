//! Lights against answers known by other means.

use kiln_proto::{
    scene::{Falloff, Light, LightShape, Projection},
    units::Rgb,
};

/// A white light of this shape, by the inverse square.
pub(crate) fn light(shape: LightShape) -> Light {
    Light {
        name: "light".into(),
        shape,
        intensity: Rgb::WHITE,
        falloff: Falloff::InverseSquare { range: None },
        ambient: Rgb::BLACK,
        casts_shadows: true,
        shadow_intensity: 1.0,
        projection: Projection::default(),
        shadow_map: None,
        texture: None,
    }
}
