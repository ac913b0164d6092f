//! Files of other formats, pictures in addresses, and instances that bring them.

use super::{Value::*, *};
use base64::{Engine, prelude::BASE64_STANDARD};
use kiln_proto::{scene::Reflection, units::Rgb};
use serde_json::json;

const TRIANGLE: &[u8] = b"mtllib m.mtl\no chair\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wood\nf 1 2 3\n";
const WOOD: &[u8] = b"newmtl wood\nKd 0.5 0.25 0\n";

/// A scene with an OBJ beside it.
fn with_chair(main: &str) -> Scene {
    let main = format!("#X3D V3.3 utf8\n{main}");
    import_files(&[("a.x3dv", main.as_bytes()), ("chair.obj", TRIANGLE), ("m.mtl", WOOD)], &ImportOptions::default()).unwrap().0
}

/// A file that stands in two places is two surfaces of one material.
#[test]
fn an_inlined_file_is_read_once_and_stands_wherever_it_is_used() {
    let scene = with_chair("PointLight { }\nDEF Chair Inline { url \"chair.obj\" }\nTransform { translation 5 0 0 children USE Chair }\n");
    assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["chair", "chair-2"]);
    assert_eq!((scene.materials.len(), scene.bounds()), (1, ([0.0; 3], [6.0, 1.0, 0.0])));
    let Reflection::Phong(phong) = &scene.materials[0].reflection else { panic!() };
    assert_eq!(phong.diffuse, Rgb::new(0.5, 0.25, 0.0));
}

#[test]
fn an_inlined_file_is_lit_like_the_shapes_beside_it() {
    let unlit = |main: &str| -> Vec<Vec<u32>> { with_chair(main).surfaces.iter().map(|s| s.parts[0].unlit_by.clone()).collect() };
    let chair = "Inline { url \"chair.obj\" }";
    let shape = "Shape { appearance Appearance { material Material { } } geometry Box { } }";
    // Lights shine on their own group unless they are global; shapes come before files.
    assert_eq!(unlit(&format!("PointLight {{ }} Group {{ children [ DirectionalLight {{ }} {shape} ] }} {chair}")), [vec![], vec![1]]);
    assert_eq!(unlit(&format!("PointLight {{ }} {shape} Group {{ children [ DirectionalLight {{ }} {chair} ] }}")), [vec![1], vec![]]);
    assert_eq!(unlit(&format!("Group {{ children DirectionalLight {{ global TRUE }} }} {chair}")), [vec![0u32; 0]]);
}

fn first_texels(scene: &Scene) -> Vec<Vec<u8>> {
    scene.textures.iter().map(|t| t.texels.clone()).collect()
}

/// Each instance has the address that was given to it, also where a prototype hands it on to another.
#[test]
fn pictures_in_addresses_are_those_of_their_instances() {
    let proto = "PROTO T [ field MFString url [ ] ] { Shape { appearance Appearance { material Material { } texture ImageTexture { url IS url } } geometry Box { } } }
      PROTO Outer [ field MFString picture [ ] ] { Group { children T { url IS picture } } }";
    let [red, green] = [[255, 0, 0, 255], [0, 255, 0, 255]].map(data_uri);
    for (kind, field) in [("T", "url"), ("Outer", "picture")] {
        let text = format!(
            "#X3D V3.3 utf8\n{proto} PointLight {{ }} {kind} {{ {field} \"{red}\" }} Transform {{ translation 5 0 0 children {kind} {{ {field} [ \"{green}\" ] }} }}"
        );
        let scene = import("a.x3dv", &text, &ImportOptions::default()).unwrap().0;
        assert_eq!(first_texels(&scene), [vec![255, 0, 0], vec![0, 255, 0]], "{kind}");
    }
}

/// An address that a prototype hands on counts from the file in which it was written.
#[test]
fn addresses_that_are_handed_on_count_from_where_they_were_written() {
    let library = b"#X3D V3.3 utf8\nPROTO T [ field MFString url [ ] ] { Shape { appearance Appearance { material Material { } texture ImageTexture { url IS url } } geometry Box { } } }
PROTO Outer [ field MFString u [ ] ] { T { url IS u } }";
    let main = b"#X3D V3.3 utf8\nEXTERNPROTO Outer [ field MFString u ] \"lib/l.x3dv#Outer\"\nPointLight { } Outer { u \"p.png\" }";
    let png = |pixel: [u8; 4]| {
        let uri = data_uri(pixel);
        STANDARD.decode(uri.rsplit(',').next().unwrap()).unwrap()
    };
    let (mine, its) = (png([1, 2, 3, 255]), png([9, 9, 9, 255]));
    let files: [(&str, &[u8]); 4] = [("a.x3dv", main), ("lib/l.x3dv", library), ("p.png", &mine), ("lib/p.png", &its)];
    assert_eq!(first_texels(&import_files(&files, &ImportOptions::default()).unwrap().0), [[1, 2, 3]]);
}

