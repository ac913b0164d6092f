//! What MTL and OBJ mean, by small files: normals, colours, opacity, glass, the PBR extension, options of textures.

use super::*;
use crate::import::{Content, Imported, Part, import_bundle};
use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use kiln_proto::{
    math,
    options::ImportOptions,
    scene::{AlphaMode, Material, MetallicRoughness, Opacity, Phong, Reflection, Wrap},
    units::Rgb,
};
use std::io::Cursor;

mod exporters;
mod looks;
mod pictures;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
/// A roof: two squares that meet in an edge at a right angle.
const ROOF: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";

fn import_parts(parts: Vec<Part>) -> Result<Imported, Vec<String>> {
    let bundle = Bundle::from_parts(parts, Some("a.obj"), &std::env::temp_dir()).unwrap();
    import_bundle(&bundle, &ImportOptions::default()).map_err(|e| e.iter().map(ToString::to_string).collect())
}

fn file(name: &str, bytes: impl Into<Vec<u8>>) -> Part {
    Part { name: name.into(), content: Content::Bytes(bytes.into()) }
}

/// The scene of an OBJ without materials, and what was said of it but that it has no light.
fn geometry(text: &str) -> (Scene, Vec<String>) {
    let imported = import_parts(vec![file("a.obj", text)]).unwrap();
    let said = imported.warnings.iter().map(ToString::to_string).filter(|w| !w.contains("emits light") && !w.contains("no material"));
    (imported.scene, said.collect())
}

/// The normals of the corners of a triangle.
fn normals(scene: &Scene, triangle: usize) -> Option<[[f32; 3]; 3]> {
    scene.surfaces[0].normals.get(triangle).map(|n| n.map(|i| scene.normals[i as usize]))
}

#[test]
fn library_names_may_hold_blanks() {
    let files = ["a b.mtl", "c.mtl", "d e"];
    let split = |operands: &str| split_names(operands, |n| files.contains(&n));
    assert_eq!(split("a b.mtl c.mtl"), ["a b.mtl", "c.mtl"]);
    assert_eq!(split("\"a b.mtl\" d e"), ["a b.mtl", "d e"]);
    assert_eq!(split("gone.mtl c.mtl"), ["gone.mtl", "c.mtl"]);
    assert_eq!(split("also gone.MTL x y"), ["also gone.MTL", "x y"]);
    assert_eq!(split(""), [""; 0]);
}

#[test]
fn a_file_s_normals_are_kept_as_directions() {
    let (scene, said) = geometry(&format!("{SQUARE}vn 0 0 2\nvn 0 3 4\nf 1//1 2//2 3//-1\nf 1 3 4\n"));
    assert_eq!(normals(&scene, 0).unwrap(), [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.6, 0.8]]);
    assert_eq!(normals(&scene, 1).unwrap(), [[0.0, 0.0, 1.0]; 3], "flat where there are none");
    assert_eq!(said, [""; 0]);
    let (flat, _) = geometry(&format!("{SQUARE}vn 0 0 2\nf 1//1 2//1 3//1\n"));
    assert!(flat.surfaces[0].normals.is_empty(), "normals of the triangle itself are none");
}

#[test]
fn odd_normals_are_told_once_and_harm_nothing() {
    let odd = "vn 0 0 -1\nvn 0 0 0\nvn 0 0.6 0.8\n";
    let faces = "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\nf 2//2 1//2 3//2\nf 3//9 1//9 4//9\nf 4//0 3//3 2//3\nf 2//3 3 4\n";
    let (scene, said) = geometry(&format!("{SQUARE}{odd}{faces}"));
    assert_eq!(normals(&scene, 0).unwrap(), [[0.0, 0.0, -1.0]; 3]);
    assert_eq!(normals(&scene, 2).unwrap()[0][2].abs(), 1.0);
    for wanted in [
        "a.obj:12: faces have normals on the side of their back; they were kept: 2,",
        "a.obj:14: faces have normals without a length, and are shaded as if they had none: 1, here",
        "a.obj:15: faces refer to normals that do not exist, and are shaded as if they had none: 2,",
        "a.obj:17: a face has normals at some corners only; they were ignored there",
    ] {
        assert!(said.iter().any(|w| w.starts_with(wanted)), "{wanted} is not in {said:#?}");
    }
    assert_eq!(said.len(), 4, "{said:#?}");
}

#[test]
fn smoothing_groups_round_edges_within_them_only() {
    let along = |faces: &str| {
        let (scene, _) = geometry(&format!("{ROOF}{faces}"));
        normals(&scene, 0).map(|n| n[1])
    };
    let edge = along("s 1\nf 1 2 3 4\nf 2 5 6 3\n").unwrap();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!((edge[0] - half).abs() < 1e-6 && (edge[2] - half).abs() < 1e-6, "{edge:?}");
    assert_eq!(along("s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n"), None, "groups of one face each are flat");
    assert_eq!(along("f 1 2 3 4\nf 2 5 6 3\n"), None);
    assert_eq!(along("s 1\nf 1 2 3 4\ns off\nf 2 5 6 3\ns 0\nf 6 5 2 3"), None);
    // Across objects and materials: what is one group is one roundness.
    let (two, _) = geometry(&format!("{ROOF}s 4\no a\nf 1 2 3 4\no b\nf 2 5 6 3\n"));
    assert_eq!((two.surfaces.len(), normals(&two, 0).unwrap()[1]), (2, edge));
    // Normals of the file go before, and other faces of the group have theirs.
    let (mixed, _) = geometry(&format!("{ROOF}vn 0 1 0\ns 1\nf 1//1 2//1 3//1 4//1\nf 2 5 6 3\n"));
    assert_eq!((normals(&mixed, 0).unwrap()[1], normals(&mixed, 2).unwrap()[0]), ([0.0, 1.0, 0.0], edge));
}

#[test]
fn vertex_colours_reach_the_corners_linear() {
    let (scene, said) = geometry("v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0 0 0 1\nf 1 2 3\n");
    let colors = scene.surfaces[0].colors[0].map(|i| scene.colors[i as usize]);
    assert_eq!(colors, [[1.0, 0.0, 0.0, 1.0], [0.0, math::srgb_eotf(0.5), 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
    assert_eq!(said, [""; 0]);
}
