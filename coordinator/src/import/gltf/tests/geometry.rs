use super::*;

/// Four corners of a square, shown by `mode` and these 8-bit indices.
fn square(mode: u32, indices: &[u8]) -> Scene {
    let mut sample = Sample::new();
    let positions = sample.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let mut primitive = json!({ "attributes": { "POSITION": positions }, "mode": mode });
    if !indices.is_empty() {
        primitive["indices"] = json!(sample.accessor(5121, "SCALAR", indices, indices.len()));
    }
    sample.push("meshes", json!({ "primitives": [primitive] }));
    sample.show(json!({ "mesh": 0 }));
    sample.scene()
}

#[test]
fn strips_fans_and_lists_face_forward() {
    for (mode, indices, count) in
        [(4, &[0u8, 1, 2, 2, 1, 3][..], 2), (5, &[], 2), (5, &[0, 1, 2, 3], 2), (6, &[0, 1, 3, 2], 2), (4, &[], 1), (4, &[0, 1, 2, 3], 1)]
    {
        let scene = square(mode, indices);
        assert_eq!(scene.triangle_count(), count, "{mode} {indices:?}");
        for t in 0..count {
            let [a, b, c] = corners(&scene, 0, t).map(glam::Vec3::from_array);
            assert_eq!((b - a).cross(c - a), glam::Vec3::Z, "{mode} {indices:?}");
        }
    }
}

#[test]
fn points_and_lines_are_counted_and_skipped() {
    let mut sample = Sample::triangle();
    let primitives = sample.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    for mode in [0, 1, 3] {
        primitives.push(json!({ "attributes": { "POSITION": 0 }, "mode": mode }));
    }
    let found = sample.import();
    assert!(found.warns("/meshes/0/primitives/1: primitives of points or lines were ignored, only triangles are surfaces: 3"));
    assert_eq!(found.scene().surfaces.len(), 1);
}

#[test]
fn degenerate_and_repeated_triangles_are_dropped_with_a_count() {
    let mut sample = Sample::triangle();
    let indices = sample.accessor(5123, "SCALAR", &[0, 0, 1, 0, 2, 0, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 1, 0], 12);
    sample.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let found = sample.import();
    assert!(found.warns("repeat another one exactly were dropped: 1") && found.warns("without area were dropped: 1"));
    let polygons: Vec<u32> = found.scene().surfaces[0].triangles.iter().map(|t| t.polygon).collect();
    assert_eq!(polygons, [0, 3]);
}

