//! `--environment` as its users meet it: an HDR through `kiln bake` and an OpenEXR through the service, held against a sum over the sky
//! that knows nothing of the program, and seen behind the scene by `kiln render`.

use crate::harness::{Server, runtime, succeed};
use glam::DVec3;
use kiln_proto::math;
use serde_json::Value;
use std::{f64::consts::PI, path::Path};
use tempfile::TempDir;

const WIDTH: usize = 8;
const HEIGHT: usize = 4;
/// Degrees about +Y, and the factor.
const ROTATION: f64 = 60.0;
const INTENSITY: f64 = 1.5;
const OPTIONS: [(&str, &str); 2] = [("environment-rotation", "60"), ("environment-intensity", "1.5")];

/// A floor that faces +Y and a wall that faces +X, neither of which sees the other; without materials they reflect a half, diffusely.
const SCENE: &str =
    "o floor\nv -2 0 1\nv -1 0 1\nv -1 0 0\nv -2 0 0\nf 1 2 3 4\no wall\nv 0 -2 1\nv 0 -2 0\nv 0 -1 0\nv 0 -1 1\nf 5 6 7 8\n";

/// The sky's pixels, from the top row down: no two alike, and all of them numbers that RGBE holds exactly.
fn pixel(column: usize, row: usize) -> [f32; 3] {
    [(1 + (column * 5 + row) % 8) as f32 / 8.0, (1 + row) as f32 / 4.0, (1 + (column + 3 * row) % 4) as f32 / 2.0]
}

fn hdr() -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n").into_bytes();
    for (column, row) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (column, row))) {
        // An exponent of 130 makes the bytes 64ths.
        bytes.extend(pixel(column, row).map(|v| (v * 64.0) as u8));
        bytes.push(130);
    }
    bytes
}

fn exr(path: &Path) {
    exr::prelude::write_rgb_file(path, WIDTH, HEIGHT, |x, y| {
        let [r, g, b] = pixel(x, y);
        (r, g, b)
    })
    .unwrap();
}

/// Radiance of the turned sky: bilinear between the centres of its pixels, around in longitude, constant beyond the outermost rows.
fn sky(direction: DVec3) -> DVec3 {
    // Turning the sky by an angle is turning the direction back by it: +X comes from where +Z was.
    let (sin, cos) = math::sin_cos_degrees(ROTATION);
    let (x, z) = (direction.x * cos - direction.z * sin, direction.x * sin + direction.z * cos);
    let across = (0.5 + math::atan2(z, x) / (2.0 * PI)) * WIDTH as f64 - 0.5;
    let down = ((0.5 - math::atan2(direction.y, (x * x + z * z).sqrt()) / PI) * HEIGHT as f64 - 0.5).clamp(0.0, (HEIGHT - 1) as f64);
    let at = |dx: f64, dy: f64| {
        let column = (across.floor() + dx).rem_euclid(WIDTH as f64) as usize;
        let row = (down.floor() + dy).min((HEIGHT - 1) as f64) as usize;
        let [r, g, b] = pixel(column, row);
        DVec3::new(f64::from(r), f64::from(g), f64::from(b))
    };
    let (fx, fy) = (across - across.floor(), down - down.floor());
    let line = |dy: f64| at(0.0, dy) * (1.0 - fx) + at(1.0, dy) * fx;
    (line(0.0) * (1.0 - fy) + line(1.0) * fy) * INTENSITY
}

/// What a surface that reflects a half diffusely sends out beneath the sky: a half over pi times the sum of light times cosine.
fn reflected(normal: DVec3) -> DVec3 {
    const BANDS: u32 = 180;
    let mut sum = DVec3::ZERO;
    for (i, j) in (0..BANDS).flat_map(|i| (0..2 * BANDS).map(move |j| (i, j))) {
        let step = 180.0 / f64::from(BANDS);
        let ((up, out), (sin, cos)) =
            (math::sin_cos_degrees((f64::from(i) + 0.5) * step - 90.0), math::sin_cos_degrees((f64::from(j) + 0.5) * step));
        let direction = DVec3::new(cos * out, up, sin * out);
        let angle = step.to_radians();
        sum += sky(direction) * (direction.dot(normal).max(0.0) * out * angle * angle);
    }
    sum * (0.5 / PI)
}

