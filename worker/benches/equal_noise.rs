//! The shared gather against one path per direction at equal noise, on the glossy surfaces of thesis-room, one thread, one binary. One JSON
//! line per surface: core-seconds per texel of the shared gather, core-seconds that independent paths need for the same root mean square
//! error, and their ratio. The reference is the mean of many gathers with other seeds, so it is the same for both; its own noise is small
//! and counted against the shared gather.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../src/testing.rs"]
mod testing;

use kiln_proto::{
    settings::{BakeSettings, SettingsPatch},
    units::Rgb,
};
use kiln_worker::{
    capture::{Capture, per_direction, shared, simd::Simd},
    scene::BakeScene,
};
use std::{sync::Arc, time::Instant};

const SURFACES: [&str; 4] = ["wall_side", "floor", "box_front", "prism"];
/// Texels of each surface, spread over its texture.
const TEXELS: u32 = 10;
/// Gathers of 4,096 samples in a reference.
const REFERENCES: u64 = 64;
/// Independent paths per direction; their error is scaled from here by the square root of their number.
const PATHS: u32 = 16;

/// Squared error and seconds.
#[derive(Default)]
struct Cost {
    error: f64,
    seconds: f64,
}

fn main() {
    let nominal = std::fs::read_to_string(testing::test_file("scenes/thesis-room/nominal.json")).unwrap();
    let settings = serde_json::from_str::<SettingsPatch>(&nominal).unwrap().resolve().unwrap();
    let scene = testing::load("thesis");
    let plan = Arc::new(testing::plan(&scene, &settings));
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), plan).unwrap();
    for name in SURFACES {
        let surface = capture.scene().scene().surface(name).unwrap().0;
        let (mut ours, mut theirs, mut power) = (Cost::default(), Cost::default(), 0.0);
        for texel in texels(&capture, surface) {
            let at = |samples, seed| BakeSettings { samples, seed, max_depth: 5, ..settings.clone() };
            let reference = reference(&capture, surface, texel, &at);
            measure(&mut ours, &reference, || shared(&capture, surface, texel, &at(1_024, 1)).unwrap().0);
            measure(&mut theirs, &reference, || per_direction(&capture, surface, texel, &at(PATHS, 1)).unwrap().0);
            power += reference.iter().flatten().map(|v| v * v).sum::<f64>();
        }
        let seconds = theirs.seconds * theirs.error / ours.error;
        println!(
            r#"{{"surface":"{name}","relative_rmse":{:.4},"shared_core_seconds":{:.6},"per_direction_core_seconds":{:.6},"paths_per_direction":{:.0},"ratio":{:.1}}}"#,
            (ours.error / power).sqrt(),
            ours.seconds / f64::from(TEXELS),
            seconds / f64::from(TEXELS),
            f64::from(PATHS) * theirs.error / ours.error,
            seconds / ours.seconds,
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

fn measure(cost: &mut Cost, reference: &[[f64; 3]], run: impl Fn() -> Vec<Rgb>) {
    let start = Instant::now();
    let light = run();
    cost.seconds += start.elapsed().as_secs_f64();
    let off = |(l, r): (&Rgb, &[f64; 3])| (0..3).map(|c| (f64::from(l.to_array()[c]) - r[c]).powi(2)).sum::<f64>();
    #[allow(clippy::disallowed_methods)]
    let error = light.iter().zip(reference).map(off).sum::<f64>();
    cost.error += error;
}
