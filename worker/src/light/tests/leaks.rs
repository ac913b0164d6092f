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
    frame::FrameRule,
    scene::{LightShape, Material, Scene},
    texel::SurfaceRaster,
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

/// A room of side 1 between six boards of this thickness, each of which stands out beyond its neighbours. Surface 6 k is the inside of
/// board k.
fn boards(thick: f32, out: f32) -> Scene {
    let mut scene = crate::testing::empty();
    let walls = closed_box(1.0, &grey());
    for (k, wall) in walls.surfaces.iter().enumerate() {
        let c = |t: usize, i: usize| Vec3::from_array(walls.positions[wall.triangles[t].corners[i] as usize]);
        let (u, v) = (c(0, 1) - c(0, 0), c(1, 2) - c(0, 0));
        let (inside, away) = (c(0, 0) - (u + v) * (thick + out), u.cross(v) * -thick);
        let (u, v) = (u * (1.0 + 2.0 * (thick + out)), v * (1.0 + 2.0 * (thick + out)));
        let faces =
            [(inside, u, v), (inside + away, v, u), (inside, away, u), (inside, v, away), (inside + v, u, away), (inside + u, away, v)];
        for (i, (corner, u, v)) in faces.into_iter().enumerate() {
            add_quad(&mut scene, &format!("board{k} {i}"), corner.to_array(), u.to_array(), v.to_array(), grey());
        }
    }
    scene
}

/// What is seen inside is filtered from texels up to one beyond the edge: those within the walls show the light of the side they are nearer
/// to.
#[test]
fn boards_that_run_through_each_other_are_black_inside_where_they_are_two_texels_thick() {
    for out in [0.05, 0.0725, 0.13] {
        let mut scene = boards(0.1, out);
        scene.environment = Some(sky(8, 4, |_, _| [1e6; 3]));
        let side = ((1.2 + 2.0 * out) / 0.05) as u32;
        let sizes: Vec<String> = (0..6).map(|k| format!(r#""board{k} 0":"{side}x{side}""#)).collect();
        let json = format!(r#"{{"samples":64,"max_depth":3,"directions":"2x2","texture_sizes":{{{}}}}}"#, sizes.join(","));
        let plan = plan(&scene, &settings(&json));
        let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(plan)).unwrap();
        let (mut within, mut beyond) = (0, 0);
        for surface in (0..36).step_by(6) {
            let planned = &capture.plan().surfaces[surface];
            let raster =
                SurfaceRaster::new(capture.scene().scene(), &capture.scene().scene().surfaces[surface], planned, FrameRule::Texture);
            let texel = (1.2 + 2.0 * out) / side as f32;
            let tile = capture.bake_tile(capture.plan().first_tile(surface)).unwrap();
            for (row, light) in tile.rows.iter().zip(tile.radiance.chunks(4 * 3)) {
                let Some(place) = raster.texel(row.x, row.y).map(|t| raster.centre(&t).position) else { continue };
                if place.cmpge(Vec3::splat(-texel)).all() && place.cmple(Vec3::splat(1.0 + texel)).all() {
                    within += 1;
                    assert!(light.iter().all(|l| *l == 0.0), "standing out by {out}: board {surface} has {light:?} at {place}");
                } else {
                    beyond += usize::from(light.iter().any(|l| *l > 0.0));
                }
            }
        }
        assert!(within > 6 * 400 && beyond > 6 * 40, "{within} texels inside, {beyond} lit ones outside");
    }
}