/// The mean over texels and directions of a surface's kept radiance.
fn mean(package: &str, surface: &str) -> DVec3 {
    let csv = succeed(["decode", package, "--out", "-", "--from", "raw", "--surface", surface]);
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let rows: Vec<DVec3> =
        reader.records().map(|row| DVec3::from_array(std::array::from_fn(|c| row.as_ref().unwrap()[14 + c].parse().unwrap()))).collect();
    assert!(rows.len() > 100, "{}", rows.len());
    rows.iter().sum::<DVec3>() / rows.len() as f64
}

fn assert_lit_by_the_sky(package: &str) {
    for (surface, normal) in [("floor", DVec3::Y), ("wall", DVec3::X)] {
        let (found, expected) = (mean(package, surface), reflected(normal));
        assert!(((found - expected) / expected).abs().max_element() < 0.01, "{surface}: {found} is not {expected}");
    }
    // The two tell every mistake about up, right and the turn.
    assert!((reflected(DVec3::Y) - reflected(DVec3::X)).abs().max_element() > 0.1);
}

#[test]
fn an_hdr_lights_a_bake_and_lies_behind_its_pictures() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    std::fs::write(path("scene.obj"), SCENE).unwrap();
    std::fs::write(path("sky.hdr"), hdr()).unwrap();
    let mut args = ["bake", &path("scene.obj"), "-o", &path("package"), "--environment", &path("sky.hdr")].map(str::to_owned).to_vec();
    args.extend(OPTIONS.iter().flat_map(|(name, value)| [format!("--{name}"), (*value).to_owned()]));
    args.extend(["--samples", "64", "--directions", "2x4", "--texels-per-metre", "8", "--raw", "f32"].map(str::to_owned));
    succeed(args);
    let package = path("package");
    assert_lit_by_the_sky(&package);

    let manifest: Value = serde_json::from_slice(&std::fs::read(dir.path().join("package/manifest.json")).unwrap()).unwrap();
    let factor = math::exp2(manifest["exposure"]["stops"].as_f64().unwrap() as f32);
    let look = |target: [f64; 3], more: &[&str]| {
        let [x, y, z] = target;
        let (png, target) = (path("view.png"), format!("{x},{y},{z}"));
        let view = ["render", &package, "-o", &png, "--eye", "9,9,9", "--target", &target, "--size", "1x1", "--fov", "1"];
        succeed(view.iter().chain(more));
        image::open(&png).unwrap().to_rgb8().get_pixel(0, 0).0
    };
    // Past the scene, toward four sides and up: one degree of the sky in one pixel.
    for target in [[12.0, 9.5, 9.0], [9.0, 8.0, 14.0], [9.0, 9.0, 5.0], [10.0, 12.0, 9.0]] {
        let light = sky((DVec3::from_array(target) - 9.0).normalize());
        let expected = light.to_array().map(|v| kiln_proto::units::radiance_to_byte(v as f32, factor));
        let found = look(target, &[]);
        assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1), "{target:?}: {found:?} is not {expected:?}");
        assert_eq!(look(target, &["--hide-environment"]), [0x20, 0x24, 0x28]);
    }
}

#[test]
fn an_exr_of_an_upload_lights_a_job() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let _worker = server.worker(&[]);
    exr(&dir.path().join("sky.exr"));
    let sky = std::fs::read(dir.path().join("sky.exr")).unwrap();
    let query = OPTIONS.map(|(name, value)| format!("&{}={value}", name.replace('-', "_"))).concat();
    let job = runtime().block_on(async {
        let file = |name: &'static str, bytes: Vec<u8>| reqwest::multipart::Part::bytes(bytes).file_name(name);
        let form = reqwest::multipart::Form::new()
            .part("file", file("scene.obj", SCENE.as_bytes().to_vec()))
            .part("file", file("sky.exr", sky))
            .text("settings", r#"{"samples": 64, "directions": "2x4", "texels_per_metre": 8, "raw": "f32"}"#);
        let url = format!("{}/v1/bakes?environment=sky.exr{query}", server.url);
        let reply = reqwest::Client::new().post(url).multipart(form).send().await.unwrap();
        assert_eq!(reply.status(), 201);
        let bake: Value = reply.json().await.unwrap();
        bake["job"]["id"].as_str().unwrap().to_owned()
    });
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_lit_by_the_sky(package.to_str().unwrap());
}
