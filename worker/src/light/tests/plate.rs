//! Lights without area over a plate: cosine, distance, cone, range, radius, occluder, scale.

use super::{ask, light, plate, upward};
use crate::testing::{add_quad, lambert, phong, scaled};
use glam::Vec3;
use kiln_proto::{
    scene::{Coding, Falloff, Light, LightShape, Mapping, Projector, Scene, SpotProfile, Texture, TextureRef},
    units::Rgb,
};
use std::f32::consts::PI;

const KD: f32 = 0.6;

fn lit(light: Light) -> Scene {
    Scene { lights: vec![light], ..plate(lambert(KD, 0.0)) }
}

/// Irradiance of the plate at a point, from what leaves it.
fn irradiance(light: Light, at: [f32; 3]) -> f32 {
    upward(lit(light), at).g * PI / KD
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-4 * b.abs() + 1e-7
}

fn spot(profile: SpotProfile, cut_off: f32, beam_width: f32) -> Light {
    light(LightShape::Spot { position: [0.0, 2.0, 0.0], direction: [0.0, -1.0, 0.0], cut_off, beam_width, profile })
}

#[test]
fn a_point_light_gives_its_intensity_over_distance_squared_times_the_cosine() {
    let point = Light { intensity: Rgb::new(3.0, 6.0, 9.0), ..light(LightShape::Point { position: [1.0, 2.0, -1.0] }) };
    for at in [[1.0, 0.0, -1.0], [-3.0, 0.0, 2.5], [4.9, 0.0, 4.9]] {
        let toward = Vec3::new(1.0, 2.0, -1.0) - Vec3::from_array(at);
        let expected = 6.0 * toward.normalize().y / toward.length_squared();
        let found = upward(lit(point.clone()), at);
        assert!(close(found.g * PI / KD, expected), "{at:?}: {found:?} {expected}");
        assert!(close(found.r * 2.0, found.g) && close(found.b * 2.0, found.g * 3.0));
    }
    let below = light(LightShape::Point { position: [0.0, -2.0, 0.0] });
    assert_eq!(irradiance(below, [0.5, 0.0, 0.5]), 0.0, "a light behind the plate");
}

#[test]
fn range_and_polynomial_weaken_as_their_formats_say() {
    let at = |falloff| irradiance(Light { falloff, ..light(LightShape::Point { position: [0.0, 2.0, 0.0] }) }, [0.0; 3]);
    assert!(close(at(Falloff::InverseSquare { range: Some(4.0) }), (1.0 - 1.0 / 16.0) / 4.0));
    assert_eq!(at(Falloff::InverseSquare { range: Some(1.9) }), 0.0);
    let polynomial = |attenuation, radius| at(Falloff::Polynomial { attenuation, radius });
    assert!(close(polynomial([1.0, 0.0, 0.0], 100.0), 1.0), "X3D's default: no falloff");
    assert!(close(polynomial([0.5, 1.0, 0.25], 100.0), 1.0 / 3.5));
    assert!(close(polynomial([0.1, 0.1, 0.0], 100.0), 1.0), "never more than its intensity");
    assert_eq!(polynomial([1.0, 0.0, 0.0], 1.9), 0.0);
}

#[test]
fn a_spot_fades_from_its_beam_to_its_edge_by_either_profile() {
    let (cut_off, beam) = (0.6f32, 0.2f32);
    for degrees in [0.0f64, 5.0, 11.4, 11.6, 20.0, 28.0, 34.3, 34.5, 60.0] {
        let (sin, cos) = kiln_proto::math::sin_cos_degrees(degrees);
        let at = [(2.0 * sin / cos) as f32, 0.0, 0.0];
        // cos/d² = cos³/h².
        let full = (cos * cos * cos / 4.0) as f32;
        let angle = (degrees.to_radians()) as f32;
        let linear = ((cut_off - angle) / (cut_off - beam)).clamp(0.0, 1.0);
        let edge = |a: f32| kiln_proto::math::sin_cos_turns(a / (2.0 * PI)).1;
        let cosine = ((cos as f32 - edge(cut_off)) / (edge(beam) - edge(cut_off))).clamp(0.0, 1.0);
        for (profile, share) in [(SpotProfile::Linear, linear), (SpotProfile::SquaredCosine, cosine * cosine)] {
            let found = irradiance(spot(profile, cut_off, beam), at);
            assert!((found - full * share).abs() < 2e-4 * full, "{profile:?} at {degrees}: {found} {}", full * share);
        }
    }
    // An edge without fading, and a cone of half a turn.
    assert!(close(irradiance(spot(SpotProfile::Linear, 0.5, 0.5), [0.5, 0.0, 0.0]), 0.25 * (4.0f32 / 4.25) * (4.0f32 / 4.25).sqrt()));
    assert!(irradiance(spot(SpotProfile::Linear, PI, PI), [4.0, 0.0, 0.0]) > 0.0);
}

