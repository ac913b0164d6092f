//! What shows through, in pictures: holes, two blended panes one behind the other, clear glass whose tint, smoothness and reflection vary,
//! both sides of a leaf, smooth meshes. The page blends triangles by depth, the renderer follows each ray; both have it from the same
//! materials.
//!
//! The reference has 3 x 3 rays a pixel. Where they differ by more than [`STEEP`] levels lies an edge, which is counted and not compared;
//! anywhere else the page has a value that lies among theirs, give or take the levels of its filtering. There may be one edge for six
//! pixels that are compared, and of these one in a thousand may be off.

use super::{Look, SIZE, Scheme, compare_each, difference::compare_through};
use crate::{
    browser::GPUS,
    made::{back, ball, make_package, square},
};
use glam::Vec3;
use kiln_proto::{
    scene::{
        AlphaMode, Coding, LayerMode, Material, MetallicRoughness, NormalMap, Opacity, Reflection, Scene, Surface, Texture, TextureLayer,
        TextureRef, Wrap,
    },
    texel::Texel,
    units::Rgb,
};
use tempfile::TempDir;

/// What covers is decided beside the samples: two schemes are enough.
const SCHEMES: [Scheme; 2] = [("expanded", "hardware"), ("streamed", "exact")];
/// Levels within a pixel.
const STEEP: f32 = 6.0;

/// From before, along the panes so that they reflect, close to the glass ball, and from behind.
const LOOKS: [Look; 4] = [
    (Vec3::new(0.0, 0.5, 9.0), Vec3::ZERO),
    (Vec3::new(7.5, 0.4, 2.2), Vec3::new(0.0, 0.2, 0.0)),
    (Vec3::new(1.2, 2.6, 3.0), Vec3::new(0.8, 1.6, 0.0)),
    (Vec3::new(-1.0, 0.5, -7.0), Vec3::ZERO),
];

/// A square image of 4 x 4 texels.
fn image(name: &str, coding: Coding, texel: impl Fn(usize, usize) -> [u8; 4]) -> Texture {
    let texels = (0..16).flat_map(|i| texel(i % 4, i / 4)).collect();
    Texture { name: name.into(), width: 4, height: 4, coding, has_alpha: true, texels }
}

fn textures() -> Vec<Texture> {
    vec![
        image("wire", Coding::Srgb, |x, y| [255, 255, 255, if (x + y) % 2 == 0 { 255 } else { 0 }]),
        image("haze", Coding::Srgb, |x, y| [255, 255, 255, (40 + 12 * x + 30 * y) as u8]),
        image("stained", Coding::Srgb, |x, y| [(60 + 60 * x) as u8, (255 - 50 * y) as u8, 120, 255]),
        // Green: the left half smooth, the right rough; blue: half a metal above.
        image("etched", Coding::Linear, |x, y| [0, if x < 2 { 0 } else { 255 }, if y < 2 { 0 } else { 128 }, 255]),
        image("clarity", Coding::Linear, |x, _| [(255 - 40 * x) as u8, 0, 0, 255]),
        image("bumps", Coding::Linear, |x, y| [(100 + 50 * (x % 2)) as u8, (100 + 50 * (y % 2)) as u8, 240, 255]),
    ]
}

fn materials() -> Vec<Material> {
    let clamped = |texture: u32| TextureRef { wrap: [Wrap::Clamp; 2], ..TextureRef::plain(texture, 0) };
    let covering = |name: &str, mode, factor, texture| Material {
        opacity: Opacity { mode, factor, texture },
        ..Material::matt(name, Rgb::splat(0.5))
    };
    let glass = |name: &str, m: MetallicRoughness| Material::new(name, Reflection::MetallicRoughness(m));
    let clear = |colour| MetallicRoughness { transmission: 0.9, ..MetallicRoughness::plain(colour, 0.0, 0.0) };
    vec![
        Material::matt("grey", Rgb::splat(0.5)),
        covering("wire", AlphaMode::Mask { cutoff: 0.5 }, 1.0, Some(clamped(0))),
        covering("haze", AlphaMode::Blend, 0.8, Some(clamped(1))),
        covering("half", AlphaMode::Blend, 0.5, None),
        glass("amber", MetallicRoughness { specular: 0.5, ior: 1.8, ..clear(Rgb::new(0.9, 0.5, 0.1)) }),
        glass(
            "window",
            MetallicRoughness {
                layers: vec![TextureLayer { texture: clamped(2), mode: LayerMode::Modulate { scale: 1.0 } }],
                metallic: 1.0,
                roughness: 1.0,
                metallic_roughness_texture: Some(clamped(3)),
                transmission_texture: Some(clamped(4)),
                specular: 0.0,
                ..clear(Rgb::WHITE)
            },
        ),
        glass("bead", MetallicRoughness { specular_color: Rgb::new(1.0, 0.2, 0.2), ..clear(Rgb::new(0.4, 0.8, 1.0)) }),
        Material { normal_map: Some(NormalMap { texture: clamped(5), scale: 1.0 }), ..Material::matt("hammered", Rgb::splat(0.5)) },
    ]
}

