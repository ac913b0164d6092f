//! What refers to nothing is an error, whether it is read or not.

use super::*;

#[test]
fn textures_that_are_not_looked_up_are_there_all_the_same() {
    let none = json!({ "index": 99 });
    let extension = |name: &str, value: Value| json!({ "extensions": { name: value } });
    for material in [
        json!({ "occlusionTexture": none }),
        json!({ "emissiveTexture": none }),
        json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": none }, "extensions": { "KHR_materials_unlit": {} } }),
        json!({ "pbrMetallicRoughness": { "baseColorTexture": none }, "extensions": { "KHR_materials_pbrSpecularGlossiness": {} } }),
        extension("KHR_materials_clearcoat", json!({ "clearcoatTexture": none })),
        extension("KHR_materials_clearcoat", json!({ "clearcoatFactor": 1, "clearcoatNormalTexture": none })),
        extension("KHR_materials_volume", json!({ "thicknessTexture": none })),
        extension("KHR_materials_sheen", json!({ "sheenColorTexture": none })),
    ] {
        let error = Sample::textured(material).error();
        assert!(error.contains("/materials/0/") && error.contains("Texture/index: there is no texture 99; the file has 1"), "{error}");
    }
    let error = Sample::textured(json!({ "occlusionTexture": {} })).error();
    assert!(error.contains("/materials/0/occlusionTexture: the property `index` is missing"), "{error}");
    let own = extension("ACME_magic", json!({ "oneTexture": 4, "otherTexture": { "index": 99 } }));
    assert_eq!(Sample::textured(own).import().errors, [""; 0], "what others mean by it is not known");
    let mut sample = Sample::textured(json!({}));
    sample.json["textures"][0]["extensions"] = json!({ "EXT_texture_webp": { "source": 5 } });
    assert!(sample.error().contains("/textures/0/extensions/EXT_texture_webp/source: there is no image 5"), "{}", sample.error());
}

#[test]
fn accessors_that_are_not_read_are_there_all_the_same() {
    for name in ["_X", "COLOR_1", "TEXCOORD_8", "JOINTS_3", "OTHER"] {
        let mut sample = Sample::triangle();
        sample.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(9);
        let wanted = format!("/meshes/0/primitives/0/attributes/{name}: there is no accessor 9; the file has 1");
        assert!(sample.error().contains(&wanted), "{}", sample.error());
    }
    let mappings = json!({ "KHR_materials_variants": { "mappings": [{ "material": 9, "variants": [0] }] } });
    for (more, wanted) in [
        (json!({ "targets": [{ "TEXCOORD_0": 9 }] }), "/targets/0/TEXCOORD_0: there is no accessor 9"),
        (json!({ "mode": 0, "indices": 9 }), "/indices: there is no accessor 9"),
        (json!({ "extensions": mappings }), "/mappings/0/material: there is no material 9"),
    ] {
        let mut sample = Sample::triangle();
        let mut primitive = json!({ "attributes": { "POSITION": 0 } });
        primitive.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        sample.push("meshes", json!({ "primitives": [primitive] }));
        assert!(sample.error().contains(wanted), "{}", sample.error());
    }
}

#[test]
fn nodes_that_are_not_shown_refer_to_what_is_there() {
    for (extension, wanted) in [
        (json!({ "KHR_lights_punctual": { "light": 1 } }), "/KHR_lights_punctual/light: there is no light 1; the file has 1"),
        (json!({ "KHR_lights_punctual": {} }), "/KHR_lights_punctual: the property `light` is missing"),
        (
            json!({ "EXT_mesh_gpu_instancing": { "attributes": { "SCALE": 9 } } }),
            "/attributes/SCALE: there is no accessor 9; the file has 1",
        ),
    ] {
        let mut sample = Sample::triangle();
        sample.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
        sample.push("nodes", json!({ "extensions": extension }));
        let error = sample.error();
        assert!(error.contains("/nodes/1/extensions/") && error.contains(wanted), "{error}");
    }
}
