use super::*;

/// The triangle with one animated property of its node, key frames at 1 and 3 seconds.
fn animated(path: &str, interpolation: &str, kind: &str, values: &[f32]) -> Sample {
    let mut sample = Sample::triangle();
    let input = sample.floats("SCALAR", &[1.0, 3.0]);
    sample.json["accessors"][input]["min"] = json!([1]);
    sample.json["accessors"][input]["max"] = json!([3]);
    let output = sample.floats(kind, values);
    let samplers = json!([{ "input": input, "output": output, "interpolation": interpolation }]);
    sample.push("animations", json!({ "samplers": samplers, "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }] }));
    sample
}

/// Where the second corner, (1, 0, 0) at rest, is at a time.
fn second(sample: &Sample, time: Option<f64>) -> [f32; 3] {
    corners(&sample.import_at(time).scene(), 0, 0)[1]
}

fn near(a: [f32; 3], b: [f32; 3]) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} is not {b:?}");
}

#[test]
fn linear_values_are_clamped_at_both_ends() {
    let sample = animated("translation", "LINEAR", "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    near(second(&sample, None), [1.0, 0.0, 0.0]);
    for (time, y) in [(0.0, 0.0), (1.0, 0.0), (1.5, 1.0), (3.0, 4.0), (99.0, 4.0)] {
        near(second(&sample, Some(time)), [1.0, y, 0.0]);
    }
    assert!(sample.import().warns("/animations/0: the file has 1 animations; the rest pose is imported"));
    assert_eq!(sample.import_at(Some(0.0)).warnings, [""; 0]);
}

#[test]
fn steps_hold_their_value_until_the_next() {
    let sample = animated("scale", "STEP", "VEC3", &[2.0, 2.0, 2.0, 5.0, 5.0, 5.0]);
    for (time, x) in [(0.0, 2.0), (2.999, 2.0), (3.0, 5.0), (4.0, 5.0)] {
        near(second(&sample, Some(time)), [x, 0.0, 0.0]);
    }
}

#[test]
fn rotations_turn_evenly() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let sample = animated("rotation", "LINEAR", "VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let third = second(&sample, Some(1.0 + 2.0 / 3.0));
    near(third, [0.75f32.sqrt(), 0.5, 0.0]);
    near(second(&sample, Some(3.0)), [0.0, 1.0, 0.0]);
}

#[test]
fn cubic_splines_follow_their_tangents() {
    // In-tangent, value, out-tangent; over two seconds the tangents count twice.
    let values = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]].concat();
    let sample = animated("translation", "CUBICSPLINE", "VEC3", &values);
    near(second(&sample, Some(2.0)), [1.0, 0.5, 0.0]);
    near(second(&sample, Some(1.0)), [1.0, 0.0, 0.0]);
    near(second(&sample, Some(9.0)), [1.0, 0.0, 0.0]);
}

