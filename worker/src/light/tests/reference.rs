//! Lights without area and the environment in a room with an occluder, against Mitsuba (see `tests/reference/README.md`).

use super::{light, sky};
use crate::{
    eval::{Query, evaluate},
    scene::BakeScene,
    simd::Simd,
    testing::{load, settings, test_file},
};
use glam::Vec3;
use kiln_proto::{
    math,
    scene::{Environment, Light, LightShape, Scene, SpotProfile},
    units::Rgb,
};
use std::collections::BTreeMap;

struct Row {
    query: Query,
    /// Radiance and standard error at depth 2, then at depth 5.
    truth: [[f64; 3]; 4],
}

/// The rows of each light.
fn rows() -> BTreeMap<String, Vec<Row>> {
    let text = std::fs::read_to_string(test_file("reference/lights-room.csv")).unwrap();
    let mut rows: BTreeMap<String, Vec<Row>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let words: Vec<&str> = line.split(',').collect();
        let number = |k: usize| words[k].parse::<f64>().unwrap();
        let vector = |k: usize| Vec3::from_array(std::array::from_fn(|c| number(k + c) as f32));
        let query = Query { surface: words[1].into(), position: vector(2), direction: vector(5) };
        let truth = std::array::from_fn(|t| std::array::from_fn(|c| number(8 + 3 * t + c)));
        rows.entry(words[0].into()).or_default().push(Row { query, truth });
    }
    rows
}

/// The light of this name.
fn lit(name: &str) -> Scene {
    let mut scene = load("lights");
    let from = Vec3::new(1.5, 2.8, 2.0);
    let spot = |profile| LightShape::Spot {
        position: from.to_array(),
        direction: (Vec3::new(-0.3, 0.0, -0.5) - from).normalize().to_array(),
        cut_off: 30f32.to_radians(),
        beam_width: 18f32.to_radians(),
        profile,
    };
    let (shape, [r, g, b]) = match name {
        "point" => (LightShape::Point { position: [0.8, 2.2, 1.0] }, [20.0, 18.0, 15.0]),
        "spot" => (spot(SpotProfile::Linear), [40.0, 36.0, 30.0]),
        "spot-gltf" => (spot(SpotProfile::SquaredCosine), [40.0, 36.0, 30.0]),
        "directional" => (LightShape::Directional { direction: Vec3::new(-0.5, -0.8, -0.45).normalize().to_array() }, [3.0, 2.8, 2.5]),
        _ => {
            scene.environment = Some(environment());
            return scene;
        }
    };
    scene.lights = vec![Light { intensity: Rgb::new(r, g, b), ..light(shape) }];
    scene
}

/// The picture, whose left edge Mitsuba sees toward -Z: a quarter turn from here. Its scan lines are literal runs of 64 bytes a channel.
fn environment() -> Environment {
    let bytes = std::fs::read(test_file("reference/lights-room-env.hdr")).unwrap();
    let (width, height) = (64usize, 32usize);
    let data = &bytes[bytes.len() - height * (4 + 4 * (1 + width))..];
    let byte = |row: usize, channel: usize, x: usize| data[row * 264 + 4 + channel * 65 + 1 + x];
    let texel = |x: u32, y: u32| -> [f32; 3] {
        let (x, row) = (x as usize, height - 1 - y as usize);
        let scale = math::exp2(f32::from(byte(row, 3, x)) - 136.0);
        std::array::from_fn(|c| f32::from(byte(row, c, x)) * scale)
    };
    Environment { rotation: -std::f32::consts::FRAC_PI_2, ..sky(width as u32, height as u32, texel) }
}

/// Every value within 1 % and four standard errors, the mean within 0.3 %, and z-scores of the size that noise has.
fn compare(name: &str, rows: &[Row], depth: u32, samples: u32) {
    let scene = BakeScene::new(lit(name), Simd::Auto).unwrap();
    let queries: Vec<Query> = rows.iter().map(|r| r.query.clone()).collect();
    let settings = settings(&format!(r#"{{"samples":{samples},"max_depth":{depth},"directions":"4x8"}}"#));
    let answers = evaluate(&scene, &queries, &settings, 16);
    let (mut ours, mut theirs, mut z2, mut lit) = (0.0, 0.0, 0.0, 0.0f64);
    for (row, answer) in rows.iter().zip(answers) {
        let answer = answer.unwrap();
        let [radiance, error] = if depth == 2 { [row.truth[0], row.truth[1]] } else { [row.truth[2], row.truth[3]] };
        let (found, own) = (answer.radiance.to_array().map(f64::from), answer.stderr.to_array().map(f64::from));
        for c in 0..3 {
            let sigma = (error[c] * error[c] + own[c] * own[c]).sqrt();
            let off = found[c] - radiance[c];
            assert!(off.abs() <= 0.01 * radiance[c] + 4.0 * sigma, "{name}, depth {depth}: {:?}: {answer:?} {radiance:?}", row.query);
            ours += found[c];
            theirs += radiance[c];
            if radiance[c] > 0.0 {
                z2 += off * off / (sigma * sigma + 1e-6 * radiance[c] * radiance[c]);
                lit += 1.0;
            }
        }
    }
    assert!((ours / theirs - 1.0).abs() < 0.003, "{name}, depth {depth}: {ours} {theirs}");
    assert!(z2 / lit < 1.6, "{name}, depth {depth}: {}", z2 / lit);
}

#[test]
fn direct_light_of_every_kind_agrees_with_mitsuba() {
    for (name, rows) in &rows() {
        compare(name, rows, 2, if name == "env" { 2048 } else { 64 });
    }
}

#[test]
fn light_of_every_kind_after_three_bounces_agrees_with_mitsuba() {
    for (name, rows) in &rows() {
        compare(name, rows, 5, 1024);
    }
}
