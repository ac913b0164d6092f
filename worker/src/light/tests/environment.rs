//! The environment: density, orientation, brute-force sums, noise of a sun.

use super::{ask, light, plate, sky, upward};
use crate::{
    light::environment::Sky,
    sampling::chi_square::{Case, check},
    testing::{add_quad, lambert, phong},
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    scene::{Environment, LightShape, Scene},
    units::Rgb,
};
use std::f64::consts::PI;

/// Uneven, coloured, brighter above.
fn uneven() -> Environment {
    let texel = |x: u32, y: u32| [0.2 + ((x * 7 + y * 3) % 5) as f32, 0.1 * y as f32, if (x, y) == (3, 6) { 40.0 } else { 0.3 }];
    Environment { rotation: 0.7, intensity: 1.5, ..sky(12, 9, texel) }
}

#[test]
fn directions_follow_their_density_and_values_agree() {
    let sun = sky(16, 8, |x, y| [if (x, y) == (5, 4) { 1000.0 } else { 1.0 }; 3]);
    let black_row = sky(9, 6, |x, y| [if y == 3 { 0.0 } else { x as f32 }; 3]);
    let maps = [uneven(), sun, black_row, sky(1, 1, |_, _| [2.0; 3]), sky(2, 1, |x, _| [x as f32; 3])];
    let skies: Vec<Sky> = maps.iter().map(|m| Sky::new(m).unwrap()).collect();
    type Sampler<'a> = Box<dyn Fn([f32; 2]) -> Vec3 + 'a>;
    type Density<'a> = Box<dyn Fn(Vec3) -> f32 + 'a>;
    let pairs: Vec<(Sampler<'_>, Density<'_>)> = maps
        .iter()
        .zip(&skies)
        .map(|(map, sky)| {
            let sample: Sampler<'_> = Box::new(|u| sky.sample(map, u).map_or(Vec3::ZERO, |s| s.direction));
            let pdf: Density<'_> = Box::new(|d| sky.eval(map, d).1);
            (sample, pdf)
        })
        .collect();
    let names = ["uneven", "sun", "black row", "one texel", "two texels"];
    check(&names.iter().zip(&pairs).map(|(n, (s, p))| Case::new(n, s, p)).collect::<Vec<_>>());
    for (map, sky) in maps.iter().zip(&skies) {
        for i in 0..500u32 {
            let s = sky.sample(map, [(i as f32 + 0.5) / 500.0, (i.reverse_bits() >> 8) as f32 / 16_777_216.0]).unwrap();
            let (radiance, pdf) = sky.eval(map, s.direction);
            let cos = (1.0 - s.direction.y * s.direction.y).max(0.0).sqrt();
            // At the poles all longitudes are one direction.
            if cos < 0.01 {
                continue;
            }
            assert!((pdf / s.pdf - 1.0).abs() < 1e-3 + 1e-4 / cos, "{s:?} {pdf}");
            assert!((radiance.r - s.radiance.r).abs() < 1e-3 * s.radiance.r.max(1.0), "{s:?} {radiance:?}");
        }
    }
    assert!(Sky::new(&sky(4, 2, |_, _| [0.0; 3])).is_none() && Sky::new(&Environment { intensity: 0.0, ..uneven() }).is_none());
}

#[test]
fn the_middle_is_east_rows_go_up_and_rotation_turns_about_up() {
    // One red texel toward +X, one green toward +Z, a blue row at the top.
    let map = sky(64, 33, |x, y| match (x, y) {
        (31 | 32, 16) => [1.0, 0.0, 0.0],
        (47 | 48, 16) => [0.0, 1.0, 0.0],
        (_, 32) => [0.0, 0.0, 1.0],
        _ => [0.0; 3],
    });
    let seen = |map: &Environment, d: Vec3| Sky::new(map).unwrap().eval(map, d).0;
    assert_eq!(
        (seen(&map, Vec3::X), seen(&map, Vec3::Z), seen(&map, Vec3::Y)),
        (Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.0, 0.0, 1.0))
    );
    assert_eq!((seen(&map, -Vec3::Y), seen(&map, -Vec3::X)), (Rgb::BLACK, Rgb::BLACK));
    // A quarter turn about +Y carries +X to -Z and +Z to +X.
    let turned = Environment { rotation: std::f32::consts::FRAC_PI_2, intensity: 2.0, ..map };
    assert!((seen(&turned, -Vec3::Z).r - 2.0).abs() < 1e-4 && (seen(&turned, Vec3::X).g - 2.0).abs() < 1e-4);
}

/// Irradiance of a surface facing up from the directions that `visible` lets through, by a sum over pieces of texels.
fn brute_force(map: &Environment, visible: impl Fn(DVec3) -> bool) -> DVec3 {
    let sky = Sky::new(map).unwrap();
    let (w, h) = (map.width * 48, map.height * 48);
    let mut sum = DVec3::ZERO;
    for (j, i) in (0..h).flat_map(|j| (0..w).map(move |i| (j, i))) {
        let (sin, cos) = kiln_proto::math::sin_cos_degrees(((f64::from(j) + 0.5) / f64::from(h) - 0.5) * 180.0);
        let (s, c) = kiln_proto::math::sin_cos_degrees((f64::from(i) + 0.5) / f64::from(w) * 360.0);
        let d = DVec3::new(c * cos, sin, s * cos);
        if sin > 0.0 && visible(d) {
            let light = sky.eval(map, d.as_vec3()).0.to_array().map(f64::from);
            sum += DVec3::from_array(light) * sin * cos * (2.0 * PI / f64::from(w)) * (PI / f64::from(h));
        }
    }
    sum
}

