//! What a baked scene is beside light: masks with holes, glass, both sides, parts, lights of a draft, the environment, the author's
//! cameras, in the viewer.

use crate::{
    browser::{GPUS, Script},
    harness::View,
    made::{back, ball, make_package, square},
};
use glam::Vec3;
use kiln_proto::{
    scene::{
        AlphaMode, Camera, Coding, Environment, Lens, Light, LightShape, Material, MetallicRoughness, Opacity, Part, Reflection, Scene,
        Surface, Texture, TextureRef,
    },
    texel::Texel,
    units::Rgb,
};
use tempfile::TempDir;

const GREY: u32 = 0;
const FENCE: u32 = 1;
const GLASS: u32 = 2;
const PANE: u32 = 3;
const HALF: u32 = 4;

fn materials() -> Vec<Material> {
    let grey = |name: &str| Material::matt(name, Rgb::splat(0.5));
    let covering = |name: &str, mode, factor, texture| Material { opacity: Opacity { mode, factor, texture }, ..grey(name) };
    let checker = TextureRef { nearest: true, ..TextureRef::plain(0, 0) };
    let clear = MetallicRoughness { transmission: 0.8, ..MetallicRoughness::plain(Rgb::WHITE, 0.0, 0.0) };
    vec![
        grey("grey"),
        covering("wire", AlphaMode::Mask { cutoff: 0.5 }, 1.0, Some(checker)),
        covering("glass", AlphaMode::Blend, 0.25, None),
        Material::new("clear", Reflection::MetallicRoughness(clear)),
        covering("half", AlphaMode::Blend, 0.5, None),
    ]
}

/// A wall, and before it side by side a fence, glass, a thin pane, a leaf and a surface of two parts; above them a ball, and two panes one
/// behind the other, the nearer first in its surface; around them an environment that is another in each texel. `cover.mjs` knows where.
fn scene() -> Scene {
    let mut scene = Scene { materials: materials(), ..Scene::empty() };
    let alpha = [255, 0, 0, 255].iter().flat_map(|a| [255, 255, 255, *a]).collect();
    scene.textures = vec![Texture { name: "checker".into(), width: 2, height: 2, coding: Coding::Srgb, has_alpha: true, texels: alpha }];
    let wall = square(&mut scene, "wall", GREY, [0.0, 0.0, -1.0], 8.0);
    let fence = square(&mut scene, "fence", FENCE, [-4.0, 0.0, 0.0], 0.8);
    let glass = square(&mut scene, "glass", GLASS, [-2.0, 0.0, 0.0], 0.8);
    let pane = square(&mut scene, "pane", PANE, [0.0, 0.0, 0.0], 0.8);
    let leaf = square(&mut scene, "leaf", GREY, [2.0, 0.0, 0.0], 0.8);
    let mut atlas = square(&mut scene, "atlas", GREY, [4.0, 0.0, 0.0], 0.8);
    atlas.parts = vec![Part::plain("lower right", GREY, 1), Part::plain("upper left", GREY, 1)];
    let mut panes = square(&mut scene, "panes", HALF, [0.0, 3.0, 0.5], 0.8);
    let far = square(&mut scene, "far", HALF, [0.0, 3.0, 0.0], 0.8);
    panes.triangles.extend(far.triangles);
    panes.parts[0].triangles = 4;
    // The upper half of the texture is the far one's.
    let halves = panes.uv_sets[0].iter().map(|uv| uv.map(|c| c.map(|[u, v]| [u, 0.45 * v])));
    let upper = far.uv_sets[0].iter().map(|uv| uv.map(|c| c.map(|[u, v]| [u, 0.55 + 0.45 * v])));
    panes.uv_sets = vec![halves.chain(upper).collect()];
    let leaf_back = back(&leaf, 4);
    let ball = ball(&mut scene, "ball", GREY, [-3.0, 3.0, 0.0], 0.9, 8);
    scene.surfaces = vec![wall, fence, glass, pane, leaf, leaf_back, atlas, panes, ball];
    scene.lights = vec![Light::new("bulb", LightShape::Point { position: [0.0, 0.0, 1.0] }, Rgb::splat(20.0))];
    let camera = |name: &str, z: f32| {
        let lens = Lens::Perspective { fov: std::f32::consts::FRAC_PI_4, of_smaller: false };
        Camera { name: name.into(), eye: [0.0, 0.0, z], forward: [0.0, 0.0, -z.signum()], up: [0.0, 1.0, 0.0], lens }
    };
    let texel = |k: usize| [(k % 8 + 1) as f32 / 32.0, (k / 8 + 1) as f32 / 16.0, (k % 8 * (k / 8) % 5) as f32 / 20.0];
    scene.environment = Some(Environment {
        name: "sky.hdr".into(),
        width: 8,
        height: 4,
        rgb: (0..32).map(texel).collect(),
        rotation: 0.3 + 8.0 * std::f32::consts::PI,
        intensity: 2.0,
    });
    scene.cameras = vec![camera("front", 12.0), camera("from behind", -12.0)];
    scene
}

/// One colour a surface but for the ball; of the two panes, the nearer is red and the other green.
fn light(surface: &Surface, texel: &Texel, toward: Vec3) -> [f32; 3] {
    let gloss = (0..4).fold(1.0, |product: f32, _| product * toward.dot(Vec3::new(0.0, 0.6, 0.8)).max(0.0));
    match surface.name.as_str() {
        "wall" => [0.6, 0.1, 0.1],
        "fence" => [0.1, 0.6, 0.1],
        "glass" => [0.1, 0.1, 0.6],
        "pane" => [0.1, 0.1, 0.1],
        "leaf" => [0.5, 0.5, 0.0],
        "leaf~back" => [0.0, 0.5, 0.5],
        "panes" if texel.position.z > 0.25 => [0.8, 0.0, 0.0],
        "panes" => [0.0, 0.8, 0.0],
        "ball" => [0.1 + 0.4 * gloss, 0.1 + 0.3 * texel.frame.normal.y.max(0.0), 0.3],
        _ => [0.2, 0.2, 0.2],
    }
}

fn look_on(gpu: &str) {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("garden");
    make_package(&package, &scene(), "4x6", light);
    Script::start("cover.mjs", [&View::start(&package).url, gpu]).finish();
}

#[test]
fn page_shows_what_lies_behind_on_swiftshader() {
    look_on(GPUS[0]);
}

#[test]
fn page_shows_what_lies_behind_on_llvmpipe() {
    look_on(GPUS[1]);
}
