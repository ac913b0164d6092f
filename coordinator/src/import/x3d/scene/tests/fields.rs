//! Every field of the shadow and projector extensions, from each encoding into the canonical scene.

use super::{Node, Value::*, *};
use kiln_proto::{
    options::{LightUnits, OutsideMap, ShadowMode},
    scene::{Falloff, Light, LightShape, Projection, ShadowCompare, ShadowMap, ShadowUpdate, SpotProfile},
    units::Rgb,
};
use std::f32::consts::PI;

fn light(fields: Node) -> Light {
    scene_of(&[fields, shape(vec![])]).lights[0].clone()
}

fn projection(kind: &'static str, field: &'static str, value: &'static str) -> Projection {
    light(node(kind, [(field, One(value))])).projection
}

fn refused(root: Node, wanted: &str) {
    for errors in refusals(&[root, shape(vec![])]) {
        assert!(errors.iter().any(|e| e.contains(wanted)), "{wanted} is not in {errors:?}");
    }
}

#[test]
fn projection_near_and_far_of_every_light() {
    for kind in ["DirectionalLight", "PointLight", "SpotLight"] {
        let near = projection(kind, "projectionNear", "0.25");
        assert_eq!((near.near, near.automatic & 1), (0.25, 0), "{kind}");
        let far = projection(kind, "projectionFar", "40");
        assert_eq!((far.far, far.automatic & 2), (40.0, 0), "{kind}");
        assert_eq!(projection(kind, "on", "TRUE").automatic & 3, 3, "{kind}: zero means automatic");
        refused(node(kind, [("projectionNear", One("5")), ("projectionFar", One("5"))]), "not below projectionFar 5");
        refused(node(kind, [("projectionFar", One("-1"))]), "projectionFar -1");
    }
}

#[test]
fn up_is_made_orthogonal_and_zero_is_local_y() {
    for kind in ["DirectionalLight", "SpotLight"] {
        assert_eq!(projection(kind, "up", "3 0 7").up, [1.0, 0.0, 0.0], "{kind} looks along -Z");
        assert_eq!(projection(kind, "up", "0 0 0").up, [0.0, 1.0, 0.0], "{kind}");
    }
    let turned = node("Transform", [("rotation", One("0 0 1 1.5707963267948966")), ("children", Children(vec![node("SpotLight", [])]))]);
    let up = light(turned).projection.up;
    assert!((up[0] + 1.0).abs() < 1e-6 && up[1].abs() < 1e-6, "local +Y, in the world: {up:?}");
}

#[test]
fn default_shadow_map_and_each_of_its_fields() {
    let map = |fields: Vec<(&'static str, Value)>| {
        let map = node("GeneratedShadowMap", fields);
        light(node("SpotLight", [("defaultShadowMap", Child(map))])).shadow_map.unwrap()
    };
    let default = ShadowMap { update: ShadowUpdate::None, size: 128, scale: 1.1, bias: 4.0, compare: ShadowCompare::LessEqual };
    assert_eq!(map(vec![]), default);
    assert_eq!(map(vec![("update", Text("ALWAYS"))]).update, ShadowUpdate::Always);
    assert_eq!(map(vec![("update", Text("NEXT_FRAME_ONLY"))]).update, ShadowUpdate::NextFrameOnly);
    assert_eq!(map(vec![("size", One("1024"))]).size, 1024);
    assert_eq!(map(vec![("scale", One("2.5"))]).scale, 2.5);
    assert_eq!(map(vec![("bias", One("10"))]).bias, 10.0);
    for (word, compare) in [
        ("COMPARE_R_LEQUAL", ShadowCompare::LessEqual),
        ("COMPARE_R_EQUAL", ShadowCompare::LessEqual),
        ("COMPARE_R_GEQUAL", ShadowCompare::GreaterEqual),
        ("NONE", ShadowCompare::None),
    ] {
        assert_eq!(map(vec![("compareMode", Text(word))]).compare, compare, "{word}");
    }
    let bad = node("GeneratedShadowMap", [("size", One("0"))]);
    refused(node("SpotLight", [("defaultShadowMap", Child(bad))]), "GeneratedShadowMap has the size 0");
}

#[test]
fn directional_rectangle_and_location() {
    let p = light(node("DirectionalLight", [("projectionRectangle", One("-1 -2 3 4")), ("projectionLocation", One("5 6 7"))])).projection;
    assert_eq!((p.rectangle, p.location, p.automatic & 4), ([-1.0, -2.0, 3.0, 4.0], [5.0, 6.0, 7.0], 0));
    let scaled = node("Transform", [("scale", One("2 2 2")), ("translation", One("0 1 0"))]);
    let inner = node(
        "DirectionalLight",
        [("projectionRectangle", One("-1 -2 3 4")), ("projectionLocation", One("5 6 7")), ("projectionFar", One("9"))],
    );
    let p = light(scaled.with("children", Children(vec![inner]))).projection;
    assert_eq!((p.rectangle, p.location, p.far), ([-2.0, -4.0, 6.0, 8.0], [10.0, 13.0, 14.0], 18.0));
    refused(node("DirectionalLight", [("projectionRectangle", One("1 0 1 1"))]), "projectionRectangle 1 0 1 1");
}

