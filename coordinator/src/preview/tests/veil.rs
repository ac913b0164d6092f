//! What is seen through: holes, blended layers in their order, clear glass, both sides of one thing.

use super::*;
use kiln_proto::{
    format::stream::Trust,
    scene::{AlphaMode, Coding, MetallicRoughness, Opacity, Reflection, Texture, TextureRef},
};

const SHEET: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];

/// Sheets of 2 m x 2 m one behind the other, facing +z, the first nearest to an eye there.
fn sheets(count: usize) -> Scene {
    let quads: Vec<_> = (0..count).map(|k| SHEET.map(|[x, y, _]| [x, y, -(k as f32)])).collect();
    let mut scene = scene_of(&quads, 1.0);
    scene.materials = (0..count).map(|k| Material::matt(format!("m{k}"), Rgb::splat(0.5))).collect();
    scene.surfaces.iter_mut().enumerate().for_each(|(k, s)| s.parts[0].material = k as u32);
    scene
}

fn opacity(mode: AlphaMode, factor: f32) -> Opacity {
    Opacity { mode, factor, texture: None }
}

/// What a ray from (x, y, 5) straight ahead finds; `(x, y)` by default the middle of a texel.
fn pixel(scene: &Scene, at: [f32; 2], toward: f32) -> Pixel {
    let plan = plan_of(scene, "4x4", "2x2");
    let files = files_of(scene, &plan, |_, _| true);
    let camera = camera_at([at[0], at[1], 5.0 * toward], [at[0], at[1], 0.0], size(1, 1));
    let mut light = Light::new(&files, scene, &plan, Origin::Codec, Trust::Checksum);
    render(scene, &plan, &mut light, &camera, Mode::LightField).unwrap().pixels()[0]
}

const AT: [f32; 2] = [0.25, 0.25];

/// The light of sheet `k` alone.
fn alone(scene: &Scene, k: usize) -> Rgb {
    let mut only = scene.clone();
    only.materials.iter_mut().enumerate().for_each(|(m, material)| {
        material.opacity = if m == k { Opacity::OPAQUE } else { opacity(AlphaMode::Blend, 0.0) };
        material.reflection = Reflection::None;
    });
    pixel(&only, AT, 1.0).radiance
}