#[test]
fn faulty_animations_are_located() {
    for (path, kind, values, wanted) in [
        ("translation", "VEC3", vec![0.0; 9], "2 values of type VEC3 are expected for `translation`; there are 3"),
        ("colour", "VEC3", vec![0.0; 6], "`colour` cannot be animated"),
    ] {
        let error = animated(path, "LINEAR", kind, &values).error();
        assert!(error.contains("/animations/0/channels/0/target: ") && error.contains(wanted), "{error}");
    }
    let error = animated("translation", "LINEAR", "VEC4", &[0.0; 8]).error();
    assert!(error.contains("/animations/0/samplers/0/output: an accessor of type VEC3 is expected here, not VEC4"), "{error}");
    let with = |change: fn(&mut Sample)| {
        let mut sample = animated("translation", "LINEAR", "VEC3", &[0.0; 6]);
        change(&mut sample);
        sample.error()
    };
    assert!(with(|s| s.json["animations"][0]["channels"][0]["sampler"] = json!(1)).contains("there is no sampler 1"));
    assert!(with(|s| s.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBIC")).contains("`CUBIC` is no interpolation"));
    assert!(
        with(|s| s.json["animations"][0]["samplers"][0]["input"] = json!(0))
            .contains("/input: an accessor of type SCALAR is expected here")
    );
    assert!(with(|s| s.bytes[36..40].copy_from_slice(&5.0f32.to_le_bytes())).contains("time 1 is 3; times must be 0 or more and rise"));
    let identity = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let mut sample = animated("translation", "LINEAR", "VEC3", &[0.0; 6]);
    sample.json["nodes"][0]["matrix"] = identity;
    assert!(sample.error().contains("node 0 has a `matrix`, so its translation cannot be animated"));
    let mut sample = animated("pointer", "LINEAR", "VEC3", &[0.0; 6]);
    sample.json["animations"][0]["channels"][0]["target"] =
        json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": "/materials/0" } } });
    assert!(sample.import().warns("(KHR_animation_pointer) were skipped: 1"));
}

/// Integers stand for numbers in [-1, 1] only where they say so.
#[test]
fn key_frames_are_of_the_types_that_their_property_allows() {
    let turned = |path: &str, kind: &str, normalized: bool| {
        let mut sample = animated(path, "STEP", "VEC4", &[0.0; 8]);
        let output = sample.accessor(5123, kind, &[0, 0, 0, 0, 0xff, 0xff, 0, 0].repeat(2), 2);
        if kind == "VEC3" {
            let view = sample.json["accessors"][output]["bufferView"].as_u64().unwrap() as usize;
            sample.json["bufferViews"][view]["byteStride"] = json!(8);
        }
        sample.json["accessors"][output]["normalized"] = json!(normalized);
        sample.json["animations"][0]["samplers"][0]["output"] = json!(output);
        sample
    };
    let at = "/animations/0/samplers/0/output: ";
    let error = turned("rotation", "VEC4", false).error();
    assert!(error.contains(at) && error.contains("integers must be `normalized` here"), "{error}");
    near(second(&turned("rotation", "VEC4", true), Some(0.0)), [-1.0, 0.0, 0.0]);
    for path in ["translation", "scale"] {
        let error = turned(path, "VEC3", true).error();
        assert!(error.contains(at) && error.contains("the component type 5123 is not allowed here; it must be 5126"), "{error}");
    }
}

#[test]
fn morph_targets_move_by_mesh_node_or_animated_weights() {
    let mut sample = animated("weights", "LINEAR", "SCALAR", &[1.0, 0.0, 0.0, 2.0]);
    let up = sample.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let out = sample.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    sample.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": up }, { "POSITION": out }]);
    near(second(&sample, None), [1.0, 0.0, 0.0]);
    sample.json["meshes"][0]["weights"] = json!([0.5, 0]);
    near(second(&sample, None), [1.0, 0.0, 0.5]);
    sample.json["nodes"][0]["weights"] = json!([0, 3]);
    near(second(&sample, None), [4.0, 0.0, 0.0]);
    near(second(&sample, Some(0.0)), [1.0, 0.0, 1.0]);
    near(second(&sample, Some(2.0)), [2.0, 0.0, 0.5]);
    sample.json["nodes"][0]["weights"] = json!([0]);
    assert!(sample.error().contains("/nodes/0: 1 weights are given for the 2 morph targets"));
}

#[test]
fn the_last_of_two_channels_for_one_property_counts() {
    let mut sample = animated("translation", "STEP", "VEC3", &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let other = sample.floats("VEC3", &[0.0, 7.0, 0.0, 0.0, 7.0, 0.0]);
    let mut animation = sample.json["animations"][0].clone();
    animation["samplers"][0]["output"] = json!(other);
    sample.push("animations", animation);
    near(second(&sample, Some(1.0)), [1.0, 7.0, 0.0]);
    let channel = sample.json["animations"][0]["channels"][0].clone();
    sample.json["animations"][0]["channels"].as_array_mut().unwrap().push(channel);
    assert!(sample.import().warns("/animations/0/channels/1: channels of one animation move the same thing as another"));
}

/// The triangle bound to two joints: its second corner half to each, the others to the first.
fn skinned() -> Sample {
    let mut sample = Sample::triangle();
    let joints = sample.accessor(5121, "VEC4", &[0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0], 3);
    let weights = sample.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let moved = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let inverse = sample.floats("MAT4", &[moved(0.0), moved(-1.0)].concat());
    let attributes = &mut sample.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    sample.show(json!({ "children": [2] }));
    sample.push("nodes", json!({ "translation": [1, 0, 0] }));
    sample.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": inverse }));
    sample.json["nodes"][0]["skin"] = json!(0);
    // The node of a skinned mesh does not move it.
    sample.json["nodes"][0]["translation"] = json!([100, 0, 0]);
    sample
}

#[test]
fn skins_blend_joints_with_weights_that_sum_to_one() {
    let mut sample = skinned();
    near(second(&sample, None), [1.0, 0.0, 0.0]);
    sample.json["nodes"][2]["translation"] = json!([1, 0, 3]);
    near(second(&sample, None), [1.0, 0.0, 1.5]);
    sample.json["nodes"][1]["translation"] = json!([0, 0, 1]);
    let scene = sample.scene();
    near(corners(&scene, 0, 0)[0], [0.0, 0.0, 1.0]);
    near(corners(&scene, 0, 0)[1], [1.0, 0.0, 2.5]);
}

#[test]
fn joints_and_skins_that_miss_each_other_are_said() {
    let mut sample = skinned();
    sample.json["nodes"][0].as_object_mut().unwrap().remove("skin");
    assert!(sample.import().warns("primitives have joints, but their nodes have no skin"));
    near(second(&sample, None), [101.0, 0.0, 0.0]);
    let mut sample = Sample::triangle();
    sample.push("skins", json!({ "joints": [0] }));
    sample.json["nodes"][0]["skin"] = json!(0);
    assert!(sample.import().warns("nodes have a skin, but their meshes have no joints"));
}

#[test]
fn faulty_skins_are_located() {
    let mut sample = skinned();
    sample.json["skins"][0]["joints"] = json!([1]);
    assert!(sample.error().contains("/meshes/0/primitives/0: vertex 1 names joint 1, but the skin has 1"));
    sample.json["skins"][0]["joints"] = json!([1, 2, 0]);
    assert!(sample.error().contains("/skins/0/inverseBindMatrices: 3 matrices of type MAT4 are expected"));
    sample.json["skins"][0]["joints"] = json!([1, 9]);
    assert!(sample.error().contains("/skins/0/joints/1: there is no node 9"));
    let mut sample = skinned();
    sample.json["skins"][0]["inverseBindMatrices"] = json!(sample.accessor(5121, "MAT4", &[1; 32], 2));
    assert!(sample.error().contains("/skins/0/inverseBindMatrices: the component type 5121 is not allowed here; it must be 5126"));
    let mut sample = skinned();
    let attributes = &mut sample.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["WEIGHTS_0"] = json!(1);
    assert!(sample.error().contains("integers must be `normalized` here"));
}
