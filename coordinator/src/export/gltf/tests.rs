//! Out and in again through the importer, which is as strict as the Khronos validator.

use super::*;
use crate::import::{Bundle, Content, Imported, Part as Upload, import_bundle};
use kiln_proto::{
    options::ImportOptions,
    scene::{
        AlphaMode, Camera, Coding, Environment, Falloff, LayerMode, Lens, Light, LightShape, Lobe, Mapping, Material, MetallicRoughness,
        NormalMap, Opacity, Part, Phong, Projector, Reflection, SpotProfile, Surface, Texture, TextureLayer, TextureRef, Triangle, Wrap,
    },
    units::Rgb,
};

fn image(name: &str, coding: Coding, has_alpha: bool) -> Texture {
    let channels = if has_alpha { 4 } else { 3 };
    let texels = (0..4 * channels).map(|i| if has_alpha && i % 4 == 3 { 60 + i } else { 20 * (i % 12) }).collect();
    Texture { name: name.into(), width: 2, height: 2, coding, has_alpha, texels }
}

/// A quad in the plane z = `z` in two triangles.
fn quad(scene: &mut Scene, name: &str, z: f32, material: u32) -> Surface {
    let first = scene.positions.len() as u32;
    scene.positions.extend([[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.5, z], [0.0, 1.5, z]]);
    let [a, b, c, d] = [[0.125, 0.25], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let triangles = [([0, 1, 2], [a, b, c]), ([0, 2, 3], [a, c, d])];
    let triangles = triangles
        .iter()
        .enumerate()
        .map(|(i, (corners, uv))| (Triangle { corners: corners.map(|v| first + v), polygon: i as u32 }, Some(*uv)));
    Surface::plain(name, material, triangles.collect())
}

fn two_sided(front: &Surface, index: u32) -> Surface {
    let turn = |[a, b, c]: [u32; 3]| [a, c, b];
    let mut back = front.clone();
    back.name = format!("{}~back", front.name);
    back.file_stem = back.name.replace('~', "_");
    back.parts[0].name = back.name.clone();
    back.back_of = Some(index);
    back.triangles.iter_mut().for_each(|t| t.corners = turn(t.corners));
    back.uv_sets.iter_mut().flatten().flatten().for_each(|uv| *uv = [uv[0], uv[2], uv[1]]);
    back
}

/// Everything that glTF can say.
fn faithful() -> Scene {
    let mut scene = Scene::empty();
    scene.textures = vec![image("colour.png", Coding::Srgb, true), image("numbers.png", Coding::Linear, false)];
    let color = TextureRef {
        wrap: [Wrap::Mirror, Wrap::Clamp],
        nearest: true,
        transform: [[2.0, 0.0, 0.25], [0.0, -0.5, 0.125]],
        ..TextureRef::plain(0, 0)
    };
    let numbers = TextureRef::plain(1, 0);
    let pbr = MetallicRoughness {
        layers: vec![TextureLayer { texture: color, mode: LayerMode::Modulate { scale: 1.0 } }],
        metallic_roughness_texture: Some(numbers),
        ior: 1.33,
        specular: 0.5,
        specular_color: Rgb::new(0.5, 1.0, 2.0),
        transmission: 0.25,
        transmission_texture: Some(numbers),
        ..MetallicRoughness::plain(Rgb::new(0.1, 0.7, 0.3), 0.2, 0.6)
    };
    let glass = Material {
        emission: Rgb::new(0.3, 5.0, 1.1),
        emission_texture: Some(color),
        opacity: Opacity { mode: AlphaMode::Mask { cutoff: 0.4 }, factor: 0.9, texture: Some(color) },
        normal_map: Some(NormalMap { texture: numbers, scale: 0.7 }),
        ..Material::new("glass", Reflection::MetallicRoughness(pbr))
    };
    let sign = Material::new("sign", Reflection::None).emitting(Rgb::new(0.2, 0.4, 0.6));
    scene.materials = vec![glass, sign];
    scene.normals = vec![[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]];
    scene.colors = vec![[1.0, 0.5, 0.25, 1.0], [0.0, 1.0, 0.5, 0.5]];
    let mut pane = quad(&mut scene, "pane", 0.0, 0);
    pane.normals = vec![[0, 1, 1], [0, 1, 0]];
    pane.tangents = vec![[0, 1, 1], [0, 1, 0]];
    scene.tangents = vec![[1.0, 0.0, 0.0, 1.0], [0.0, 0.8, -0.6, -1.0], [1.0, 0.0, 0.0, -1.0], [0.0, 0.8, -0.6, 1.0]];
    pane.colors = vec![[0, 1, 1], [0, 1, 0]];
    let (normals, tangents) = (vec![[2, 3, 3], [2, 2, 3]], vec![[2, 3, 3], [2, 2, 3]]);
    let back = Surface { normals, tangents, colors: vec![[0, 1, 1], [0, 0, 1]], ..two_sided(&pane, 0) };
    scene.normals.extend([[0.0, 0.0, -1.0], [0.0, -0.6, -0.8]]);
    let sign = quad(&mut scene, "sign", 1.0, 1);
    scene.surfaces = vec![pane, back, sign];
    let light = |name: &str, shape| Light::new(name, shape, Rgb::new(3.0, 1.5, 0.75));
    scene.lights = vec![
        Light { falloff: Falloff::InverseSquare { range: Some(7.5) }, ..light("lamp", LightShape::Point { position: [1.0, 2.0, 3.0] }) },
        light("sun", LightShape::Directional { direction: [0.0, -1.0, 0.0] }),
        light(
            "spot",
            LightShape::Spot {
                position: [0.0, 4.0, 0.0],
                direction: [0.6, -0.8, 0.0],
                cut_off: 0.7,
                beam_width: 0.3,
                profile: SpotProfile::SquaredCosine,
            },
        ),
    ];
    let camera =
        |name: &str, lens| Camera { name: name.into(), eye: [0.5, 0.5, 4.0], forward: [0.0, 0.0, -1.0], up: [0.0, 1.0, 0.0], lens };
    scene.cameras =
        vec![camera("eye", Lens::Perspective { fov: 0.8, of_smaller: false }), camera("plan", Lens::Orthographic { half_height: 2.5 })];
    scene.validate().unwrap();
    scene
}

fn again(name: &str, files: Vec<(&str, Vec<u8>)>) -> Imported {
    let parts = files.into_iter().map(|(name, bytes)| Upload { name: name.into(), content: Content::Bytes(bytes) });
    let bundle = Bundle::from_parts(parts.collect(), Some(name), std::path::Path::new("unused")).unwrap();
    import_bundle(&bundle, &ImportOptions::default()).unwrap()
}

fn back_in(scene: &Scene) -> Scene {
    again("s.glb", vec![("s.glb", export(scene).unwrap().glb().unwrap())]).scene
}

/// The corners of each surface with all that belongs to them, whatever the pools are called.
fn corners(scene: &Scene) -> Vec<(String, Vec<String>)> {
    let of = |s: &Surface| {
        let corner = |t: usize, c: usize| {
            let pick = |list: &[[u32; 3]]| list.get(t).map(|ids| ids[c] as usize);
            let (position, normal, color) = (s.triangles[t].corners[c] as usize, pick(&s.normals), pick(&s.colors));
            let uvs: Vec<_> = (0..s.uv_sets.len()).map(|set| s.uv(set, t).map(|uv| uv[c])).collect();
            let (normal, tangent) = (normal.map(|n| scene.normals[n]), pick(&s.tangents).map(|t| scene.tangents[t]));
            format!("{:?} {normal:?} {tangent:?} {:?} {uvs:?}", scene.positions[position], color.map(|n| scene.colors[n]))
        };
        (0..s.triangles.len()).flat_map(|t| (0..3).map(move |c| (t, c))).map(|(t, c)| corner(t, c)).collect()
    };
    scene.surfaces.iter().map(|s| (s.name.clone(), of(s))).collect()
}

#[test]
fn what_gltf_can_say_comes_back_as_it_was() {
    let scene = faithful();
    let exported = export(&scene).unwrap();
    assert_eq!(exported.warnings, []);
    let found = back_in(&scene);
    assert_eq!(corners(&found), corners(&scene));
    assert_eq!(found.surfaces.iter().map(|s| s.back_of).collect::<Vec<_>>(), [None, Some(0), None]);
    assert_eq!(found.materials, scene.materials);
    let pixels = |s: &Scene| s.textures.iter().map(|t| (t.coding, t.has_alpha, t.texels.clone())).collect::<Vec<_>>();
    assert_eq!(pixels(&found), pixels(&scene));
    assert_eq!((&found.lights[0], &found.lights[1].intensity), (&scene.lights[0], &scene.lights[1].intensity));
    for (found, wanted) in found.lights.iter().zip(&scene.lights) {
        let (found, wanted) = (light::tests::direction(found), light::tests::direction(wanted));
        assert!((found - wanted).length() < 1e-6, "{found} {wanted}");
    }
    assert_eq!(found.cameras, scene.cameras);
}

#[test]
fn the_same_scene_gives_the_same_bytes_and_text_says_what_binary_says() {
    let scene = faithful();
    let (one, two) = (export(&scene).unwrap(), export(&scene).unwrap());
    let binary = one.glb().unwrap();
    assert_eq!(binary, two.glb().unwrap());
    let (text, bytes) = two.gltf("s 1%.bin").unwrap();
    assert!(binary.ends_with(&bytes));
    let found = again("s.gltf", vec![("s.gltf", text), ("s 1%.bin", bytes)]).scene;
    assert_eq!((corners(&found), found.materials), (corners(&scene), scene.materials));
}

fn one_material(material: Material) -> Scene {
    let mut scene = Scene { textures: faithful().textures, materials: vec![material], ..Scene::empty() };
    let surface = quad(&mut scene, "wall", 0.0, 0);
    scene.surfaces = vec![surface];
    scene
}

fn imported_pbr(scene: &Scene) -> MetallicRoughness {
    match back_in(scene).materials.remove(0).reflection {
        Reflection::MetallicRoughness(pbr) => pbr,
        other => panic!("{other:?}"),
    }
}

#[test]
fn phong_keeps_its_colour_its_reflectance_and_its_width() {
    let matt = one_material(Material::matt("m", Rgb::new(0.2, 0.3, 0.4)));
    assert_eq!(export(&matt).unwrap().warnings, []);
    let found = imported_pbr(&matt);
    assert_eq!((found.base_color, found.specular, found.metallic), (Rgb::new(0.2, 0.3, 0.4), 0.0, 0.0));
    let glossy = |diffuse, specular| {
        one_material(Material::new(
            "m",
            Reflection::Phong(Phong { specular, lobe: Lobe::Phong { exponent: 30.0 }, ..Phong::matt(diffuse) }),
        ))
    };
    let plastic = glossy(Rgb::splat(0.5), Rgb::splat(0.2));
    assert!(export(&plastic).unwrap().warnings[0].message.contains("glossy Phong"));
    let found = imported_pbr(&plastic);
    assert!((found.specular_color.r * DIELECTRIC - 0.2).abs() < 1e-6 && found.metallic == 0.0);
    assert!((found.roughness - 0.5).abs() < 1e-6, "alpha^2 = 2/32, roughness = sqrt(1/4): {}", found.roughness);
    let metal = imported_pbr(&glossy(Rgb::BLACK, Rgb::new(0.9, 0.6, 0.2)));
    assert_eq!((metal.metallic, metal.base_color), (1.0, Rgb::new(0.9, 0.6, 0.2)));
}

const DIELECTRIC: f32 = 0.04;

#[test]
fn opacity_of_an_image_of_its_own_joins_the_colour() {
    let (color, alpha) = (TextureRef::plain(1, 0), TextureRef::plain(0, 0));
    let layers = vec![TextureLayer { texture: color, mode: LayerMode::Modulate { scale: 1.0 } }];
    let phong = Phong { layers, ..Phong::matt(Rgb::WHITE) };
    let opacity = Opacity { mode: AlphaMode::Blend, factor: 1.0, texture: Some(alpha) };
    let leaf = one_material(Material { opacity, ..Material::new("leaf", Reflection::Phong(phong)) });
    let found = back_in(&leaf);
    let opacity = found.materials[0].opacity.texture.unwrap();
    let texture = &found.textures[opacity.texture as usize];
    assert!(texture.has_alpha);
    let alphas: Vec<u8> = texture.texels.chunks(4).map(|p| p[3]).collect();
    let wanted: Vec<u8> = leaf.textures[0].texels.chunks(4).map(|p| p[3]).collect();
    assert_eq!(alphas, wanted);
}

#[test]
fn a_sheared_transform_goes_into_the_coordinates() {
    let sheared = TextureRef { transform: [[1.0, 0.5, 0.0], [0.25, 1.0, 0.5]], ..TextureRef::plain(1, 0) };
    let layers = vec![TextureLayer { texture: sheared, mode: LayerMode::Modulate { scale: 1.0 } }];
    let scene = one_material(Material::new("m", Reflection::Phong(Phong { layers, ..Phong::matt(Rgb::WHITE) })));
    let found = back_in(&scene);
    let Reflection::MetallicRoughness(pbr) = &found.materials[0].reflection else { panic!() };
    let reference = pbr.layers[0].texture;
    assert_eq!((reference.mapping, reference.transform), (Mapping::Uv { set: 1 }, TextureRef::plain(0, 0).transform));
    let [[u, v], ..] = found.surfaces[0].uv(1, 0).unwrap();
    assert!((u - 0.25).abs() < 1e-6 && (v - 0.78125).abs() < 1e-6, "{u} {v}");
}

#[test]
fn what_is_left_out_is_counted_and_the_rest_is_valid() {
    let mut scene = faithful();
    scene.environment =
        Some(Environment { name: "sky.hdr".into(), width: 1, height: 1, rgb: vec![[1.0; 3]], rotation: 0.0, intensity: 1.0 });
    scene.projectors = vec![Projector { name: "p".into(), light: None, matrix: [[0.0; 4]; 4] }];
    let projected = TextureRef { mapping: Mapping::Projected { projector: 0 }, ..TextureRef::plain(1, 0) };
    for mode in [LayerMode::Add, LayerMode::Modulate { scale: 1.0 }] {
        let layers = vec![TextureLayer { texture: projected, mode }];
        scene.materials.push(Material::new("slide", Reflection::Phong(Phong { layers, ..Phong::matt(Rgb::WHITE) })));
        let index = scene.materials.len() as u32 - 1;
        let surface = quad(&mut scene, &format!("wall {index}"), index as f32, index);
        scene.surfaces.push(Surface { file_stem: format!("wall{index}"), ..surface });
    }
    scene.lights[0].falloff = Falloff::Polynomial { attenuation: [1.0, 0.0, 0.0], radius: 10.0 };
    scene.lights[0].ambient = Rgb::WHITE;
    if let LightShape::Spot { cut_off, beam_width, profile, .. } = &mut scene.lights[2].shape {
        (*cut_off, *beam_width, *profile) = (2.0, 2.0, SpotProfile::Linear);
    }
    scene.surfaces[0].parts[0] =
        Part { casts_shadows: false, receive_shadows: vec![1], unlit_by: vec![0], ..scene.surfaces[0].parts[0].clone() };
    scene.validate().unwrap();
    let told: Vec<String> = export(&scene).unwrap().warnings.into_iter().map(|w| w.message).collect();
    for word in [
        "`sky.hdr`",
        "more textures",
        "falloff",
        "ambient",
        "linearly",
        "half space",
        "soft edge",
        "no shadow",
        "shadow fields",
        "do not shine",
    ] {
        assert!(told.iter().any(|m| m.contains(word)), "{word}: {told:#?}");
    }
    assert!(told.iter().any(|m| m.starts_with("materials have more textures") && m.contains(": 2, the first is `slide`")), "{told:#?}");
    back_in(&scene);
}

/// glTF wants normals beside tangents; those of the triangles are none when they come back.
#[test]
fn tangents_of_a_flat_surface_come_back() {
    let normal_map = Some(NormalMap { texture: TextureRef::plain(1, 0), scale: 1.0 });
    let mut scene = one_material(Material { normal_map, ..Material::matt("m", Rgb::WHITE) });
    (scene.tangents, scene.surfaces[0].tangents) = (vec![[0.6, 0.8, 0.0, -1.0]], vec![[0; 3]; 2]);
    scene.validate().unwrap();
    let found = back_in(&scene);
    assert_eq!((corners(&found), found.normals), (corners(&scene), vec![]));
}

/// Below a texture that replaces the colour nothing is seen.
#[test]
fn the_texture_of_a_stack_is_the_one_that_shows() {
    let layer = |texture: u32, mode| TextureLayer { texture: TextureRef::plain(texture, 0), mode };
    let (below, above) = (layer(0, LayerMode::Modulate { scale: 1.0 }), layer(1, LayerMode::Replace));
    let stack = |layers| {
        let scene = one_material(Material::new("m", Reflection::Phong(Phong { layers, ..Phong::matt(Rgb::splat(0.5)) })));
        (export(&scene).unwrap().warnings.len(), imported_pbr(&scene).base_color, back_in(&scene).textures.remove(0).name)
    };
    let alone = stack(vec![above.clone()]);
    assert_eq!((alone.0, alone.1), (0, Rgb::WHITE));
    assert_eq!(stack(vec![below.clone(), above.clone()]), alone);
    assert_eq!(stack(vec![above.clone(), below.clone(), above]), alone);
    assert_ne!(stack(vec![below]), alone);
}

#[test]
fn a_back_of_another_material_is_a_surface_of_its_own() {
    let mut scene = one_material(Material::matt("front", Rgb::WHITE));
    scene.materials.push(Material::matt("back", Rgb::BLACK));
    let mut back = two_sided(&scene.surfaces[0], 0);
    back.parts[0].material = 1;
    scene.surfaces.push(back);
    scene.validate().unwrap();
    let found = back_in(&scene);
    let surfaces: Vec<_> = found.surfaces.iter().map(|s| (s.name.as_str(), s.back_of, s.parts[0].material)).collect();
    assert_eq!(surfaces, [("wall", None, 0), ("wall~back", None, 1)]);
    assert_eq!(corners(&found), corners(&scene));
}