#[test]
fn a_missing_picture_is_told_once_however_many_shapes_share_it() {
    let texture = |name: &'static str| node("ImageTexture", [("url", Texts(&["gone.png"]))]).def(name);
    let first = shape(vec![("texture", Child(texture("Gone")))]);
    let mut roots = vec![node("PointLight", []), first];
    roots.extend((0..30).map(|_| shape(vec![("texture", Use("ImageTexture", "Gone"))])));
    for errors in refusals(&roots) {
        assert_eq!(errors.len(), 1, "{errors:?}");
        assert!(errors[0].contains("`gone.png` is not in the bundle"), "{errors:?}");
    }
}

/// A picture that several files use is in the scene once, beside those of each alone.
#[test]
fn inlined_files_share_their_pictures() {
    let png = |pixel: [u8; 4]| STANDARD.decode(data_uri(pixel).rsplit(',').next().unwrap()).unwrap();
    let (shared, own) = (png([1, 2, 3, 255]), png([9, 9, 9, 255]));
    let object = |library: &str| format!("mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    let main = "#X3D V3.3 utf8\nPointLight { } Inline { url \"a.obj\" } Inline { url \"b.obj\" } Inline { url \"c.obj\" }
Shape { appearance Appearance { material Material { } texture ImageTexture { url \"shared.png\" } } geometry Box { } }";
    let (a, b, c) = (object("a.mtl"), object("b.mtl"), object("c.mtl"));
    let library = |picture: &str| format!("newmtl m\nKd 1 1 1\nmap_Kd {picture}\n");
    let (of_shared, of_own) = (library("shared.png"), library("own.png"));
    let files: [(&str, &[u8]); 9] = [
        ("main.x3dv", main.as_bytes()),
        ("a.obj", a.as_bytes()),
        ("b.obj", b.as_bytes()),
        ("c.obj", c.as_bytes()),
        ("a.mtl", of_shared.as_bytes()),
        ("b.mtl", of_own.as_bytes()),
        ("c.mtl", of_shared.as_bytes()),
        ("shared.png", &shared),
        ("own.png", &own),
    ];
    let scene = import_files(&files, &ImportOptions::default()).unwrap().0;
    assert_eq!(first_texels(&scene), [[1, 2, 3], [9, 9, 9]]);
    let of_materials: Vec<u32> = scene.materials.iter().map(|m| m.textures().next().unwrap().texture).collect();
    assert_eq!(of_materials, [0, 0, 1, 0]);
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
    let leaf = leaf.to_string();
    let files = [("a.x3dv", main.as_bytes()), ("leaf.gltf", leaf.as_bytes())];
    let scene = import_files(&files, &ImportOptions::default()).unwrap().0;
    let first = |s: usize| scene.surfaces[s].tangents[0].map(|t| scene.tangents[t as usize]);
    assert_eq!(first(0), [[0.6, 0.8, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
    assert_eq!(first(1), [[-0.6, 0.8, 0.0, -1.0], [-1.0, 0.0, 0.0, -1.0], [-1.0, 0.0, 0.0, -1.0]]);
}

/// Two scales that are numbers come to one that is none.
#[test]
fn an_inlined_file_that_becomes_infinite_is_an_error_with_its_line() {
    let main = "#X3D V3.3 utf8\nPointLight { }\nTransform { scale 1e38 1e38 1e38 children\nTransform { scale 10 10 10 children\n  \
                Inline { url \"chair.obj\" } } }\n";
    let errors = import_files(&[("a.x3dv", main.as_bytes()), ("chair.obj", TRIANGLE), ("m.mtl", WOOD)], &ImportOptions::default());
    let errors = errors.unwrap_err();
    assert!(
        errors.len() == 1 && errors[0].starts_with("a.x3dv:5: ") && errors[0].contains("`chair.obj` becomes infinitely large"),
        "{errors:?}"
    );
}
