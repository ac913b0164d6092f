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
fn verification_finds_a_flipped_byte() {
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
fn verification_names_a_false_claim() {
    let dir = TempDir::new().unwrap();
    let package_dir = dir.path().join("package");
    bake_room(&package_dir, &[]);
    let path = package_dir.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let surfaces = manifest["surfaces"].as_array_mut().unwrap();
    let floor = surfaces.iter().position(|s| s["name"] == "floor").unwrap();
    let claim = &mut surfaces[floor]["encoding"]["errors"]["max"];
    let truth = claim.as_u64().unwrap();
    assert!(truth > 0, "the floor is glossy: it cannot be coded without error");
    // Better than it is, and no file is touched: only measuring again can tell.
    *claim = (truth - 1).into();
    std::fs::write(&path, serde_json::to_vec_pretty(&manifest).unwrap()).unwrap();
    let (place, measured) = (format!("surfaces[{floor}].encoding.errors.max"), format!("measured: {truth}"));
    fail(1, &[&place, &measured], ["inspect", "--verify", package_dir.to_str().unwrap()]);
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

/// Texture sizes of the thesis and what it prints for them: raw size in its MB (1,024,000 bytes) at 400 directions.
const THESIS_SIZES: [(&str, u64, u64, &str); 6] = [
    ("wall_side", 200, 100, "23.4"),
    ("wall_front", 200, 100, "23.4"),
    ("floor", 200, 200, "46.9"),
    ("box_front", 300, 300, "105.5"),
    ("box_back", 300, 300, "105.5"),
    ("prism", 512, 512, "307.2"),
];

#[test]
fn at_nominal_sizes_raw_and_mtsp_are_as_large_as_the_thesis_has_them() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("package");
    let (room, out) = (crate::harness::room().display().to_string(), out.display().to_string());
    let mut args: Vec<String> = ["bake", &room, "-o", &out].map(str::to_owned).to_vec();
    args.extend(crate::harness::nominal());
    args.extend(["--samples", "1", "--directions", "2x2", "--max-depth", "2", "--texel-scale", "1", "--raw", "u8"].map(str::to_owned));
    succeed(args);
    let manifest: Value = serde_json::from_str(&std::fs::read_to_string(format!("{out}/manifest.json")).unwrap()).unwrap();
    let table = succeed(["inspect", &out]);
    for (name, width, height, thesis) in THESIS_SIZES {
        let surface = manifest["surfaces"].as_array().unwrap().iter().find(|s| s["name"] == name).unwrap();
        assert_eq!(surface["size"], format!("{width}x{height}"));
        let payload = |kind: &str| {
            let bytes = std::fs::read(format!("{out}/surfaces/{name}.{kind}")).unwrap();
            bytes.len() as u64 - 32
        };
        assert_eq!(payload("mtsp"), 4 * (width * height + 1), "{name}: a start for every texel, and the end");
        let raw = 3 * 4 * width * height;
        assert_eq!(payload("mtex"), raw, "{name}: three bytes for every texel and direction");
        assert_eq!(surface["encoding"]["raw_bytes"], 3 * 4 * surface["covered"].as_u64().unwrap(), "{name}");
        // 400 directions are a hundred times as many, and nothing else in the raw size depends on them.
        assert_eq!(format!("{:.1}", (100 * raw) as f64 / 1_024_000.0), thesis, "{name}");
        let printed = raw.to_string().as_bytes().rchunks(3).rev().map(|g| String::from_utf8_lossy(g)).collect::<Vec<_>>().join(",");
        let line = |l: &&str| l.starts_with(name) && l.contains(&printed);
        assert!(table.lines().any(|l| line(&l)), "{name} {printed} in\n{table}");
    }
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
