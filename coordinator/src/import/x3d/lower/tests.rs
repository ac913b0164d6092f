//! The shortcut and what it stands for are the same to whoever bakes them.

use crate::import::{
    Bundle, Content, Part, import_bundle,
    x3d::{X3dEncoding, rewrite},
};
use kiln_proto::{options::ImportOptions, scene::Scene};

const HEAD: &str = "#X3D V3.2 utf8\n";

fn bundle(text: &str) -> Bundle {
    let parts = vec![Part { name: "s.x3dv".into(), content: Content::Bytes(text.as_bytes().to_vec()) }];
    Bundle::from_parts(parts, None, &std::env::temp_dir()).unwrap()
}

fn scene(text: &str) -> Scene {
    import_bundle(&bundle(text), &ImportOptions::default()).unwrap_or_else(|e| panic!("{e:#?}: {text}")).scene
}

fn lowered(text: &str) -> (String, Vec<String>, usize) {
    let out = rewrite(&bundle(&format!("{HEAD}{text}")), None, true, X3dEncoding::Classic).unwrap();
    (out.text, out.warnings.iter().map(ToString::to_string).collect(), out.lowered)
}

/// Which light each part receives shadows from, and the part's texture layers.
fn received(scene: &Scene) -> Vec<(Vec<u32>, String)> {
    let parts = scene.surfaces.iter().flat_map(|s| &s.parts);
    parts.map(|p| (p.receive_shadows.clone(), format!("{:?}", scene.materials[p.material as usize].reflection))).collect()
}

const FLOOR: &str = r#"
  DEF Sun DirectionalLight { direction 0 -1 0.5 defaultShadowMap GeneratedShadowMap { update "ALWAYS" size 512 scale 2 bias 7 } }
  DEF Spot SpotLight { location 0 3 0 direction 0 -1 0 projectionNear 0.5 projectionFar 9 }
  Shape { appearance DEF Look Appearance { material Material {} receiveShadows [ USE Sun USE Spot ]
      texture PixelTexture { image 1 1 3 0xff8000 } textureTransform TextureTransform { scale 2 2 } }
    geometry IndexedFaceSet { coordIndex [0 1 2 -1] coord Coordinate { point [0 0 0, 0 0 1, 1 0 0] }
      texCoord TextureCoordinate { point [0 0, 0 1, 1 0] } } }
  Transform { translation 0 1 0 children Shape { appearance USE Look geometry Box {} } }"#;

#[test]
fn the_lowered_form_is_the_same_scene() {
    let (text, warnings, count) = lowered(FLOOR);
    assert_eq!((warnings, count), (vec![], 1));
    let (short, long) = (scene(&format!("{HEAD}{FLOOR}")), scene(&text));
    assert_eq!(received(&long), received(&short), "{text}");
    assert!(received(&long).iter().all(|(lights, _)| *lights == [0, 1]));
    assert_eq!((&long.lights, &long.positions, &long.textures), (&short.lights, &short.positions, &short.textures));
    let uvs = |s: &Scene| s.surfaces.iter().map(|s| s.uv_sets.clone()).collect::<Vec<_>>();
    assert_eq!(uvs(&long), uvs(&short));
    let maps = &long.surfaces[0].parts[0].shadow_maps;
    assert_eq!(maps.iter().map(|(light, map)| (*light, map.size, map.bias)).collect::<Vec<_>>(), [(0, 512, 7.0), (1, 128, 4.0)]);
    assert!(!text.contains("receiveShadows"), "{text}");
}

#[test]
fn both_encodings_say_the_lowered_form_alike() {
    let of = |encoding| scene(&rewrite(&bundle(&format!("{HEAD}{FLOOR}")), None, true, encoding).unwrap().text);
    assert_eq!(of(X3dEncoding::Xml), of(X3dEncoding::Classic));
}

