//! Textures through lights and viewpoints.

use super::{Node, Value::*, *};
use kiln_proto::{
    options::ProjectorMode,
    scene::{Mapping, Reflection},
    units::Rgb,
};

fn projected(projector: Node) -> Vec<Node> {
    let texture = node("PixelTexture", [("image", One("2 1 3 0xff0000 0x00ff00"))]);
    let quad = node(
        "IndexedFaceSet",
        [
            ("coordIndex", Many("0 1 2 3 -1")),
            ("coord", Child(node("Coordinate", [("point", Many("-1 -1 0 1 -1 0 1 1 0 -1 1 0"))]))),
            ("texCoord", Child(node("ProjectedTextureCoordinate", [("projector", Child(projector))]))),
        ],
    );
    let material = node("Material", []);
    let appearance = node("Appearance", [("material", Child(material)), ("texture", Child(texture))]);
    vec![node("PointLight", []), node("Shape", [("appearance", Child(appearance)), ("geometry", Child(quad))])]
}

fn look_up(scene: &Scene, p: [f32; 3]) -> [f32; 2] {
    let m = &scene.projectors[0].matrix;
    let [s, t, _, q] = m.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]);
    assert!(q > 0.0);
    [s / q, t / q]
}

#[test]
fn each_kind_of_projector_projects() {
    let spot = node("SpotLight", [("location", One("0 0 2")), ("projectionAngle", One("1.5707963"))]);
    let directional = node("DirectionalLight", [("projectionLocation", One("0 0 2")), ("projectionRectangle", One("-2 -2 2 2"))]);
    let view = node("Viewpoint", [("position", One("0 0 2")), ("fieldOfView", One("1.5707963"))]);
    for (projector, is_light) in [(spot, true), (directional, true), (view, false)] {
        let scene = scene_of(&projected(projector.clone()));
        let found = look_up(&scene, [1.0, -1.0, 0.0]);
        assert!((found[0] - 0.75).abs() < 1e-5 && (found[1] - 0.25).abs() < 1e-5, "{}: {found:?}", projector.kind);
        assert_eq!(scene.projectors[0].light.is_some(), is_light);
        let lights: Vec<Rgb> = scene.lights.iter().map(|l| l.intensity).collect();
        assert!(lights[1..].iter().all(|l| l.is_black()), "a light in `projector` does not shine");
    }
}

#[test]
fn the_bound_viewpoint_projects_with_the_aspect_of_the_picture() {
    let bound = node("Viewpoint", [("position", One("0 0 2")), ("fieldOfView", One("1.5707963"))]).def("View");
    let mut roots = vec![bound.clone()];
    let mut rest = projected(bound);
    if let Some((_, Child(geometry))) = rest[1].fields.last_mut() {
        geometry.fields.pop();
        let coordinate = node("ProjectedTextureCoordinate", [("projector", Use("Viewpoint", "View"))]);
        geometry.fields.push(("texCoord", Child(coordinate)));
    }
    roots.append(&mut rest);
    let scene = scene_of(&roots);
    let found = look_up(&scene, [1.0, -1.0, 0.0]);
    assert!((found[0] - (0.5 + 0.25 / (4.0 / 3.0))).abs() < 1e-5 && (found[1] - 0.25).abs() < 1e-5, "{found:?}");
    assert_eq!(scene.cameras.len(), 1);
}

#[test]
fn projectors_may_colour_their_light_instead() {
    let spot = node("SpotLight", [("location", One("0 0 2"))]);
    let options = ImportOptions { x3d_projectors: ProjectorMode::Light, ..ImportOptions::default() };
    let scene = scene_with(&projected(spot), &options);
    let texture = scene.lights[1].texture.unwrap();
    assert_eq!(texture.mapping, Mapping::Projected { projector: 0 });
    assert_eq!(scene.materials[0].textures().count(), 0, "the shape itself is not textured");
}

/// X3D 4 has the texture in the material.
fn in_the_material(projector: Node, material: &'static str, field: &'static str) -> Vec<Node> {
    let mut roots = projected(projector);
    let texture = node("PixelTexture", [("image", One("2 1 3 0xff0000 0x00ff00"))]);
    let appearance = node("Appearance", [("material", Child(node(material, [(field, Child(texture))])))]);
    roots[1].fields[0] = ("appearance", Child(appearance));
    roots
}