#[test]
fn a_directional_light_gives_its_intensity_times_the_cosine_everywhere() {
    let direction = Vec3::new(0.3, -0.9, 0.2).normalize();
    let sun = Light { intensity: Rgb::splat(2.0), ..light(LightShape::Directional { direction: direction.to_array() }) };
    for at in [[0.0; 3], [-4.9, 0.0, 4.9]] {
        assert!(close(irradiance(sun.clone(), at), -2.0 * direction.y));
    }
    assert_eq!(irradiance(light(LightShape::Directional { direction: [0.0, 1.0, 0.0] }), [0.0; 3]), 0.0);
}

#[test]
fn a_glossy_plate_answers_with_its_brdf() {
    let sun = light(LightShape::Directional { direction: Vec3::new(0.6, -0.8, 0.0).to_array() });
    let scene = Scene { lights: vec![sun], ..plate(phong(0.3, 0.5, 20.0)) };
    let toward = [[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.48, 0.8, 0.36]];
    let answers = ask(scene, &toward.map(|d| ([1.0, 0.0, 1.0], d)), 64, 2);
    for (d, answer) in toward.iter().zip(answers) {
        let lobe = kiln_proto::math::pow(Vec3::from_array(*d).dot(Vec3::new(0.6, 0.8, 0.0)).max(0.0), 20.0);
        let expected = 0.8 * (0.3 / PI + 0.5 * 22.0 / (2.0 * PI) * lobe);
        assert!((answer.radiance.g / expected - 1.0).abs() < 1e-4, "{d:?}: {answer:?} {expected}");
        assert!(answer.stderr.g < 1e-6 * expected, "lights without area have no noise at a point");
    }
}

#[test]
fn an_occluder_throws_a_sharp_shadow() {
    let mut scene = lit(light(LightShape::Point { position: [0.0, 4.0, 0.0] }));
    add_quad(&mut scene, "occluder", [0.0, 2.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 0.0));
    // Its shadow on the plate is twice as large: x in [0, 2].
    for (x, dark) in [(-0.01, false), (0.01, true), (1.99, true), (2.01, false)] {
        assert_eq!(upward(scene.clone(), [x, 0.0, 0.3]).g == 0.0, dark, "{x}");
    }
}

#[test]
fn the_same_lights_over_a_scene_a_thousand_times_smaller_or_larger_give_the_same() {
    let build = |k: f32| {
        let mut scene = scaled(plate(phong(0.3, 0.5, 20.0)), k);
        let moved = |p: [f32; 3]| p.map(|v| v * k);
        let point = Light { intensity: Rgb::splat(k * k), ..light(LightShape::Point { position: moved([1.0, 2.0, 0.5]) }) };
        let falloff = Falloff::Polynomial { attenuation: [0.0, 0.5 / k, 0.2 / (k * k)], radius: 8.0 * k };
        let shape = LightShape::Spot {
            position: moved([-2.0, 3.0, 0.0]),
            direction: [0.0, -1.0, 0.0],
            cut_off: 0.9,
            beam_width: 0.3,
            profile: SpotProfile::Linear,
        };
        let spot = Light { falloff, ..light(shape) };
        let sun = light(LightShape::Directional { direction: [0.6, -0.8, 0.0] });
        scene.lights = vec![point, spot, sun];
        ask(scene, &[(moved([0.3, 0.0, 0.4]), [0.1, 1.0, 0.2]), (moved([-2.0, 0.0, 1.0]), [0.5, 0.5, 0.0])], 256, 4)
    };
    let metre = build(1.0);
    for k in [1e-3, 1e3] {
        for (a, b) in metre.iter().zip(build(k)) {
            assert!((a.radiance.g / b.radiance.g - 1.0).abs() < 1e-3, "{k}: {a:?} {b:?}");
        }
    }
}

#[test]
fn a_texture_colours_a_light_through_its_projector() {
    let texels = [[255u8, 0, 0], [0, 255, 0]].concat();
    let mut scene = lit(light(LightShape::Directional { direction: [0.0, -1.0, 0.0] }));
    scene.textures.push(Texture { name: "t".into(), width: 2, height: 1, coding: Coding::Linear, has_alpha: false, texels });
    // s = (x + 2)/4, t = (z + 2)/4.
    let matrix = [[0.25, 0.0, 0.0, 0.5], [0.0, 0.0, 0.25, 0.5], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    scene.projectors.push(Projector { name: "p".into(), light: Some(0), matrix });
    scene.lights[0].texture = Some(TextureRef { mapping: Mapping::Projected { projector: 0 }, ..TextureRef::plain(0, 0) });
    let at = |x: f32| upward(scene.clone(), [x, 0.0, 0.0]) * (PI / KD);
    assert!(close(at(-1.0).r, 1.0) && at(-1.0).g < 1e-4 && close(at(1.0).g, 1.0) && at(1.0).r < 1e-4);
    assert!(close(at(3.0).r, 1.0) && close(at(3.0).b, 1.0), "beside the picture the light keeps its colour");
}
