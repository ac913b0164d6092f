use super::*;

/// A binary glTF of these chunks.
fn binary(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let mut out = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, data) in chunks {
        let size = data.len().next_multiple_of(4);
        out.extend((size as u32).to_le_bytes());
        out.extend(*kind);
        out.extend(*data);
        out.resize(out.len() + size - data.len(), if *kind == b"JSON" { b' ' } else { 0 });
    }
    let length = out.len() as u32;
    out[8..12].copy_from_slice(&length.to_le_bytes());
    out
}

/// The triangle with its buffer in the binary chunk.
fn triangle() -> (String, Vec<u8>) {
    let mut sample = Sample::triangle();
    sample.json["buffers"] = json!([{ "byteLength": sample.bytes.len() }]);
    (sample.text(), sample.bytes)
}

fn error(bytes: &[u8]) -> String {
    let errors = outcome(&[("a.glb", bytes)], None).errors;
    assert_eq!(errors.len(), 1, "{errors:#?}");
    errors[0].clone()
}

#[test]
fn a_binary_file_is_read_whatever_follows_its_chunks() {
    let (json, bytes) = triangle();
    let file = binary(&[(b"JSON", json.as_bytes()), (b"BIN\0", &bytes), (b"ABCD", b"else")]);
    let found = outcome(&[("a.glb", &file)], None);
    assert_eq!((found.warnings.len(), found.scene().triangle_count()), (0, 1));
    let mut longer = file;
    longer.extend(b"tail");
    let found = outcome(&[("a.glb", &longer)], None);
    assert!(found.warns("4 bytes behind the end"), "{:?}", found.warnings);
    let zeros = format!("{json}{}", "\0".repeat(8 - json.len() % 4));
    let found = outcome(&[("a.glb", &binary(&[(b"JSON", zeros.as_bytes()), (b"BIN\0", &bytes)]))], None);
    assert!(found.warns("the JSON is filled up with zeros") && found.scene().triangle_count() == 1);
    let mut sample = Sample::triangle();
    sample.json["nodes"][0]["mesh"] = json!(7);
    let file = binary(&[(b"JSON", sample.text().as_bytes())]);
    assert_eq!(error(&file), "a.glb: /nodes/0/mesh: there is no mesh 7; the file has 1", "no lines inside a chunk");
}

#[test]
fn broken_containers_are_refused_by_what_is_wrong() {
    let (json, bytes) = triangle();
    let good = binary(&[(b"JSON", json.as_bytes()), (b"BIN\0", &bytes)]);
    let with = |at: usize, value: u32| {
        let mut file = good.clone();
        file[at..at + 4].copy_from_slice(&value.to_le_bytes());
        error(&file)
    };
    assert!(with(4, 1).contains("of version 1"));
    assert!(with(8, 0).contains("says that the file has 0 bytes"));
    assert!(with(8, u32::MAX).contains("says that the file has 4294967295 bytes"));
    assert!(with(12, u32::MAX).contains("chunk 0 at byte 12 says that it has 4294967295 bytes"));
    assert!(with(12, 2).contains("multiple of 4"));
    assert!(with(16, 1).contains("the first chunk is not JSON"));
    assert!(error(&good[..good.len() - 1]).contains("says that the file has"));
    assert!(error(&good[..7]).contains("12 bytes of its header"));
    assert!(error(b"\0\0").contains("12 bytes of its header"));
    assert!(error(&binary(&[(b"JSON", json.as_bytes()), (b"JSON", b"{}  ")])).contains("second JSON chunk"));
    assert!(error(&binary(&[(b"JSON", b"")])).contains("the JSON cannot be read"));
    assert!(error(&binary(&[(b"JSON", json.as_bytes())])).contains("/buffers/0: the buffer has no `uri`"));
}

#[test]
fn texts_must_be_json_in_utf_8_without_a_mark() {
    let error = |bytes: &[u8]| outcome(&[("a.gltf", bytes)], None).errors.join("\n");
    assert!(error(b"\xef\xbb\xbf{}").contains("byte order mark"));
    assert!(error(b"{\"a\": \"\xff\"}").contains("not UTF-8: byte 7"));
    assert!(error(b"{\n\"a\": }").starts_with("a.gltf:2: the JSON cannot be read"));
    assert!(error(b"[]").contains("a JSON object"));
    assert!(error(b"{}").contains("`asset` is missing"));
    assert!(error(b"{\"asset\": {}}").contains("/asset: the property `version` is missing"));
    assert!(error(b"{\"asset\": {\"version\": \"1.0\"}}").contains("version `1.0`"));
    assert!(error(b"{\"asset\": {\"version\": \"2.0\", \"minVersion\": \"2.1\"}}").contains("needs a reader of glTF 2.1"));
    assert!(error(b"{\"asset\": {\"version\": \"2.1\", \"minVersion\": \"2.0\"}}").contains("nothing to bake"));
    assert!(error(b"{\"asset\": {\"version\": 2}}").contains("/asset/version: this is a number, not a string"));
}

#[test]
fn buffers_are_found_inside_the_bundle_and_nowhere_else() {
    let mut sample = Sample::triangle();
    let import = |sample: &Sample, name: &str| {
        outcome(&[("scenes/a.gltf", sample.text().as_bytes()), (name, &sample.bytes), ("scenes/b.txt", b"x")], None)
    };
    let length = sample.bytes.len();
    for (uri, name) in [("my%20data.bin", "scenes/my data.bin"), ("../d.bin", "d.bin"), ("100%.bin", "scenes/100%.bin")] {
        sample.json["buffers"] = json!([{ "byteLength": length, "uri": uri }]);
        let found = import(&sample, name);
        assert_eq!((found.warnings.len(), found.errors.len()), (0, 0), "{uri}: {:?} {:?}", found.warnings, found.errors);
    }
    sample.json["buffers"][0]["uri"] = json!("D.BIN");
    assert!(import(&sample, "scenes/d.bin").warns("`scenes/d.bin` is used instead"));
    for (uri, wanted) in
        [("gone.bin", "not in the bundle"), ("https://x.org/d.bin", "`https:`"), ("../../../etc/passwd", "not in the bundle")]
    {
        sample.json["buffers"][0]["uri"] = json!(uri);
        let errors = import(&sample, "scenes/d.bin").errors;
        assert!(errors.len() == 1 && errors[0].contains("/buffers/0/uri") && errors[0].contains(wanted), "{errors:?}");
    }
    sample.json["buffers"][0] = json!({ "byteLength": length + 1, "uri": "d.bin" });
    assert!(import(&sample, "scenes/d.bin").errors[0].contains(&format!("should have {} bytes; there are {length}", length + 1)));
}

#[test]
fn references_are_listed_for_who_gathers_them() {
    let mut sample = Sample::triangle();
    sample.json["buffers"] = json!([{ "byteLength": 36, "uri": "a%20b.bin" }, { "byteLength": 1, "uri": "data:;base64,AA==" }]);
    sample.json["images"] = json!([{ "uri": "tex/i.png" }, { "uri": "http://x.org/i.png" }]);
    let found = crate::import::gltf::references("a.gltf", sample.text().as_bytes());
    assert_eq!(found.iter().map(|(_, path)| path.as_str()).collect::<Vec<_>>(), ["a b.bin", "tex/i.png"]);
    assert!(found[0].0 > 1);
    assert_eq!(crate::import::gltf::references("a.gltf", b"{"), []);
}
