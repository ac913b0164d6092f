//! Whole paths against Mitsuba's: the rooms of `tests/reference/metallic-roughness`.
#![allow(clippy::print_stdout)] // The figures that a comparison came to are part of what the soak reports.

use super::{
    footprint::Points,
    hemisphere::{Budget, Views, capture_each},
    site::Site,
};
use crate::{
    eval::{Answer, Query, evaluate},
    sampling::TexelKey,
    scene::BakeScene,
    simd::Simd,
    testing::{Line, Table, add_quad, appendix_b, empty, lambert, rough, settings, test_file},
};
use glam::Vec3;
use kiln_proto::{
    scene::{Material, MetallicRoughness, Scene},
    texel::SurfacePoint,
    units::Rgb,
};
use rayon::prelude::*;
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

/// Whether time is no matter: `make soak`.
fn soak() -> bool {
    std::env::var_os("KILN_SOAK").is_some()
}

/// The queries of a table.
fn queries(table: &Table) -> Vec<Query> {
    let vector = |row: &Line<'_>, letter: &str| Vec3::from_array(["x", "y", "z"].map(|a| row.number(&format!("{letter}{a}"))));
    let query = |r: Line<'_>| Query { surface: r.text("surface").to_owned(), position: vector(&r, "p"), direction: vector(&r, "d") };
    table.rows().map(query).collect()
}

