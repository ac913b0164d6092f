//! Each fault is found, and said so that its owner finds it.

use super::*;
use crate::scene::{
    Camera, Coding, Environment, LayerMode, Lens, Light, LightShape, Material, Part, Phong, Projection, Projector, Reflection,
    ShadowCompare, ShadowMap, ShadowUpdate, SpotProfile, Surface, Texture, TextureLayer, TextureRef, Triangle,
};

fn scene() -> Scene {
    Scene {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        surfaces: vec![Surface {
            name: "floor".into(),
            file_stem: "floor".into(),
            parts: vec![Part::plain("floor", 0, 1)],
            triangles: vec![Triangle { corners: [0, 1, 2], polygon: 0 }],
            ..Surface::default()
        }],
        materials: vec![Material::matt("grey", Rgb::splat(0.5))],
        ..Scene::empty()
    }
}

fn phong(s: &mut Scene) -> &mut Phong {
    match &mut s.materials[0].reflection {
        Reflection::Phong(phong) => phong,
        other => panic!("{other:?}"),
    }
}

fn back() -> Surface {
    Surface {
        name: "floor~back".into(),
        file_stem: "floor~back".into(),
        back_of: Some(0),
        triangles: vec![Triangle { corners: [0, 2, 1], polygon: 0 }],
        ..scene().surfaces[0].clone()
    }
}

#[test]
fn a_valid_scene_survives_its_canonical_bytes() {
    let bytes = scene().to_bytes().unwrap();
    assert_eq!(Scene::from_bytes(&bytes).unwrap(), scene());
    assert!(Scene::from_bytes(&bytes[..bytes.len() - 1]).is_err());
    assert!(Scene::from_bytes(&[bytes.as_slice(), &[0]].concat()).is_err(), "trailing bytes must be refused");
}

/// A change of the canonical form changes every scene's address: then `SCENE_VERSION` goes up and this hash is written anew.
#[test]
fn the_canonical_bytes_never_change() {
    let bytes = scene().to_bytes().unwrap();
    assert_eq!(Scene::hash_of(&bytes).to_string(), "d473d09ddddebf9704434b493b42ab889d0cef16d86e02274a7eb77443fb1700");
}

#[test]
fn each_fault_is_found_and_named() {
    let broken = |f: fn(&mut Scene)| {
        let mut s = scene();
        f(&mut s);
        s.validate().unwrap_err().to_string()
    };
    assert!(broken(|s| s.version = 9).contains("version 9"));
    assert!(broken(|s| (s.surfaces[0].triangles.clear(), s.surfaces[0].parts[0].triangles = 0).1).contains("no triangle"));
    assert!(broken(|s| s.positions[1][2] = f32::NAN).contains("vertex 1"));
    assert!(broken(|s| s.surfaces[0].triangles[0].corners[2] = 7).contains("vertex 7"));
    assert!(broken(|s| s.surfaces.push(s.surfaces[0].clone())).contains("not unique"));
    assert!(broken(|s| phong(s).specular = Rgb::splat(0.6)).contains("more light"));
    assert!(broken(|s| s.materials[0].emission.g = -1.0).contains("negative"));
    assert!(
        broken(|s| phong(s).layers.push(TextureLayer { texture: TextureRef::plain(0, 0), mode: LayerMode::Replace })).contains("texture 0")
    );
    let short = |s: &mut Scene| {
        let texels = vec![0; 11];
        s.textures.push(Texture { name: "t".into(), width: 2, height: 2, coding: Coding::Srgb, has_alpha: false, texels });
    };
    assert!(broken(short).contains("11 bytes"));
    assert!(broken(|s| s.surfaces[0].parts[0].triangles = 2).contains("2 triangles in its parts"));
    assert!(broken(|s| s.surfaces[0].normals = vec![[0; 3]]).contains("normals 0"));
    assert!(broken(|s| s.surfaces[0].tangents = vec![[0; 3]]).contains("tangents 0"));
    assert!(broken(|s| s.tangents = vec![[1.0, 0.0, 0.0, 0.5]]).contains("tangent 0 has a side other"));
    assert!(broken(|s| s.tangents = vec![[f32::NAN, 0.0, 0.0, 1.0]]).contains("tangent 0 has a value that is not finite"));
    assert!(broken(|s| s.surfaces[0].uv_sets = vec![vec![]]).contains("0 texture coordinates"));
    assert!(broken(|s| s.surfaces[0].parts[0].unlit_by = vec![3]).contains("light 3"));
    assert!(broken(|s| s.materials[0].opacity.factor = 1.5).contains("opacity"));
}

