//! What images cost: each is read as often as there are needs for it, and not again.

use super::{super::picture::READ, *};

#[test]
fn an_image_that_nothing_uses_is_looked_at_once() {
    let mut sample = Sample::triangle();
    let view = sample.view(b"no image");
    for image in [json!({ "uri": "b" }), json!({ "bufferView": view, "mimeType": "image/png" })] {
        for _ in 0..3 {
            sample.push("images", image.clone());
        }
    }
    let found = outcome(&[("a.gltf", sample.text().as_bytes()), ("b", b"no image either")], None);
    let said: Vec<&String> = found.warnings.iter().filter(|w| w.contains("no material uses it")).collect();
    assert!(said.len() == 2 && said[0].contains("/images/0") && said[1].contains("/images/3"), "{said:?}");
}

/// Images that are one file, as textures of coats: the second is known before anybody reads it.
#[test]
fn an_image_is_read_only_where_it_is_not_known() {
    let coat = |index: usize| {
        let coat = json!({ "clearcoatFactor": 1, "clearcoatTexture": { "index": index } });
        json!({ "extensions": { "KHR_materials_clearcoat": coat } })
    };
    let mut sample = Sample::textured(coat(0));
    sample.json["images"] = json!(vec![json!({ "uri": "a.png" }); 2]);
    sample.push("textures", json!({ "source": 1 }));
    sample.push("materials", coat(1));
    let mut other = sample.json["meshes"][0]["primitives"][0].clone();
    other["material"] = json!(1);
    sample.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    READ.set(0);
    let found = outcome(&[("a.gltf", sample.text().as_bytes()), ("a.png", &image())], None);
    assert_eq!((found.errors.len(), READ.get()), (0, 1));
}

#[test]
fn a_broken_image_is_told_once_whatever_it_is_used_for() {
    let all = json!({ "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } });
    let coat = json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatTexture": { "index": 0 } } });
    let mut sample = Sample::textured(json!({ "pbrMetallicRoughness": all, "extensions": coat }));
    for broken in ["AAAA", "A!"] {
        sample.json["images"][0]["uri"] = json!(format!("data:image/png;base64,{broken}"));
        assert!(sample.error().contains("/images/0") || sample.error().contains("#/images/0"), "{}", sample.error());
    }
}

#[test]
fn images_of_one_view_are_one_and_views_may_not_overlap_without_end() {
    let base = json!({ "baseColorTexture": { "index": 0 } });
    let material = json!({ "pbrMetallicRoughness": base, "emissiveTexture": { "index": 1 }, "emissiveFactor": [1, 1, 1] });
    let mut sample = Sample::textured(material);
    let view = sample.view(&[image(), vec![0; 100]].concat());
    sample.json["images"] = json!(vec![json!({ "bufferView": view, "mimeType": "image/png" }); 2]);
    sample.push("textures", json!({ "source": 1 }));
    let found = sample.import();
    assert_eq!((found.errors.len(), found.scene().textures.len()), (0, 1));
    for i in 0..12usize {
        let mut other = sample.json["bufferViews"][view].clone();
        other["byteLength"] = json!(other["byteLength"].as_u64().unwrap() - 1 - i as u64);
        let other = sample.push("bufferViews", other);
        let source = sample.push("images", json!({ "bufferView": other, "mimeType": "image/png" }));
        let texture = sample.push("textures", json!({ "source": source }));
        let material = sample.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } }));
        let mut primitive = sample.json["meshes"][0]["primitives"][0].clone();
        primitive["material"] = json!(material);
        sample.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let errors = sample.import().errors;
    assert!(errors[0].contains("/images/") && errors[0].contains("more than 4 times the bytes of all buffers"), "{errors:?}");
    sample.json["materials"] = json!([{}]);
    sample.json["meshes"][0]["primitives"].as_array_mut().unwrap().truncate(1);
    let found = sample.import();
    assert!(found.warns("images that no material uses were not looked at: their views overlap too much"), "{:?}", found.warnings);
}
