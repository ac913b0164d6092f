use super::*;
use crate::import::import_bundle;
use proptest::prelude::*;
use std::io::Write;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

const OBJ: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn part(name: &str, bytes: &[u8]) -> Part {
    Part { name: name.into(), content: Content::Bytes(bytes.to_vec()) }
}

fn parts(list: &[(&str, &[u8])]) -> Result<Bundle, Problem> {
    Bundle::from_parts(list.iter().map(|(n, b)| part(n, b)).collect(), None, &std::env::temp_dir())
}

fn zip_of(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(vec![]));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, bytes) in entries {
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn unzip(bytes: &[u8]) -> Result<Bundle, Problem> {
    Bundle::from_zip(Cursor::new(bytes), None, &std::env::temp_dir())
}

fn refused(result: Result<Bundle, Problem>) -> String {
    result.map(|b| b.main().to_string()).unwrap_err().to_string()
}

#[test]
fn an_archive_holds_what_its_files_hold() {
    let files: [(&str, &[u8]); 3] = [("models/a.obj", OBJ), ("models/t/x.mtl", b"newmtl m\n"), ("models/b.txt", b"")];
    let loose = parts(&files).unwrap();
    let packed = parts(&[("upload.bin", &zip_of(&files))]).unwrap();
    assert_eq!(packed.main().as_str(), "models/a.obj");
    let contents = |b: &Bundle| b.files().map(|(p, _)| (p.to_string(), b.read(p, 1 << 20).unwrap().into_owned())).collect::<Vec<_>>();
    assert_eq!(contents(&packed), contents(&loose));
}

#[test]
fn scratch_files_vanish_with_the_bundle() {
    let scratch = tempfile::tempdir().unwrap();
    let bundle = Bundle::from_zip(Cursor::new(zip_of(&[("a.obj", OBJ)])), None, scratch.path()).unwrap();
    assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 1);
    drop(bundle);
    assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 0);
}

#[test]
fn unsafe_uploads_are_refused() {
    assert!(refused(parts(&[("../a.obj", OBJ)])).contains("leads out of the bundle"));
    assert!(refused(parts(&[("/a.obj", OBJ)])).contains("absolute"));
    assert!(refused(parts(&[("a.obj", OBJ), ("./a.obj", OBJ)])).contains("another file"));
    assert!(refused(parts(&[("a.obj", OBJ), ("t.PNG", b"1"), ("T.png", b"2")])).contains("differs in case only"));
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("../b", b"")]))).contains("leads out of the bundle"));
    assert!(refused(unzip(&zip_of(&[("C:/a.obj", OBJ)]))).contains("absolute"));
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("x//y", b"1"), ("x/y", b"2")]))).contains("another file"));
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("x/y", b"1"), ("X/y", b"2")]))).contains("differs in case only"));
    let mut zip = ZipWriter::new(Cursor::new(vec![]));
    zip.add_symlink("a.mtl", "/etc/passwd", SimpleFileOptions::default()).unwrap();
    assert!(refused(unzip(&zip.finish().unwrap().into_inner())).contains("link"));
}

#[test]
fn litter_is_skipped_and_the_scene_must_be_one() {
    let bytes = zip_of(&[("room/a.obj", OBJ), ("__MACOSX/room/._a.obj", b""), ("room/.DS_Store", b"")]);
    assert_eq!(unzip(&bytes).unwrap().files().count(), 1);
    assert!(refused(parts(&[("a.obj", OBJ), ("b.obj", OBJ)])).contains("2 scenes"));
    assert!(refused(parts(&[("a.mtl", b"")])).contains("no scene"));
    assert!(refused(parts(&[])).contains("empty"));
    assert_eq!(parts(&[("a.gltf", b"{}"), ("a.bin", b"")]).unwrap().main().as_str(), "a.gltf");
    assert!(refused(parts(&[("a.fbx", b"{}"), ("a.bin", b"")])).contains("FBX"));
    assert_eq!(parts(&[("", OBJ)]).unwrap().main().as_str(), "scene.obj");
    let choice = Bundle::from_parts(vec![part("a.obj", OBJ), part("b.obj", OBJ)], Some("b.obj"), &std::env::temp_dir());
    assert_eq!(choice.unwrap().main().as_str(), "b.obj");
}

#[test]
fn too_many_entries_are_refused_before_they_are_listed() {
    let mut bytes = zip_of(&[("a.obj", OBJ)]);
    let end = bytes.len() - 22;
    bytes[end + 10..end + 12].copy_from_slice(&5_000u16.to_le_bytes());
    assert!(refused(unzip(&bytes)).contains("5000 or more entries"));
}

/// The places of the local header and the directory entry of the only file.
fn headers(bytes: &[u8]) -> [usize; 2] {
    [b"PK\x03\x04", b"PK\x01\x02"].map(|magic| bytes.windows(4).position(|w| w == magic).unwrap())
}