#[test]
fn textures_in_fields_of_materials_are_projected_too() {
    let through = Mapping::Projected { projector: 0 };
    for (material, field) in [
        ("Material", "diffuseTexture"),
        ("PhysicalMaterial", "baseTexture"),
        ("PhysicalMaterial", "metallicRoughnessTexture"),
        ("UnlitMaterial", "emissiveTexture"),
        ("Material", "normalTexture"),
    ] {
        let spot = node("SpotLight", [("location", One("0 0 2")), ("projectionAngle", One("1.5707963"))]);
        let scene = scene_of(&in_the_material(spot, material, field));
        assert_eq!(scene.materials[0].textures().map(|t| t.mapping).collect::<Vec<_>>(), [through], "{field}");
        let found = look_up(&scene, [1.0, -1.0, 0.0]);
        assert!((found[0] - 0.75).abs() < 1e-5 && (found[1] - 0.25).abs() < 1e-5, "{found:?}");
    }
    let options = ImportOptions { x3d_projectors: ProjectorMode::Light, ..ImportOptions::default() };
    let spot = node("SpotLight", [("location", One("0 0 2"))]);
    let scene = scene_with(&in_the_material(spot.clone(), "Material", "diffuseTexture"), &options);
    assert_eq!(scene.lights[1].texture.unwrap().mapping, through);
    assert_eq!(scene.materials[0].textures().count(), 0, "the light has it");
    // What is no colour stays on the shape.
    let scene = scene_with(&in_the_material(spot, "Material", "normalTexture"), &options);
    assert_eq!((scene.lights[1].texture, scene.materials[0].textures().count()), (None, 1));
}

