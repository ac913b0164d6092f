//! The page against the reference: look-ups and pictures, for each scheme, on both software GPUs.
//!
//! *Look-ups*: the shader says for every pixel what it looks up (texture coordinate, direction) and what it finds; the Rust decoder looks
//! up the same. No pixel is left out. *Pictures*: the page's radiance against `kiln render`'s own ray casting. Pixels where the two see
//! different charts are edges, where a triangle's border falls between two roundings; they are counted, and are few. llvmpipe places what
//! it draws to 1/256 of a pixel, so that its pictures are held to the same bounds. SwiftShader snaps corners to 1/16, and noise is not the
//! same a sixteenth of a pixel further: there, a pixel must have a value that the reference has somewhere within it, give or take a level;
//! one in a thousand may not, where many texels fall into a pixel.
//!
//! Differences are in levels of 1/255 as displayed. On a failure the figures of all schemes are in the message.

mod covers;
mod difference;
mod reference;

use self::{
    difference::{Expected, compare_pictures, floats},
    reference::Reference,
};
use crate::{
    browser::{GPUS, Script},
    harness::{View, bake_room},
    made::{ball, make_package, square},
};
use glam::Vec3;
use kiln_coordinator::preview::Origin;
use kiln_proto::{
    scene::{Material, Scene},
    units::Rgb,
};
use std::{collections::BTreeMap, path::Path};
use tempfile::TempDir;

const SIZE: (u32, u32) = (320, 240);

/// Eye and target.
type Look = (Vec3, Vec3);

/// From outside, along the walls, at grazing angles, and close to the glossy floor.
const ROOM: [Look; 5] = [
    (Vec3::new(16.3, 17.2, 16.3), Vec3::new(5.0, 3.7, 5.0)),
    (Vec3::new(9.0, 3.0, 9.0), Vec3::new(2.0, 1.5, 2.0)),
    (Vec3::new(5.0, 0.4, 9.5), Vec3::new(5.0, 0.0, 2.0)),
    (Vec3::new(1.5, 1.2, 8.0), Vec3::new(8.0, 2.0, 1.0)),
    (Vec3::new(0.3, 4.0, 9.0), Vec3::new(3.0, 1.0, 0.5)),
];
/// A ball from three sides, and so near that its facets fill the view.
const BALL: [Look; 4] = [
    (Vec3::new(0.5, 1.0, 4.0), Vec3::ZERO),
    (Vec3::new(-3.0, -0.5, 0.2), Vec3::ZERO),
    (Vec3::new(0.3, 3.5, -0.4), Vec3::ZERO),
    (Vec3::new(0.9, 0.9, 0.9), Vec3::new(0.2, 0.1, 0.6)),
];
const FOV: f32 = 45.0;

/// How samples lie on the GPU, and what interpolates between texels.
type Scheme = (&'static str, &'static str);

const SCHEMES: [Scheme; 5] =
    [("raw", "exact"), ("raw", "hardware"), ("expanded", "exact"), ("expanded", "hardware"), ("streamed", "exact")];

/// Bakes the room and compares it.
fn compare_room(gpu: &str, raw: &str, within: u32) {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("room");
    bake_room(&package, &["--directions", "20x20", "--raw", raw]);
    compare_on(gpu, &package, &ROOM, within);
}

/// What the page drew of one view with one scheme.
struct Shot {
    scheme: String,
    filter: String,
    camera: usize,
    radiance: Vec<[f32; 4]>,
    lookup: Vec<[f32; 4]>,
}

impl Shot {
    fn origin(&self) -> Origin {
        if self.scheme == "raw" { Origin::Raw } else { Origin::Codec }
    }

    /// Levels that it may be off by: GPUs interpolate texels with few bits.
    fn allowed(&self) -> f32 {
        if self.filter == "exact" { 1.0 } else { 2.0 }
    }
}

/// Draws all views of a package on `gpu` with each scheme.
fn shoot(gpu: &str, package: &Path, looks: &[Look], schemes: &[Scheme]) -> Vec<Shot> {
    let dir = TempDir::new().unwrap();
    let out = dir.path();
    let view = View::start(package);
    let camera = |(eye, target): &Look| serde_json::json!({"eye": eye.to_array(), "target": target.to_array(), "fov": FOV});
    let cameras = serde_json::Value::from(looks.iter().map(camera).collect::<Vec<_>>()).to_string();
    let (width, height) = (SIZE.0.to_string(), SIZE.1.to_string());
    let script = Script::start(
        "parity.mjs",
        [&view.url, gpu, out.to_str().unwrap(), &width, &height, &cameras, &serde_json::to_string(schemes).unwrap()],
    );
    let mut shots = vec![];
    for said in script.finish() {
        println!("{gpu} {said}");
        let word = |name: &str| said[name].as_str().unwrap().to_owned();
        let (scheme, filter) = (word("scheme"), word("filter"));
        shots.extend((0..looks.len()).map(|camera| {
            let file = |what: &str| floats(&out.join(format!("{scheme}-{filter}-{camera}.{what}")));
            Shot { scheme: scheme.clone(), filter: filter.clone(), camera, radiance: file("radiance"), lookup: file("lookup") }
        }));
    }
    assert_eq!(shots.len(), schemes.len() * looks.len());
    shots
}

