use super::*;
use kiln_proto::{
    scene::{AlphaMode, Coding, LayerMode, Mapping, Wrap},
    units::Rgb,
};

fn material(json: Value) -> (Material, Vec<String>) {
    let found = Sample::textured(json).import();
    let warnings = found.warnings.clone();
    (found.scene().materials.remove(0), warnings)
}

fn quiet(json: Value) -> Material {
    let (material, warnings) = material(json);
    assert_eq!(warnings, [""; 0]);
    material
}

#[test]
fn metallic_roughness_and_its_defaults() {
    let m = quiet(json!({ "name": "plain" }));
    assert_eq!((m.name.as_str(), pbr(&m)), ("plain", &MetallicRoughness::plain(Rgb::WHITE, 1.0, 1.0)));
    let textures = json!({
        "name": "all", "emissiveFactor": [1, 0.5, 0], "emissiveTexture": { "index": 0 }, "normalTexture": { "index": 0, "scale": 0.5 },
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0.25, "roughnessFactor": 0.75,
            "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 }
        },
        "extensions": {
            "KHR_materials_emissive_strength": { "emissiveStrength": 8 }, "KHR_materials_ior": { "ior": 1.25 },
            "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [0, 2, 1], "specularTexture": { "index": 0 },
                "specularColorTexture": { "index": 0 } },
            "KHR_materials_transmission": { "transmissionFactor": 0.75, "transmissionTexture": { "index": 0 } }
        }
    });
    let mut sample = Sample::textured(textures);
    sample.json["extensionsRequired"] = json!(["KHR_materials_ior", "KHR_materials_specular", "KHR_materials_transmission"]);
    let scene = sample.scene();
    let (m, codings) = (&scene.materials[0], [Coding::Srgb, Coding::Linear]);
    let coding = |t: Option<kiln_proto::scene::TextureRef>| scene.textures[t.unwrap().texture as usize].coding;
    assert_eq!(m.emission, Rgb::new(8.0, 4.0, 0.0));
    assert_eq!(
        (coding(m.emission_texture), coding(m.normal_map.map(|n| n.texture)), m.normal_map.unwrap().scale),
        (codings[0], codings[1], 0.5)
    );
    let p = pbr(m);
    assert_eq!((p.base_color, p.metallic, p.roughness, p.ior), (Rgb::new(0.5, 0.25, 0.125), 0.25, 0.75, 1.25));
    assert_eq!((p.specular, p.specular_color, p.transmission), (0.5, Rgb::new(0.0, 2.0, 1.0), 0.75));
    assert_eq!(p.layers[0].mode, LayerMode::Modulate { scale: 1.0 });
    assert_eq!(coding(Some(p.layers[0].texture)), codings[0]);
    assert_eq!([coding(p.metallic_roughness_texture), coding(p.specular_texture), coding(p.transmission_texture)], [codings[1]; 3]);
    assert_eq!(coding(p.specular_color_texture), codings[0]);
    assert_eq!((scene.textures.len(), scene.textures.iter().map(|t| t.has_alpha).collect::<Vec<_>>()), (2, vec![false, true]));
    // The lower row comes first; both rows are red on the left.
    assert_eq!(scene.textures[0].texels[..6], [255, 0, 0, 0, 255, 0]);
}

#[test]
fn alpha_modes_decide_what_shows_through() {
    let base = json!({ "baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": { "index": 0 } });
    let opacity = |more: Value| {
        let mut json = json!({ "pbrMetallicRoughness": base });
        json.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let scene = Sample::textured(json).scene();
        (scene.materials[0].opacity, scene.textures[0].has_alpha)
    };
    assert_eq!(opacity(json!({})), (kiln_proto::scene::Opacity::OPAQUE, false));
    let (mask, kept) = opacity(json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 }));
    assert_eq!((mask.mode, mask.factor, mask.texture.map(|t| t.texture), kept), (AlphaMode::Mask { cutoff: 0.25 }, 0.5, Some(0), true));
    assert_eq!(opacity(json!({ "alphaMode": "MASK" })).0.mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(opacity(json!({ "alphaMode": "BLEND" })).0.mode, AlphaMode::Blend);
    assert!(Sample::textured(json!({ "alphaMode": "ADD" })).error().contains("/materials/0: `ADD` is no alpha mode"));
}

