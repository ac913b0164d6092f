//! Lights against answers known by other means.

mod environment;
mod gather;
mod leaks;
mod plate;
mod reference;
mod strict;

use crate::{
    eval::{Answer, Query, evaluate},
    scene::BakeScene,
    simd::Simd,
    testing::{add_quad, empty, settings},
};
use glam::Vec3;
use kiln_proto::{
    scene::{Environment, Light, LightShape, Material, Scene},
    units::Rgb,
};

/// A white light of this shape, by the inverse square.
pub(crate) fn light(shape: LightShape) -> Light {
    Light::new("light", shape, Rgb::WHITE)
}

/// An environment of these texels, row 0 (straight down) first.
fn sky(width: u32, height: u32, texel: impl Fn(u32, u32) -> [f32; 3]) -> Environment {
    let rgb = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Environment { name: "sky".into(), width, height, rgb, rotation: 0.0, intensity: 1.0 }
}

/// A plate at y = 0 from (-5, -5) to (5, 5), called `plate`, facing up.
fn plate(material: Material) -> Scene {
    let mut scene = empty();
    add_quad(&mut scene, "plate", [-5.0, 0.0, 5.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], material);
    scene
}

/// What leaves points of `plate` toward directions, by `repeats` independent answers of direct light alone.
fn ask(scene: Scene, queries: &[([f32; 3], [f32; 3])], samples: u32, repeats: u32) -> Vec<Answer> {
    let scene = BakeScene::new(scene, Simd::Auto).unwrap();
    let query = |(position, direction): &([f32; 3], [f32; 3])| Query {
        surface: "plate".into(),
        position: Vec3::from_array(*position),
        direction: Vec3::from_array(*direction),
    };
    let queries: Vec<Query> = queries.iter().map(query).collect();
    let settings = settings(&format!(r#"{{"samples":{samples},"max_depth":2,"directions":"4x8"}}"#));
    evaluate(&scene, &queries, &settings, repeats).into_iter().map(Result::unwrap).collect()
}

/// The same, upward from one point.
fn upward(scene: Scene, position: [f32; 3]) -> Rgb {
    ask(scene, &[(position, [0.0, 1.0, 0.0])], 64, 2)[0].radiance
}
