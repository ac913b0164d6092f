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
    assert!(refused(parts(&[("a.obj", OBJ), ("./a.obj", OBJ)])).contains("two files"));
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("../b", b"")]))).contains("leads out of the bundle"));
    assert!(refused(unzip(&zip_of(&[("C:/a.obj", OBJ)]))).contains("absolute"));
    assert!(refused(unzip(&zip_of(&[("a.obj", OBJ), ("x//y", b"1"), ("x/y", b"2")]))).contains("two entries"));
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
    let (bundle, missing) = collect(&folder.path().join("scene/a.obj"), folder.path()).unwrap();
    assert_eq!(bundle.files().map(|(p, _)| p.as_str()).collect::<Vec<_>>(), ["a.obj", "lib/two words.mtl", "my tex.png"]);
    let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
    assert_eq!(missing.len(), 3, "{missing:?}");
    assert!(missing[0].starts_with("a.obj:1: `/etc/passwd`") && missing[1].starts_with("lib/two words.mtl:3: `../../secret.png`"));
    assert!(collect(&folder.path().join("none.obj"), folder.path()).unwrap_err().message.contains("no such file"));
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