#[test]
fn what_is_no_plain_file_of_its_own_is_refused_with_words() {
    let mut locked = zip_of(&[("a.obj", OBJ)]);
    let [local, entry] = headers(&locked);
    (locked[local + 6], locked[entry + 8]) = (locked[local + 6] | 1, locked[entry + 8] | 1);
    assert!(refused(unzip(&locked)).contains("a.obj: the ZIP entry is encrypted"), "{}", refused(unzip(&locked)));
    let mut device = zip_of(&[("a.obj", OBJ)]);
    let [_, entry] = headers(&device);
    device[entry + 5] = 3; // Made on Unix.
    device[entry + 38..entry + 42].copy_from_slice(&(0o020_644u32 << 16).to_le_bytes());
    assert!(refused(unzip(&device)).contains("a.obj: the ZIP entry is a device"), "{}", refused(unzip(&device)));
    let inner = zip_of(&[("b.obj", OBJ)]);
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("b.bin", &inner)]))).contains("b.bin: this is a ZIP inside the bundle"));
    assert!(refused(parts(&[("a.obj", OBJ), ("b.zip", &inner)])).contains("b.zip: this is a ZIP inside the bundle"));
}

/// A size that is stated too small is not believed, nor does it hide a bomb from the budget: what comes out counts.
#[test]
fn stated_sizes_are_not_believed() {
    let mut lying = zip_of(&[("a.obj", &b"v 0 0 0\n".repeat(10_000))]);
    let [local, entry] = headers(&lying);
    lying[local + 22..local + 26].copy_from_slice(&8u32.to_le_bytes());
    lying[entry + 24..entry + 28].copy_from_slice(&8u32.to_le_bytes());
    if let Ok(bundle) = unzip(&lying) {
        assert_eq!(bundle.read(bundle.main(), 1 << 20).unwrap().len(), 80_000);
    }
}

#[test]
fn archives_with_64_bit_records_are_counted_by_them() {
    let wide = |count: u64| {
        let mut bytes = zip_of(&[("a.obj", OBJ)]);
        let end = bytes.split_off(bytes.len() - 22);
        let at = bytes.len() as u64;
        let directory = u32::from_le_bytes(end[16..20].try_into().unwrap());
        let size = u32::from_le_bytes(end[12..16].try_into().unwrap());
        bytes.extend(b"PK\x06\x06");
        bytes.extend(44u64.to_le_bytes());
        bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        [count, count, u64::from(size), u64::from(directory)].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend(at.to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
        let mut end = end;
        end[8..12].copy_from_slice(&[0xff; 4]);
        bytes.extend(end);
        unzip(&bytes)
    };
    assert_eq!(wide(1).unwrap().main().as_str(), "a.obj");
    assert!(refused(wide(70_000)).contains("70000 or more entries"));
}

#[test]
fn inflation_stops_at_the_budget() {
    let folder = tempfile::tempdir().unwrap();
    let mut bomb = std::io::repeat(0);
    let result = archive::inflate(&mut bomb, &folder.path().join("0"), 1_000);
    assert!(matches!(result, Err(archive::InflateError::Budget)));
    assert_eq!(archive::inflate(&mut &[1u8; 1_000][..], &folder.path().join("1"), 1_000).ok(), Some(1_000));
}

#[test]
fn collecting_takes_what_the_scene_refers_to_and_nothing_outside() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    write("secret.png", b"private");
    write("scene/unrelated.png", b"");
    write("scene/my tex.png", b"");
    write("scene/lib/two words.mtl", b"newmtl m\nmap_Kd ../my tex.png\nmap_Ke ../../secret.png\nmap_Kd C:\\x\\gone.png\n");
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.path().join("secret.png"), folder.path().join("scene/gone.png")).unwrap();
    write("scene/a.obj", &[b"mtllib lib/two words.mtl /etc/passwd\n", OBJ].concat());
    let (bundle, missing) = collect(&folder.path().join("scene/a.obj"), None, folder.path()).unwrap();
    assert_eq!(bundle.files().map(|(p, _)| p.as_str()).collect::<Vec<_>>(), ["a.obj", "lib/two words.mtl", "my tex.png"]);
    let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
    assert_eq!(missing.len(), 3, "{missing:?}");
    assert!(missing[0].starts_with("a.obj:1: `/etc/passwd`") && missing[1].starts_with("lib/two words.mtl:3: `../../secret.png`"));
    assert!(collect(&folder.path().join("none.obj"), None, folder.path()).unwrap_err().message.contains("no such file"));
}