#[test]
fn a_back_has_the_triangles_of_its_front_turned_over() {
    let with = |back: Surface| Scene { surfaces: vec![scene().surfaces[0].clone(), back], ..scene() }.validate();
    with(back()).unwrap();
    let wrong = |f: fn(&mut Surface)| {
        let mut back = back();
        f(&mut back);
        with(back).unwrap_err().to_string().contains("not the back")
    };
    assert!(wrong(|b| b.triangles[0].corners = [0, 1, 2]) && wrong(|b| b.back_of = Some(1)) && wrong(|b| b.back_of = Some(9)));
}

#[test]
fn energy_above_one_is_scaled_to_one() {
    assert_eq!(energy_scale(Rgb::splat(0.5), Rgb::splat(0.5)), 1.0);
    assert_eq!(energy_scale(Rgb::splat(1.0), Rgb::new(0.0, 1.0, 0.0)), 0.5);
}

const MAP: ShadowMap = ShadowMap { update: ShadowUpdate::Always, size: 128, scale: 1.1, bias: 4.0, compare: ShadowCompare::LessEqual };

/// The scene with a sun and a spot that are cameras as well, an environment, a projector and a camera.
fn lit() -> Scene {
    let (direction, up) = ([0.0, -1.0, 0.0], [0.0, 0.0, -1.0]);
    let light = |shape, projection| Light { projection, shadow_map: Some(MAP), ..Light::new("lamp", shape, Rgb::WHITE) };
    let seen = Projection { near: 0.0, far: 9.0, up, ..Projection::default() };
    let sun = light(LightShape::Directional { direction }, Projection { rectangle: [-1.0, -1.0, 1.0, 1.0], ..seen });
    let (cut_off, profile) = (0.5, SpotProfile::Linear);
    let spot = LightShape::Spot { position: [0.0; 3], direction, cut_off, beam_width: 0.2, profile };
    let sky = Environment { name: "sky".into(), width: 2, height: 1, rgb: vec![[1.0; 3]; 2], rotation: 0.5, intensity: 1.0 };
    let camera = Camera { name: "door".into(), eye: [0.0; 3], forward: direction, up, lens: Lens::Orthographic { half_height: 1.0 } };
    Scene {
        lights: vec![sun, light(spot, Projection { angle: 1.0, ..seen })],
        environment: Some(sky),
        projectors: vec![Projector { name: "slide".into(), light: Some(1), matrix: [[1.0; 4]; 4] }],
        cameras: vec![camera],
        ..scene()
    }
}

/// What is said of the lit scene once it is broken.
fn said(f: impl FnOnce(&mut Scene)) -> String {
    let mut s = lit();
    f(&mut s);
    s.validate().map_or_else(|e| e.to_string(), |()| "valid".to_owned())
}

const BEYOND: f32 = limits::BRIGHTEST * 1.01;

#[test]
fn no_light_is_brighter_than_the_brightest() {
    assert_eq!(said(|_| {}), "valid");
    assert_eq!(said(|s| s.lights[0].intensity.b = limits::BRIGHTEST), "valid");
    let most = format!("[0, {:e}]", limits::BRIGHTEST);
    for bad in [BEYOND, -1.0, f32::NAN, f32::INFINITY] {
        for (word, text) in [
            ("light `lamp` has an intensity outside", said(|s| s.lights[1].intensity.g = bad)),
            ("light `lamp` has an ambient term outside", said(|s| s.lights[1].ambient.b = bad)),
            ("environment `sky` has radiance outside", said(|s| s.environment.as_mut().unwrap().rgb[1][2] = bad)),
            ("or an intensity outside", said(|s| s.environment.as_mut().unwrap().intensity = bad)),
        ] {
            assert!(text.contains(word) && text.contains(&most), "{bad}: {text}");
        }
    }
    assert!(said(|s| s.materials[0].emission.r = BEYOND).contains("material `grey` has an emission above 1e13"));
    for shadow in [-0.1, 1.1, f32::NAN] {
        assert_eq!(said(|s| s.lights[0].shadow_intensity = shadow), "light `lamp` has a shadow intensity outside [0, 1]");
    }
}