#[test]
fn a_point_light_looks_nowhere_and_projects_nothing() {
    for (name, text) in files(&projected(node("PointLight", []))) {
        let (scene, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
        assert!(warnings.iter().any(|w| w.contains("PointLight cannot project a texture")), "{warnings:?}");
        let Reflection::Phong(phong) = &scene.materials[0].reflection else { panic!() };
        assert_eq!((scene.projectors.len(), phong.layers[0].texture.mapping), (0, Mapping::Uv { set: 0 }));
    }
}

/// A viewpoint that is one too many for a camera projects from its place all the same.
#[test]
fn viewpoints_beyond_the_cameras_project_from_where_they_stand() {
    let views = "Viewpoint { } ".repeat(1000);
    let text = format!(
        "#X3D V3.3 utf8\nPointLight {{ }} {views}
         Transform {{ translation 0 0 2 children DEF V Viewpoint {{ position 0 0 0 fieldOfView 1.5707963 }} }}
         Shape {{ appearance Appearance {{ material Material {{ }} texture PixelTexture {{ image 1 1 1 0x80 }} }}
           geometry IndexedFaceSet {{ coordIndex [ 0 1 2 3 -1 ] coord Coordinate {{ point [ -1 -1 0 1 -1 0 1 1 0 -1 1 0 ] }}
             texCoord ProjectedTextureCoordinate {{ projector USE V }} }} }}"
    );
    let found = look_up(&import("a.x3dv", &text, &ImportOptions::default()).unwrap().0, [1.0, -1.0, 0.0]);
    assert!((found[0] - 0.75).abs() < 1e-5 && (found[1] - 0.25).abs() < 1e-5, "{found:?}");
}

fn refused(projector: Node, wanted: &str) {
    for errors in refusals(&projected(projector)) {
        assert!(errors.iter().any(|e| e.contains(wanted)), "{wanted} is not in {errors:?}");
    }
}

#[test]
fn viewpoints_that_project_are_checked_as_lights_are() {
    for extent in ["0 -1 0 1", "1 -1 -1 1", "-1 1 1 1", "-1 1 1 -1"] {
        refused(
            node("OrthoViewpoint", [("fieldOfView", Many(extent))]),
            &format!("OrthoViewpoint has the fieldOfView {extent}; it is left"),
        );
    }
    refused(node("Viewpoint", [("projectionNear", One("-1"))]), "Viewpoint has the projectionNear -1");
    refused(node("Viewpoint", [("projectionFar", One("-0.5"))]), "Viewpoint has the projectionFar -0.5");
    refused(node("Viewpoint", [("projectionNear", One("3")), ("projectionFar", One("3"))]), "not below projectionFar 3");
}

/// Nobody wrote a far end: it is found, and gives way.
#[test]
fn a_near_end_beyond_the_far_one_that_was_found_is_said_of_lights_and_viewpoints() {
    for kind in ["Viewpoint", "OrthoViewpoint", "SpotLight", "DirectionalLight"] {
        for (name, text) in files(&projected(node(kind, [("projectionNear", One("1000"))]))) {
            let (scene, warnings) = import(name, &text, &ImportOptions::default()).unwrap();
            assert!(
                warnings.iter().any(|w| w.contains("projectionNear 1000 beyond") && w.contains("2000 is used")),
                "{kind}: {warnings:?}"
            );
            assert_eq!(scene.projectors.len(), 1);
        }
    }
}

#[test]
fn depths_and_rectangles_of_viewpoints_are_as_large_as_their_group() {
    let depth = |scene: &Scene, z: f32| {
        let [.., r, q] = scene.projectors[0].matrix.map(|r| r[2] * z + r[3]);
        r / q
    };
    let common = [("position", One("0 0 2")), ("projectionNear", One("0.5")), ("projectionFar", One("2"))];
    for (kind, view) in [("Viewpoint", One("1.5707963")), ("OrthoViewpoint", Many("-1 -1 1 1"))] {
        let inner = node(kind, common.clone()).with("fieldOfView", view).def("View");
        let mut roots = vec![node("Viewpoint", [])];
        roots.push(node("Transform", [("scale", One("2 2 2")), ("children", Children(vec![inner.clone()]))]));
        let mut rest = projected(inner);
        if let Some((_, Child(geometry))) = rest[1].fields.last_mut() {
            geometry.fields.pop();
            let coordinate = node("ProjectedTextureCoordinate", [("projector", Use(kind, "View"))]);
            geometry.fields.push(("texCoord", Child(coordinate)));
        }
        roots.append(&mut rest);
        let scene = scene_of(&roots);
        // The eye stands at 4, near lies 1 m and far 4 m before it.
        assert!(depth(&scene, 3.0).abs() < 1e-5 && (depth(&scene, 0.0) - 1.0).abs() < 1e-5, "{kind}");
        if kind == "OrthoViewpoint" {
            assert!((look_up(&scene, [2.0, -2.0, 0.0])[0] - 1.0).abs() < 1e-5);
            assert_eq!(scene.cameras[1].lens, kiln_proto::scene::Lens::Orthographic { half_height: 2.0 });
        }
    }
}

/// The field of the material is not empty, so the appearance's texture is no colour of the shape.
#[test]
fn a_texture_that_colours_a_light_lets_no_other_take_its_place() {
    for (material, field, mapping) in [
        ("Material", "diffuseTexture", "diffuseTextureMapping"),
        ("PhysicalMaterial", "baseTexture", "baseTextureMapping"),
        ("UnlitMaterial", "emissiveTexture", "emissiveTextureMapping"),
    ] {
        let mut roots = in_the_material(node("SpotLight", [("location", One("0 0 2"))]), material, field);
        let [(_, Child(appearance)), (_, Child(geometry))] = &mut roots[1].fields[..] else { panic!() };
        appearance.fields.push(("texture", Child(node("PixelTexture", [("image", One("1 1 4 0x11223380"))]))));
        let [(_, Child(material))] = &mut appearance.fields[..1] else { panic!() };
        material.fields.push((mapping, Text("beam")));
        let (_, Child(beam)) = geometry.fields.pop().unwrap() else { panic!() };
        let plain = node("TextureCoordinate", [("point", Many("0 0 1 0 1 1 0 1"))]);
        let both = Children(vec![plain, beam.with("mapping", Text("beam"))]);
        geometry.fields.push(("texCoord", Child(node("MultiTextureCoordinate", [("texCoord", both)]))));
        let options = ImportOptions { x3d_projectors: ProjectorMode::Light, ..ImportOptions::default() };
        let scene = scene_with(&roots, &options);
        assert!(scene.lights[1].texture.is_some(), "{field}");
        assert_eq!(scene.materials[0].textures().count(), 0, "{field}: neither its colour nor its opacity");
    }
}