/// A scene of X3D in a folder that inlines X3D, which inlines glTF, which has a buffer and an image.
#[test]
fn collecting_follows_inlined_scenes_and_the_first_address_that_exists() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    write(
        "a.x3dv",
        b"#X3D V3.3 utf8\nInline { url [ \"gone.x3dv\" \"sub/b.wrl\" ] } Inline { url \"../out.wrl\" }\nInline { url \"a.x3dv\" }",
    );
    write("sub/b.wrl", b"#VRML V2.0 utf8\nInline { url \"../c.gltf\" } Shape { appearance Appearance { texture ImageTexture { url \"http://x.org/my%20leaf.png\" } } }");
    write("sub/my leaf.png", b"");
    write(
        "c.gltf",
        br#"{ "asset": { "version": "2.0" }, "buffers": [ { "uri": "c.bin", "byteLength": 4 } ], "images": [ { "uri": "sub/c.png" } ] }"#,
    );
    write("c.bin", b"1234");
    write("sub/c.png", b"");
    let (bundle, missing) = collect(&folder.path().join("a.x3dv"), None, folder.path()).unwrap();
    let found: Vec<&str> = bundle.files().map(|(p, _)| p.as_str()).collect();
    assert_eq!(found, ["a.x3dv", "c.bin", "c.gltf", "sub/b.wrl", "sub/c.png", "sub/my leaf.png"]);
    let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
    assert!(missing.len() == 1 && missing[0].starts_with("a.x3dv:2: `../out.wrl`"), "{missing:?}");
}

/// The very path in either spelling comes before one that is near to the first.
#[test]
fn an_exact_path_comes_before_one_that_is_near() {
    let bundle = parts(&[("a.obj", OBJ), ("my%20wall.png", b""), ("t/My Wall.png", b""), ("t/leaf%.png", b"")]).unwrap();
    let found = |address| bundle.find_address(bundle.main(), address);
    let path = |name: &str| bundle.files().find(|(path, _)| path.as_str() == name).unwrap().0;
    assert_eq!(found("my%20wall.png"), Some(Found::Exact(path("my%20wall.png"))));
    assert_eq!(found("t/My%20Wall.png"), Some(Found::Exact(path("t/My Wall.png"))));
    assert_eq!(found("T/my%20wall.PNG"), Some(Found::Near(path("t/My Wall.png"))));
    assert_eq!((found("t/leaf%.png"), found("gone.png")), (Some(Found::Exact(path("t/leaf%.png"))), None));
    let mut said = vec![];
    for address in ["t/My%20Wall.png", "LEAF%.png"] {
        found(address).unwrap().told("the image", address, |message| said.push(message));
    }
    assert_eq!(said, ["the image `LEAF%.png` is not in the bundle; `t/leaf%.png` is used instead"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// No archive makes the import panic.
    #[test]
    fn mutated_archives_never_panic(edits in prop::collection::vec((any::<u16>(), any::<u8>()), 1..6), cut in prop::option::of(any::<u16>())) {
        let mut bytes = zip_of(&[("a.obj", OBJ), ("m/b.mtl", b"newmtl m\nKd 1 1 1\n")]);
        for (at, value) in edits {
            let at = usize::from(at) % bytes.len();
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(usize::from(cut) % bytes.len());
        }
        if let Ok(bundle) = unzip(&bytes) {
            let _ = import_bundle(&bundle, &kiln_proto::options::ImportOptions::default());
        }
    }
}

#[test]
fn a_file_from_elsewhere_lies_beside_the_scene_under_a_name_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let local = folder.path().join("sky.hdr");
    std::fs::write(&local, b"mine").unwrap();
    let mut bundle = parts(&[("room/a.obj", OBJ), ("room/sky.hdr", b"another")]).unwrap();
    for _ in 0..2 {
        let name = bundle.add(&local).unwrap();
        assert_eq!(name, "1-sky.hdr");
        let Some(Found::Exact(path)) = bundle.find(bundle.main(), &name) else { panic!() };
        assert_eq!((path.as_str(), &*bundle.read(path, 9).unwrap()), ("room/1-sky.hdr", b"mine".as_slice()));
    }
    assert_eq!(bundle.files().count(), 3, "the same file again is the same file");
    assert!(bundle.add(&folder.path().join("none.hdr")).unwrap_err().to_string().contains("no such file"));
    assert!(bundle.add(folder.path()).unwrap_err().to_string().contains("not a file"));
}

#[test]
fn a_larger_folder_may_be_named_and_nothing_beyond_it_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("all/rooms/a.obj", "mtllib ../common/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    write("all/common/m.mtl", "newmtl m\nmap_Kd ../../secret.png\n");
    write("secret.png", "no");
    let main = folder.path().join("all/rooms/a.obj");
    let (bundle, missing) = collect(&main, None, folder.path()).unwrap();
    assert_eq!((bundle.main().as_str(), bundle.files().count(), missing.len()), ("a.obj", 1, 1));
    let (bundle, missing) = collect(&main, Some(&folder.path().join("all")), folder.path()).unwrap();
    let names: Vec<&str> = bundle.files().map(|(path, _)| path.as_str()).collect();
    assert_eq!((bundle.main().as_str(), names), ("rooms/a.obj", vec!["common/m.mtl", "rooms/a.obj"]));
    assert!(missing[0].message.contains("secret.png"));
    let elsewhere = collect(&main, Some(&folder.path().join("all/common")), folder.path()).unwrap_err();
    assert!(elsewhere.message.contains("does not lie in the folder"), "{elsewhere}");
}
