//! Small files that ask for much: what they cost is known before it is spent.

use super::{super::json::VISITED, *};

/// Accessors of single bytes in a view of zeros.
fn lists(bytes: usize, number: usize, layout: impl Fn(usize) -> (usize, usize)) -> Sample {
    let mut sample = Sample::triangle();
    let view = sample.view(&vec![0; bytes]);
    let one = |i| {
        let (offset, count) = layout(i);
        json!({ "bufferView": view, "componentType": 5121, "type": "SCALAR", "byteOffset": offset, "count": count })
    };
    sample.json["accessors"].as_array_mut().unwrap().extend((0..number).map(one));
    sample
}

#[test]
fn the_same_data_are_looked_at_once_whoever_names_them() {
    let same = lists(60_000, 3_000, |_| (0, 60_000)).import();
    assert_eq!(same.errors, [""; 0]);
    let errors = lists(60_000, 3_000, |i| (i, 60_000 - i)).import().errors;
    assert!(errors[0].contains("/accessors/") && errors[0].contains("name 16 times as many numbers"), "{errors:?}");
}

impl Sample {
    /// Replacements of floats, from these indices of 16 bits.
    fn replacements(&mut self, indices: &[u16], values: &[f32]) -> Value {
        let places = self.view(&indices.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<u8>>());
        let values = self.view(&values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
        json!({ "count": indices.len(), "indices": { "bufferView": places, "componentType": 5123 }, "values": { "bufferView": values } })
    }
}

/// As face rigs are written: each target moves a few vertices of many, from nothing or from zeros that all share.
#[test]
fn what_replacements_leave_at_zero_costs_nothing() {
    for has_zeros in [false, true] {
        let mut sample = Sample::triangle();
        let positions: Vec<f32> = (0..15_000).map(|i| [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].get(i).copied().unwrap_or(0.0)).collect();
        let positions = sample.floats("VEC3", &positions);
        let indices = sample.accessor(5121, "SCALAR", &[0, 1, 2, 0], 3);
        let zeros = sample.view(&[0; 60_000]);
        let mut target = |i: u16| {
            let sparse = sample.replacements(&[1, 2 + i, 4_000], &[f32::from(i), 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
            let mut accessor = json!({ "componentType": 5126, "type": "VEC3", "count": 5_000, "sparse": sparse });
            (accessor["min"], accessor["max"]) = (json!([0, 0, 0]), json!([i, 1, 1]));
            if has_zeros {
                accessor["bufferView"] = json!(zeros);
            }
            json!({ "POSITION": sample.push("accessors", accessor) })
        };
        let targets: Vec<Value> = (0..300).map(&mut target).collect();
        let primitive = &mut sample.json["meshes"][0]["primitives"][0];
        (primitive["attributes"]["POSITION"], primitive["indices"], primitive["targets"]) =
            (json!(positions), json!(indices), json!(targets));
        sample.json["meshes"][0]["weights"] = json!((0..300).map(|i| u32::from(i == 7)).collect::<Vec<u32>>());
        let found = sample.import();
        assert_eq!(found.errors, [""; 0]);
        assert!(!found.warns("is not that of the data"), "{:?}", found.warnings);
        assert_eq!(corners(&found.scene(), 0, 0), [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    }
}

/// Zeros that are not looked at one by one count all the same.
#[test]
fn zeros_between_replacements_stand_in_bounds_and_orders() {
    let stated = |count: u64, indices: &[u16], values: &[f32]| {
        let mut sample = Sample::triangle();
        let sparse = sample.replacements(indices, values);
        let times = json!({ "componentType": 5126, "type": "SCALAR", "count": count, "sparse": sparse, "min": [0], "max": [values[0]] });
        let times = sample.push("accessors", times);
        let still = sample.push("accessors", json!({ "componentType": 5126, "type": "VEC3", "count": count }));
        sample.push("animations", json!({ "samplers": [{ "input": times, "output": still }], "channels": [] }));
        let found = sample.import();
        (found.errors.concat(), found.warnings.concat())
    };
    for (count, indices, values, time) in
        [(9, &[1u16][..], &[1.0f32][..], 2), (9, &[3], &[1.0], 1), (9, &[0, 1], &[1.0, 2.0], 2), (3, &[1, 2], &[1.0, 0.0], 2)]
    {
        let (errors, _) = stated(count, indices, values);
        assert!(errors.contains(&format!("time {time} is 0; times must be 0 or more and rise")), "{indices:?}: {errors}");
    }
    let (errors, warnings) = stated(2, &[1], &[5.0]);
    assert!(errors.is_empty() && !warnings.contains("is not that of the data"), "{errors} {warnings}");
    let (_, warnings) = stated(2, &[0, 1], &[1.0, 2.0]);
    assert!(warnings.contains("the min 0 is not that of the data, 1"), "{warnings}");
}

#[test]
fn key_frames_that_do_not_rise_are_found_once_for_all_samplers() {
    let mut sample = Sample::triangle();
    let (times, values) = (sample.floats("SCALAR", &[0.0, 1.0, 1.0]), sample.floats("VEC3", &[0.0; 9]));
    let again = sample.json["accessors"][times].clone();
    let again = sample.push("accessors", again);
    let sampler = |input: usize| json!({ "input": input, "output": values });
    sample.push("animations", json!({ "samplers": [sampler(times), sampler(again)], "channels": [] }));
    let errors = sample.import().errors;
    assert_eq!(errors.len(), 2);
    assert!(errors.iter().all(|e| e.contains("time 2 is 1; times must be 0 or more and rise")), "{errors:?}");
    let mut early = Sample::triangle();
    let (times, values) = (early.floats("SCALAR", &[-1.0, 1.0]), early.floats("VEC3", &[0.0; 6]));
    early.push("animations", json!({ "samplers": [{ "input": times, "output": values }], "channels": [] }));
    assert!(early.error().contains("time 0 is -1"));
}

/// Each of these nodes would have weights of its own: a gigabyte from a hundred kilobytes.
#[test]
fn animated_weights_are_counted() {
    let mut sample = Sample::triangle();
    let times = sample.floats("SCALAR", &[0.0]);
    let values = sample.push("accessors", json!({ "componentType": 5126, "type": "SCALAR", "count": 15_000 }));
    let nodes: Vec<Value> = (0..100).map(|_| json!({})).collect();
    sample.json["nodes"].as_array_mut().unwrap().extend(nodes);
    let channels: Vec<Value> = (1..=100).map(|node| json!({ "sampler": 0, "target": { "node": node, "path": "weights" } })).collect();
    sample.push("animations", json!({ "samplers": [{ "input": times, "output": values }], "channels": channels }));
    let padding = " ".repeat(60_000);
    let at = |time| outcome(&[("a.gltf", format!("{}{padding}", sample.text()).as_bytes())], time);
    assert_eq!(at(None).errors, [""; 0]);
    let errors = at(Some(0.0)).errors;
    assert!(errors[0].contains("/animations/0/channels/69/target: with its 15000 weights the channels have more"), "{errors:?}");
}

/// One triangle of 20,000 vertices, copied and morphed: few triangles, and much to read.
#[test]
fn vertices_that_no_triangle_uses_are_not_read_without_end() {
    let mut sample = Sample::triangle();
    let positions = sample.floats("VEC3", &[0.0; 60_000]);
    let indices = sample.accessor(5121, "SCALAR", &[0, 1, 2, 0], 3);
    let translations = sample.floats("VEC3", &[0.0; 18_000]);
    let primitive = &mut sample.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["POSITION"] = json!(positions);
    primitive["indices"] = json!(indices);
    sample.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translations } } });
    let error = sample.error();
    assert!(error.contains("/nodes/0: with this node 120000000 vertices") && error.contains("are read for 6000 triangles"), "{error}");
    sample.json["nodes"][0].as_object_mut().unwrap().remove("extensions");
    sample.json["meshes"][0]["primitives"][0]["targets"] = Value::Array(vec![json!({ "POSITION": positions }); 6_000]);
    sample.json["meshes"][0]["weights"] = json!(vec![1; 6_000]);
    assert!(sample.error().contains("with this node 120020000 vertices"), "{}", sample.error());
    // Targets without weight are not read.
    sample.json["meshes"][0]["weights"] = json!(vec![0; 6_000]);
    assert!(sample.error().contains("no node of the scene shows a triangle"));
}

#[test]
fn too_many_instances_are_refused_before_the_first() {
    let mut sample = Sample::triangle();
    let turns = sample.accessor(5120, "VEC4", &[0, 0, 0, 127, 0, 0, 127, 0].repeat(35_000), 70_000);
    sample.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "ROTATION": turns } } });
    assert!(sample.error().contains("/attributes/ROTATION: integers must be `normalized` here"), "{}", sample.error());
    sample.json["accessors"][turns]["normalized"] = json!(true);
    assert!(sample.error().contains("the scene has 70000 surfaces; at most 65535 are allowed"), "{}", sample.error());
    sample.json["accessors"][turns]["count"] = json!(2);
    assert_eq!(sample.scene().surfaces.len(), 2);
    let places = sample.accessor(5121, "VEC3", &[0; 6], 2);
    sample.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places } } });
    assert!(sample.error().contains("the component type 5121 is not allowed here; it must be 5126"), "{}", sample.error());
}

