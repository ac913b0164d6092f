//! A sealed box in bright light is exactly dark inside, however its walls are built.

use super::{light, sky};
use crate::{
    capture::Capture,
    scene::BakeScene,
    simd::Simd,
    testing::{add_quad, closed_box, lambert, plan, settings},
};
use glam::{Quat, Vec3};
use kiln_proto::{
    scene::{LightShape, Material, Scene},
    tile::TileIndex,
};
use std::sync::Arc;

fn grey() -> Material {
    lambert(0.7, 0.0)
}

/// The same box seen from outside: a shell of this size about the unit cube's middle.
fn shell(scene: &mut Scene, grow: f32) {
    let inside = closed_box(1.0 + 2.0 * grow, &grey());
    for (k, surface) in inside.surfaces.iter().enumerate() {
        let c = |i: usize| inside.positions[surface.triangles[0].corners[i] as usize].map(|v| v - grow);
        let (a, b, d) = (c(0), c(1), inside.positions[surface.triangles[1].corners[2] as usize].map(|v| v - grow));
        let edge = |to: [f32; 3]| std::array::from_fn(|i| to[i] - a[i]);
        add_quad(scene, &format!("outside{k}"), a, edge(d), edge(b), grey());
    }
}

fn thin() -> Scene {
    closed_box(1.0, &grey())
}

fn thick() -> Scene {
    let mut scene = thin();
    shell(&mut scene, 0.1);
    scene
}

fn two_sided() -> Scene {
    let mut scene = thin();
    shell(&mut scene, 0.0);
    scene
}

/// Walls of four pieces each, whose edges meet those of their neighbours and share no vertex with them.
fn pieces() -> Scene {
    let mut scene = crate::testing::empty();
    let walls = closed_box(1.0, &grey());
    for (k, surface) in walls.surfaces.iter().enumerate() {
        let c = |t: usize, i: usize| Vec3::from_array(walls.positions[surface.triangles[t].corners[i] as usize]);
        let (a, u, v) = (c(0, 0), (c(0, 1) - c(0, 0)) * 0.5, (c(1, 2) - c(0, 0)) * 0.5);
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            add_quad(&mut scene, &format!("wall{k} {i} {j}"), (a + u * i + v * j).to_array(), u.to_array(), v.to_array(), grey());
        }
    }
    scene
}

fn turned(mut scene: Scene, angle: f32, scale: f32) -> Scene {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, 0.8, 0.5).normalize(), angle);
    for p in &mut scene.positions {
        *p = (turn * (Vec3::from_array(*p) - 0.5) * scale + Vec3::new(3.0, 1.0, -2.0) * scale).to_array();
    }
    scene
}

#[test]
fn inside_is_exactly_black_whatever_the_walls_and_the_angle() {
    type Build = fn() -> Scene;
    let walls: [(&str, Build); 4] = [("thin", thin), ("thick", thick), ("two-sided", two_sided), ("pieces", pieces)];
    for (name, build) in walls {
        for (angle, scale) in [(0.0, 1.0), (0.37, 1.0), (1.234, 1e-3), (2.71, 1e3)] {
            let mut scene = turned(build(), angle, scale);
            scene.environment = Some(sky(8, 4, |_, _| [1e6; 3]));
            scene.lights = vec![light(LightShape::Directional { direction: [0.48, -0.8, 0.36] })];
            scene.lights[0].intensity = kiln_proto::units::Rgb::splat(1e6);
            let inner = scene.surfaces.iter().position(|s| s.name.starts_with("outside")).unwrap_or(scene.surfaces.len());
            let plan = plan(&scene, &settings(r#"{"samples":64,"max_depth":5,"directions":"2x2"}"#));
            let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(plan)).unwrap();
            for surface in 0..inner {
                let light = capture.bake_tile(capture.plan().first_tile(surface)).unwrap().radiance;
                assert!(
                    light.iter().all(|l| *l == 0.0),
                    "{name}, turned by {angle}, times {scale}: wall {surface} has {:?}",
                    light.iter().copied().fold(0.0, f32::max)
                );
            }
            if inner < capture.plan().surfaces.len() {
                let outside = capture.bake_tile(TileIndex(capture.plan().first_tile(inner).0)).unwrap().radiance;
                assert!(outside.iter().all(|l| *l > 0.0), "{name}: the outside is lit");
            }
        }
    }
}
