//! Materials, textures, coordinates and places.

use super::{Value::*, *};
use base64::{Engine, prelude::BASE64_STANDARD};
use kiln_proto::{
    scene::{AlphaMode, LayerMode, Lobe, Mapping, Phong, Reflection, Wrap},
    units::Rgb,
};
use serde_json::json;

fn with_material(material: Node, rest: Vec<(&'static str, Value)>) -> Scene {
    let appearance = node("Appearance", std::iter::once(("material", Child(material))).chain(rest));
    let shape = node("Shape", [("appearance", Child(appearance)), ("geometry", Child(node("Box", [])))]);
    scene_of(&[node("PointLight", []), shape])
}

fn phong(scene: &Scene) -> Phong {
    match &scene.materials[0].reflection {
        Reflection::Phong(phong) => phong.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn material_becomes_lambert_and_a_lobe_as_bright_as_x3d_draws_it() {
    let fields = [
        ("diffuseColor", One("0.2 0.3 0.4")),
        ("specularColor", One("0.5 0.5 0.5")),
        ("shininess", One("0.25")),
        ("emissiveColor", One("2 0 0")),
        ("ambientIntensity", One("0.3")),
        ("transparency", One("0.25")),
    ];
    let scene = with_material(node("Material", fields), vec![]);
    let found = phong(&scene);
    // 128 x 0.25 about the half vector is 8 about the mirror direction; 2/(8 + 2) keeps its height.
    assert_eq!((found.lobe, found.specular), (Lobe::Phong { exponent: 8.0 }, Rgb::splat(0.1)));
    assert_eq!((found.diffuse, found.ambient), (Rgb::new(0.2, 0.3, 0.4), 0.3));
    let material = &scene.materials[0];
    assert_eq!((material.emission, material.opacity.mode, material.opacity.factor), (Rgb::new(2.0, 0.0, 0.0), AlphaMode::Blend, 0.75));
}

#[test]
fn physical_and_unlit_materials() {
    let fields = [("baseColor", One("0.9 0.5 0.1")), ("metallic", One("0.75")), ("roughness", One("0.5"))];
    let scene = with_material(node("PhysicalMaterial", fields), vec![]);
    let Reflection::MetallicRoughness(pbr) = &scene.materials[0].reflection else { panic!() };
    assert_eq!((pbr.base_color, pbr.metallic, pbr.roughness), (Rgb::new(0.9, 0.5, 0.1), 0.75, 0.5));
    let scene = with_material(node("UnlitMaterial", [("emissiveColor", One("0.5 1 2"))]), vec![]);
    assert_eq!((&scene.materials[0].reflection, scene.materials[0].emission), (&Reflection::None, Rgb::new(0.5, 1.0, 2.0)));
}

#[test]
fn two_sides_have_two_materials_and_two_surfaces() {
    let fields = [("separateBackColor", One("TRUE")), ("diffuseColor", One("1 0 0")), ("backDiffuseColor", One("0 0 1"))];
    let appearance = node("Appearance", [("material", Child(node("TwoSidedMaterial", fields)))]);
    let sphere = node("Sphere", [("solid", One("FALSE"))]);
    let scene =
        scene_of(&[node("PointLight", []), node("Shape", [("appearance", Child(appearance)), ("geometry", Child(sphere))]).def("Ball")]);
    let names: Vec<_> = scene.surfaces.iter().map(|s| (s.name.as_str(), s.back_of)).collect();
    assert_eq!(names, [("Ball", None), ("Ball~back", Some(0))]);
    let colour = |surface: usize| match &scene.materials[scene.surfaces[surface].parts[0].material as usize].reflection {
        Reflection::Phong(p) => p.diffuse,
        other => panic!("{other:?}"),
    };
    assert_eq!((colour(0), colour(1)), (Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 0.0, 1.0)));
    assert_eq!(scene.surfaces[0].normals.len(), scene.surfaces[0].triangles.len(), "a sphere is smooth");
}

fn pixel(image: &'static str) -> Node {
    node("PixelTexture", [("image", One(image))])
}

#[test]
fn textures_stack_with_their_modes_wraps_and_transforms() {
    let transform = node("TextureTransform", [("translation", One("0.5 0")), ("scale", One("2 3")), ("center", One("0.5 0.5"))]);
    let clamped = pixel("1 2 3 0x010203 0x040506").with("repeatS", One("FALSE"));
    let multi = node(
        "MultiTexture",
        [("mode", Texts(&["MODULATE", "ADD", "OFF"])), ("texture", Children(vec![clamped, pixel("1 1 1 0x80"), pixel("1 1 1 0x80")]))],
    );
    let scene = with_material(node("Material", []), vec![("texture", Child(multi)), ("textureTransform", Child(transform))]);
    let layers = phong(&scene).layers;
    assert_eq!(layers.iter().map(|l| l.mode).collect::<Vec<_>>(), [LayerMode::Modulate { scale: 1.0 }, LayerMode::Add]);
    assert_eq!(layers[0].texture.wrap, [Wrap::Clamp, Wrap::Repeat]);
    assert_eq!(scene.textures[0].texels, [1, 2, 3, 4, 5, 6], "the first pixel is the lower left one");
    // u' = 2 (u + 0.5 + 0.5) - 0.5, v' = 3 (v + 0.5) - 0.5.
    assert_eq!(layers[0].texture.transform, [[2.0, 0.0, 1.5], [0.0, 3.0, 1.0]]);
}

#[test]
fn alpha_is_cut_out_or_blended_by_what_the_image_holds_or_the_file_says() {
    let mode = |image, rest: Vec<(&'static str, Value)>| {
        let rest = std::iter::once(("texture", Child(pixel(image)))).chain(rest).collect();
        with_material(node("Material", []), rest).materials[0].opacity.mode
    };
    let (cut, soft) = ("2 1 4 0xffffffff 0xffffff00", "2 1 4 0xffffff80 0xffffff40");
    assert_eq!(mode(cut, vec![]), AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(mode(soft, vec![]), AlphaMode::Blend);
    assert_eq!(mode(soft, vec![("alphaMode", Text("MASK")), ("alphaCutoff", One("0.3"))]), AlphaMode::Mask { cutoff: 0.3 });
    assert_eq!(mode(cut, vec![("alphaMode", Text("OPAQUE"))]), AlphaMode::Opaque);
    assert_eq!(mode("1 1 3 0xffffff", vec![]), AlphaMode::Opaque);
}

#[test]
fn several_coordinate_sets_reach_their_textures() {
    let lists =
        vec![node("TextureCoordinate", [("point", Many("0 0 1 0 0 1"))]), node("TextureCoordinate", [("point", Many("0 0 2 0 0 2"))])];
    let face = node(
        "IndexedFaceSet",
        [
            ("coordIndex", Many("0 1 2 -1")),
            ("coord", Child(node("Coordinate", [("point", Many("0 0 0 1 0 0 0 1 0"))]))),
            ("texCoord", Child(node("MultiTextureCoordinate", [("texCoord", Children(lists))]))),
            ("color", Child(node("Color", [("color", Many("1 0 0 0 1 0 0 0 1"))]))),
        ],
    );
    let multi = node("MultiTexture", [("texture", Children(vec![pixel("1 1 1 0x80"), pixel("1 1 1 0x40")]))]);
    let material = node("Material", [("diffuseColor", One("0.1 0.1 0.1"))]);
    let appearance = node("Appearance", [("material", Child(material)), ("texture", Child(multi))]);
    let scene = scene_of(&[node("PointLight", []), node("Shape", [("appearance", Child(appearance)), ("geometry", Child(face))])]);
    let layers = phong(&scene).layers;
    assert_eq!(layers.iter().map(|l| l.texture.mapping).collect::<Vec<_>>(), [Mapping::Uv { set: 0 }, Mapping::Uv { set: 1 }]);
    assert_eq!(scene.surfaces[0].uv(1, 0).unwrap(), [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]);
    assert_eq!(phong(&scene).diffuse, Rgb::WHITE, "vertex colours take the place of the material's");
    assert_eq!(scene.colors[scene.surfaces[0].colors[0][1] as usize], [0.0, 1.0, 0.0, 1.0]);
}

#[test]
fn transforms_multiply_and_mirrors_keep_fronts_outside() {
    let mirrored =
        node("Transform", [("scale", One("-1 2 1")), ("translation", One("10 0 0")), ("children", Children(vec![shape(vec![])]))]);
    let outer = node("Transform", [("rotation", One("0 1 0 1.5707963267948966")), ("children", Children(vec![mirrored]))]);
    let scene = scene_of(&[node("PointLight", []), outer]);
    let (low, high) = scene.bounds();
    for (found, wanted) in low.iter().chain(&high).zip([-1.0, -2.0, -11.0, 1.0, 2.0, -9.0]) {
        assert!((found - wanted).abs() < 1e-5, "{low:?} {high:?}");
    }
    let volume: f64 = scene.surfaces[0]
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = scene.corners(t);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    assert!((volume - 16.0).abs() < 1e-4, "{volume}");
}

#[test]
fn switch_and_lod_choose_and_use_stands_twice() {
    let ball = node("Transform", [("translation", One("5 0 0")), ("children", Children(vec![shape(vec![]).def("Box1")]))]);
    let switch = node("Switch", [("whichChoice", One("1")), ("children", Children(vec![shape(vec![]), ball]))]);
    let again = node("Transform", [("translation", One("0 9 0")), ("children", Uses("Shape", "Box1"))]);
    let lod = node("LOD", [("range", Many("10")), ("children", Children(vec![again, shape(vec![])]))]);
    let scene = scene_of(&[node("PointLight", []), switch, lod]);
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["Box1", "Box1-2"]);
    assert_eq!(scene.bounds(), ([-1.0, -1.0, -1.0], [6.0, 10.0, 1.0]));
}

#[test]
fn what_is_not_baked_is_reported_by_name_and_an_empty_scene_says_why() {
    let text = node("Shape", [("geometry", Child(node("Text", [("string", Texts(&["hello"]))])))]);
    for (name, text) in files(&[node("PointLight", []), text, node("Fog", [])]) {
        let errors = import(name, &text, &ImportOptions::default()).unwrap_err();
        assert!(errors.iter().any(|e| e.contains("`Text` is not supported")), "{errors:?}");
        assert!(errors.iter().any(|e| e.contains("nothing to bake")), "{errors:?}");
    }
    for (name, text) in files(&[shape(vec![]), node("Background", [("skyColor", Many("0 0 1"))])]) {
        let (_, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
        assert!(warnings.iter().any(|w| w.contains("Background nodes were left out")), "{warnings:?}");
        assert!(warnings.iter().any(|w| w.contains("headlight")), "{warnings:?}");
    }
}

/// A file that stands in two places is two surfaces of one material.
#[test]
fn an_inlined_file_is_read_once_and_stands_wherever_it_is_used() {
    let main =
        "#X3D V3.3 utf8\nPointLight { }\nDEF Chair Inline { url \"chair.obj\" }\nTransform { translation 5 0 0 children USE Chair }\n";
    let chair = "mtllib m.mtl\no chair\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wood\nf 1 2 3\n";
    let files = [("a.x3dv", main), ("chair.obj", chair), ("m.mtl", "newmtl wood\nKd 0.5 0.25 0\n")];
    let parts = files.map(|(name, text)| Part { name: name.into(), content: Content::Bytes(text.as_bytes().to_vec()) });
    let bundle = Bundle::from_parts(parts.to_vec(), Some("a.x3dv"), &std::env::temp_dir()).unwrap();
    let scene = import_bundle(&bundle, &ImportOptions::default()).unwrap().scene;
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["chair", "chair-2"]);
    assert_eq!((scene.materials.len(), scene.bounds()), (1, ([0.0; 3], [6.0, 1.0, 0.0])));
    assert_eq!(phong(&scene).diffuse, Rgb::new(0.5, 0.25, 0.0));
}

/// The author's tangents of an inlined file turn with it, and a mirror changes the sides of their bitangents.
#[test]
fn tangents_of_an_inlined_file_stand_as_it_stands() {
    let numbers: [&[f32]; 4] = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        &[0.0, 0.0, 1.0, 0.0, 0.6, 0.8, 0.0, 0.0, 1.0],
        &[0.6, 0.8, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0],
        &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
    ];
    let (mut bytes, mut views, mut accessors) = (vec![], vec![], vec![]);
    for (values, kind) in numbers.iter().zip(["VEC3", "VEC3", "VEC4", "VEC2"]) {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * values.len()}));
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5126, "type": kind, "count": 3}));
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    }
    let mut png = std::io::Cursor::new(vec![]);
    image::RgbImage::from_pixel(1, 1, image::Rgb([128, 128, 255])).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let coded = |bytes: &[u8]| format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(bytes));
    let leaf = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"material": 0, "attributes": {"POSITION": 0, "NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3}}]}],
        "materials": [{"normalTexture": {"index": 0}}], "textures": [{"source": 0}], "images": [{"uri": coded(png.get_ref())}],
        "buffers": [{"byteLength": bytes.len(), "uri": coded(&bytes)}], "bufferViews": views, "accessors": accessors
    });
    let main =
        "#X3D V3.3 utf8\nPointLight { }\nInline { url \"leaf.gltf\" }\nTransform { scale -1 1 1 children Inline { url \"leaf.gltf\" } }\n";
    let parts = [("a.x3dv", main.as_bytes().to_vec()), ("leaf.gltf", leaf.to_string().into_bytes())];
    let parts = parts.map(|(name, bytes)| Part { name: name.into(), content: Content::Bytes(bytes) });
    let bundle = Bundle::from_parts(parts.to_vec(), Some("a.x3dv"), &std::env::temp_dir()).unwrap();
    let scene = import_bundle(&bundle, &ImportOptions::default()).unwrap().scene;
    let first = |s: usize| scene.surfaces[s].tangents[0].map(|t| scene.tangents[t as usize]);
    assert_eq!(first(0), [[0.6, 0.8, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
    assert_eq!(first(1), [[-0.6, 0.8, 0.0, -1.0], [-1.0, 0.0, 0.0, -1.0], [-1.0, 0.0, 0.0, -1.0]]);
}