#[test]
fn what_is_said_often_is_said_once_and_what_is_not_said_is_counted() {
    let mut sample = Sample::triangle();
    sample.json["extensionsUsed"] = json!(["EXT_one", "EXT_one", "EXT_two", "EXT_one"]);
    assert_eq!(sample.import().warnings.iter().filter(|w| w.contains("is not read; what it says was ignored")).count(), 2);
    sample.json["extensionsUsed"] = json!((0..150).map(|i| format!("EXT_{i}")).collect::<Vec<_>>());
    let found = sample.import();
    assert!(found.warns("/extensionsUsed/99") && !found.warns("/extensionsUsed/100") && found.warns("50 further warnings"));
    sample.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 0 }] }));
    let found = sample.import();
    assert!(found.warns("/meshes/1/primitives/0: primitives of points or lines were ignored"), "{:?}", found.warnings);
}

/// A chain whose nodes are all listed: who is no root is told, and nothing is walked once for each of its ancestors.
#[test]
fn what_is_no_root_is_not_shown_again() {
    let (mut sample, many) = (Sample::triangle(), 3_000);
    sample.json["nodes"].as_array_mut().unwrap().extend((0..many).map(|i| json!({ "children": [i] })));
    sample.json["scenes"][0]["nodes"] = json!((0..=many).collect::<Vec<_>>());
    VISITED.set(0);
    let errors = sample.import().errors;
    assert!(errors[0].contains("/scenes/0: node 0 of this scene is a child of node 1; only roots may be listed"), "{errors:?}");
    let visited = VISITED.get();
    assert!(visited < 1_000_000, "{visited}");
}

