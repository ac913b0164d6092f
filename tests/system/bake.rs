//! `kiln bake` and the tools that read its package.

use crate::harness::{bake_room, fail, package, run, succeed};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn a_package_is_complete_true_to_its_claims_and_readable() {
    let dir = TempDir::new().unwrap();
    let package_dir = dir.path().join("package");
    bake_room(&package_dir, &[]);
    let path = package_dir.to_str().unwrap();
    let files = package(&package_dir);
    for name in [
        "manifest.json",
        "scene.kiln",
        "surfaces/floor.mtex",
        "surfaces/floor.mtsp",
        "surfaces/floor.mti",
        "surfaces/floor.mtnc",
        "surfaces/floor.mtm",
    ] {
        assert!(files.contains_key(name), "{name} is missing among {:?}", files.keys());
    }
    let manifest: Value = serde_json::from_slice(&files["manifest.json"]).unwrap();
    assert_eq!(manifest["surfaces"].as_array().unwrap().len(), 7);

    let table = succeed(["inspect", path]);
    assert!(table.contains("wall_side") && table.contains("prism"), "{table}");
    succeed(["inspect", "--verify", path]);

    let csv = dir.path().join("decoded.csv");
    for from in ["raw", "codec"] {
        succeed(["decode", path, "--out", csv.to_str().unwrap(), "--texels", "3", "--seed", "5", "--from", from]);
        let text = std::fs::read_to_string(&csv).unwrap();
        assert!(text.starts_with("surface,tx,ty,i,j,px,py,pz,nx,ny,nz,dx,dy,dz,r,g,b"), "{}", &text[..80]);
        // Six surfaces that do not emit, three texels, 48 directions.
        assert_eq!(text.lines().count(), 1 + 6 * 3 * 48);
    }
}

#[test]
fn verification_finds_a_flipped_byte_and_a_false_claim() {
    let dir = TempDir::new().unwrap();
    let package_dir = dir.path().join("package");
    bake_room(&package_dir, &[]);
    let file = package_dir.join("surfaces/floor.mtnc");
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    fail(1, &["floor.mtnc"], ["inspect", "--verify", package_dir.to_str().unwrap()]);
}

#[test]
fn another_encoding_equals_a_bake_with_those_settings() {
    let dir = TempDir::new().unwrap();
    let baked = dir.path().join("baked");
    bake_room(&baked, &[]);
    let direct = dir.path().join("direct");
    bake_room(&direct, &["--rule", "thesis", "--threshold", "9"]);
    let encoded = dir.path().join("encoded");
    let paths = [&baked, &encoded].map(|p| p.to_str().unwrap());
    succeed(["encode", paths[0], "-o", paths[1], "--codec", "pwl", "--rule", "thesis", "--threshold", "9", "--raw", "u8"]);
    let (a, b) = (package(&direct), package(&encoded));
    for (name, bytes) in &a {
        assert!(name.ends_with(".json") || name == "scene.kiln" || *bytes == b[name], "{name} differs");
    }
    succeed(["inspect", "--verify", paths[1]]);
    fail(2, &["not empty"], ["encode", paths[0], "-o", paths[1], "--rule", "bounded"]);
}

#[test]
fn json_goes_to_stdout_and_progress_does_not() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("out");
    let room = crate::harness::room();
    let output = run([
        "--json",
        "bake",
        room.to_str().unwrap(),
        "-o",
        out.to_str().unwrap(),
        "--samples",
        "2",
        "--directions",
        "2x4",
        "--texel-scale",
        "0.1",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["job"]["state"], "done");
    let inspected: Value = serde_json::from_str(&succeed(["--json", "inspect", out.to_str().unwrap()])).unwrap();
    assert!(inspected["package_hash"].is_string(), "{inspected}");
}
