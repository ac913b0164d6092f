//! Whole paths against Mitsuba's: the rooms of `tests/reference/metallic-roughness`.

use crate::{
    eval::{Query, evaluate},
    scene::BakeScene,
    simd::Simd,
    testing::{Line, Table, add_quad, appendix_b, empty, lambert, rough, settings, test_file},
};
use glam::Vec3;
use kiln_proto::{
    scene::{Material, MetallicRoughness, Scene},
    units::Rgb,
};
use serde_json::Value;
use std::collections::BTreeMap;

fn material(description: &Value) -> Material {
    let number = |key: &str| description[key].as_f64().unwrap() as f32;
    let colour = |v: &Value| -> [f32; 3] { std::array::from_fn(|k| v[k].as_f64().unwrap() as f32) };
    let mut material = if description["lambert"].is_array() {
        lambert(colour(&description["lambert"])[0], 0.0)
    } else {
        let base = colour(&description["base_color"]);
        rough(MetallicRoughness { ior: number("ior"), ..appendix_b(base, number("metallic"), number("roughness")) })
    };
    if description["lambert"].is_array() {
        material = Material::matt("m", Rgb::from(colour(&description["lambert"])));
    }
    if description["emission"].is_array() {
        material.emission = Rgb::from(colour(&description["emission"]));
    }
    material
}

/// The room's quads, one surface each.
fn room(name: &str) -> Scene {
    let read = |file: &str| std::fs::read_to_string(test_file(&format!("reference/metallic-roughness/{file}"))).unwrap();
    let materials: Value = serde_json::from_str(&read(&format!("{name}-room.json"))).unwrap();
    let (mut scene, mut corners, mut surface) = (empty(), Vec::<Vec3>::new(), String::new());
    let (text, mut used) = (read("room.obj"), String::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.first().copied() {
            Some("o") => surface = words[1].to_owned(),
            Some("usemtl") => used = words[1].to_owned(),
            Some("v") => corners.push(Vec3::from_array(std::array::from_fn(|k| words[k + 1].parse().unwrap()))),
            Some("f") => {
                let quad = &corners[corners.len() - 4..];
                let (u, v) = (quad[1] - quad[0], quad[3] - quad[0]);
                let material = material(&materials["materials"][&used]);
                add_quad(&mut scene, &surface, quad[0].to_array(), u.to_array(), v.to_array(), material);
            }
            _ => {}
        }
    }
    scene
}

/// What the queries of a surface add up to, and the variance of that sum: channels of a query share their noise, queries do not.
#[derive(Default)]
struct Total {
    ours: f64,
    truth: f64,
    variance: f64,
}

/// Values within their common noise, the mean of z² near one, and every surface on the whole within 1 % or three standard deviations.
fn compare(name: &str) {
    let scene = BakeScene::new(room(name), Simd::Auto).unwrap();
    let table = Table::read(&format!("reference/metallic-roughness/{name}-room.csv"));
    let vector = |row: &Line<'_>, letter: &str| Vec3::from_array(["x", "y", "z"].map(|a| row.number(&format!("{letter}{a}"))));
    let query = |r: Line<'_>| Query { surface: r.text("surface").to_owned(), position: vector(&r, "p"), direction: vector(&r, "d") };
    let queries: Vec<Query> = table.rows().map(query).collect();
    let answers = evaluate(&scene, &queries, &settings(r#"{"samples":1024,"max_depth":5}"#), 32);
    let (mut z2, mut count, mut totals) = (0.0, 0.0, BTreeMap::<String, Total>::new());
    for (row, answer) in table.rows().zip(answers) {
        let answer = answer.unwrap();
        let total = totals.entry(row.text("surface").to_owned()).or_default();
        let mut sigmas = 0.0;
        for (c, (ours, error)) in answer.radiance.to_array().into_iter().zip(answer.stderr.to_array()).enumerate() {
            let (truth, se) = (f64::from(row.number(["r", "g", "b"][c])), f64::from(row.number(["se_r", "se_g", "se_b"][c])));
            let sigma = (f64::from(error) * f64::from(error) + se * se).sqrt().max(1e-9);
            let z = (f64::from(ours) - truth) / sigma;
            let close = (f64::from(ours) - truth).abs() < 0.01 * truth;
            assert!(z.abs() < 5.0 || close, "{}, channel {c}: {answer:?} {truth} +- {se}", row.text("surface"));
            (z2, count, sigmas) = (z2 + z * z, count + 1.0, sigmas + sigma);
            (total.ours, total.truth) = (total.ours + f64::from(ours), total.truth + truth);
        }
        total.variance += sigmas * sigmas;
    }
    // Repeats estimate their own spread, so that z² is Student's: 31/29 on average. Channels share their noise: 200 free numbers, not 600.
    assert!(z2 / count < 1.35, "{}", z2 / count);
    for (surface, Total { ours, truth, variance }) in totals {
        let off = (ours - truth).abs();
        assert!(off <= 0.01 * truth || off < 3.0 * variance.sqrt(), "{surface}: {ours} {truth} +- {}", variance.sqrt());
    }
}

#[test]
fn metals_in_a_room_look_as_in_mitsuba() {
    compare("metal");
}

#[test]
fn dielectrics_in_a_room_look_as_in_mitsuba() {
    compare("dielectric");
}