/// A wall with a ball before it, and another one opposite; before them a fence, two panes one behind the other, an amber one, a window and
/// a leaf; above, a bead of glass.
fn scene() -> Scene {
    let mut scene = Scene { materials: materials(), textures: textures(), ..Scene::empty() };
    let s = &mut scene;
    let wall = square(s, "wall", 0, [0.0, 0.0, -2.0], 5.0);
    let hammered = ball(s, "hammered", 7, [-0.6, 0.3, -1.0], 0.7, 8);
    let fence = square(s, "fence", 1, [-2.4, 0.0, 0.0], 0.7);
    let haze = square(s, "haze", 2, [-0.8, 0.0, 0.4], 0.7);
    let half = square(s, "half", 3, [-0.6, 0.2, 0.0], 0.6);
    let amber = square(s, "amber", 4, [0.7, 0.0, 0.0], 0.7);
    let window = square(s, "window", 5, [2.2, 0.0, 0.0], 0.7);
    let leaf = square(s, "leaf", 0, [-2.2, 1.8, 0.0], 0.6);
    let leaf_back = back(&leaf, 7);
    let bead = ball(s, "bead", 6, [0.8, 1.7, 0.0], 0.7, 10);
    // Behind the viewer, and seen from behind.
    let opposite = square(s, "opposite", 0, [0.0, 0.0, 10.0], 8.0);
    let opposite = Surface { name: opposite.name.clone(), file_stem: opposite.file_stem.clone(), back_of: None, ..back(&opposite, 0) };
    scene.surfaces = vec![wall, hammered, fence, haze, half, amber, window, leaf, leaf_back, bead, opposite];
    scene
}

/// Bands over the wall, so that what is seen through glass shows where it is seen; some gloss elsewhere, which normals decide.
fn light(surface: &Surface, texel: &Texel, toward: Vec3) -> [f32; 3] {
    let gloss = (0..4).fold(1.0, |product: f32, _| product * toward.dot(Vec3::new(0.0, 0.6, 0.8)).max(0.0));
    let p = texel.position;
    match surface.name.as_str() {
        "wall" | "opposite" => [0.5 + 0.06 * p.x, 0.5 + 0.06 * p.y, 0.5 - 0.05 * p.x],
        "hammered" => [0.1 + 0.5 * gloss, 0.1 + 0.3 * texel.frame.normal.y.max(0.0), 0.3],
        "leaf" => [0.5, 0.5, 0.0],
        "leaf~back" => [0.0, 0.4 + 0.1 * p.x.abs(), 0.5],
        "half" => [0.6, 0.1, 0.1],
        "haze" => [0.8, 0.8, 0.9],
        _ => [0.02 + 0.2 * gloss, 0.03, 0.03 + 0.1 * toward.y.max(0.0)],
    }
}

fn compare_on(gpu: &str) {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("panes");
    make_package(&package, &scene(), "6x8", light);
    compare_each((gpu, &package), (&LOOKS, &SCHEMES), 3, |_, shot, expected| {
        let shown = compare_through(expected, &shot.radiance, STEEP, shot.allowed());
        let figures = format!(
            "largest {:.3}, mean {:.4}, {} off, {} compared, {} at edges",
            shown.max,
            shown.mean(),
            shown.off,
            shown.compared,
            shown.edges
        );
        let enough = (SIZE.0 * SIZE.1 / 4) as usize;
        (figures, shown.off * 1_000 <= shown.compared && shown.compared >= enough && shown.edges * 6 <= shown.compared)
    });
}

#[test]
fn page_and_reference_agree_on_what_shows_through_on_swiftshader() {
    compare_on(GPUS[0]);
}

#[test]
fn page_and_reference_agree_on_what_shows_through_on_llvmpipe() {
    compare_on(GPUS[1]);
}