#[test]
fn an_automatic_rectangle_is_fitted_to_what_casts() {
    // A box of 2 m about the origin, and one of 2 m at x = 10 that casts no shadow.
    let aside = shape(vec![("shadowCaster", One("FALSE"))]);
    let moved = node("Transform", [("translation", One("10 0 0")), ("children", Children(vec![aside]))]);
    let p = scene_of(&[node("DirectionalLight", []), shape(vec![]), moved]).lights[0].projection;
    // The location lies one size beyond the corner that faces the light: at (-3, -3, 3).
    assert_eq!((p.location, p.rectangle), ([-3.0, -3.0, 3.0], [2.0, 2.0, 4.0, 4.0]));
    assert_eq!((p.near, p.far, p.automatic), (1.0, 8.0, 7));
    // From so far that all corners have the same number.
    let [left, _, right, _] = light(node("DirectionalLight", [("projectionLocation", One("1e9 0 0"))])).projection.rectangle;
    assert!(left < -1e9 && right > -1e9 && right - left < 1e4, "{left} {right}");
}

#[test]
fn a_viewpoint_without_height_is_left_out() {
    let view = |extent| scene_of(&[node("OrthoViewpoint", [("fieldOfView", Many(extent))]), shape(vec![])]).cameras;
    assert_eq!(view("-2 -1 2 3")[0].lens, kiln_proto::scene::Lens::Orthographic { half_height: 2.0 });
    assert!(view("-1 1 1 1").is_empty() && view("-1 -3e38 1 3e38").is_empty());
}

/// The place is asked of the file's numbers, not of where the light's group has moved them.
#[test]
fn a_directional_light_without_a_place_has_none_in_a_moved_group() {
    let moved = |light| node("Transform", [("translation", One("50 0 0")), ("children", Children(vec![light, shape(vec![])]))]);
    let p = scene_of(&[moved(node("DirectionalLight", []))]).lights[0].projection;
    assert_eq!((p.location, p.rectangle), ([47.0, -3.0, 3.0], [2.0, 2.0, 4.0, 4.0]));
    assert_eq!((p.near, p.far, p.automatic), (1.0, 8.0, 7));
    // One that its author put where the world has its origin stays there.
    let p = scene_of(&[moved(node("DirectionalLight", [("projectionLocation", One("-50 0 0"))]))]).lights[0].projection;
    assert_eq!((p.location, p.rectangle), ([0.0; 3], [49.0, -1.0, 51.0, 1.0]));
}

#[test]
fn spot_angle_is_the_field_of_view() {
    assert_eq!(projection("SpotLight", "projectionAngle", "0.6").angle, 0.6);
    let found = projection("SpotLight", "cutOffAngle", "0.4");
    assert_eq!((found.angle, found.automatic & 8), (0.8, 8), "twice the cut-off angle");
    refused(node("SpotLight", [("projectionAngle", One("4"))]), "projectionAngle 4");
}

#[test]
fn receive_shadows_and_shadow_caster() {
    let lamp = node("SpotLight", [("location", One("0 5 0"))]).def("Lamp");
    let scene = scene_of(&[
        lamp,
        node("PointLight", []),
        shape(vec![("receiveShadows", Uses("SpotLight", "Lamp"))]),
        node("Transform", [("translation", One("5 0 0")), ("children", Children(vec![shape(vec![("shadowCaster", One("FALSE"))])]))]),
    ]);
    let parts: Vec<_> = scene.surfaces.iter().map(|s| (s.parts[0].receive_shadows.clone(), s.parts[0].casts_shadows)).collect();
    assert_eq!(parts, [(vec![0], true), (vec![], false)]);
    assert!(scene.lights[0].shadow_map.is_some_and(|m| m.update == ShadowUpdate::Always), "a NULL defaultShadowMap acts as ALWAYS");
    assert!(scene.lights[1].shadow_map.is_none(), "nobody wants its shadow");
}

#[test]
fn a_generated_shadow_map_is_carried_and_its_own_light_does_not_shine() {
    let inside = node("SpotLight", [("location", One("0 5 0"))]);
    let map = node("GeneratedShadowMap", [("light", Child(inside)), ("size", One("64"))]);
    let scene = scene_of(&[node("PointLight", []), shape(vec![("texture", Child(map))])]);
    let part = &scene.surfaces[0].parts[0];
    assert_eq!((part.shadow_maps[0].0, part.shadow_maps[0].1.size, part.receive_shadows.clone()), (1, 64, vec![1]));
    assert_eq!((scene.lights[0].intensity, scene.lights[1].intensity), (Rgb::splat(PI), Rgb::BLACK));
    // A light that stands in the scene and is used there shines.
    let shining = node("GeneratedShadowMap", [("light", Use("SpotLight", "Lamp"))]);
    let scene = scene_of(&[node("SpotLight", []).def("Lamp"), shape(vec![("texture", Child(shining))])]);
    assert_eq!((scene.lights.len(), scene.lights[0].intensity), (1, Rgb::splat(PI)));
}

