use super::*;
use crate::package::fixture;
use kiln_proto::settings::{RawFormat, Rule};
use std::{fs, path::Path};

fn inspect(dir: &Path, verify: bool, json: bool) -> (Result<(), ToolError>, String) {
    let mut out = vec![];
    let result = run(&Args { package: dir.to_owned(), verify }, json, &mut out);
    (result, String::from_utf8(out).unwrap())
}

#[test]
fn a_package_holds_what_it_claims_with_every_rule_and_raw_format() {
    for (rule, raw) in [
        (Rule::Bounded { eps: 2 }, Some(RawFormat::F32)),
        (Rule::Thesis { threshold: 6 }, Some(RawFormat::U8)),
        (Rule::Cumulative { threshold: 9 }, None),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let hash = fixture::bake(dir.path(), fixture::settings(rule, raw));
        let (result, text) = inspect(dir.path(), true, false);
        assert!(result.is_ok(), "{rule}: {}\n{text}", result.unwrap_err());
        assert!(text.contains(&hash.to_string()) && text.contains("\nverified: "), "{text}");
        assert_eq!(text.contains("errors measured again"), raw.is_some());
        let (_, json) = inspect(dir.path(), true, true);
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["package_hash"], hash.to_string());
        assert_eq!(json["verification"]["differences"], serde_json::json!([]));
        // 35 x 33 covered texels of the wall with their gutter, and the lamp's 8 x 5.
        assert_eq!(json["verification"]["texels"], 37 * 35 + 40);
        assert!(json["manifest"]["surfaces"][0]["encoding"]["errors"]["max"].as_u64().unwrap() > 0 || raw.is_none());
    }
}

#[test]
fn the_tables_have_the_sizes_of_the_files() {
    let dir = tempfile::tempdir().unwrap();
    fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 2 }, Some(RawFormat::U8)));
    let (_, text) = inspect(dir.path(), false, false);
    // 70 x 66 texels: 24 directions x 3 bytes raw, header and terminator beside 4 bytes a texel.
    for expected in ["70x66", "332,640", "332,672", "18,516"] {
        assert!(text.contains(expected), "{expected} is missing in\n{text}");
    }
}

/// A byte that is changed anywhere is found, and its file is named.
#[test]
fn one_changed_byte_is_named() {
    for name in ["surfaces/wall.mtnc", "surfaces/wall.mtex", "surfaces/lamp.mtm", "surfaces/wall.mtsp"] {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 2 }, Some(RawFormat::F32)));
        fixture::flip(&dir.path().join(name));
        let (result, text) = inspect(dir.path(), true, false);
        let error = result.unwrap_err();
        assert!(!error.is_usage());
        assert!(error.to_string().contains(name) && text.contains("NOT VERIFIED"), "{error}\n{text}");
    }
}

/// A manifest that lies consistently about its files still cannot lie about what they hold.
#[test]
fn a_false_claim_is_named() {
    for (from, to, field) in [
        ("\"covered\": 1155", "\"covered\": 1156", "covered"),
        ("\"colour_bits\": 16", "\"colour_bits\": 24", "colour_bits"),
        ("\"seed\": 0", "\"seed\": 1", "seed"),
        ("\"eps\": 3", "\"eps\": 0", "eps"),
        ("\"p99_9\": ", "\"p99_9\": 1", "p99_9"),
        ("\"average\": 0", "\"average\": 1", "average"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 3 }, Some(RawFormat::F32)));
        let path = dir.path().join("manifest.json");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from} is not in\n{text}");
        fs::write(&path, text.replace(from, to)).unwrap();
        let error = inspect(dir.path(), true, false).0.unwrap_err().to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
}

/// A manifest rewritten to fit what was done to the files: hashes and checksums all agree, the content does not.
fn reseal(dir: &Path, name: &str, change: impl FnOnce(&mut [u8])) {
    let path = dir.join(name);
    let mut bytes = fs::read(&path).unwrap();
    change(&mut bytes[32..]);
    let crc = crc32c::crc32c(&bytes[32..]);
    bytes[28..32].copy_from_slice(&crc.to_le_bytes());
    fs::write(&path, &bytes).unwrap();
    edit_manifest(dir, |m| {
        let file = m.files.iter_mut().find(|f| f.path == name).unwrap();
        file.sha256 = Sha256Hex::of(&bytes);
    });
}

fn edit_manifest(dir: &Path, change: impl FnOnce(&mut manifest::Manifest)) {
    let path = dir.join("manifest.json");
    let mut manifest = manifest::Manifest::from_bytes(&fs::read(&path).unwrap()).unwrap();
    change(&mut manifest);
    fs::write(&path, manifest.to_bytes().unwrap()).unwrap();
}

/// A package without the second tile of the wall and without the only one of the lamp, written to `dir`.
fn torn(dir: &Path, raw: Option<RawFormat>) {
    fixture::bake_around(dir, fixture::settings(Rule::default(), raw), [&[1], &[0]]);
}

#[test]
fn a_package_with_holes_is_verified_and_lists_them() {
    for raw in [None, Some(RawFormat::U8), Some(RawFormat::F32)] {
        let dir = tempfile::tempdir().unwrap();
        torn(dir.path(), raw);
        let (result, text) = inspect(dir.path(), true, false);
        assert!(result.is_ok(), "{}\n{text}", result.unwrap_err());
        // The wall covers 35 x 33 texels: its second tile has the last three columns of the first 32 rows.
        let line = "hole     wall tile 1, columns 32 to 64 and rows 0 to 32 (96 covered texels): failed 3 times on 2 workers";
        assert!(text.contains(line) && text.contains("lamp has no tile at all: it is black."), "{text}");
        let (_, json) = inspect(dir.path(), true, true);
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["manifest"]["surfaces"][0]["holes"][0]["reason"], "failed 3 times on 2 workers");
        fixture::bake(dir.path(), fixture::settings(Rule::default(), raw));
        assert!(!inspect(dir.path(), true, false).1.contains("hole "));
    }
}