#[test]
fn a_light_as_a_camera_has_a_usable_projection() {
    let broken = |light: usize, f: &dyn Fn(&mut Projection)| said(|s| f(&mut s.lights[light].projection));
    for light in [0, 1] {
        for (near, far) in [(-1.0, 9.0), (f32::NAN, 9.0), (0.0, f32::INFINITY), (0.0, f32::NAN), (9.0, 9.0), (0.0, 0.0)] {
            assert!(broken(light, &|p| (p.near, p.far) = (near, far)).contains("whose near and far"), "{light}: {near} {far}");
        }
        for up in [[0.0; 3], [0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [0.0, 0.8, 0.6], [f32::NAN, 0.0, 0.0]] {
            assert!(broken(light, &|p| p.up = up).contains("whose up is not"), "{light}: {up:?}");
        }
        assert!(broken(light, &|p| p.location[1] = f32::INFINITY).contains("projection location"), "{light}");
        assert!(broken(light, &|p| p.automatic = 16).contains("unknown automatic"), "{light}");
    }
    let nan = f32::NAN;
    for rectangle in [[1.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 0.5], [nan, 0.0, 1.0, 1.0], [0.0, 0.0, f32::INFINITY, 1.0], [0.0; 4]] {
        assert!(broken(0, &|p| p.rectangle = rectangle).contains("projection rectangle"), "{rectangle:?}");
    }
    assert!(broken(1, &|p| p.rectangle = [0.0, 0.0, 1.0, 1.0]).contains("projection rectangle"), "a spot has none");
    for angle in [0.0, -1.0, 4.0, nan] {
        assert!(broken(1, &|p| p.angle = angle).contains("projection angle"), "{angle}");
    }
    assert!(broken(0, &|p| p.angle = 1.0).contains("projection angle"), "a sun has none");
    assert_eq!(broken(0, &|p| *p = Projection::default()), "valid", "a light of a format without shadow maps");
}

#[test]
fn shadow_maps_of_lights_and_parts_have_a_size_and_finite_offsets() {
    let broken = [
        (ShadowMap { size: 0, ..MAP }, "size"),
        (ShadowMap { size: limits::TEXTURE_SIDE + 1, ..MAP }, "size"),
        (ShadowMap { scale: f32::NAN, ..MAP }, "scale or bias"),
        (ShadowMap { bias: f32::INFINITY, ..MAP }, "scale or bias"),
    ];
    for (map, word) in broken {
        let (light, part) =
            (said(|s| s.lights[1].shadow_map = Some(map)), said(|s| s.surfaces[0].parts[0].shadow_maps = vec![(0, MAP), (1, map)]));
        assert!(light.starts_with("light `lamp`") && light.contains(word), "{light}");
        assert!(part.starts_with("part `floor`") && part.contains(word), "{part}");
    }
}

#[test]
fn cameras_and_projectors_can_see() {
    let broken = |f: &dyn Fn(&mut Camera)| said(|s| f(&mut s.cameras[0]));
    assert!(broken(&|c| c.eye[0] = f32::NAN).contains("camera `door` has a value that is not finite"));
    for (forward, up) in [([0.0; 3], [0.0, 0.0, -1.0]), ([0.0, -1.0, 0.0], [0.0; 3]), ([0.0, -1.0, 0.0], [0.0, -1.0, 0.0])] {
        assert!(broken(&|c| (c.forward, c.up) = (forward, up)).contains("camera `door` looks along"), "{forward:?} {up:?}");
    }
    for fov in [0.0, -1.0, 3.2, f32::NAN] {
        assert!(broken(&|c| c.lens = Lens::Perspective { fov, of_smaller: true }).contains("field of view"), "{fov}");
    }
    for half_height in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        assert!(broken(&|c| c.lens = Lens::Orthographic { half_height }).contains("height"), "{half_height}");
    }
    assert!(said(|s| s.projectors[0].light = Some(2)).contains("projector `slide` refers to light 2"));
    assert!(said(|s| s.projectors[0].matrix[3][3] = f32::NAN).contains("projector `slide`"));
}