#[test]
fn samplers_and_transforms_say_how_a_texture_is_looked_up() {
    let extension = json!({ "KHR_texture_transform": { "offset": [0.5, 0.25], "scale": [2, 4], "rotation": std::f64::consts::FRAC_PI_2, "texCoord": 2 } });
    let info = json!({ "index": 0, "texCoord": 1, "extensions": extension });
    let mut sample = Sample::textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": info } }));
    sample.push("samplers", json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }));
    sample.json["textures"][0]["sampler"] = json!(0);
    let found = sample.import();
    assert!(found.warns("lack texture coordinates that their material looks up"));
    let texture = pbr(&found.scene().materials[0]).layers[0].texture;
    assert_eq!((texture.mapping, texture.wrap, texture.nearest), (Mapping::Uv { set: 2 }, [Wrap::Clamp, Wrap::Mirror], true));
    // With v down, (u, v) goes to (4 v + 0.5, -2 u + 0.25); v up: (4.5 - 4 v, 2 u + 0.75).
    assert_eq!(texture.transform, [[0.0, -4.0, 4.5], [2.0, 0.0, 0.75]]);
    for (pointer, value, wanted) in [
        ("wrapS", json!(1), "/samplers/0: `wrapS` is 1; it may be 33071, 33648 or 10497"),
        ("magFilter", json!(9984), "/samplers/0: `magFilter` is 9984"),
    ] {
        let mut sample = Sample::textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
        sample.push("samplers", json!({}));
        sample.json["samplers"][0][pointer] = value;
        sample.json["textures"][0]["sampler"] = json!(0);
        assert!(sample.error().contains(wanted), "{}", sample.error());
    }
}

#[test]
fn two_sided_materials_make_two_surfaces() {
    let scene = Sample::textured(json!({ "doubleSided": true })).scene();
    let names: Vec<(&str, Option<u32>)> = scene.surfaces.iter().map(|s| (s.name.as_str(), s.back_of)).collect();
    assert_eq!(names, [("leaf", None), ("leaf~back", Some(0))]);
    assert_eq!(corners(&scene, 1, 0), [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    assert_eq!(scene.surfaces[1].uv(0, 0), Some([[0.0, 1.0], [0.0, 0.0], [1.0, 1.0]]));
}

#[test]
fn unlit_materials_shine_and_take_the_mean_of_vertex_colours() {
    let json = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": { "index": 0 } },
        "emissiveFactor": [1, 1, 1], "extensions": { "KHR_materials_unlit": {} }
    });
    let mut sample = Sample::textured(json);
    let found = sample.import();
    assert!(found.warns("unlit materials are taken as shining with their colour"));
    let m = found.scene().materials.remove(0);
    assert_eq!((m.reflection, m.emission, m.emission_texture.map(|t| t.texture)), (Reflection::None, Rgb::new(0.5, 1.0, 1.0), Some(0)));
    let colors = sample.floats("VEC3", &[1.0, 1.0, 1.0, 0.25, 1.0, 1.0, 0.25, 1.0, 1.0]);
    sample.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
    let found = sample.import();
    assert!(found.warns("unlit primitives with vertex colours were given the mean of them: 1"));
    assert_eq!(found.scene().materials[0].emission, Rgb::new(0.25, 1.0, 1.0));
}