fn near(a: Rgb, b: Rgb) -> bool {
    a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn blended_layers_lie_over_each_other_from_the_nearest_to_the_background() {
    let mut scene = sheets(3);
    let light: Vec<Rgb> = (0..3).map(|k| alone(&scene, k)).collect();
    assert!(light[0] != light[1] && light[1] != light[2]);
    scene.materials[0].opacity = opacity(AlphaMode::Blend, 0.25);
    scene.materials[1].opacity = opacity(AlphaMode::Blend, 0.5);
    let found = pixel(&scene, AT, 1.0);
    assert!(near(found.radiance, light[0] * 0.25 + light[1] * (0.75 * 0.5) + light[2] * (0.75 * 0.5)), "{found:?}");
    assert_eq!((found.chart, found.found, found.background), (1, true, Rgb::BLACK));
    scene.materials[2].opacity = opacity(AlphaMode::Blend, 0.0);
    let found = pixel(&scene, AT, 1.0);
    assert!(near(found.background, Rgb::splat(0.375)), "{found:?}");
    assert!(near(found.radiance, light[0] * 0.25 + light[1] * 0.375 + BACKGROUND * 0.375), "{found:?}");
    assert_eq!(pixel(&scene, AT, -1.0), Pixel { radiance: BACKGROUND, background: Rgb::WHITE, chart: 0, found: false }, "no backs");
    let rgb = vec![[3.0, 2.0, 1.0]];
    scene.environment = Some(Environment { name: "sky".into(), width: 1, height: 1, rgb, rotation: 0.0, intensity: 0.5 });
    let found = pixel(&scene, AT, 1.0);
    assert!(near(found.radiance, light[0] * 0.25 + (light[1] + Rgb::new(1.5, 1.0, 0.5)) * 0.375), "{found:?}");
    assert_eq!(found.background, Rgb::BLACK);
}

#[test]
fn masks_have_holes_and_clear_glass_colours_what_lies_behind() {
    let mut scene = sheets(2);
    let light: Vec<Rgb> = (0..2).map(|k| alone(&scene, k)).collect();
    // Left half of the texture clear, right half opaque.
    let texels = [[0u8, 0, 0, 0], [0, 0, 0, 255]].concat();
    scene.textures.push(Texture { name: "a".into(), width: 2, height: 1, coding: Coding::Linear, has_alpha: true, texels });
    let texture = TextureRef { nearest: true, ..TextureRef::plain(0, 0) };
    scene.materials[0].opacity = Opacity { mode: AlphaMode::Mask { cutoff: 0.5 }, factor: 1.0, texture: Some(texture) };
    let (hole, sheet) = (pixel(&scene, [-0.25, 0.25], 1.0), pixel(&scene, AT, 1.0));
    assert_eq!((hole.chart, sheet.chart), (2, 1));
    assert!(near(sheet.radiance, light[0]));
    scene.materials[0].opacity = Opacity::OPAQUE;
    let glass = MetallicRoughness { transmission: 1.0, ..MetallicRoughness::plain(Rgb::new(1.0, 0.5, 0.0), 0.0, 0.0) };
    scene.materials[0].reflection = Reflection::MetallicRoughness(glass);
    let found = pixel(&scene, AT, 1.0);
    assert!(near(found.radiance, light[0] + light[1] * Rgb::new(0.96, 0.48, 0.0)), "{found:?}");
}

#[test]
fn however_many_layers_there_are_each_is_seen() {
    let mut scene = sheets(40);
    scene.materials.iter_mut().for_each(|m| m.opacity = opacity(AlphaMode::Blend, 0.125));
    let found = pixel(&scene, AT, 1.0);
    assert!((found.background.r / kiln_proto::math::pow(0.875, 40.0) - 1.0).abs() < 1e-4, "{found:?}");
    assert!(found.found && found.chart == 1);
    // Behind the last that is followed there is no sky.
    let mut scene = sheets(1_030);
    scene.materials.iter_mut().for_each(|m| m.opacity = opacity(AlphaMode::Blend, 1.0 / 1_024.0));
    let found = pixel(&scene, AT, 1.0);
    assert!(!found.found && found.background == Rgb::BLACK, "{found:?}");
    // A hundred halves leave nothing: neither the opaque sheet behind them nor a sky is looked for.
    let mut scene = sheets(101);
    scene.materials[..100].iter_mut().for_each(|m| m.opacity = opacity(AlphaMode::Blend, 0.5));
    let found = pixel(&scene, AT, 1.0);
    assert!(found.found && found.background == Rgb::BLACK, "{found:?}");
    let mut scene = sheets(40);
    scene.materials.iter_mut().for_each(|m| m.opacity = opacity(AlphaMode::Blend, 0.5));
    let found = pixel(&scene, AT, 1.0);
    assert!(found.background.r > 0.0, "2^-40 is seen: {found:?}");
    // What is behind sixteen of them, the last of one go, and what ends there.
    for count in [16, 17, 32] {
        let mut scene = sheets(count);
        scene.materials[..count - 1].iter_mut().for_each(|m| m.opacity = opacity(AlphaMode::Blend, 0.0625));
        let light = alone(&scene, count - 1);
        let found = pixel(&scene, AT, 1.0);
        assert_eq!(found.background, Rgb::BLACK);
        let (own, through) = (0.0625, 0.9375f32);
        let expected =
            (0..count).map(|k| if k + 1 == count { light } else { alone(&scene, k) * own } * kiln_proto::math::pow(through, k as f32));
        assert!(near(found.radiance, expected.fold(Rgb::BLACK, |sum, l| sum + l)), "{count}: {found:?}");
    }
}

#[test]
fn what_has_two_sides_shows_the_one_that_faces_the_eye() {
    let mut scene = sheets(1);
    let mut back = scene.surfaces[0].clone();
    (back.name, back.file_stem, back.back_of) = ("s0~back".into(), "s0-back".into(), Some(0));
    back.triangles.iter_mut().for_each(|t| t.corners.swap(1, 2));
    back.uv_sets[0].iter_mut().flatten().for_each(|uv| {
        uv.swap(1, 2);
        uv.iter_mut().for_each(|c| c[0] = 1.0 - c[0]);
    });
    scene.surfaces.push(back);
    scene.validate().unwrap();
    let (front, back) = (pixel(&scene, AT, 1.0), pixel(&scene, AT, -1.0));
    assert_eq!((front.chart, back.chart), (1, 2));
    assert!(front.found && back.found && front.radiance != back.radiance);
}
