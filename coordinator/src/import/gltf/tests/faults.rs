use super::*;

/// The triangle with some values changed by JSON pointer.
fn changed(changes: &[(&str, Value)]) -> Sample {
    let mut sample = Sample::triangle();
    for (pointer, value) in changes {
        let (owner, name) = pointer.rsplit_once('/').unwrap();
        let owner = sample.json.pointer_mut(owner).unwrap();
        match (owner, name.parse::<usize>()) {
            (Value::Array(list), Ok(index)) if index < list.len() => list[index] = value.clone(),
            (Value::Array(list), _) => list.push(value.clone()),
            (owner, _) => owner[name] = value.clone(),
        }
    }
    sample
}

fn check(cases: &[(&str, Value, &str)]) {
    for (pointer, value, wanted) in cases {
        let error = changed(&[(*pointer, value.clone())]).error();
        assert!(error.contains(wanted), "{pointer} = {value}: {error}");
    }
}

#[test]
fn errors_have_a_line_and_a_pointer() {
    let sample = changed(&[("/nodes/0/mesh", json!(1))]);
    let line = 1 + sample.text().lines().position(|l| l.trim_start().starts_with("\"mesh\"")).unwrap();
    assert_eq!(sample.error(), format!("a.gltf:{line}: /nodes/0/mesh: there is no mesh 1; the file has 1"));
}

