//! Opacity, and the colours of vertices that bring one.

use super::{Node, Value::*, *};
use kiln_proto::{
    scene::{AlphaMode, Mapping, Material, Opacity, Reflection},
    units::Rgb,
};

/// A triangle with vertex colours in this node, and what its appearance has; `None`: no appearance at all.
fn coloured(colours: Node, appearance: Option<Vec<(&'static str, Value)>>) -> Material {
    let face = node(
        "IndexedFaceSet",
        [
            ("coordIndex", Many("0 1 2 -1")),
            ("coord", Child(node("Coordinate", [("point", Many("0 0 0 1 0 0 0 1 0"))]))),
            ("color", Child(colours)),
        ],
    );
    let geometry = ("geometry", Child(face));
    let appearance = appearance.map(|fields| ("appearance", Child(node("Appearance", fields))));
    scene_of(&[node("PointLight", []), node("Shape", appearance.into_iter().chain([geometry]))]).materials[0].clone()
}

fn rgba(colours: &'static str) -> Node {
    node("ColorRGBA", [("color", Many(colours))])
}

const HALF: &str = "1 0 0 0.5 1 0 0 0.5 1 0 0 1";
const WHOLE: &str = "1 0 0 1 1 0 0 1 1 0 0 1";

#[test]
fn the_opacity_of_vertices_takes_the_place_of_the_materials() {
    let material = |transparency| vec![("material", Child(node("Material", [("transparency", One(transparency))])))];
    let blend = Opacity { mode: AlphaMode::Blend, factor: 1.0, texture: None };
    assert_eq!(coloured(rgba(HALF), Some(material("0"))).opacity, blend);
    assert_eq!(coloured(rgba(HALF), Some(material("0.5"))).opacity, blend, "it replaces the transparency");
    assert_eq!(coloured(rgba(WHOLE), Some(material("0.5"))).opacity, Opacity::OPAQUE);
    assert_eq!(coloured(rgba(HALF), None).opacity, blend, "an unlit shape has it too");
    let plain = node("Color", [("color", Many("1 0 0 0 1 0 0 0 1"))]);
    assert_eq!(coloured(plain, Some(material("0.5"))).opacity, Opacity { factor: 0.5, ..blend }, "Color has no opacity");
    let opaque = [material("0"), vec![("alphaMode", Text("OPAQUE"))]].concat();
    assert_eq!(coloured(rgba(HALF), Some(opaque)).opacity, Opacity::OPAQUE);
}

#[test]
fn unlit_shapes_shine_with_the_mean_of_their_vertex_colours() {
    let thirds = || node("Color", [("color", Many("1 0 0 0 1 0 0 0 1"))]);
    let third = Rgb::splat(1.0 / 3.0);
    assert_eq!((coloured(thirds(), None).emission, coloured(thirds(), None).reflection), (third, Reflection::None));
    let unlit = vec![("material", Child(node("UnlitMaterial", [("emissiveColor", One("0.1 0.1 0.1"))])))];
    assert_eq!(coloured(thirds(), Some(unlit)).emission, third);
    let bare = node(
        "Shape",
        [(
            "geometry",
            Child(node(
                "TriangleSet",
                [("coord", Child(node("Coordinate", [("point", Many("0 0 0 1 0 0 0 1 0"))]))), ("color", Child(thirds()))],
            )),
        )],
    );
    for (name, text) in files(&[bare]) {
        let (_, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
        assert!(warnings.iter().any(|w| w.starts_with(&format!("{name}:")) && w.contains("the mean of them: 1, here")), "{warnings:?}");
    }
}

fn with_material(material: Node, rest: Vec<(&'static str, Value)>) -> Material {
    let appearance = node("Appearance", std::iter::once(("material", Child(material))).chain(rest));
    let shape = node("Shape", [("appearance", Child(appearance)), ("geometry", Child(node("Box", [])))]);
    scene_of(&[node("PointLight", []), shape]).materials[0].clone()
}

fn leaf() -> Node {
    node("PixelTexture", [("image", One("2 1 4 0xffffffff 0xffffff00"))])
}

/// The alpha of a leaf lies where its colour lies.
#[test]
fn a_texture_of_the_material_has_its_opacity_where_it_has_its_colour() {
    let transform = || ("textureTransform", Child(node("TextureTransform", [("scale", One("4 4"))])));
    for (kind, field) in [("Material", "diffuseTexture"), ("PhysicalMaterial", "baseTexture"), ("UnlitMaterial", "emissiveTexture")] {
        let material = with_material(node(kind, [(field, Child(leaf()))]), vec![transform()]);
        let colour = match &material.reflection {
            Reflection::Phong(p) => p.layers[0].texture,
            Reflection::MetallicRoughness(m) => m.layers[0].texture,
            Reflection::None => material.emission_texture.unwrap(),
        };
        assert_eq!((colour.transform[0][0], colour.mapping), (4.0, Mapping::Uv { set: 0 }), "{kind}");
        assert_eq!(material.opacity, Opacity { mode: AlphaMode::Mask { cutoff: 0.5 }, factor: 1.0, texture: Some(colour) }, "{kind}");
    }
}

/// X3D 4 tells several transforms and sets of coordinates apart by names.
#[test]
fn transforms_and_coordinates_of_a_materials_textures_go_by_name() {
    let named = |mapping, scale| node("TextureTransform", [("mapping", Text(mapping)), ("scale", One(scale))]);
    let transforms = node("MultiTextureTransform", [("textureTransform", Children(vec![named("a", "2 2"), named("b", "3 3")]))]);
    let material = node(
        "PhysicalMaterial",
        [
            ("baseTexture", Child(leaf())),
            ("baseTextureMapping", Text("b")),
            ("normalTexture", Child(node("PixelTexture", [("image", One("1 1 3 0x8080ff"))]))),
        ],
    );
    let material = with_material(material, vec![("textureTransform", Child(transforms))]);
    let Reflection::MetallicRoughness(pbr) = &material.reflection else { panic!() };
    assert_eq!((pbr.layers[0].texture.transform[0][0], material.normal_map.unwrap().texture.transform[0][0]), (3.0, 2.0));
}

/// `alphaChannel NONE` of a texture is about the texture alone.
#[test]
fn a_texture_told_to_have_no_alpha_leaves_the_transparency() {
    let solid = || leaf().with("alphaChannel", Text("NONE"));
    let half = || ("transparency", One("0.5"));
    let blend = Opacity { mode: AlphaMode::Blend, factor: 0.5, texture: None };
    assert_eq!(with_material(node("Material", [half()]), vec![("texture", Child(solid()))]).opacity, blend);
    assert_eq!(with_material(node("Material", [half(), ("diffuseTexture", Child(solid()))]), vec![]).opacity, blend);
    assert_eq!(with_material(node("Material", []), vec![("texture", Child(solid()))]).opacity, Opacity::OPAQUE);
    let blended = leaf().with("alphaChannel", Text("BLENDING"));
    assert_eq!(with_material(node("Material", []), vec![("texture", Child(blended))]).opacity.mode, AlphaMode::Blend);
    assert_eq!(with_material(node("Material", [half()]), vec![("alphaChannel", Text("NONE"))]).opacity, Opacity::OPAQUE);
}

/// `alphaChannel` is asked where `alphaMode` leaves it open.
#[test]
fn the_alpha_mode_comes_before_the_channel_of_a_texture() {
    let mode = |word, channel| {
        let texture = ("texture", Child(leaf().with("alphaChannel", Text(channel))));
        with_material(node("Material", []), vec![("alphaMode", Text(word)), texture]).opacity.mode
    };
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    assert_eq!((mode("BLEND", "TEST"), mode("MASK", "BLENDING")), (AlphaMode::Blend, mask));
    assert_eq!((mode("AUTO", "TEST"), mode("AUTO", "BLENDING"), mode("OPAQUE", "TEST")), (mask, AlphaMode::Blend, AlphaMode::Opaque));
}