#[test]
fn a_plate_agrees_with_a_sum_over_texels_open_and_half_occluded() {
    let kd = 0.6;
    let at = [1.0f32, 0.0, -0.5];
    let wall = |scene: &mut Scene| add_quad(scene, "wall", [2.0, 0.0, -9.0], [0.0, 0.0, 18.0], [0.0, 7.0, 0.0], lambert(0.0, 0.0));
    // The wall at x = 2 is seen within |z| < 9, below y = 7.
    let behind = |d: DVec3| d.x > 0.0 && (d.z / d.x - 0.5).abs() < 9.0 && d.y / d.x < 7.0;
    for occluded in [false, true] {
        let mut scene = Scene { environment: Some(uneven()), ..plate(lambert(kd, 0.0)) };
        if occluded {
            wall(&mut scene);
        }
        let answer = ask(scene, &[(at, [0.0, 1.0, 0.0])], 1024, 32)[0];
        let expected = brute_force(&uneven(), |d| !(occluded && behind(d))) * f64::from(kd) / PI;
        for (k, (found, error)) in answer.radiance.to_array().into_iter().zip(answer.stderr.to_array()).enumerate() {
            let off = (f64::from(found) - expected[k]).abs();
            assert!(off < 4.0 * f64::from(error) + 3e-4 * expected[k] && off < 0.01 * expected[k], "{answer:?} {expected}");
        }
    }
}

#[test]
fn a_sun_of_one_texel_has_little_noise() {
    let height = 64;
    let map = sky(128, height, |x, y| [if (x, y) == (20, 50) { 1e6 } else { 0.5 }; 3]);
    let expected = brute_force_sun(&map);
    let answer = ask(Scene { environment: Some(map), ..plate(phong(0.3, 0.5, 20.0)) }, &[([0.0; 3], [0.0, 1.0, 0.0])], 256, 16)[0];
    assert!(answer.stderr.g < 0.003 * answer.radiance.g, "{answer:?}");
    assert!((f64::from(answer.radiance.g) / expected - 1.0).abs() < 0.01, "{answer:?} {expected}");
}

/// The sun's light as that of a light in the middle of its texel, the sky's by its integral.
fn brute_force_sun(map: &Environment) -> f64 {
    let sky = Sky::new(map).unwrap();
    let (latitude, longitude) = ((50.5 / 64.0 - 0.5) * 180.0, (20.5 / 128.0 - 0.5) * 360.0);
    let ((sin, cos), (s, c)) = (kiln_proto::math::sin_cos_degrees(latitude), kiln_proto::math::sin_cos_degrees(longitude));
    let d = DVec3::new(c * cos, sin, s * cos).as_vec3();
    let solid_angle = 2.0 * PI / 128.0 * (PI / 64.0) * cos;
    assert!(sky.eval(map, d).0.g > 9e5);
    let sun = light(LightShape::Directional { direction: (-d).to_array() });
    let scene = Scene {
        lights: vec![kiln_proto::scene::Light { intensity: Rgb::splat((1e6 * solid_angle) as f32), ..sun }],
        ..plate(phong(0.3, 0.5, 20.0))
    };
    f64::from(upward(scene, [0.0; 3]).g) + 0.5 * 0.8
}

#[test]
fn an_open_scene_under_a_constant_sky_reflects_its_albedo() {
    let even = |material| Scene { environment: Some(sky(8, 4, |_, _| [1.0; 3])), ..plate(material) };
    let matt = ask(even(lambert(0.7, 0.0)), &[([0.0; 3], [0.3, 1.0, 0.2])], 256, 8)[0];
    assert!((matt.radiance.g - 0.7).abs() < 4.0 * matt.stderr.g + 1e-4 && matt.stderr.g < 0.005, "{matt:?}");
    let glossy = ask(even(phong(0.3, 0.5, 40.0)), &[([0.0; 3], [0.0, 1.0, 0.0])], 512, 16)[0];
    assert!((glossy.radiance.g - 0.8).abs() < 4.0 * glossy.stderr.g + 1e-3 && glossy.stderr.g < 0.01, "{glossy:?}");
}

#[test]
fn many_turns_are_as_exact_as_none() {
    for turns in [0.0, 1e4, 1e8] {
        let map = Environment { rotation: (turns * 2.0 * PI) as f32, ..uneven() };
        let sky = Sky::new(&map).unwrap();
        for i in 0..200u32 {
            let s = sky.sample(&map, [(i as f32 + 0.5) / 200.0, (i.reverse_bits() >> 8) as f32 / 16_777_216.0]).unwrap();
            if s.direction.y.abs() < 0.99 {
                let (radiance, pdf) = sky.eval(&map, s.direction);
                assert!(
                    (pdf / s.pdf - 1.0).abs() < 2e-3 && (radiance.r - s.radiance.r).abs() < 2e-3 * s.radiance.r,
                    "{turns}: {s:?} {pdf}"
                );
            }
        }
    }
}
