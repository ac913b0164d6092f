//! The shared gather against one path per direction at equal noise, on the glossy surfaces of thesis-room, one thread, one binary. One JSON
//! line per surface: core-seconds per texel of the shared gather, core-seconds that independent paths need for the same root mean square
//! error, and their ratio. Independent paths are measured at 64 and at 512 a direction, and the error goes on from there with the slope
//! between the two (1 is that of plain Monte Carlo; their sequences do a little better). The reference is the mean of many gathers with
//! other seeds, so it is the same for both; its own noise is small and counted against the shared gather.
#![allow(clippy::disallowed_methods)] // Logarithms of measured errors reach no baked byte.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../src/testing.rs"]
mod testing;

use kiln_proto::{
    settings::{BakeSettings, SettingsPatch},
    units::Rgb,
};
use kiln_worker::{
    capture::{Capture, per_direction, shared},
    scene::BakeScene,
    simd::Simd,
};
use std::sync::Arc;

const SURFACES: [&str; 4] = ["wall_side", "floor", "box_front", "prism"];
/// Texels of each surface, spread over its texture.
const TEXELS: u32 = 10;
/// Gathers of 4,096 samples in a reference.
const REFERENCES: u64 = 64;
/// Independent paths per direction, few and many.
const PATHS: [u32; 2] = [64, 512];
/// Seeds of the shared gather, and of the independent paths, so that both the error and the clock have something to average.
const SEEDS: [u64; 2] = [8, 2];

/// One way to capture a texel: (texel, seed) to radiance.
type Way<'a> = &'a dyn Fn((u32, u32), u64) -> Vec<Rgb>;

fn main() {
    let nominal = std::fs::read_to_string(testing::test_file("scenes/thesis-room/nominal.json")).unwrap();
    let settings = serde_json::from_str::<SettingsPatch>(&nominal).unwrap().resolve().unwrap();
    let scene = testing::load("thesis");
    let plan = Arc::new(testing::plan(&scene, &settings));
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), plan).unwrap();
    for name in SURFACES {
        let surface = capture.scene().scene().surface(name).unwrap().0;
        let at = |samples, seed| BakeSettings { samples, seed, max_depth: 5, ..settings.clone() };
        let texels = texels(&capture, surface);
        let references: Vec<_> = texels.iter().map(|t| reference(&capture, surface, *t, &at)).collect();
        let (ours, our_error) =
            measure(&texels, &references, SEEDS[0], &|t, seed| shared(&capture, surface, t, &at(1_024, seed)).unwrap().0);
        let [(_, few), (theirs, many)] = PATHS.map(|paths| {
            measure(&texels, &references, SEEDS[1], &|t, seed| per_direction(&capture, surface, t, &at(paths, seed)).unwrap().0)
        });
        let slope = (few / many).log2() / f64::from(PATHS[1] / PATHS[0]).log2();
        let power: f64 = references.iter().flatten().flatten().map(|v| v * v).sum();
        let more = (many / our_error).powf(1.0 / slope);
        let (paths, equal) = (f64::from(PATHS[1]) * more, theirs * more);
        println!(
            r#"{{"surface":"{name}","relative_rmse":{:.4},"shared_core_seconds":{ours:.6},"per_direction_core_seconds":{equal:.6},"paths_per_direction":{paths:.0},"slope":{slope:.3},"ratio":{:.1}}}"#,
            (our_error / power).sqrt(),
            equal / ours,
        );
    }
}

fn texels(capture: &Capture, surface: usize) -> Vec<(u32, u32)> {
    let layout = &capture.plan().surfaces[surface];
    let step = |k: u32| (f64::from(k) * 0.754_877_666 % 1.0, f64::from(k) * 0.569_840_29 % 1.0);
    let spread = (1..).map(step).map(|(u, v)| ((u * f64::from(layout.size.width)) as u32, (v * f64::from(layout.size.height)) as u32));
    let probe = BakeSettings { samples: 1, ..capture.plan().settings.clone() };
    spread.filter(|t| shared(capture, surface, *t, &probe).is_some()).take(TEXELS as usize).collect()
}

fn reference(capture: &Capture, surface: usize, texel: (u32, u32), at: &dyn Fn(u32, u64) -> BakeSettings) -> Vec<[f64; 3]> {
    let mut sum = vec![[0.0; 3]; capture.plan().settings.directions.len() as usize];
    for seed in 0..REFERENCES {
        let (light, _) = shared(capture, surface, texel, &at(4_096, 1_000 + seed)).unwrap();
        for (s, l) in sum.iter_mut().zip(&light) {
            (0..3).for_each(|c| s[c] += f64::from(l.to_array()[c]) / REFERENCES as f64);
        }
    }
    sum
}

/// Core-seconds of one capture, and its squared error summed over the texels.
fn measure(texels: &[(u32, u32)], references: &[Vec<[f64; 3]>], seeds: u64, way: Way<'_>) -> (f64, f64) {
    let start = testing::thread_seconds();
    let captured: Vec<Vec<Rgb>> = texels.iter().flat_map(|t| (1..=seeds).map(|seed| way(*t, seed))).collect();
    let seconds = testing::thread_seconds() - start;
    let off = |(l, r): (&Rgb, &[f64; 3])| (0..3).map(|c| f64::from(l.to_array()[c]) - r[c]).map(|d| d * d).sum::<f64>();
    let error = |(k, light): (usize, &Vec<Rgb>)| light.iter().zip(&references[k / seeds as usize]).map(off).sum::<f64>();
    let total: f64 = captured.iter().enumerate().map(error).sum();
    (seconds / captured.len() as f64, total / seeds as f64)
}