#[test]
fn what_a_package_says_of_its_holes_is_checked() {
    let refusal = |change: &dyn Fn(&Path)| {
        let dir = tempfile::tempdir().unwrap();
        torn(dir.path(), None);
        change(dir.path());
        inspect(dir.path(), true, false).0.unwrap_err().to_string()
    };
    let moved = refusal(&|dir| edit_manifest(dir, |m| m.surfaces[0].holes[0].x = 64));
    assert!(moved.contains("manifest.surfaces[0].holes[0].x is 64; measured: 32"), "{moved}");
    let none = refusal(&|dir| edit_manifest(dir, |m| m.surfaces[0].holes[0].tile = 99));
    assert!(none.contains("manifest.json") && none.contains("none of its tiles"), "{none}");
    // Texel (32, 0) is the first of the wall's hole; its first sample takes another colour of the map.
    let strays = refusal(&|dir| {
        let starts = fs::read(dir.join("surfaces/wall.mtsp")).unwrap();
        let first = u32::from_le_bytes(*starts[32 + 4 * 32..].first_chunk().unwrap()) as usize;
        reseal(dir, "surfaces/wall.mtnc", |colours| colours[2 * first] ^= 1);
    });
    assert!(strays.contains("1 texels of holes, (32, 0)"), "{strays}");
}

#[test]
fn files_and_the_list_of_files_are_held_against_each_other() {
    let fresh = |raw| {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(Rule::default(), raw));
        dir
    };
    let refusal = |dir: &Path| inspect(dir, true, false).0.unwrap_err().to_string();
    let dir = fresh(None);
    fs::write(dir.path().join("report.json"), "{}").unwrap();
    assert!(inspect(dir.path(), true, false).0.is_ok());
    fs::write(dir.path().join("surfaces/extra.bin"), "x").unwrap();
    assert!(refusal(dir.path()).contains("surfaces/extra.bin: in the folder"));
    edit_manifest(dir.path(), |m| {
        let extra = kiln_proto::format::FileRecord {
            path: "surfaces/extra.bin".into(),
            sha256: Sha256Hex::of(b"x"),
            bytes: 1,
            ..m.files[0].clone()
        };
        m.files.insert(1, extra);
    });
    assert!(refusal(dir.path()).contains("surfaces/extra.bin: no file"));
    for (name, raw) in [("surfaces/wall.mtex", Some(RawFormat::U8)), ("surfaces/lamp.mti", None), ("scene.kiln", None)] {
        let dir = fresh(raw);
        edit_manifest(dir.path(), |m| m.files.retain(|f| f.path != name));
        assert!(refusal(dir.path()).contains(&format!("does not list {name}")));
    }
}

#[test]
fn claims_are_checked_without_raw_too() {
    let lossless = [Rule::Thesis { threshold: 0 }, Rule::Cumulative { threshold: 0 }, Rule::Bounded { eps: 0 }];
    for (rule, max) in lossless.map(|rule| (rule, 1)).into_iter().chain([(Rule::Bounded { eps: 2 }, 3)]) {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(rule, None));
        assert!(inspect(dir.path(), true, false).0.is_ok());
        edit_manifest(dir.path(), |m| m.surfaces[0].encoding.errors.max = max);
        let error = inspect(dir.path(), true, false).0.unwrap_err().to_string();
        assert!(error.contains("`wall`: a claimed error"), "{error}");
    }
}

#[test]
fn a_colour_map_out_of_order_and_a_gutter_of_its_own_are_named() {
    let dir = tempfile::tempdir().unwrap();
    fixture::bake(dir.path(), fixture::settings(Rule::default(), None));
    reseal(dir.path(), "surfaces/lamp.mtm", |map| map.copy_within(..3, 3));
    let error = inspect(dir.path(), true, false).0.unwrap_err().to_string();
    assert!(error.contains("`lamp`") && error.contains(".mtm is not ascending"), "{error}");
    fixture::bake(dir.path(), fixture::settings(Rule::default(), None));
    // Column 35 of row 0 is the first gutter texel of the wall; its first sample takes another colour of the map.
    let starts = fs::read(dir.path().join("surfaces/wall.mtsp")).unwrap();
    let first = u32::from_le_bytes(*starts[32 + 4 * 35..].first_chunk().unwrap()) as usize;
    reseal(dir.path(), "surfaces/wall.mtnc", |colours| colours[2 * first] ^= 1);
    let error = inspect(dir.path(), true, false).0.unwrap_err().to_string();
    assert!(error.contains("1 gutter texels, (35, 0)"), "{error}");
}

#[test]
fn what_is_no_package_is_an_error_that_names_the_file() {
    let dir = tempfile::tempdir().unwrap();
    assert!(inspect(dir.path(), false, false).0.unwrap_err().to_string().contains("manifest.json"));
    fixture::bake(dir.path(), fixture::settings(Rule::default(), None));
    fs::remove_file(dir.path().join("surfaces/wall.mti")).unwrap();
    assert!(inspect(dir.path(), true, false).0.unwrap_err().to_string().contains("wall.mti"));
    fs::write(dir.path().join("scene.kiln"), "no").unwrap();
    assert!(inspect(dir.path(), false, false).0.unwrap_err().to_string().contains("scene.kiln"));
}