#[test]
fn nodes_place_copies_and_mirrors_keep_their_fronts() {
    let mut sample = Sample::triangle();
    sample.json["nodes"][0] = json!({ "name": "leaf", "mesh": 0, "translation": [0, 0, 5], "children": [1] });
    sample.push("nodes", json!({ "name": "leaf", "mesh": 0, "scale": [-2, 1, 1] }));
    sample.show(json!({ "mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 9, 1] }));
    let scene = sample.scene();
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["leaf", "leaf-2", "mesh0"]);
    assert_eq!(corners(&scene, 0, 0), [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]);
    assert_eq!(corners(&scene, 1, 0), [[0.0, 0.0, 5.0], [0.0, 1.0, 5.0], [-2.0, 0.0, 5.0]]);
    assert_eq!(corners(&scene, 2, 0), [[0.0, 0.0, 9.0], [0.0, 1.0, 9.0], [-1.0, 0.0, 9.0]]);
}

#[test]
fn surfaces_of_several_primitives_are_named_by_material() {
    let mut sample = Sample::triangle();
    let other = sample.floats("VEC3", &[0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    let third = sample.floats("VEC3", &[0.0, 0.0, 2.0, 1.0, 0.0, 2.0, 0.0, 1.0, 2.0]);
    sample.push("materials", json!({ "name": "red" }));
    sample.push("materials", json!({}));
    for (positions, material) in [(other, json!(0)), (third, json!(1))] {
        let primitive = json!({ "attributes": { "POSITION": positions }, "material": material });
        sample.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let scene = sample.scene();
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["leaf.default", "leaf.red", "leaf.material1"]);
    assert_eq!(scene.materials.len(), 3);
    assert!(scene.surfaces[0].normals.is_empty(), "no normals: flat");
}

/// The material is what tells surfaces of one node apart; of a long name only a part is kept.
#[test]
fn a_long_name_of_a_node_leaves_room_for_the_material() {
    let mut sample = Sample::triangle();
    let other = sample.floats("VEC3", &[0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    sample.push("materials", json!({ "name": "red" }));
    let primitive = json!({ "attributes": { "POSITION": other }, "material": 0 });
    sample.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    sample.json["nodes"][0]["name"] = json!("n".repeat(130));
    let names: Vec<String> = sample.scene().surfaces.iter().map(|s| s.name.clone()).collect();
    assert!(names[0].ends_with("n.default") && names[1].ends_with("n.red") && names.iter().all(|n| n.len() == 128), "{names:?}");
}

#[test]
fn normals_are_carried_by_the_inverse_transposed_and_repaired() {
    let mut sample = Sample::triangle();
    let normals = sample.floats("VEC3", &[0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    sample.json["nodes"][0]["scale"] = json!([1, 2, -1]);
    let found = sample.import();
    assert!(found.warns("normals without a length were replaced by those of their triangles: 1"));
    let scene = found.scene();
    let [a, b, c] = scene.surfaces[0].normals[0].map(|n| scene.normals[n as usize]);
    let slope = glam::Vec3::new(0.0, 0.5, -1.0).normalize().to_array();
    // The mirror exchanged the second and the third corner; the front now looks along -z.
    assert_eq!((a, b, c), (slope, [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]));
}

#[test]
fn coordinate_sets_count_v_from_the_bottom() {
    let mut sample = Sample::triangle();
    let first = sample.floats("VEC2", &[0.0, 0.0, 1.0, 0.25, 2.0, -1.0]);
    let bytes = sample.accessor(5121, "VEC2", &[0, 255, 0, 0, 51, 0, 0, 0, 102, 204, 0, 0], 3);
    sample.json["accessors"][bytes]["normalized"] = json!(true);
    let view = sample.json["accessors"][bytes]["bufferView"].as_u64().unwrap() as usize;
    sample.json["bufferViews"][view]["byteStride"] = json!(4);
    let attributes = &mut sample.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["TEXCOORD_0"] = json!(first);
    attributes["TEXCOORD_2"] = json!(bytes);
    let surface = sample.scene().surfaces.remove(0);
    assert_eq!(surface.uv_sets.len(), 3);
    assert_eq!(surface.uv(0, 0), Some([[0.0, 1.0], [1.0, 0.75], [2.0, 2.0]]));
    assert_eq!(surface.uv(1, 0), None);
    let wanted = [[0.0, 0.0], [0.2, 1.0], [0.4, 0.2]];
    assert!(surface.uv(2, 0).unwrap().iter().flatten().zip(wanted.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn vertex_colours_are_linear_with_opacity() {
    let mut sample = Sample::triangle();
    let colors = sample.accessor(5123, "VEC3", &[255, 255, 0, 0, 0, 0, 0, 0, 255, 255, 51, 51, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 3);
    sample.json["accessors"][colors]["normalized"] = json!(true);
    let view = sample.json["accessors"][colors]["bufferView"].as_u64().unwrap() as usize;
    sample.json["bufferViews"][view]["byteStride"] = json!(8);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
    let scene = sample.scene();
    let found = scene.surfaces[0].colors[0].map(|c| scene.colors[c as usize]);
    assert_eq!(found, [[1.0, 0.0, 0.0, 1.0], [1.0, 0.2, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]);
    let floats = sample.floats("VEC4", &[2.0, 0.5, 0.0, 0.5, 1.0, 1.0, 1.0, 1.0, 0.0, -1.0, 0.0, 1.0]);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(floats);
    let found = sample.import();
    assert!(found.warns("vertex colours outside [0, 1] were clamped: 2"));
    assert_eq!(found.scene().colors[0], [1.0, 0.5, 0.0, 0.5]);
}

#[test]
fn sparse_accessors_replace_elements_of_bytes_or_of_zeros() {
    let mut sample = Sample::triangle();
    let indices = sample.view(&[0, 2]);
    let values = sample.view(&[1.0f32, 1.0, 1.0, 0.0, 3.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    sample.json["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5121 },
        "values": { "bufferView": values }
    });
    assert_eq!(corners(&sample.scene(), 0, 0), [[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]]);
    sample.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(corners(&sample.scene(), 0, 0), [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]);
}

/// Each matrix of bytes takes twelve, columns from four to four; the stride of the view is not that of replacements.
#[test]
fn sparse_matrices_lie_side_by_side() {
    let mut sample = Sample::triangle();
    let column = |v: u8| [v, v, v, 9];
    let (indices, values) = (sample.view(&[0, 1]), sample.view(&[[column(1); 3], [column(2); 3]].as_flattened().concat()));
    sample.json["bufferViews"][values]["byteStride"] = json!(16);
    let sparse = json!({ "count": 2, "indices": { "bufferView": indices, "componentType": 5121 }, "values": { "bufferView": values } });
    let (min, max) = (json!(vec![0; 9]), json!(vec![2; 9]));
    sample.push("accessors", json!({ "componentType": 5121, "type": "MAT3", "count": 3, "sparse": sparse, "min": min, "max": max }));
    let found = sample.import();
    assert!(found.errors.is_empty() && found.warnings.is_empty(), "{:?} {:?}", found.errors, found.warnings);
}

#[test]
fn interleaved_and_quantized_positions_are_read() {
    let mut sample = Sample::new();
    let mut bytes = vec![];
    for [x, y] in [[0i16, 0], [32_767, 0], [0, -32_768]] {
        bytes.extend([7, 7, 7, 7]);
        bytes.extend([x.to_le_bytes(), y.to_le_bytes(), [0, 0], [9, 9]].concat());
    }
    let positions = sample.accessor(5122, "VEC3", &bytes, 3);
    sample.json["accessors"][positions]["byteOffset"] = json!(4);
    sample.json["accessors"][positions]["normalized"] = json!(true);
    sample.json["bufferViews"][0]["byteStride"] = json!(12);
    sample.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    sample.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions } }] }));
    sample.show(json!({ "mesh": 0, "scale": [2, 2, 2] }));
    assert_eq!(corners(&sample.scene(), 0, 0), [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, -2.0, 0.0]]);
}

#[test]
fn instances_are_copies_within_their_node() {
    let mut sample = Sample::triangle();
    let translations = sample.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0]);
    let scales = sample.floats("VEC3", &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    sample.json["nodes"][0]["translation"] = json!([5, 0, 0]);
    sample.json["nodes"][0]["extensions"] =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translations, "SCALE": scales } } });
    sample.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = sample.scene();
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["leaf", "leaf-2"]);
    assert_eq!(corners(&scene, 1, 0), [[5.0, 0.0, 2.0], [8.0, 0.0, 2.0], [5.0, 3.0, 2.0]]);
    sample.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(0);
    assert!(sample.error().contains("differ in number: 2 and 3"));
}

/// As programs write them that number the copies and place none.
#[test]
fn instances_are_as_many_as_any_attribute_has() {
    let mut sample = Sample::triangle();
    let numbers = sample.accessor(5121, "SCALAR", &[0, 1, 2, 3], 4);
    let scales = sample.floats("VEC3", &[2.0, 2.0, 2.0, 3.0, 3.0, 3.0]);
    let mut with = |attributes: Value| {
        sample.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
        sample.import()
    };
    let found = with(json!({ "_FEATURE_ID_0": numbers }));
    assert!(found.warns("repeat another one exactly were dropped: 3"), "{:?}", found.warnings);
    assert_eq!(found.scene().surfaces.len(), 1);
    assert!(with(json!({ "_FEATURE_ID_0": numbers, "SCALE": scales })).errors[0].contains("differ in number: 2 and 4"));
    assert!(with(json!({})).errors[0].contains("/EXT_mesh_gpu_instancing/attributes: instances without an attribute have no number"));
}

#[test]
fn the_scene_decides_what_is_shown() {
    let mut sample = Sample::triangle();
    sample.push("nodes", json!({ "mesh": 0, "name": "outside" }));
    sample.push("nodes", json!({ "mesh": 0, "name": "other", "translation": [0, 0, 1] }));
    sample.push("scenes", json!({ "nodes": [2] }));
    let names = |sample: &Sample| sample.scene().surfaces.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&sample), ["leaf"]);
    let found = sample.import();
    assert!(found.warns("2 of 3 nodes were left out") && found.warns("2 scenes; scene 0"), "{:?}", found.warnings);
    sample.json["scene"] = json!(1);
    assert_eq!(names(&sample), ["other"]);
    sample.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(names(&sample), ["leaf"], "the first, where none is chosen");
    sample.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(names(&sample), ["leaf", "other"], "every root, where there are no scenes; `outside` only repeats `leaf`");
    sample.json["nodes"][0]["extensions"] = json!({ "KHR_node_visibility": { "visible": false } });
    assert_eq!(names(&sample), ["outside", "other"]);
}

#[test]
fn a_deep_hierarchy_costs_no_stack() {
    let mut sample = Sample::triangle();
    let depth = 50_000;
    let nodes: Vec<Value> = (0..depth).map(|i| json!({ "translation": [0, 0, 0.5], "children": [i + 1] })).collect();
    sample.json["nodes"] = json!(nodes);
    sample.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(corners(&sample.scene(), 0, 0)[0], [0.0, 0.0, 25_000.0]);
}
