//! How well surfaces fill their textures, and how long that takes: a torus, and every scene named on the command line (`cargo bench -p
//! kiln-coordinator --bench unwrap -- SCENE…`). Author's coordinates are dropped, so that charts are found. One JSON line per surface and
//! density. `KILN_DENSITIES` names texels per metre; without it a torus gets 20 and 240, a scene 20.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use kiln_coordinator::{
    import::{bundle, import_bundle},
    split::make_plan,
};
use kiln_proto::{
    math::sin_cos_degrees,
    options::ImportOptions,
    scene::{Material, Scene, Surface, Triangle},
    settings::SettingsPatch,
    units::Rgb,
};
use std::{path::Path, time::Instant};

fn main() {
    let asked = std::env::var("KILN_DENSITIES").ok();
    let densities = |default: &[f32]| asked.as_ref().map_or(default.to_vec(), |d| d.split(',').map(|v| v.parse().unwrap()).collect());
    report("torus", torus(64, 32), &densities(&[20.0, 240.0]));
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        let scratch = tempfile::tempdir().unwrap();
        let (bundle, _) = bundle::collect(Path::new(&path), None, scratch.path()).unwrap();
        let scene = import_bundle(&bundle, &ImportOptions::default()).unwrap().scene;
        report(bundle.main().as_str(), scene, &densities(&[20.0]));
    }
}

fn report(model: &str, mut scene: Scene, densities: &[f32]) {
    scene.surfaces.iter_mut().for_each(|s| s.uv_sets.clear());
    scene.materials.iter_mut().for_each(|m| *m = Material::matt(m.name.clone(), Rgb::splat(0.5)));
    let hash = Scene::hash_of(&scene.to_bytes().unwrap());
    for density in densities {
        let settings = SettingsPatch { texels_per_metre: Some(*density), ..SettingsPatch::default() }.resolve().unwrap();
        let begun = Instant::now();
        let (plan, _) = make_plan(&scene, hash, &settings).unwrap();
        let seconds = begun.elapsed().as_secs_f64();
        for (surface, layout) in scene.surfaces.iter().zip(&plan.surfaces) {
            let charts = layout.charts.iter().max().map_or(0, |last| last + 1);
            let (triangles, size) = (surface.triangles.len(), layout.size);
            let share = layout.covered as f64 / size.texels() as f64;
            println!(
                "{{\"bench\":\"unwrap\",\"model\":{model:?},\"surface\":{:?},\"texels_per_metre\":{density},\"triangles\":{triangles},\
                 \"charts\":{charts},\"size\":\"{size}\",\"covered_share\":{share:.4},\"plan_seconds\":{seconds:.2}}}",
                surface.name
            );
        }
    }
}

/// A smooth torus of radii 1 and 0.35 m.
fn torus(around: u32, across: u32) -> Scene {
    let angle = |k: u32, n: u32| sin_cos_degrees(360.0 * f64::from(k % n) / f64::from(n));
    let (mut positions, mut normals) = (vec![], vec![]);
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let ((s, c), (t, d)) = (angle(i, around), angle(j, across));
        positions.push([(1.0 + 0.35 * d) * c, 0.35 * t, -(1.0 + 0.35 * d) * s].map(|v| v as f32));
        normals.push([d * c, t, -d * s].map(|v| v as f32));
    }
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let quads = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    let corners = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let corners: Vec<[u32; 3]> = corners.collect();
    let triangles = corners.iter().enumerate().map(|(k, c)| (Triangle { corners: *c, polygon: k as u32 }, None)).collect();
    let surface = Surface { normals: corners, ..Surface::plain("torus", 0, triangles) };
    Scene { positions, normals, surfaces: vec![surface], materials: vec![Material::matt("m", Rgb::splat(0.5))], ..Scene::empty() }
}