#[test]
fn accessors_stay_within_what_they_read() {
    check(&[
        ("/accessors/0/bufferView", json!(9), "/accessors/0/bufferView: there is no buffer view 9; the file has 1"),
        ("/accessors/0/count", json!(4), "/accessors/0: 4 elements from byte 0 take 48 bytes, but buffer view 0 has 36"),
        ("/accessors/0/count", json!(9_007_199_254_740_991u64), "but buffer view 0 has 36"),
        ("/accessors/0/count", json!(0), "/accessors/0/count: an accessor must have at least 1 element"),
        ("/accessors/0/count", json!(1.5), "/accessors/0/count: the value 1.5 is not a whole number"),
        ("/accessors/0/count", json!(-1), "/accessors/0/count: the value -1 is out of range"),
        ("/accessors/0/count", json!("3"), "/accessors/0/count: this is a string, not a number"),
        ("/accessors/0/byteOffset", json!(4), "take 40 bytes, but"),
        ("/accessors/0/componentType", json!(5124), "/accessors/0/componentType: this is no component type"),
        ("/accessors/0/type", json!("VEC5"), "/accessors/0/type: this is no accessor type"),
        ("/accessors/0/normalized", json!(true), "only integers of 8 and 16 bits"),
        ("/bufferViews/0/byteStride", json!(8), "an element has 12 bytes, but buffer view 0 has a stride of 8"),
        ("/bufferViews/0/byteStride", json!(6), "/bufferViews/0/byteStride: the stride 6 is not a multiple of 4"),
        ("/bufferViews/0/byteLength", json!(40), "bytes 0 to 40 lie beyond the end of buffer 0, which has 36"),
        ("/bufferViews/0/byteOffset", json!(9_007_199_254_740_991u64), "lie beyond the end of buffer 0"),
        ("/bufferViews/0/buffer", json!(1), "there is no buffer 1; the file has 1"),
        ("/accessors/0/min", json!([0]), "/accessors/0/min: an accessor of type VEC3 has 3 of them; there are 1"),
        (
            "/accessors/1",
            json!({ "componentType": 5126, "type": "VEC3", "count": 1_000_000_000 }),
            "/accessors/1: 1000000000 elements without",
        ),
    ]);
    let views: Vec<u8> = [0.0f32, f32::NAN, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut sample = Sample::triangle();
    sample.accessor(5126, "VEC3", &views, 1);
    assert!(sample.error().contains("/accessors/1: element 0 has a number that is not finite (NaN)"));
}

#[test]
fn what_does_no_harm_is_a_warning() {
    let found = changed(&[("/accessors/0/min", json!([0, 0.5, 0]))]).import();
    assert!(found.warns("/accessors/0/min/1: the min 0.5 is not that of the data, 0"), "{:?}", found.warnings);
    let mut sample = Sample::triangle();
    sample.json["bufferViews"][0]["byteOffset"] = json!(1);
    sample.bytes.insert(0, 0);
    assert!(sample.import().warns("not aligned to their components"));
    assert!(changed(&[("/nodes/0/rotation", json!([0, 0, 0, 2]))]).import().warns("no unit quaternions"));
    assert!(changed(&[("/nodes/0/children", json!([]))]).import().warns("lists that are empty"));
    let shear = json!([1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    assert!(changed(&[("/nodes/0/matrix", shear)]).import().warns("matrices with a shear"));
}

#[test]
fn sparse_indices_rise_within_bounds() {
    for (indices, wanted) in [([1, 1], "sparse index 1 is 1"), ([2, 0], "sparse index 1 is 0"), ([0, 3], "sparse index 1 is 3")] {
        let mut sample = Sample::triangle();
        let (indices, values) = (sample.view(&indices), sample.view(&[0; 24]));
        let sparse = json!({ "count": 2, "indices": { "bufferView": indices, "componentType": 5121 }, "values": { "bufferView": values } });
        sample.json["accessors"][0]["sparse"] = sparse;
        assert!(sample.error().contains(wanted), "{}", sample.error());
        sample.json["accessors"][0]["sparse"]["count"] = json!(4);
        assert!(sample.error().contains("4 sparse elements are not between 1 and the accessor's 3"));
        sample.json["accessors"][0]["sparse"]["count"] = json!(3);
        assert!(sample.error().contains("/accessors/0/sparse/indices: 3 elements from byte 0 take 3 bytes, but"));
    }
}

#[test]
fn indices_name_vertices() {
    for (component, bytes, wanted) in [
        (5121, vec![0, 1, 3], "/meshes/0/primitives/0/indices: index 2 is 3, but the primitive has 3 vertices"),
        (5121, vec![0, 1, 255], "index 2 is 255, the primitive restart value"),
        (5123, vec![0, 0, 1, 0, 255, 255], "index 2 is 65535, the primitive restart value"),
        (5122, vec![0, 0, 1, 0, 2, 0], "the component type 5122 is not allowed here"),
    ] {
        let mut sample = Sample::triangle();
        sample.json["meshes"][0]["primitives"][0]["indices"] = json!(sample.accessor(component, "SCALAR", &bytes, 3));
        assert!(sample.error().contains(wanted), "{}", sample.error());
    }
}

#[test]
fn attributes_must_fit_together() {
    let mut sample = Sample::triangle();
    let flat = sample.floats("VEC2", &[0.0; 6]);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(flat);
    let wanted = "/meshes/0/primitives/0/attributes/POSITION: an accessor of type VEC3 is expected here, not VEC2";
    assert!(sample.error().contains(wanted));
    let mut sample = Sample::triangle();
    let short = sample.floats("VEC3", &[0.0; 6]);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(short);
    assert!(sample.error().contains("/attributes/NORMAL: the accessor has 2 elements, but the primitive has 3 vertices"));
    check(&[
        ("/meshes/0/primitives", json!([]), "/meshes/0: the mesh has no primitives"),
        ("/meshes/0/primitives/0/mode", json!(7), "the mode 7 is none"),
        ("/meshes/0/primitives/0/material", json!(0), "there is no material 0; the file has 0"),
        ("/meshes/0/primitives/0/attributes/JOINTS_0", json!(0), "JOINTS_0 and WEIGHTS_0 come together"),
        ("/meshes/0/primitives/0/attributes", json!({}), "nothing to bake"),
        ("/meshes/0/weights", json!([1]), "the mesh has 1 weights for 0 morph targets"),
    ]);
}

#[test]
fn no_material_shines_brighter_than_the_brightest() {
    let shining = |strength: f64| {
        let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        let material = json!([{ "emissiveFactor": [1, 0.5, 0], "extensions": strength }]);
        changed(&[("/materials", material), ("/meshes/0/primitives/0/material", json!(0))])
    };
    assert_eq!(shining(1e13).scene().materials[0].emission.g, 5e12);
    for strength in [1.1e13, 3e38] {
        let error = shining(strength).error();
        assert!(error.contains("/materials/0: the emission is") && error.contains("at most 1e13 is possible"), "{error}");
    }
}

#[test]
fn nodes_are_a_forest_of_finite_transforms() {
    check(&[
        ("/nodes/0/children", json!([0]), "/nodes/0: the node is part of a loop"),
        ("/nodes/0/children", json!([1]), "/nodes/0/children/0: there is no node 1"),
        (
            "/nodes/0/translation",
            json!([1e39, 0, 0]),
            "/nodes/0/translation/0: the value 1e39 is out of range; it must be finite in single precision",
        ),
        ("/nodes/0/translation", json!([0, 0]), "/nodes/0/translation: 3 numbers are expected here; there are 2"),
        ("/nodes/0/matrix", json!([3e38, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3e38, 0, 0, 1]), "where single precision does not reach"),
        ("/nodes/0/matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2]), "the last row of `matrix`"),
        ("/nodes/0/skin", json!(0), "there is no skin 0"),
        ("/scenes/0/nodes", json!([0, 0]), "/scenes/0/nodes/1: node 0 is listed twice"),
        ("/scene", json!(1), "/scene: there is no scene 1"),
        ("/nodes/0", json!(4), "/nodes/0: this is a number, not an object"),
    ]);
    let both =
        changed(&[("/nodes/0/matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])), ("/nodes/0/scale", json!([1, 1, 1]))]);
    assert!(both.error().contains("/nodes/0: the node has both `matrix` and `scale`"));
    let parents = changed(&[("/nodes/1", json!({ "children": [0] })), ("/nodes/2", json!({ "children": [0] }))]);
    assert!(parents.error().contains("/nodes/2: node 0 is already a child of node 1"));
    let listed = changed(&[("/nodes/1", json!({ "children": [0] }))]);
    assert!(listed.error().contains("node 0 of this scene is a child of node 1"));
    let ring = changed(&[("/nodes/1", json!({ "children": [2] })), ("/nodes/2", json!({ "children": [1] }))]);
    let errors = ring.import().errors;
    assert!(errors.len() == 2 && errors[0].contains("/nodes/1") && errors[1].contains("/nodes/2"), "{errors:?}");
}

#[test]
fn extensions_are_honoured_skipped_or_refused_by_name() {
    check(&[
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "requires KHR_draco_mesh_compression, which is not decoded"),
        ("/extensionsRequired", json!(["EXT_meshopt_compression"]), "requires EXT_meshopt_compression, which is not decoded"),
        ("/extensionsRequired", json!(["KHR_texture_basisu"]), "requires KHR_texture_basisu, which is not decoded; export its images"),
        ("/extensionsRequired", json!(["ACME_magic"]), "/extensionsRequired/0: the file requires the extension ACME_magic"),
    ]);
    let mut sample = Sample::triangle();
    sample.json["extensionsUsed"] = json!(["ACME_magic", "KHR_materials_unlit"]);
    let found = sample.import();
    assert!(found.warnings.len() == 1 && found.warns("/extensionsUsed/0: the extension ACME_magic is not read"), "{:?}", found.warnings);
    sample.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression": {} });
    assert_eq!(sample.scene().triangle_count(), 1, "the uncompressed data are there");
    sample.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(sample.error().contains("compressed with KHR_draco_mesh_compression only"));
    let mut sample = Sample::triangle();
    sample.json["buffers"] = json!([{ "byteLength": 36, "extensions": { "EXT_meshopt_compression": { "fallback": true } } }]);
    assert!(sample.error().contains("the data of accessor 0 are compressed"), "{}", sample.error());
}

#[test]
fn a_small_file_cannot_ask_for_a_huge_scene() {
    let mut sample = Sample::triangle();
    let indices = sample.accessor(5121, "SCALAR", &vec![0; 300_000], 300_000);
    sample.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let count = 600;
    sample.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": sample.json["accessors"].as_array().unwrap().len() } } });
    sample.floats("VEC3", &vec![0.0; 3 * count]);
    assert!(sample.error().contains("with this node the scene has 60000000 triangles"), "{}", sample.error());
}

/// The validator's verdicts on files of its own that come without their buffers: the same data, here inside the file.
#[test]
fn the_validator_s_faults_of_data_are_not_accepted_in_silence() {
    let mut sample = Sample::new();
    let indices = sample.accessor(5121, "SCALAR", &[0, 1, 2, 3, 4, 5], 6);
    let bounds = json!({ "componentType": 5126, "type": "VEC3", "count": 4, "min": [-1, -1, -1], "max": [1, 1, 1] });
    let positions = sample.push("accessors", bounds);
    sample.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices }] }));
    assert!(
        sample.error().contains("/meshes/0/primitives/0/indices: index 4 is 4, but the primitive has 4 vertices"),
        "{}",
        sample.error()
    );
    let mut sample = Sample::triangle();
    let values: Vec<u8> = [0u16, 1, 2, 5, 6, 7].iter().flat_map(|v| v.to_le_bytes()).collect();
    let wrong = sample.accessor(5123, "VEC3", &values, 2);
    sample.json["accessors"][wrong]["min"] = json!([3, 3, 3]);
    sample.json["accessors"][wrong]["max"] = json!([4, 4, 4]);
    let found = sample.import();
    assert!(found.warns("/accessors/1/min/0: the min 3 is not that of the data, 0"), "{:?}", found.warnings);
    assert!(found.warns("/accessors/1/max/0: the max 4 is not that of the data, 5"), "{:?}", found.warnings);
    let mut sample = Sample::triangle();
    sample.push("images", json!({ "uri": "broken.jpg" }));
    let found = outcome(&[("a.gltf", sample.text().as_bytes()), ("broken.jpg", b"\xff\xd8\xff\xe0\0\0JFIF")], None);
    assert!(found.warns("/images/0: the image cannot be decoded") && found.warns("no material uses it"), "{:?}", found.warnings);
}

/// Numbers that went through single precision, and zeros where blanks should fill up the JSON of a binary file.
#[test]
fn the_slips_of_exporters_are_repaired_with_a_word() {
    let row = json!([1, 0, 0, 0, 0, 1, 0, 1e-7, 0, 0, 1, 0, 5, 0, 0, 0.999_999_9]);
    let found = changed(&[("/nodes/0/matrix", row)]).import();
    assert!(found.warns("/nodes/0: matrices whose last row is 0, 0, 0, 1 but for rounding (taken as that): 1"), "{:?}", found.warnings);
    assert_eq!(corners(&found.scene(), 0, 0)[0], [5.0, 0.0, 0.0]);
    let row = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 0.9]);
    assert!(changed(&[("/nodes/0/matrix", row)]).error().contains("the last row of `matrix` must be 0, 0, 0, 1"));
    let color = |c: f64| json!({ "pbrMetallicRoughness": { "baseColorFactor": [c, 0.5, 0, 1], "metallicFactor": -1e-8 } });
    let found = Sample::textured(color(1.000_000_1)).import();
    assert!(found.warns("/materials/0/pbrMetallicRoughness/baseColorFactor/0: values that rounding put out of range were brought back: 2"));
    let scene = found.scene();
    assert_eq!((pbr(&scene.materials[0]).base_color.r, pbr(&scene.materials[0]).metallic), (1.0, 0.0));
    assert!(Sample::textured(color(1.001)).error().contains("the value 1.001 is out of range; it must lie in [0, 1]"));
}
