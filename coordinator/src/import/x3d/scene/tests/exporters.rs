//! What programs and archives write beside the plain nodes of the standard.

use super::{Node, Value::*, *};
use kiln_proto::{
    scene::{AlphaMode, LayerMode, Lobe, Mapping, Phong, Reflection},
    units::Rgb,
};

fn bone() -> Node {
    node("Shape", [("geometry", Child(node("Box", [("size", One("1 1 1"))])))])
}

/// A humanoid is a tree of groups: joints turn about their centres, what USE lists are for is not there a second time.
#[test]
fn humanoids_stand_as_their_joints_do() {
    let hip = node(
        "HAnimJoint",
        [
            ("name", Text("l_hip")),
            ("center", One("0 2 0")),
            ("rotation", One("0 0 1 1.5707963267948966")),
            ("children", Children(vec![node("HAnimSegment", [("name", Text("l_thigh")), ("children", Children(vec![bone()]))])])),
        ],
    )
    .def("Hip");
    let skin = node("Transform", [("translation", One("0 0 7")), ("children", Children(vec![bone()]))]);
    let humanoid = node(
        "HAnimHumanoid",
        [
            ("translation", One("10 0 0")),
            ("skeleton", Children(vec![hip])),
            ("joints", Uses("HAnimJoint", "Hip")),
            ("skin", Children(vec![skin])),
        ],
    );
    let roots = [node("PointLight", []), humanoid];
    let scene = scene_of(&roots);
    assert_eq!(scene.surfaces.len(), 2);
    let (low, high) = scene.bounds();
    // The bone about the origin, turned about (0, 2, 0), lies about (2, 2, 0).
    for (found, wanted) in low.iter().chain(&high).zip([9.5, -0.5, -0.5, 12.5, 2.5, 7.5]) {
        assert!((found - wanted).abs() < 1e-5, "{low:?} {high:?}");
    }
    for (name, text) in files(&roots) {
        let (_, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
        assert!(warnings.iter().any(|w| w.contains("skins of humanoids")), "{warnings:?}");
    }
}

fn shaded(appearance: Vec<(&'static str, Value)>) -> Scene {
    let shape = node("Shape", [("appearance", Child(node("Appearance", appearance))), ("geometry", Child(node("Box", [])))]);
    scene_of(&[node("PointLight", []), shape])
}

fn phong(scene: &Scene) -> &Phong {
    let Reflection::Phong(phong) = &scene.materials[0].reflection else { panic!("{:?}", scene.materials) };
    phong
}

/// A shape without a material shines white; one that a shader draws does not.
#[test]
fn a_shader_without_a_material_is_no_lamp() {
    for kind in ["ComposedShader", "ProgramShader", "PackagedShader"] {
        let shader = || ("shaders", Children(vec![node(kind, [("language", Text("GLSL"))])]));
        let scene = shaded(vec![shader()]);
        assert_eq!((phong(&scene).diffuse, scene.materials[0].emission), (Rgb::splat(0.8), Rgb::BLACK), "{kind}");
        let red = node("Material", [("diffuseColor", One("1 0 0"))]);
        assert_eq!(phong(&shaded(vec![shader(), ("material", Child(red))])).diffuse, Rgb::new(1.0, 0.0, 0.0), "{kind}");
    }
}

#[test]
fn x3doms_common_surface_shader_is_a_material() {
    let pixel = node("PixelTexture", [("image", One("1 1 3 0x808080"))]);
    let wrapped = node("SurfaceShaderTexture", [("texture", Child(pixel))]);
    let shader = node(
        "CommonSurfaceShader",
        [
            ("diffuseFactor", One("0.25 0.5 0.125")),
            ("specularFactor", One("0.5 0.5 0.5")),
            ("shininessFactor", One("0.25")),
            ("emissiveFactor", One("0 0 2")),
            ("alphaFactor", One("0.75")),
            ("diffuseTexture", Child(wrapped)),
        ],
    );
    let scene = shaded(vec![("shaders", Children(vec![shader])), ("material", Child(node("Material", [])))]);
    let (found, material) = (phong(&scene), &scene.materials[0]);
    assert_eq!((found.diffuse, found.specular, found.lobe), (Rgb::new(0.25, 0.5, 0.125), Rgb::splat(0.1), Lobe::Phong { exponent: 8.0 }));
    assert_eq!((material.emission, material.opacity.mode, material.opacity.factor), (Rgb::new(0.0, 0.0, 2.0), AlphaMode::Blend, 0.75));
    assert_eq!((found.layers.len(), &scene.textures[0].texels[..]), (1, &[128, 128, 128][..]));
}

/// The number of the coordinates stands in the node around the texture.
#[test]
fn wrapped_textures_take_the_coordinates_that_they_name() {
    let pixel = node("PixelTexture", [("image", One("1 1 3 0x808080"))]);
    let wrapped = node("SurfaceShaderTexture", [("texture", Child(pixel)), ("textureCoordinatesId", One("1")), ("channelMask", Text("A"))]);
    let shader = node("CommonSurfaceShader", [("diffuseTexture", Child(wrapped))]);
    let set = |points| node("TextureCoordinate", [("point", Many(points))]);
    let sets = Children(vec![set("0 0 1 0 0 1"), set("0 0 2 0 0 2")]);
    let face = node(
        "IndexedFaceSet",
        [
            ("coordIndex", Many("0 1 2 -1")),
            ("coord", Child(node("Coordinate", [("point", Many("0 0 0 1 0 0 0 1 0"))]))),
            ("texCoord", Child(node("MultiTextureCoordinate", [("texCoord", sets)]))),
        ],
    );
    let appearance = node("Appearance", [("shaders", Children(vec![shader]))]);
    let shape = node("Shape", [("appearance", Child(appearance)), ("geometry", Child(face))]);
    for (name, text) in files(&[node("PointLight", []), shape]) {
        let (scene, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
        assert_eq!(phong(&scene).layers[0].texture.mapping, Mapping::Uv { set: 1 });
        assert!(warnings.iter().any(|w| w.contains("channelMask, which is not supported: all channels are used: 1, here")), "{warnings:?}");
    }
}

/// X3DOM's PhysicalMaterial has the names of glTF.
#[test]
fn physical_materials_with_the_names_of_gltf() {
    let fields = [("baseColorFactor", One("0.9 0.5 0.1")), ("metallicFactor", One("0.75")), ("roughnessFactor", One("0.5"))];
    let scene = shaded(vec![("material", Child(node("PhysicalMaterial", fields)))]);
    let Reflection::MetallicRoughness(pbr) = &scene.materials[0].reflection else { panic!() };
    assert_eq!((pbr.base_color, pbr.metallic, pbr.roughness), (Rgb::new(0.9, 0.5, 0.1), 0.75, 0.5));
}

/// Blender's exporter puts each sun into a Transform of its own, where by the standard it shines on nothing else.
#[test]
fn a_light_alone_in_its_group_is_said_to_shine_on_nothing() {
    let alone = |light: Node| node("Transform", [("children", Children(vec![light]))]);
    let warned = |roots: &[Node]| {
        let said = |(name, text): &(&str, String)| import(name, text, &ImportOptions::default()).unwrap().1.join("\n");
        files(roots).iter().all(|file| said(file).contains("shine on nothing; make them `global`: 1, here"))
    };
    let sun = || node("DirectionalLight", []);
    assert!(warned(&[alone(sun()), shape(vec![])]));
    assert!(!warned(&[alone(sun().with("global", One("TRUE"))), shape(vec![])]));
    assert!(!warned(&[sun(), alone(shape(vec![]))]), "it shines on what hangs deeper in its group");
}

/// A layer of CAD hides its children one by one.
#[test]
fn layers_of_cad_show_the_children_that_they_say() {
    let part = |name: &'static str| node("CADPart", [("children", Children(vec![node("CADFace", [("shape", Child(bone().def(name)))])]))]);
    let shown = |visible: Option<&'static str>| -> Vec<String> {
        let layer = node("CADLayer", [("children", Children(vec![part("A"), part("B")]))]);
        let layer = if let Some(visible) = visible { layer.with("visible", Many(visible)) } else { layer };
        let lifted = node("Transform", [("translation", One("0 5 0")), ("children", Children(vec![bone().def("C")]))]);
        scene_of(&[node("PointLight", []), layer, lifted]).surfaces.iter().map(|s| s.name.clone()).collect()
    };
    assert_eq!(shown(Some("FALSE TRUE")), ["B", "C"]);
    assert_eq!(shown(Some("TRUE FALSE")), ["A", "C"]);
    assert_eq!(
        (shown(None), shown(Some("TRUE"))),
        (vec!["A".to_owned(), "C".to_owned()], vec!["A".to_owned(), "C".to_owned()]),
        "B lies in A"
    );
    assert_eq!(shown(Some("FALSE")), ["C"], "X3D 4 has one for all");
}

/// Layers are drawn one over the other, and only those that `order` names.
#[test]
fn layers_that_are_drawn_are_baked() {
    let layer = |name: &'static str, at: &'static str| {
        let moved = node("Transform", [("translation", One(at)), ("children", Children(vec![bone().def(name)]))]);
        node("Layer", [("children", Children(vec![moved]))])
    };
    let set = |order| node("LayerSet", [("layers", Children(vec![layer("A", "3 0 0"), layer("B", "6 0 0")])), ("order", Many(order))]);
    let names = |order| -> Vec<String> { scene_of(&[bone(), set(order)]).surfaces.iter().map(|s| s.name.clone()).collect() };
    assert_eq!(names("0 1 2"), ["Shape", "A", "B"]);
    assert_eq!((names("0 2"), names("0")), (vec!["Shape".to_owned(), "B".to_owned()], vec!["Shape".to_owned()]));
}

/// CAD without lights relies on the headlight, which is not there: what shines is then no more than what the author made shine.
#[test]
fn a_headlight_is_missed_where_nothing_else_lights_the_scene() {
    let said = |roots: &[Node], options: &ImportOptions, word: &str| {
        files(roots).iter().all(|(name, text)| import(name, text, options).unwrap().1.iter().any(|w| w.contains(word)))
    };
    let default = ImportOptions::default();
    assert!(said(&[shape(vec![])], &default, "lit by the viewer's headlight only"));
    let glowing = [shape(vec![]), node("Transform", [("translation", One("5 0 0")), ("children", Children(vec![bone()]))])];
    assert!(said(&glowing, &default, "what shines by itself is all the light"));
    assert!(!said(&[shape(vec![]), node("PointLight", [])], &default, "headlight"));
    let off = node("NavigationInfo", [("headlight", One("FALSE"))]);
    assert!(!said(&[off, shape(vec![])], &default, "headlight"));
    assert!(!said(&[bone()], &default, "headlight"), "what is unlit needs none");
}

/// What nobody here can bake still counts where other fields name children by their places.
#[test]
fn what_is_skipped_keeps_its_place() {
    let names = |root: Node| -> Vec<String> { scene_of(&[node("PointLight", []), root]).surfaces.iter().map(|s| s.name.clone()).collect() };
    for skipped in ["GeoLocation", "Gizmo"] {
        let children = Children(vec![node(skipped, []), bone().def("A"), bone().def("B")]);
        assert_eq!(names(node("Switch", [("whichChoice", One("1")), ("children", children)])), ["A"], "{skipped}");
    }
    let layer = node("Layer", [("children", Children(vec![bone().def("A")]))]);
    let set = node("LayerSet", [("layers", Children(vec![node("LayoutLayer", []), layer])), ("order", Many("0 2"))]);
    assert_eq!(names(set), ["A"]);
    let pixel = node("PixelTexture", [("image", One("1 1 3 0x808080"))]);
    let textures = Children(vec![node("MovieTexture", []), pixel]);
    let multi = node("MultiTexture", [("mode", Texts(&["ADD", "REPLACE"])), ("texture", textures)]);
    let layers = phong(&shaded(vec![("material", Child(node("Material", []))), ("texture", Child(multi))])).layers.clone();
    assert_eq!(layers.iter().map(|l| l.mode).collect::<Vec<_>>(), [LayerMode::Replace]);
}

/// XML says the field of a child by its type, also where the type is not known.
#[test]
fn what_is_skipped_keeps_its_place_in_xml() {
    let shape = |name: &str| format!("<Shape DEF='{name}'><Box/></Shape>");
    for skipped in ["<Gizmo/>", "<GeoLocation/>", "<Shape USE='Nobody'/>"] {
        let text = format!(
            "<X3D version='3.3'><Scene><PointLight/><Switch whichChoice='1'>{skipped}<MetadataString/>{}{}</Switch></Scene></X3D>",
            shape("A"),
            shape("B")
        );
        let scene = import("a.x3d", &text, &ImportOptions::default()).unwrap().0;
        assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["A"], "{skipped}");
    }
}
