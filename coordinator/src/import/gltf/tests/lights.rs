use super::*;
use kiln_proto::scene::{Falloff, Lens, LightShape, SpotProfile};

/// The triangle lit by one light that a node turns by 90 degrees about +X: -Z becomes +Y.
fn lit(light: &Value) -> Sample {
    let mut sample = Sample::triangle();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let node = json!({
        "name": "lamp", "translation": [1, 2, 3], "rotation": [half, 0, 0, half], "scale": [2, 5, 3],
        "extensions": { "KHR_lights_punctual": { "light": 0 } }
    });
    sample.show(node);
    sample.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    sample.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    sample
}

#[test]
fn point_spot_and_directional_lights_stand_in_the_world() {
    let point = lit(&json!({ "type": "point", "color": [1, 0.5, 0], "intensity": 8, "range": 4 })).scene().lights.remove(0);
    assert_eq!((point.name.as_str(), point.intensity.to_array()), ("lamp", [8.0, 4.0, 0.0]));
    assert_eq!(point.shape, LightShape::Point { position: [1.0, 2.0, 3.0] });
    assert_eq!(point.falloff, Falloff::InverseSquare { range: Some(4.0) });
    assert!(point.casts_shadows && point.shadow_intensity == 1.0);
    let spot = lit(&json!({ "type": "spot", "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } })).scene().lights.remove(0);
    let LightShape::Spot { position, direction, cut_off, beam_width, profile } = spot.shape else { panic!("{spot:?}") };
    assert_eq!((position, cut_off, beam_width, profile), ([1.0, 2.0, 3.0], 0.5, 0.25, SpotProfile::SquaredCosine));
    assert!((glam::Vec3::from_array(direction) - glam::Vec3::Y).length() < 1e-6, "{direction:?}");
    let sun = lit(&json!({ "type": "directional" })).scene().lights.remove(0);
    let LightShape::Directional { direction } = sun.shape else { panic!("{sun:?}") };
    assert!((glam::Vec3::from_array(direction) - glam::Vec3::Y).length() < 1e-6 && sun.intensity.to_array() == [1.0; 3]);
}

#[test]
fn a_spot_with_a_hard_edge_gets_a_narrow_one() {
    let found = lit(&json!({ "type": "spot", "spot": { "innerConeAngle": 0.5, "outerConeAngle": 0.5 } })).import();
    assert!(found.warns("spot lights without a soft edge, which glTF forbids, were given a narrow one: 1"));
    let LightShape::Spot { cut_off, beam_width, .. } = found.scene().lights[0].shape else { panic!() };
    assert!(cut_off == 0.5 && beam_width < 0.5 && beam_width > 0.499);
}

#[test]
fn lights_of_one_name_are_told_apart() {
    let mut sample = lit(&json!({ "type": "point", "name": "bulb" }));
    for _ in 0..2 {
        sample.show(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    }
    let names: Vec<String> = sample.scene().lights.iter().map(|l| l.name.clone()).collect();
    assert_eq!(names, ["lamp", "bulb", "bulb-2"]);
}

#[test]
fn impossible_lights_are_located() {
    for (light, wanted) in [
        (json!({ "type": "area" }), "`area` is no type of light"),
        (json!({}), "the property `type` is missing"),
        (json!({ "type": "spot" }), "the property `spot` is missing"),
        (json!({ "type": "point", "range": 0 }), "the range of a light must be more than 0"),
        (json!({ "type": "point", "intensity": -1 }), "/intensity: the value -1 is out of range"),
        (json!({ "type": "point", "intensity": 2e13 }), "the light has the intensity 2e13; at most 1e13 is possible"),
        (json!({ "type": "point", "color": [2, 0, 0] }), "/color/0: the value 2 is out of range; it must lie in [0, 1]"),
        (json!({ "type": "spot", "spot": { "innerConeAngle": 0.6, "outerConeAngle": 0.5 } }), "must be less than the outer angle"),
        (json!({ "type": "spot", "spot": { "outerConeAngle": 2 } }), "/spot/outerConeAngle: the value 2 is out of range"),
    ] {
        let error = lit(&light).error();
        assert!(error.contains("/extensions/KHR_lights_punctual/lights/0") && error.contains(wanted), "{error}");
    }
    let mut sample = lit(&json!({ "type": "point" }));
    sample.json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = json!(1);
    assert!(sample.error().contains("/nodes/1/extensions/KHR_lights_punctual/light: there is no light 1"));
}

#[test]
fn cameras_are_kept_in_the_world() {
    let mut sample = Sample::triangle();
    sample.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.75, "znear": 0.1 } }));
    sample.push("cameras", json!({ "type": "orthographic", "orthographic": { "xmag": 4, "ymag": 3, "znear": 0, "zfar": 9 } }));
    sample.show(json!({ "camera": 0, "name": "front", "translation": [0, 0, 5], "scale": [1, 2, 3] }));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    sample.show(json!({ "camera": 1, "rotation": [-half, 0, 0, half] }));
    let cameras = sample.scene().cameras;
    assert_eq!((cameras[0].name.as_str(), cameras[0].lens), ("front", Lens::Perspective { fov: 0.75, of_smaller: false }));
    assert_eq!((cameras[0].eye, cameras[0].forward, cameras[0].up), ([0.0, 0.0, 5.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]));
    assert_eq!((cameras[1].name.as_str(), cameras[1].lens), ("camera1", Lens::Orthographic { half_height: 3.0 }));
    let (forward, up) = (glam::Vec3::from_array(cameras[1].forward), glam::Vec3::from_array(cameras[1].up));
    assert!((forward + glam::Vec3::Y).length() < 1e-6 && (up + glam::Vec3::Z).length() < 1e-6, "{forward} {up}");
    sample.json["cameras"][0]["perspective"]["yfov"] = json!(1e-300);
    assert!(sample.error().contains("/cameras/0/perspective/yfov: the field of view"), "too small for single precision");
    sample.json["cameras"][0]["perspective"]["yfov"] = json!(0);
    assert!(sample.error().contains("/cameras/0/perspective/yfov: the field of view 0 must lie between 0 and pi"));
}
