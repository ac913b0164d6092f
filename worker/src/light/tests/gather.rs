//! The shared gather against independent paths, under every kind of light at once.

use super::{light, plate, sky};
use crate::{
    capture::{Capture, per_direction, shared},
    scene::BakeScene,
    simd::Simd,
    testing::{add_quad, lambert, mirror, phong, plan, settings},
};
use kiln_proto::{
    scene::{Falloff, Light, LightShape, Scene, SpotProfile},
    units::Rgb,
};
use std::sync::Arc;

fn everything(lamps: u32) -> Scene {
    let mut scene = plate(phong(0.3, 0.5, 20.0));
    add_quad(&mut scene, "wall", [-5.0, 0.0, 5.0], [0.0, 0.0, -10.0], [0.0, 4.0, 0.0], mirror(0.3, 0.4, 0.0));
    add_quad(&mut scene, "lamp", [2.0, 5.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 3.0));
    add_quad(&mut scene, "shelf", [-1.0, 2.0, 2.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0], lambert(0.6, 0.0));
    let shape = LightShape::Spot {
        position: [3.0, 3.0, 3.0],
        direction: glam::Vec3::new(-0.5, -0.7, -0.5).normalize().to_array(),
        cut_off: 0.8,
        beam_width: 0.2,
        profile: SpotProfile::SquaredCosine,
    };
    scene.lights = vec![Light { intensity: Rgb::new(9.0, 6.0, 3.0), ..light(shape) }];
    scene.lights.push(Light { name: "sun".into(), ..light(LightShape::Directional { direction: [0.0, -0.8, -0.6] }) });
    for k in 0..lamps {
        let position = [(k % 9) as f32 - 4.0, 1.0 + (k % 3) as f32, (k / 9) as f32 - 4.5];
        let falloff = Falloff::Polynomial { attenuation: [1.0, 0.5, 1.0], radius: 3.0 };
        let lamp = light(LightShape::Point { position });
        scene.lights.push(Light { name: format!("lamp {k}"), falloff, intensity: Rgb::splat(20.0 / lamps as f32), ..lamp });
    }
    scene.environment = Some(sky(8, 4, |x, y| [0.1 * y as f32, 0.1, if x == 2 { 0.8 } else { 0.05 }]));
    scene
}

/// Means over seeds and their z-scores.
fn compare(scene: Scene, surface: usize, texel: (u32, u32), seeds: u64) {
    let json = |seed: u64| format!(r#"{{"samples":256,"max_depth":4,"directions":"3x4","seed":{seed}}}"#);
    let plan = plan(&scene, &settings(&json(0)));
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(plan)).unwrap();
    let runs: Vec<[Vec<Rgb>; 2]> = (0..seeds)
        .map(|seed| {
            let settings = settings(&json(seed));
            [shared(&capture, surface, texel, &settings).unwrap().0, per_direction(&capture, surface, texel, &settings).unwrap().0]
        })
        .collect();
    let n = seeds as f64;
    let (mut worst, mut squares) = (0.0f64, 0.0);
    for k in 0..12 {
        let moments = |which: usize| {
            let values: Vec<f64> = runs.iter().map(|r| f64::from(r[which][k].mean())).collect();
            let mean = values.iter().sum::<f64>() / n;
            (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0) / n)
        };
        let ((a, va), (b, vb)) = (moments(0), moments(1));
        let z = (a - b) / (va + vb).sqrt().max(1e-5 * a);
        worst = worst.max(z.abs());
        squares += z * z / 12.0;
        assert!((a / b - 1.0).abs() < 0.03, "direction {k}: {a} {b}");
    }
    assert!(worst < 4.5 && squares < 2.5, "{worst} {squares}");
}

#[test]
fn both_estimators_agree_under_area_sky_and_a_few_lights() {
    compare(everything(3), 0, (3, 5), 24);
    compare(everything(3), 1, (3, 2), 24);
}

#[test]
fn both_estimators_agree_under_more_lights_than_are_all_asked() {
    compare(everything(90), 0, (4, 4), 24);
}
