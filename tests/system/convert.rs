//! `kiln convert`: files in, files out, refusals that say what to do.

use crate::harness::{fail, room, run, succeed};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const SHADOWS: &str = "#X3D V3.2 utf8\nDEF L SpotLight { location 0 3 0 direction 0 -1 0 }\n\
    Shape { appearance Appearance { material Material {} receiveShadows USE L } geometry Box {} }\n";

fn convert(input: &Path, output: &Path, more: &[&str]) -> Vec<String> {
    let paths = [input, output].map(|p| p.display().to_string());
    ["convert".to_owned()].into_iter().chain(paths).chain(more.iter().map(|s| (*s).to_owned())).collect()
}

fn shadows(dir: &Path) -> PathBuf {
    let path = dir.join("in.x3dv");
    std::fs::write(&path, SHADOWS).unwrap();
    path
}

#[test]
fn the_room_becomes_gltf_and_that_becomes_the_same_gltf() {
    let dir = TempDir::new().unwrap();
    let (one, two, text) = (dir.path().join("one.glb"), dir.path().join("two.glb"), dir.path().join("three.gltf"));
    let report: serde_json::Value = serde_json::from_str(&succeed(convert(&room(), &one, &["--json"]))).unwrap();
    assert_eq!(report["files"][0]["bytes"], std::fs::metadata(&one).unwrap().len());
    assert!(report["triangles"].as_u64().unwrap() > 10);
    succeed(convert(&room(), &two, &[]));
    assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&two).unwrap());
    let again: serde_json::Value = serde_json::from_str(&succeed(convert(&one, &text, &["--json"]))).unwrap();
    assert_eq!(again["triangles"], report["triangles"]);
    assert!(dir.path().join("three.bin").is_file());
}

#[test]
fn a_scene_whose_z_is_up_stands_upright_in_gltf() {
    let dir = TempDir::new().unwrap();
    let (input, output) = (dir.path().join("in.obj"), dir.path().join("out.gltf"));
    std::fs::write(&input, "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 5\nf 1 2 3\nf 1 2 4\n").unwrap();
    succeed(convert(&input, &output, &["--up", "z"]));
    let gltf: serde_json::Value = serde_json::from_slice(&std::fs::read(&output).unwrap()).unwrap();
    let position = &gltf["accessors"][gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize];
    assert_eq!((&position["min"], &position["max"]), (&serde_json::json!([0, 0, -3]), &serde_json::json!([2, 5, 0])));
    fail(2, &["x or y or z", "`up`"], convert(&input, &output, &["--force", "--up", "up"]));
    fail(2, &["--up", ".glb"], convert(&shadows(dir.path()), &dir.path().join("out.x3d"), &["--up", "z"]));
}

#[test]
fn shadows_are_lowered_in_both_encodings_and_nothing_is_overwritten_unasked() {
    let dir = TempDir::new().unwrap();
    let input = shadows(dir.path());
    for name in ["out.x3d", "out.x3dv"] {
        let output = dir.path().join(name);
        let report: serde_json::Value = serde_json::from_str(&succeed(convert(&input, &output, &["--lower-shadows", "--json"]))).unwrap();
        assert_eq!(report["lowered_appearances"], 1);
        let text = std::fs::read_to_string(&output).unwrap();
        assert!(text.contains("GeneratedShadowMap") && text.contains("ProjectedTextureCoordinate"), "{text}");
        fail(2, &[name, "--force"], convert(&input, &output, &[]));
        assert_eq!(std::fs::read_to_string(&output).unwrap(), text);
        succeed(convert(&input, &output, &["--force"]));
        assert!(!std::fs::read_to_string(&output).unwrap().contains("GeneratedShadowMap"));
    }
}

#[test]
fn refusals_say_what_where_and_what_to_do() {
    let dir = TempDir::new().unwrap();
    let input = shadows(dir.path());
    let to = |name: &str| dir.path().join(name);
    fail(2, &["out.fbx", ".glb"], convert(&input, &to("out.fbx"), &[]));
    fail(2, &["--lower-shadows", ".x3d"], convert(&input, &to("out.glb"), &["--lower-shadows"]));
    fail(2, &["thesis.obj", "not X3D"], convert(&room(), &to("out.x3d"), &[]));
    fail(2, &["in.x3dv", "the input"], convert(&input, &input, &["--force"]));
    fail(2, &["time"], convert(&input, &to("out.glb"), &["--time", "nan"]));
    fail(1, &["gone.obj", "no such file"], convert(&to("gone.obj"), &to("out.glb"), &[]));
    std::fs::write(to("bad.x3dv"), "#X3D V3.0 utf8\nShape {").unwrap();
    fail(1, &["bad.x3dv:2"], convert(&to("bad.x3dv"), &to("out.x3d"), &[]));
    assert!(!to("out.glb").exists() && !to("out.x3d").exists());
    let warned = run(convert(&input, &dir.path().join("sub/out.glb"), &[]));
    assert!(warned.status.success() && String::from_utf8_lossy(&warned.stderr).contains("warning: "), "falloff of X3D");
}
