//! What a nominal bake of thesis-room costs: rays per second, nanoseconds per (sample, direction) and core-minutes, extrapolated from a few
//! tiles of every surface on one thread. One JSON line per surface and one for the scene.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../src/testing.rs"]
mod testing;

use kiln_proto::{settings::SettingsPatch, tile::TileIndex};
use kiln_worker::{capture::Capture, scene::BakeScene, simd::Simd};
use std::sync::Arc;

/// Every so many tiles of a surface one is baked.
const STRIDE: usize = 37;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let portable = std::env::args().any(|a| a == "portable");
        let nominal = std::fs::read_to_string(testing::test_file("scenes/thesis-room/nominal.json")).unwrap();
        let sizes: SettingsPatch = serde_json::from_str(&nominal).unwrap();
        let patch: SettingsPatch = serde_json::from_str(r#"{"samples":1024,"max_depth":5}"#).unwrap();
        let settings = sizes.overridden_by(patch).resolve().unwrap();
        let scene = testing::load("thesis");
        let plan = Arc::new(testing::plan(&scene, &settings));
        let scene = Arc::new(BakeScene::new(scene, if portable { Simd::Portable } else { Simd::Auto }).unwrap());
        let capture = Capture::new(scene, plan.clone()).unwrap();
        let (mut minutes, mut texels) = (0.0, 0);
        for (index, surface) in plan.surfaces.iter().enumerate() {
            let (mut rays, mut baked, mut seconds) = (0, 0usize, 0.0);
            let first = plan.first_tile(index).0;
            for tile in (0..surface.tiles.len()).skip(STRIDE / 2 % surface.tiles.len()).step_by(STRIDE) {
                let start = testing::thread_seconds();
                let radiance = capture.bake_tile(TileIndex(first + tile as u64)).unwrap();
                seconds += testing::thread_seconds() - start;
                rays += radiance.rays;
                let mut sources: Vec<_> = radiance.rows.iter().map(|r| r.source).collect();
                sources.sort_unstable();
                sources.dedup();
                baked += sources.len();
            }
            let per_texel = seconds / baked.max(1) as f64;
            minutes += per_texel * surface.covered as f64 / 60.0;
            texels += surface.covered;
            println!(
                r#"{{"surface":"{}","texels":{},"us_per_texel":{:.1},"ns_per_ray":{:.1},"rays_per_texel":{:.0},"ns_per_sample_direction":{:.3}}}"#,
                capture.scene().scene().surfaces[index].name,
                surface.covered,
                per_texel * 1e6,
                seconds * 1e9 / rays.max(1) as f64,
                rays as f64 / baked.max(1) as f64,
                per_texel * 1e9 / (1280.0 * 400.0),
            );
        }
        println!(r#"{{"scene":"thesis-room","texels":{texels},"core_minutes":{minutes:.2}}}"#);
    });
}
