//! The Rust decoder against the golden package, which the page's decoder is tested against too.

use crate::harness::succeed;
use std::path::Path;
use tempfile::TempDir;

#[test]
fn the_golden_room_decodes_to_its_table() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("decoded.csv");
    let room = golden.join("room");
    succeed(["decode", room.to_str().unwrap(), "--texels", "2", "--seed", "3", "--out", out.to_str().unwrap()]);
    let decoded = std::fs::read_to_string(out).unwrap();
    let expected = std::fs::read_to_string(golden.join("room-decoded.csv")).unwrap();
    assert!(decoded.lines().count() > 100);
    // The golden table leaves out positions, normals and directions.
    for (decoded, expected) in decoded.lines().zip(expected.lines()) {
        let fields: Vec<&str> = decoded.split(',').collect();
        assert_eq!([&fields[..5], &fields[14..]].concat().join(","), expected);
    }
    assert_eq!(decoded.lines().count(), expected.lines().count());
    succeed(["inspect", "--verify", room.to_str().unwrap()]);
}
