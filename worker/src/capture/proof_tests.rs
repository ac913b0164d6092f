//! What a light field promises as a whole: its hemisphere integral is the lightmap, directions between those of the grid are interpolated
//! as well as the grid allows, and the noise that is claimed is the noise that is there.

use super::tests::{capture, lit_floor, polygon_factor};
use super::*;
use crate::{
    eval::{Query, evaluate},
    simd::Simd,
    testing::{lambert, phong, settings},
};
use glam::DVec3;
use kiln_proto::lookup::{self, DiffuseMean};
use std::f64::consts::PI;

/// Irradiance of the floor of [`lit_floor`] at (x, z), W/m².
fn irradiance(x: f64, z: f64) -> f64 {
    20.0 * polygon_factor(DVec3::new(x, 0.0, z), DVec3::Y)
}

/// The position of a texel's centre on the floor, 8 x 8 texels of 1.25 m.
fn centre(x: u32, y: u32) -> Vec3 {
    Vec3::new((x as f32 + 0.5) * 1.25, 0.0, 10.0 - (y as f32 + 0.5) * 1.25)
}

#[test]
fn the_hemisphere_integral_of_a_diffuse_texel_is_its_lightmap() {
    let json = r#"{"samples":4096,"max_depth":2,"directions":"8x16","footprint":"point"}"#;
    let capture = capture(lit_floor(lambert(0.6, 0.0)), json, Simd::Auto);
    let integral = DiffuseMean::new(capture.plan().settings.directions);
    for (x, y) in [(0, 0), (3, 5), (4, 4), (7, 2)] {
        let (light, _) = shared(&capture, 0, (x, y), &settings(json)).unwrap();
        let mean = integral.of(light.iter().copied());
        assert_eq!(mean, light[0], "to the last bit where all directions are equal");
        let at = centre(x, y).as_dvec3();
        let lightmap = 0.6 / PI * irradiance(at.x, at.z);
        assert!((f64::from(mean.g) / lightmap - 1.0).abs() < 0.02, "({x}, {y}): {} {lightmap}", mean.g);
    }
}

#[test]
fn the_hemisphere_integral_of_a_glossy_texel_is_that_of_single_questions() {
    let json = r#"{"samples":1024,"max_depth":2,"directions":"10x20","footprint":"point"}"#;
    let capture = capture(lit_floor(phong(0.3, 0.5, 20.0)), json, Simd::Auto);
    let integral = DiffuseMean::new(capture.plan().settings.directions);
    let texel = capture.rasters[0].texel(2, 3).unwrap();
    let (light, _) = shared(&capture, 0, (2, 3), &settings(json)).unwrap();
    let query = |d: &Vec3| Query { surface: "floor".into(), position: texel.position, direction: texel.frame.to_world(*d) };
    let queries: Vec<Query> = capture.directions.iter().map(query).collect();
    let answers: Vec<Rgb> = evaluate(&capture.scene, &queries, &settings(json), 8).into_iter().map(|a| a.unwrap().radiance).collect();
    let (ours, theirs) = (integral.of(light.iter().copied()).g, integral.of(answers.iter().copied()).g);
    assert!((ours / theirs - 1.0).abs() < 0.02, "{ours} {theirs}");
    let spread = answers.iter().fold(0.0, |m: f32, a| m.max(a.g)) / answers.iter().fold(f32::MAX, |m, a| m.min(a.g));
    assert!(spread > 1.5, "it is glossy: {spread}");
}