#[test]
fn maps_follow_the_authors_textures_and_share_their_light() {
    let (text, ..) = lowered(FLOOR);
    assert_eq!(text.matches("GeneratedShadowMap {").count(), 3, "one per light, and the default map that stays in its light: {text}");
    assert_eq!(text.matches("ProjectedTextureCoordinate {").count(), 2);
    assert!(text.contains(r#"mode ["MODULATE" "MODULATE" "MODULATE"]"#), "{text}");
    assert!(text.contains("mode \"BOUNDS\""), "the box had no coordinates for the author's texture: {text}");
}

#[test]
fn a_geometry_with_two_appearances_is_copied_where_they_need_other_coordinates() {
    let text = r#"DEF L SpotLight { location 0 3 0 }
        Shape { appearance Appearance { receiveShadows USE L material Material {} } geometry DEF B Box {} }
        Transform { translation 3 0 0 children Shape { appearance Appearance { material Material {} } geometry USE B } }
        Transform { translation 6 0 0 children Shape { appearance Appearance { receiveShadows USE L material Material {}
            texture PixelTexture { image 1 1 1 128 } } geometry USE B } }"#;
    let (out, warnings, count) = lowered(text);
    assert_eq!((warnings, count), (vec![], 2));
    assert_eq!(out.matches("Box {").count(), 3, "{out}");
    assert!(out.contains("geometry DEF B Box {}"), "the one that receives nothing is as it was: {out}");
    let (short, long) = (scene(&format!("{HEAD}{text}")), scene(&out));
    assert_eq!((received(&long), long.positions), (received(&short), short.positions));
}

#[test]
fn what_cannot_be_lowered_stays_and_is_counted() {
    let text = r#"DEF P PointLight {} DEF L SpotLight { location 0 3 0 }
        Shape { appearance Appearance { receiveShadows [ USE P USE L ] material PhysicalMaterial { baseTexture PixelTexture { image 1 1 1 9 } } }
                geometry Rectangle2D {} }"#;
    let (out, warnings, count) = lowered(text);
    assert_eq!(count, 1);
    for word in ["cannot be a camera", "texCoord", "textures of their own"] {
        assert!(warnings.iter().any(|w| w.contains(word) && w.starts_with("s.x3dv:")), "{word}: {warnings:#?}");
    }
    assert_eq!(out.split_once("receiveShadows [\n").unwrap().1.split_whitespace().take(3).collect::<Vec<_>>(), ["USE", "P", "]"]);
    assert_eq!(lowered("Shape { geometry Box {} }").2, 0);
}

#[test]
fn files_are_inlined_and_addresses_count_from_the_main_file() {
    let part = |name: &str, text: &str| Part { name: name.into(), content: Content::Bytes(text.as_bytes().to_vec()) };
    let parts = vec![
        part("s/main.x3dv", "#X3D V3.0 utf8\nTransform { children DEF In Inline { url \"sub/part.x3d\" bboxSize 1 1 1 } }"),
        part(
            "s/sub/part.x3d",
            "<X3D version='3.0'><Scene><Shape><Appearance><ImageTexture url='\"../t/a.png\"'/></Appearance><Box/></Shape></Scene></X3D>",
        ),
        part("s/t/a.png", "no matter"),
    ];
    let bundle = Bundle::from_parts(parts, Some("s/main.x3dv"), &std::env::temp_dir()).unwrap();
    let out = rewrite(&bundle, None, false, X3dEncoding::Classic).unwrap();
    assert!(
        out.text.contains("DEF In Group {\n") && out.text.contains("url [\"t/a.png\"]") && out.text.contains("bboxSize 1 1 1"),
        "{}",
        out.text
    );
    assert_eq!(out.files, ["t/a.png"]);
    assert!(out.warnings.iter().any(|w| w.message.starts_with("Inline nodes were replaced")), "{:?}", out.warnings);
}

/// An address is found as an import finds it, and written so that it is found again.
#[test]
fn addresses_with_escapes_are_found_and_escaped() {
    let part = |name: &str, text: &str| Part { name: name.into(), content: Content::Bytes(text.as_bytes().to_vec()) };
    let inner = r#"#X3D V3.3 utf8
Shape { appearance Appearance { texture ImageTexture { url [ "my%20wall.png" "http://example.com/my%20wall.png" "data:image/png;base64,AA==" ] } } geometry Box { } }
Anchor { url "more%20rooms.x3dv#Door" } Inline { url "a chair.glb" }"#;
    let parts = vec![
        part("main.x3dv", "#X3D V3.3 utf8\nInline { url \"sub/part.x3dv\" } Anchor { url \"sub/my%20wall.png\" }"),
        part("sub/part.x3dv", inner),
        part("sub/my wall.png", "no matter"),
        part("sub/more rooms.x3dv", "#X3D V3.3 utf8\n"),
        part("sub/a chair.glb", "glTF"),
    ];
    let bundle = Bundle::from_parts(parts, Some("main.x3dv"), &std::env::temp_dir()).unwrap();
    let out = rewrite(&bundle, None, false, X3dEncoding::Classic).unwrap();
    for address in [
        r#"url ["sub/my%20wall.png" "data:image/png;base64,AA=="]"#,
        r#"url ["sub/more%20rooms.x3dv#Door"]"#,
        r#"url ["sub/a%20chair.glb"]"#,
        r#"url ["sub/my%20wall.png"]"#,
    ] {
        assert!(out.text.contains(address), "{address} is not in {}", out.text);
    }
    assert_eq!(out.files, ["sub/a chair.glb", "sub/more rooms.x3dv", "sub/my wall.png"]);
}

#[test]
fn what_would_be_too_deep_to_read_again_is_refused() {
    let deep = |groups: usize| {
        let shape = "Shape { appearance Appearance { receiveShadows USE L material Material {} } geometry Box {} }";
        format!("{HEAD}DEF L SpotLight {{ location 0 3 0 }}\n{}{shape}{}", "Group { children ".repeat(groups), "}".repeat(groups))
    };
    let outcome = |groups| rewrite(&bundle(&deep(groups)), None, true, X3dEncoding::Classic);
    assert!(outcome(150).is_ok_and(|out| rewrite(&bundle(&out.text), None, false, X3dEncoding::Xml).is_ok()));
    assert!(outcome(197).unwrap_err()[0].message.contains("more than 200 nodes inside one another"));
}

/// The field that the colour comes from counts, of whatever describes the material.
#[test]
fn textures_of_their_own_are_said_of_every_kind_of_material() {
    let said = |appearance: &str| {
        let text = format!(
            "DEF L SpotLight {{ location 0 3 0 }} Shape {{ appearance Appearance {{ receiveShadows USE L {appearance} }} geometry Box {{ }} }}"
        );
        lowered(&text).1.iter().any(|w| w.contains("textures of their own"))
    };
    let pixel = "PixelTexture { image 1 1 1 9 }";
    for own in [
        "material UnlitMaterial { emissiveTexture",
        "shaders CommonSurfaceShader { diffuseTexture",
        "backMaterial Material { diffuseTexture",
    ] {
        assert!(said(&format!("{own} {pixel} }}")), "{own}");
    }
    assert!(!said(&format!("material Material {{ normalTexture {pixel} }}")), "the appearance's texture is still the colour");
}
