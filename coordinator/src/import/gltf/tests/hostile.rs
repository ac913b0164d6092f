//! Files that nobody wrote: whatever they hold, an import ends with a valid scene or an error, and neither panics nor hangs.

use super::*;
use proptest::prelude::*;

/// A file with something of everything.
fn everything() -> Sample {
    let mut sample = Sample::textured(json!({
        "doubleSided": true, "alphaMode": "MASK", "emissiveFactor": [1, 1, 1], "normalTexture": { "index": 0 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "rotation": 1 } } } },
        "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1 }, "KHR_materials_specular": { "specularFactor": 0.5 } }
    }));
    let normals = sample.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let indices = sample.accessor(5121, "SCALAR", &[0, 1, 2, 0], 3);
    let joints = sample.accessor(5121, "VEC4", &[0; 12], 3);
    let weights = sample.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let (times, turns) = (sample.floats("SCALAR", &[0.0, 1.0]), sample.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]));
    let primitive = &mut sample.json["meshes"][0]["primitives"][0];
    primitive["indices"] = json!(indices);
    primitive["targets"] = json!([{ "POSITION": 0, "NORMAL": normals }]);
    for (name, accessor) in [("NORMAL", normals), ("COLOR_0", 0), ("JOINTS_0", joints), ("WEIGHTS_0", weights)] {
        primitive["attributes"][name] = json!(accessor);
    }
    sample.json["meshes"][0]["weights"] = json!([0.25]);
    let (indices, values) = (sample.view(&[1, 2, 0, 0]), sample.view(&[0; 24]));
    sample.json["accessors"][normals]["sparse"] =
        json!({ "count": 2, "indices": { "bufferView": indices, "componentType": 5121 }, "values": { "bufferView": values } });
    sample.push("skins", json!({ "joints": [1] }));
    sample.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 1 } }));
    sample.push("samplers", json!({ "wrapS": 33071 }));
    sample.show(json!({ "camera": 0, "children": [2], "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } });
    sample.push("nodes", json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1], "extensions": instancing }));
    sample.json["nodes"][0]["skin"] = json!(0);
    sample.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {} }] } });
    let samplers = json!([{ "input": times, "output": turns }]);
    sample.push("animations", json!({ "samplers": samplers, "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }] }));
    sample
}

/// All values of a tree, in the order of a walk.
fn walk(json: &mut Value, visit: &mut impl FnMut(&mut Value)) {
    visit(json);
    match json {
        Value::Array(list) => list.iter_mut().for_each(|v| walk(v, visit)),
        Value::Object(members) => members.values_mut().for_each(|v| walk(v, visit)),
        _ => {}
    }
}

fn awkward() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(json!(null)),
        Just(json!([])),
        Just(json!({})),
        Just(json!("")),
        Just(json!(true)),
        Just(json!([0, 0, 0])),
        (-2i64..8).prop_map(|v| json!(v)),
        prop_oneof![Just(-1.5), Just(1e300), Just(4_294_967_296.0), Just(9e15), Just(5126.0), Just(0.1)].prop_map(|v| json!(v)),
    ]
}

fn survives(text: &[u8]) -> Result<(), TestCaseError> {
    if let Some(scene) = outcome(&[("a.gltf", text)], Some(0.5)).scene {
        prop_assert!(scene.validate().is_ok(), "{:?}", scene.validate());
    }
    Ok(())
}

#[test]
fn a_list_has_an_end() {
    let text = format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"nodes\": [{}{{}}]}}", "{},".repeat(1 << 20));
    let errors = outcome(&[("a.gltf", text.as_bytes())], None).errors;
    assert!(errors[0].contains("/nodes: the list has 1048577 entries; at most 1048576 are read"), "{errors:?}");
}

#[test]
fn the_seed_is_a_scene() {
    let found = everything().import();
    assert_eq!(found.errors, [""; 0]);
    let scene = found.scene();
    assert_eq!((scene.surfaces.len(), scene.lights.len(), scene.cameras.len()), (8, 1, 1));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn wrong_values_are_no_danger(changes in prop::collection::vec((0usize..400, awkward()), 1..4)) {
        let mut json: Value = serde_json::from_str(&everything().text()).unwrap();
        for (at, value) in changes {
            let mut index = 0;
            walk(&mut json, &mut |v| {
                if index == at {
                    *v = value.clone();
                }
                index += 1;
            });
        }
        survives(json.to_string().as_bytes())?;
    }

    #[test]
    fn wrong_bytes_are_no_danger(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>()) {
        let mut text = everything().text().into_bytes();
        for (at, byte) in changes {
            let at = at.index(text.len());
            text[at] = byte;
        }
        survives(&text)?;
        text.truncate(cut.index(text.len()));
        survives(&text)?;
    }
}