#[test]
fn directions_between_those_of_the_grid_are_interpolated_within_its_own_error() {
    // 400 directions of a lobe of exponent 20 interpolate to 44 dB of the brightest by themselves (design study); noise is left a little.
    let json = r#"{"samples":16384,"max_depth":2,"directions":"20x20","footprint":"point"}"#;
    let capture = capture(lit_floor(phong(0.3, 0.5, 20.0)), json, Simd::Auto);
    let grid = capture.plan().settings.directions;
    let texel = capture.rasters[0].texel(2, 3).unwrap();
    let (light, _) = shared(&capture, 0, (2, 3), &settings(json)).unwrap();
    let between: Vec<Vec3> = (0..200)
        .map(|k| {
            let (z, turn) = (0.1 + 0.89 * (k as f32 + 0.5) / 200.0, k as f32 * 0.618_034);
            let (sin, cos) = kiln_proto::math::sin_cos_turns(turn);
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z)
        })
        .collect();
    let query = |d: &Vec3| Query { surface: "floor".into(), position: texel.position, direction: texel.frame.to_world(*d) };
    let queries: Vec<Query> = between.iter().map(query).collect();
    let (mut square, mut brightest) = (0.0, 0.0f32);
    for (d, answer) in between.iter().zip(evaluate(&capture.scene, &queries, &settings(json), 2)) {
        let (truth, shown) = (answer.unwrap().radiance.g, lookup::toward(&lookup::stencil(grid, *d), |k| light[k as usize]).g);
        square += f64::from((shown - truth) * (shown - truth)) / between.len() as f64;
        brightest = brightest.max(truth);
    }
    // 40 dB: a hundredth of the brightest, root mean square.
    assert!(square.sqrt() < 0.01 * f64::from(brightest), "{} of {brightest}", square.sqrt());
}

#[test]
fn the_error_that_is_claimed_covers_the_true_one() {
    // 48 repeats estimate their own spread: z² is Student's with a mean of 47/45.
    let scene = BakeScene::new(lit_floor(lambert(0.6, 0.0)), Simd::Auto).unwrap();
    let point = |k: u32| Vec3::new(0.3 + (k % 20) as f32 * 0.495, 0.0, 0.3 + (k / 20) as f32 * 0.495);
    let query = |k: u32| Query { surface: "floor".into(), position: point(k), direction: Vec3::Y };
    let queries: Vec<Query> = (0..400).map(query).collect();
    let answers = evaluate(&scene, &queries, &settings(r#"{"samples":64,"max_depth":2}"#), 48);
    let z2 = queries.iter().zip(answers).map(|(q, answer)| {
        let (at, answer) = (q.position.as_dvec3(), answer.unwrap());
        let z = (f64::from(answer.radiance.g) - 0.6 / PI * irradiance(at.x, at.z)) / f64::from(answer.stderr.g);
        z * z
    });
    let mean = z2.sum::<f64>() / 400.0;
    assert!((0.8..1.25).contains(&mean), "{mean}");
}

#[test]
fn the_difference_of_two_halves_tells_the_error_of_their_mean() {
    let json = |seed: u32| {
        format!(
            r#"{{"samples":64,"max_depth":2,"directions":"2x2","footprint":"point","seed":{seed},"texture_sizes":{{"floor":"32x32"}}}}"#
        )
    };
    let half = |seed: u32| capture(lit_floor(lambert(0.6, 0.0)), &json(seed), Simd::Auto).bake_tile(TileIndex(0)).unwrap();
    let (a, b) = (half(1), half(2));
    let (mut claimed, mut real) = (0.0, 0.0);
    for ((row, a), b) in a.rows.iter().zip(a.radiance.chunks_exact(12)).zip(b.radiance.chunks_exact(12)) {
        let (x, z) = ((f64::from(row.x) + 0.5) * 0.3125, 10.0 - (f64::from(row.y) + 0.5) * 0.3125);
        let truth = 0.6 / PI * irradiance(x, z);
        let (a, b) = (f64::from(a[1]) / truth, f64::from(b[1]) / truth);
        claimed += (a - b) * (a - b) / 4.0;
        real += ((a + b) / 2.0 - 1.0) * ((a + b) / 2.0 - 1.0);
    }
    assert!((0.8..1.25).contains(&(real / claimed)), "{real} {claimed}");
}