#[test]
fn later_fields_of_the_standard() {
    let lit = light(node("SpotLight", [("shadows", One("TRUE"))]));
    assert!(lit.casts_shadows && lit.shadow_map.is_some());
    assert!(!light(node("SpotLight", [])).casts_shadows);
    assert_eq!(light(node("PointLight", [("shadowIntensity", One("0.25"))])).shadow_intensity, 0.25);
    let part = |value| scene_of(&[node("PointLight", []), shape(vec![]).with("castShadow", One(value))]).surfaces[0].parts[0].casts_shadows;
    assert_eq!((part("TRUE"), part("FALSE")), (true, false));
}

#[test]
fn options_reach_the_scene() {
    let roots = [node("DirectionalLight", [("intensity", One("0.5")), ("color", One("1 0.5 0"))]), shape(vec![])];
    assert_eq!(scene_of(&roots).lights[0].intensity, Rgb::new(0.5 * PI, 0.25 * PI, 0.0), "Kd I cos is the radiance of a Lambert surface");
    let options = ImportOptions {
        light_units: LightUnits::Physical,
        x3d_shadows: ShadowMode::Strict,
        x3d_outside_map: OutsideMap::Shadowed,
        ..ImportOptions::default()
    };
    let scene = scene_with(&roots, &options);
    assert_eq!(scene.lights[0].intensity, Rgb::new(0.5, 0.25, 0.0));
    assert!(scene.rules.strict && scene.rules.outside_is_shadowed);
    assert_eq!(scene.lights[0].falloff, Falloff::InverseSquare { range: None });
}

#[test]
fn lights_keep_shape_falloff_and_ambient() {
    let spot = node(
        "SpotLight",
        [
            ("location", One("1 2 3")),
            ("direction", One("0 -2 0")),
            ("cutOffAngle", One("0.5")),
            ("beamWidth", One("0.25")),
            ("attenuation", One("1 2 4")),
            ("radius", One("8")),
            ("ambientIntensity", One("0.1")),
        ],
    );
    let lit = light(spot.clone());
    let (position, direction) = ([1.0, 2.0, 3.0], [0.0, -1.0, 0.0]);
    assert_eq!(lit.shape, LightShape::Spot { position, direction, cut_off: 0.5, beam_width: 0.25, profile: SpotProfile::Linear });
    assert_eq!((lit.falloff, lit.ambient), (Falloff::Polynomial { attenuation: [1.0, 2.0, 4.0], radius: 8.0 }, Rgb::splat(0.1)));
    // Twice as large a group reaches twice as far.
    let doubled = light(node("Transform", [("scale", One("2 2 2")), ("children", Children(vec![spot]))]));
    assert_eq!(doubled.falloff, Falloff::Polynomial { attenuation: [1.0, 1.0, 1.0], radius: 16.0 });
    refused(node("PointLight", [("radius", One("-1"))]), "radius -1");
    refused(node("SpotLight", [("direction", One("0 0 0"))]), "direction without length");
    refused(node("PointLight", [("intensity", One("5e12"))]), "has the intensity 5e12, which with its color is more than 1e13");
    refused(node("PointLight", [("ambientIntensity", One("3e38"))]), "has the ambientIntensity 3e38");
}

#[test]
fn a_light_that_is_not_global_shines_on_its_group_only() {
    let inside = node("Group", [("children", Children(vec![node("DirectionalLight", []), shape(vec![])]))]);
    let outside = node("Transform", [("translation", One("5 0 0")), ("children", Children(vec![shape(vec![])]))]);
    let scene = scene_of(&[inside, outside, node("PointLight", [])]);
    let unlit: Vec<_> = scene.surfaces.iter().map(|s| s.parts[0].unlit_by.clone()).collect();
    assert_eq!(unlit, [vec![], vec![0]]);
}

#[test]
fn a_light_that_is_none_is_an_error_once_however_many_ask_for_it() {
    let bad = node("SpotLight", [("cutOffAngle", One("4"))]).def("Lamp");
    let mut roots = vec![shape(vec![("receiveShadows", Children(vec![bad]))])];
    roots.extend((0..3).map(|_| shape(vec![("receiveShadows", Uses("SpotLight", "Lamp"))])));
    for errors in refusals(&roots) {
        assert_eq!(errors, ["SpotLight has the cutOffAngle 4; it lies in (0, pi/2]"]);
    }
}
