//! The author's tangents: read where a normal map lies along them, carried with the mesh.

use super::*;
use glam::Vec3;
use kiln_proto::options::ImportOptions;

/// A triangle with normals along +z, a normal map and these tangents.
fn mapped(tangents: &[f32]) -> Sample {
    let mut sample = Sample::textured(json!({ "normalTexture": { "index": 0 } }));
    let normals = sample.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let tangents = sample.floats("VEC4", tangents);
    let attributes = &mut sample.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["NORMAL"], attributes["TANGENT"]) = (json!(normals), json!(tangents));
    sample
}

fn tangents(scene: &Scene, surface: usize) -> Vec<[[f32; 4]; 3]> {
    scene.surfaces[surface].tangents.iter().map(|t| t.map(|k| scene.tangents[k as usize])).collect()
}

const GIVEN: [f32; 12] = [1.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, -1.0, 0.6, 0.8, 0.0, -1.0];

#[test]
fn tangents_turn_and_stretch_with_their_node_and_mirrors_change_their_side() {
    let mut sample = mapped(&GIVEN);
    let read = sample.import();
    assert!(!read.warns("tangents"), "{:?}", read.warnings);
    assert_eq!(tangents(&read.scene(), 0), [[[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, -1.0], [0.6, 0.8, 0.0, -1.0]]]);
    sample.json["nodes"][0]["scale"] = json!([-1, 2, 1]);
    let [a, b, c] = tangents(&sample.scene(), 0)[0];
    // The second and the third corner changed places with the winding.
    assert_eq!((a, c), ([-1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 0.0, 1.0]));
    let slope = Vec3::new(-0.6, 1.6, 0.0).normalize();
    assert!(Vec3::from_slice(&b).distance(slope) < 1e-6 && b[3] == 1.0, "{b:?}");
    sample.json["materials"][0]["doubleSided"] = json!(true);
    let scene = sample.scene();
    let back: Vec<[f32; 4]> = tangents(&scene, 1)[0].to_vec();
    assert_eq!(back, [a, c, b].map(|[x, y, z, side]| [x, y, z, -side]), "the back is the front turned over");
}

/// Exporters write the normals of flat faces, too. They are dropped, but not before tangents went over the edges between them.
#[test]
fn a_flat_face_has_one_tangent_where_its_triangles_meet() {
    let mut sample = Sample::textured(json!({ "normalTexture": { "index": 0 } }));
    let positions = sample.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let normals = sample.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let coordinates = sample.floats("VEC2", &[0.1, 0.1, 0.9, 0.1, 0.7, 0.8, 0.2, 0.9]);
    let indices = sample.accessor(5121, "SCALAR", &[0, 1, 2, 0, 2, 3], 6);
    sample.json["meshes"][0]["primitives"][0]["attributes"] =
        json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": coordinates });
    sample.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let part = Part { name: "a.gltf".into(), content: Content::Bytes(sample.text().into_bytes()) };
    let bundle = Bundle::from_parts(vec![part], None, &std::env::temp_dir()).unwrap();
    let scene = crate::import::import_bundle(&bundle, &ImportOptions::default()).unwrap().scene;
    let [first, second] = tangents(&scene, 0)[..] else { panic!("{:?}", scene.surfaces[0]) };
    assert_eq!((first[0], first[2]), (second[0], second[1]));
    assert!(first[1] != first[0], "the two triangles lie in the texture in their own ways");
    assert!(scene.surfaces[0].normals.is_empty() && scene.normals.is_empty());
}

/// The backs of two fronts that mirror each other have tangents that are there already.
#[test]
fn backs_and_their_opposites_share_tangents() {
    let mut sample = mapped(&[1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
    sample.json["materials"][0]["doubleSided"] = json!(true);
    let opposite = sample.floats("VEC4", &[1.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, -1.0]);
    let mut second = sample.json["meshes"][0].clone();
    second["primitives"][0]["attributes"]["TANGENT"] = json!(opposite);
    sample.push("meshes", second);
    sample.show(json!({ "mesh": 1, "translation": [5, 0, 0] }));
    let scene = sample.scene();
    let sides = |surface| tangents(&scene, surface)[0].map(|[x, y, z, side]| ([x, y, z], side));
    assert_eq!([0, 1, 2, 3].map(sides), [1.0, -1.0, -1.0, 1.0].map(|side| [([1.0, 0.0, 0.0], side); 3]));
}

#[test]
fn tangents_are_morphed_and_bent() {
    let mut sample = mapped(&GIVEN);
    let moves = sample.floats("VEC3", &[0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    sample.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "TANGENT": moves }]);
    sample.json["meshes"][0]["weights"] = json!([0.5]);
    let [a, b, _] = tangents(&sample.scene(), 0)[0];
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!(Vec3::from_slice(&a).distance(Vec3::new(half, half, 0.0)) < 1e-6 && b == [0.0, 1.0, 0.0, -1.0], "{a:?} {b:?}");
    // One joint that turns by a quarter about z.
    let joints = sample.accessor(5121, "VEC4", &[0; 12], 3);
    let weights = sample.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let attributes = &mut sample.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    let joint = sample.show(json!({ "rotation": [0.0, 0.0, half, half] }));
    sample.push("skins", json!({ "joints": [joint] }));
    sample.json["nodes"][0]["skin"] = json!(0);
    let [a, b, _] = tangents(&sample.scene(), 0)[0];
    assert!(Vec3::from_slice(&a).distance(Vec3::new(-half, half, 0.0)) < 1e-6, "{a:?}");
    assert!(Vec3::from_slice(&b).distance(-Vec3::X) < 1e-6 && b[3] == -1.0, "{b:?}");
}

#[test]
fn what_cannot_be_used_is_left_out_and_said() {
    let mut sample = mapped(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
    let found = sample.import();
    assert!(found.warns("primitives with a tangent without a length"), "{:?}", found.warnings);
    assert!(found.scene().surfaces[0].tangents.is_empty());
    sample.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    let found = sample.import();
    assert!(found.warns("tangents of primitives without normals were ignored") && found.scene().surfaces[0].tangents.is_empty());
    let mut plain = mapped(&GIVEN);
    plain.json["materials"][0] = json!({});
    let found = plain.import();
    assert!(!found.warns("tangents") && found.scene().tangents.is_empty(), "nothing lies along them");
    let mut short = mapped(&GIVEN[..8]);
    assert!(short.error().contains("2 elements, but the primitive has 3 vertices"));
    short.json["accessors"][3]["type"] = json!("VEC3");
    assert!(short.error().contains("type VEC4 is expected here, not VEC3"));
}