/// Draws all views of a package on `gpu` with each scheme, beside the renderer's pictures with `within` x `within` rays a pixel. `judge`
/// tells the figures of a shot, and whether they are good enough.
fn compare_each(
    (gpu, package): (&str, &Path),
    (looks, schemes): (&[Look], &[Scheme]),
    within: u32,
    judge: impl Fn(&Reference, &Shot, &[Expected]) -> (String, bool),
) {
    let reference = Reference::open(package);
    let (mut report, mut good, mut pictures) = (String::new(), true, BTreeMap::new());
    for shot in shoot(gpu, package, looks, schemes) {
        let origin = shot.origin();
        let picture = || reference.picture(package, origin, looks[shot.camera], within);
        let (figures, is_good) = judge(&reference, &shot, pictures.entry((origin == Origin::Raw, shot.camera)).or_insert_with(picture));
        let line = format!("{gpu} {} {} camera {}: {figures}\n", shot.scheme, shot.filter, shot.camera);
        print!("{line}");
        report += &line;
        good &= is_good;
    }
    assert!(good, "{report}");
}

/// Look-ups and pictures of what covers all: at most one level with exact filtering, two where the GPU filters. `within` is one where the
/// GPU places exactly what it draws.
fn compare_on(gpu: &str, package: &Path, looks: &[Look], within: u32) {
    compare_each((gpu, package), (looks, &SCHEMES), within, |reference, shot, expected| {
        let found = reference.compare_lookups(shot.origin(), &shot.radiance, &shot.lookup);
        let shown = compare_pictures(expected, &shot.radiance);
        let figures = format!(
            "look-ups: {} pixels, largest difference {:.3}, mean {:.4}; \
             picture: largest {:.3}, mean {:.4}, {} off by more than one, {} of {} pixels at edges",
            found.compared,
            found.max,
            found.mean(),
            shown.max,
            shown.mean(),
            shown.off,
            shown.edges,
            shown.edges + shown.compared
        );
        let is_found = found.max <= shot.allowed() && found.compared >= (SIZE.0 * SIZE.1 / 8) as usize;
        // Where a pixel holds many texels, several rays do not find all that it may show.
        let is_shown = if within == 1 { shown.max <= shot.allowed() } else { shown.off * 1_000 <= shown.compared };
        // Of all pixels few are edges: more where any of several rays makes one.
        let are_few = shown.edges * 50 <= (shown.edges + shown.compared) * within as usize;
        (figures, is_found && is_shown && are_few)
    });
}

#[test]
fn page_and_reference_agree_on_swiftshader() {
    compare_room(GPUS[0], "u8", 5);
}

#[test]
fn page_and_reference_agree_on_llvmpipe() {
    compare_room(GPUS[1], "u8", 1);
}

#[test]
fn page_and_reference_agree_on_linear_raw_radiance() {
    compare_room(GPUS[1], "f32", 1);
}

/// Normals and tangents are interpolated in the shader as in the reference: highlights of a coarse ball show any difference.
#[test]
fn page_and_reference_agree_on_smooth_surfaces() {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("ball");
    let mut scene = Scene { materials: vec![Material::matt("gloss", Rgb::splat(0.5))], ..Scene::empty() };
    let (ball, wall) = (ball(&mut scene, "ball", 0, [0.0; 3], 1.0, 6), square(&mut scene, "wall", 0, [0.0, 0.0, -1.5], 2.0));
    scene.surfaces = vec![ball, wall];
    make_package(&package, &scene, "20x20", |_, texel, toward| {
        let gloss = (0..4).fold(1.0, |product: f32, _| product * toward.dot(Vec3::new(0.6, 0.64, 0.48)).max(0.0));
        [0.05 + gloss, 0.2 + 0.5 * texel.frame.normal.y, 0.4 + 0.3 * toward.x].map(|v| v.clamp(0.0, 1.0))
    });
    compare_on(GPUS[1], &package, &BALL, 1);
}