#[test]
fn what_is_approximated_or_skipped_is_said() {
    let coat = json!({ "pbrMetallicRoughness": { "metallicFactor": 0 },
        "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatTexture": { "index": 0 } } } });
    let (m, said) = material(coat);
    assert!(pbr(&m).ior > 1.6 && pbr(&m).roughness < 0.85, "{m:?}");
    assert!(said.iter().any(|w| w.contains("clear coats are folded")));
    assert!(said.iter().any(|w| w.contains("textures of clear coats count by their means: 1")), "{said:?}");
    let volume = json!({ "extensions": {
        "KHR_materials_transmission": { "transmissionFactor": 1 },
        "KHR_materials_volume": { "thicknessFactor": 2, "attenuationColor": [0.5, 1, 0.25], "attenuationDistance": 1 } } });
    let (m, said) = material(volume);
    assert!(said.len() == 1 && said[0].contains("taken as thin walls"), "{said:?}");
    assert!((pbr(&m).base_color.r - 0.25).abs() < 1e-6 && (pbr(&m).base_color.b - 0.0625).abs() < 1e-6);
    let thin = json!({ "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 }, "KHR_materials_volume": {} } });
    assert_eq!(pbr(&quiet(thin)).transmission, 1.0);
    let (_, said) =
        material(json!({ "occlusionTexture": { "index": 0 }, "extensions": { "KHR_materials_sheen": { "sheenColorFactor": [1, 0, 0] } } }));
    assert!(said.iter().any(|w| w.contains("occlusion textures")) && said.iter().any(|w| w.contains("KHR_materials_sheen is not read")));
    quiet(json!({ "extensions": { "KHR_materials_sheen": { "sheenColorFactor": [0, 0, 0] }, "KHR_materials_iridescence": {} } }));
}

/// Thickness is a length of the mesh, the attenuation distance one of the world: a mesh in millimetres is scaled with its glass.
#[test]
fn volumes_are_as_thick_as_their_node_makes_them() {
    let mut sample = Sample::textured(json!({ "extensions": {
        "KHR_materials_transmission": { "transmissionFactor": 1 },
        "KHR_materials_volume": { "thicknessFactor": 5, "attenuationColor": [0.25, 1, 0], "attenuationDistance": 0.01 } } }));
    sample.json["nodes"][0]["scale"] = json!([0.001, 0.001, 0.001]);
    let turn = [0.182_574_19, 0.365_148_37, 0.547_722_56, 0.730_296_74];
    sample.show(json!({ "mesh": 0, "scale": [0.001, 0.001, 0.001], "rotation": turn, "translation": [1, 0, 0] }));
    sample.show(json!({ "mesh": 0, "scale": [0.002, 0.002, 0.002], "translation": [2, 0, 0] }));
    let scene = sample.scene();
    let colors: Vec<Rgb> = scene.materials.iter().map(|m| pbr(m).base_color).collect();
    assert_eq!(colors.len(), 2, "turned copies share a material: {colors:?}");
    assert!((colors[0].r - 0.5).abs() < 1e-3 && (colors[1].r - 0.25).abs() < 1e-3, "{colors:?}");
    assert!(colors.iter().all(|c| c.g == 1.0 && c.b == 0.0), "{colors:?}");
}

/// The factors are ones, as exporters leave them; the texture (red, and clear on the right) says what the material is.
#[test]
fn a_coat_lies_over_what_textures_say() {
    let coated = |textured: bool| {
        let mut json = json!({ "pbrMetallicRoughness": {}, "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1 } } });
        if textured {
            json["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 0 });
        }
        pbr(&material(json).0).clone()
    };
    let (metal, painted) = (coated(false), coated(true));
    assert!(metal.roughness > 0.95, "a metal reflects so much that a coat is nothing: {metal:?}");
    // Blue is 0: no metal. Of a dielectric and its coat each reflects half.
    assert!((painted.roughness * painted.roughness - 0.96 / 1.96).abs() < 1e-3, "{painted:?}");
    assert_eq!(painted.metallic, 1.0);
}

/// The picture is red on its left half and green on its right: half a coat, or one half as rough. It is no texture of the scene.
#[test]
fn textures_of_coats_count_by_their_means() {
    let coated = |coat: Value| {
        let plain = json!({ "metallicFactor": 0, "roughnessFactor": 0.8 });
        Sample::textured(json!({ "pbrMetallicRoughness": plain, "extensions": { "KHR_materials_clearcoat": coat } }))
    };
    let textured = coated(json!({ "clearcoatFactor": 1, "clearcoatTexture": { "index": 0 } })).scene();
    let half = coated(json!({ "clearcoatFactor": 0.5 })).scene();
    assert_eq!((pbr(&textured.materials[0]), textured.textures.len()), (pbr(&half.materials[0]), 0));
    let rough = json!({ "clearcoatFactor": 1, "clearcoatRoughnessFactor": 1, "clearcoatRoughnessTexture": { "index": 0 },
        "clearcoatNormalTexture": { "index": 0 } });
    let found = coated(rough).import();
    assert!(found.warns("normal maps of clear coats were not read: 1"), "{:?}", found.warnings);
    assert_eq!(
        pbr(&found.scene().materials[0]),
        pbr(&coated(json!({ "clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.5 })).scene().materials[0])
    );
    let mut broken = coated(json!({ "clearcoatFactor": 1, "clearcoatTexture": { "index": 0 } }));
    broken.json["images"][0]["uri"] = json!("data:image/png;base64,AAAA");
    assert!(broken.error().contains("the image `a.gltf#/images/0` is not an image"), "{}", broken.error());
}

#[test]
fn specular_glossiness_keeps_its_reflectance() {
    let json = |texture: bool| {
        let mut extension = json!({ "diffuseFactor": [0.5, 0.25, 0, 1], "specularFactor": [0.25, 0.125, 0], "glossinessFactor": 0.75 });
        if texture {
            extension["specularGlossinessTexture"] = json!({ "index": 0 });
        }
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": extension } })
    };
    let (m, said) = material(json(false));
    assert!(said.len() == 1 && said[0].contains("was converted to metallic-roughness"), "{said:?}");
    let p = pbr(&m);
    assert_eq!((p.base_color, p.metallic, p.roughness), (Rgb::new(0.5, 0.25, 0.0), 0.0, 0.25));
    // An index of refraction of 0 leaves the reflectance to the colour, up to that of a perfect mirror.
    assert_eq!((p.ior, p.specular, p.specular_color), (0.0, 1.0, Rgb::new(0.25, 0.125, 0.0)));
    let m = material(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {} } })).0;
    assert_eq!((pbr(&m).ior, pbr(&m).specular_color), (0.0, Rgb::WHITE));
    let scene = Sample::textured(json(true)).scene();
    let p = pbr(&scene.materials[0]);
    assert_eq!((p.roughness, p.specular_color_texture.map(|t| t.texture)), (1.0, Some(0)));
    let rough = &scene.textures[p.metallic_roughness_texture.unwrap().texture as usize];
    // Opaque on the left, a glossiness of 0.75; clear on the right, none.
    assert_eq!((rough.coding, &rough.texels[..6]), (Coding::Linear, &[0, 64, 0, 0, 255, 0][..]));
}

#[test]
fn images_come_from_buffer_views_and_files_or_not_at_all() {
    let base = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } });
    let mut sample = Sample::textured(base);
    sample.json["images"][0] = json!({ "bufferView": sample.view(&image()), "mimeType": "image/jpeg" });
    assert_eq!(sample.scene().textures[0].name, "a.gltf#/images/0");
    sample.json["images"][0] = json!({ "uri": "tex/a.png" });
    let text = sample.text();
    let found = outcome(&[("a.gltf", text.as_bytes()), ("tex/a.png", &image())], None);
    assert_eq!(found.scene().textures[0].name, "tex/a.png");
    for (image, wanted) in [
        (json!({ "uri": "data:image/png;base64,AAAA" }), "/images/0"),
        (json!({}), "/images/0: an image has either a `uri` or a `bufferView`"),
        (json!({ "bufferView": 77 }), "/images/0/bufferView: there is no buffer view 77"),
    ] {
        sample.json["images"][0] = image;
        let errors = sample.import().errors;
        assert!(!errors.is_empty() && errors[0].contains(wanted), "{errors:?}");
    }
    let mut unused = Sample::textured(json!({}));
    unused.json["images"][0]["uri"] = json!("data:image/png;base64,AAAA");
    assert!(unused.import().warns("/images/0: the image is not an image that this program reads"), "{:?}", unused.import().warnings);
}

#[test]
fn textures_of_other_codecs_need_an_image_beside_them() {
    let mut sample = Sample::textured(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    sample.json["textures"][0]["extensions"] = json!({ "KHR_texture_basisu": { "source": 0 } });
    assert!(sample.import().warns("/textures/0: KHR_texture_basisu is not decoded; the image beside it is used"));
    sample.json["textures"][0].as_object_mut().unwrap().remove("source");
    assert!(sample.error().contains("/textures/0: the texture has an image of KHR_texture_basisu only"));
    sample.json["textures"][0] = json!({});
    assert!(sample.import().warns("textures without an image were left out: 1"));
}

#[test]
fn what_nothing_shows_is_checked_too() {
    let mut sample = Sample::textured(json!({}));
    sample.push("materials", json!({ "extensions": { "KHR_materials_sheen": { "sheenColorTexture": { "index": 4 } } } }));
    assert!(sample.error().contains("/materials/1/extensions/KHR_materials_sheen/sheenColorTexture/index: there is no texture 4"));
    let mut sample = Sample::textured(json!({}));
    sample.push("textures", json!({ "source": 0, "sampler": 3 }));
    assert!(sample.error().contains("/textures/1/sampler: there is no sampler 3"));
}

#[test]
fn values_out_of_range_are_located() {
    for (json, wanted) in [
        (
            json!({ "pbrMetallicRoughness": { "metallicFactor": 2 } }),
            "/materials/0/pbrMetallicRoughness/metallicFactor: the value 2 is out of range",
        ),
        (json!({ "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1] } }), "baseColorFactor: 4 numbers are expected here; there are 3"),
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": {} } }), "baseColorTexture: the property `index` is missing"),
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 5 } } }), "baseColorTexture/index: there is no texture 5"),
        (
            json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 8 } } }),
            "set 8 are wanted; sets 0 to 7 are read",
        ),
        (json!({ "emissiveFactor": [1, 1, 7] }), "/materials/0/emissiveFactor/2: the value 7 is out of range"),
        (json!({ "doubleSided": 1 }), "/materials/0/doubleSided: this is a number, not true or false"),
        (json!({ "extensions": { "KHR_materials_ior": { "ior": 0.5 } } }), "the index of refraction is 0.5; it must be 0 or at least 1"),
    ] {
        let error = Sample::textured(json).error();
        assert!(error.contains(wanted), "{error}");
    }
}