/// Independent paths at a query, so many for each of some seeds: their mean for each channel, with its standard error.
fn independent(scene: &BakeScene, query: &Query, samples: u32) -> [(f64, f64); 3] {
    const SEEDS: u64 = 12;
    let (surface, _) = scene.scene().surface(&query.surface).unwrap();
    let holds = |triangle: &u32| {
        let (c, n) = (scene.prim(scene.prim_of(surface, *triangle)).corners, scene.prim(scene.prim_of(surface, 0)).frame.normal);
        (0..3).all(|k| (c[(k + 1) % 3] - c[k]).cross(query.position - c[k]).dot(n) >= -1e-5)
    };
    let triangle = (0..2).find(holds).unwrap();
    let frame = scene.prim(scene.prim_of(surface, triangle)).frame;
    let views = Views::grid(&[frame.to_local(query.direction)]);
    let runs = (0..SEEDS).map(|seed| {
        let point = SurfacePoint { triangle, bary: [0.3, 0.3], position: query.position };
        let key = TexelKey::new(seed, surface as u32, u64::from(query.position.x.to_bits()));
        let site = Site { surface, frame, points: Points::Fixed(point), key };
        let mut out = [Rgb::BLACK];
        capture_each(scene, &site, Budget { samples, max_depth: 5 }, &views, &mut out);
        out[0].to_array().map(f64::from)
    });
    let runs: Vec<[f64; 3]> = runs.collect();
    std::array::from_fn(|c| {
        let n = SEEDS as f64;
        let mean = runs.iter().map(|r| r[c]).sum::<f64>() / n;
        (mean, (runs.iter().map(|r| (r[c] - mean) * (r[c] - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt())
    })
}

/// Independent paths agree with Mitsuba's value by value, within common noise; the shared gather, whose noise has long tails where metals
/// face metals, does on every surface and in the whole room.
fn compare(name: &str) {
    let scene = BakeScene::new(room(name), Simd::Auto).unwrap();
    let table = Table::read(&format!("reference/metallic-roughness/{name}-room.csv"));
    let queries = queries(&table);
    let answers = evaluate(&scene, &queries, &settings(r#"{"samples":1024,"max_depth":5}"#), 8);
    let paths: Vec<[(f64, f64); 3]> = queries.par_iter().map(|q| independent(&scene, q, 512)).collect();
    let (mut z2, mut totals) = (0.0, BTreeMap::<&str, [f64; 3]>::new());
    for ((k, row), answer) in table.rows().enumerate().zip(answers) {
        let shared = answer.unwrap().radiance.to_array();
        for c in 0..3 {
            let (truth, se) = (f64::from(row.number(["r", "g", "b"][c])), f64::from(row.number(["se_r", "se_g", "se_b"][c])));
            let (ours, error) = paths[k][c];
            let z = (ours - truth) / (error * error + se * se).sqrt().max(1e-9);
            // Images of the lamp in metals reach dull walls by few paths: six thousand may miss their share and not know it.
            let close = (ours - truth).abs() < 0.06 * truth;
            assert!(z.abs() < 5.5 || close, "query {k} on {}, channel {c}: {ours} +- {error}, {truth} +- {se}", queries[k].surface);
            z2 += z * z / (3 * queries.len()) as f64;
            for key in [queries[k].surface.as_str(), ""] {
                let total = totals.entry(key).or_default();
                *total = [total[0] + ours, total[1] + f64::from(shared[c]), total[2] + truth];
            }
        }
    }
    // Twelve seeds estimate their own spread, so that z² is Student's, 11/9 on average; channels share their noise: 200 free numbers, not
    // 600.
    assert!(z2 < 1.9, "{z2}");
    for (surface, [paths, shared, truth]) in totals {
        let (off, within) = (|v: f64| if truth > 0.0 { (v / truth - 1.0).abs() } else { v }, if surface.is_empty() { 0.01 } else { 0.02 });
        println!("{name}, {surface}: paths {:+.3} %, gather {:+.3} %", 100.0 * (paths / truth - 1.0), 100.0 * (shared / truth - 1.0));
        assert!(off(paths) < within && off(shared) < 4.0 * within, "{surface}: {paths} {shared} {truth}");
    }
}

/// Largest relative differences of a group of values, their mean, and the standard error of that.
#[derive(Debug, Default)]
struct Differences {
    worst: f64,
    mean: f64,
    error: f64,
}

impl Differences {
    /// Of (ours, its error, truth, its error), three channels a query, whose noise is common.
    fn of(values: &[[f64; 4]]) -> Self {
        let count = values.len() as f64;
        let relative = values.iter().map(|[ours, _, truth, _]| ours / truth - 1.0);
        let noise: f64 = values.iter().map(|[_, error, truth, se]| (error * error + se * se) / (truth * truth)).sum();
        let worst = relative.clone().map(f64::abs).fold(0.0, f64::max);
        Self { worst, mean: relative.sum::<f64>() / count, error: (3.0 * noise).sqrt() / count }
    }
}

/// White metal of five roughnesses under a dull room, against Mitsuba's own `roughconductor`: with a base colour of one, the format's
/// Fresnel term is one, as there. Within 1 % and what the noise of both leaves open; in `make soak` that is next to nothing for paths, and
/// for the mean of a roughness by the gather, which has few samples for the one narrow lobe of a query.
#[test]
fn a_floor_of_ggx_agrees_with_roughconductor_within_one_percent() {
    let table = Table::read("reference/metallic-roughness/ggx-floor.csv");
    let (json, repeats, paths) =
        if soak() { (r#"{"samples":4096,"max_depth":5}"#, 128, 32_768) } else { (r#"{"samples":1024,"max_depth":5}"#, 16, 512) };
    let all = queries(&table);
    for (g, rows) in table.rows().collect::<Vec<_>>().chunks(24).enumerate() {
        let (mut scene, roughness) = (room("floor"), rows[0].number("roughness"));
        let floor = scene.surface("floor").unwrap().1.parts[0].material as usize;
        scene.materials[floor] = rough(appendix_b([1.0; 3], 1.0, roughness));
        let (scene, queries) = (BakeScene::new(scene, Simd::Auto).unwrap(), &all[24 * g..24 * g + rows.len()]);
        let gathered = evaluate(&scene, queries, &settings(json), repeats).into_iter().map(Result::unwrap);
        let gathered = gathered.map(|a: Answer| std::array::from_fn(|c| [a.radiance, a.stderr].map(|v| f64::from(v.to_array()[c])).into()));
        let paths: Vec<[(f64, f64); 3]> = queries.par_iter().map(|q| independent(&scene, q, paths)).collect();
        for (name, ours) in [("paths", paths), ("gather", gathered.collect())] {
            let value = |k: usize, c: usize| {
                let truth = ["", "se_"].map(|column| f64::from(rows[k].number(&format!("{column}{}", ["r", "g", "b"][c]))));
                [ours[k][c].0, ours[k][c].1, truth[0], truth[1]]
            };
            let values: Vec<[f64; 4]> = (0..3 * rows.len()).map(|i| value(i / 3, i % 3)).collect();
            let found = Differences::of(&values);
            println!("roughness {roughness}, {name}: {found:?}");
            for [ours, error, truth, se] in values {
                let (off, sigma) = ((ours - truth).abs() / truth, (se * se + error * error).sqrt() / truth);
                assert!(off < 0.01 + 4.0 * sigma, "roughness {roughness}, {name}: {ours} +- {error}, {truth} +- {se}");
            }
            assert!(!soak() || name == "gather" || found.worst < 0.01, "roughness {roughness}: {found:?}");
            let noise = if soak() { 0.0 } else { 4.0 * found.error };
            assert!(found.mean.abs() < 0.01 + noise, "roughness {roughness}, {name}: {found:?}");
        }
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
