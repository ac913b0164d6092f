//! X3D's words about light and shadow, one by one.

use super::{light, plate, upward};
use crate::testing::{add_quad, lambert};
use kiln_proto::{
    scene::{Light, LightShape, Reflection, Scene},
    units::Rgb,
};
use std::f32::consts::PI;

/// A plate of Kd 0.5 under a sun straight above it, which an occluder hides at the origin.
fn hidden(change: impl FnOnce(&mut Scene)) -> f32 {
    let mut scene = plate(lambert(0.5, 0.0));
    add_quad(&mut scene, "occluder", [-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 0.0));
    let sun = light(LightShape::Directional { direction: [0.0, -1.0, 0.0] });
    scene.lights = vec![Light { casts_shadows: false, ..sun }];
    change(&mut scene);
    upward(scene, [0.0; 3]).g / (0.5 / PI)
}

fn is(found: f32, expected: f32) -> bool {
    (found - expected).abs() < 1e-5
}

#[test]
fn by_default_every_light_casts_shadows_on_everything_but_from_parts_that_cast_none() {
    assert_eq!(hidden(|_| {}), 0.0);
    assert_eq!(hidden(|s| s.lights[0].shadow_intensity = 0.5), 0.0, "shadowIntensity is a word of strict shadows");
    assert!(is(hidden(|s| s.surfaces[1].parts[0].casts_shadows = false), 1.0));
}

#[test]
fn strict_shadows_fall_only_where_the_file_asks_for_them() {
    let strict = |change: fn(&mut Scene)| {
        hidden(|s| {
            s.rules.strict = true;
            change(s);
        })
    };
    assert!(is(strict(|_| {}), 1.0));
    assert_eq!(strict(|s| s.surfaces[0].parts[0].receive_shadows = vec![0]), 0.0);
    assert_eq!(strict(|s| s.lights[0].casts_shadows = true), 0.0);
    assert!(is(strict(|s| (s.lights[0].casts_shadows, s.lights[0].shadow_intensity) = (true, 0.25)), 0.75));
    assert!(is(strict(|s| (s.lights[0].casts_shadows, s.surfaces[1].parts[0].casts_shadows) = (true, false)), 1.0));
}

#[test]
fn what_a_light_does_not_shine_on_stays_dark() {
    assert_eq!(hidden(|s| (s.surfaces[1].parts[0].casts_shadows, s.surfaces[0].parts[0].unlit_by) = (false, vec![0])), 0.0);
}

#[test]
fn the_ambient_term_comes_with_the_light_and_goes_with_its_shadow() {
    let ambient = |shadowed: bool| {
        hidden(|s| {
            s.lights[0].ambient = Rgb::splat(0.4);
            s.surfaces[1].parts[0].casts_shadows = shadowed;
            let Reflection::Phong(phong) = &mut s.materials[0].reflection else { panic!() };
            phong.ambient = 0.2;
        })
    };
    // In units of Kd/pi: 1 of the light, pi times 0.4 times 0.2 of the ambient term.
    assert!(is(ambient(false), 1.0 + PI * 0.08), "{}", ambient(false));
    assert_eq!(ambient(true), 0.0);
}

#[test]
fn emissive_surfaces_and_the_environment_are_hidden_by_every_part() {
    // A lamp of radiance 1 as large as half the sky would be blind to no part: both of its techniques see the same.
    let lit_by_sky = |casts: bool| {
        hidden(|s| {
            s.lights.clear();
            s.surfaces[1].parts[0].casts_shadows = casts;
            s.environment = Some(super::sky(4, 2, |_, _| [1.0; 3]));
        })
    };
    assert_eq!(lit_by_sky(true), lit_by_sky(false));
}