/// A sample in which a thousand things refer to the same ones, each of which has a thousand members that mean nothing.
fn shared_by_many() -> Sample {
    let many = 1_000;
    let mut sample = Sample::textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    let primitive = sample.json["meshes"][0]["primitives"][0].clone();
    sample.push("meshes", json!({ "primitives": vec![primitive; 2] }));
    let steps: Vec<f32> = (0..many).flat_map(|i| [i as f32, 0.0, 0.0]).collect();
    let translations = sample.floats("VEC3", &steps);
    sample.json["nodes"][0] =
        json!({ "mesh": 1, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translations } } } });
    sample.push("samplers", json!({}));
    sample.json["textures"] = json!(vec![json!({ "source": 0, "sampler": 0 }); many]);
    let materials = (0..many).map(|i| {
        let base = json!({ "baseColorTexture": { "index": i } });
        json!({ "pbrMetallicRoughness": base, "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 1, 1] })
    });
    sample.json["materials"].as_array_mut().unwrap().extend(materials);
    let mut users = vec![sample.json["meshes"][0]["primitives"][0].clone(); many];
    users.iter_mut().enumerate().for_each(|(i, user)| user["material"] = json!(i + 1));
    sample.json["meshes"][0]["primitives"] = json!(users);
    sample.push("cameras", json!({ "type": "orthographic", "orthographic": { "ymag": 1 } }));
    sample.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    sample.show(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    for i in 0..many {
        let light = json!({ "KHR_lights_punctual": { "light": 0 } });
        sample.show(json!({ "mesh": 2, "camera": 0, "translation": [0, 0, i + 2], "extensions": light }));
    }
    sample.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 0 } }] }));
    for pointer in [
        "/accessors/0",
        "/materials/0",
        "/textures/0",
        "/images/0",
        "/samplers/0",
        "/meshes/2",
        "/cameras/0",
        "/extensions/KHR_lights_punctual/lights/0",
    ] {
        let object = sample.json.pointer_mut(pointer).and_then(Value::as_object_mut).unwrap();
        object.extend((0..1_000).map(|i| (format!("{i}"), json!(0))));
    }
    sample
}

/// Names, bounds, images and samplers: reading them takes what the file has, not all members of a thing for each who refers to it.
#[test]
fn what_many_refer_to_is_asked_once() {
    let sample = shared_by_many();
    VISITED.set(0);
    let found = sample.import();
    assert_eq!(found.errors, [""; 0]);
    let visited = VISITED.get();
    assert!(visited < 2_000_000, "{visited}");
}
