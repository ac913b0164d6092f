//! What fuzzing runs: one function per parser of bytes from outside, each of which must return, whatever the bytes are.
//!
//! The targets live here because parsers are private and bounds on them are part of the design: a test replays their corpus with the
//! same bodies and the same count of memory as `cargo fuzz` (folder `fuzz`). A cargo feature would hide them better and build everything
//! twice.

mod declared;

use crate::import::{Bundle, Content, Part, X3dEncoding, import_bundle, rewrite_x3d};
use kiln_proto::{
    format::{Header, Kind, container, header, manifest::Manifest, surface::SurfaceFiles},
    options::ImportOptions,
    plan::Plan,
    scene::Scene,
    segment::{Segment, without_raw},
    wire::{
        frame::{self, from_frame},
        message::{ChunkTrailer, ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Refusal, Welcome},
    },
};
use std::{io::Cursor, path::Path};

/// One parser.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Its name, and that of its corpus.
    pub name: &'static str,
    /// Reads bytes.
    pub run: fn(&[u8]),
    /// Bytes that it may hold for what its input declares: images, and the text that a gzip stream unpacks to.
    pub images: fn(&[u8]) -> u64,
}

const fn target(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run, images: |_| 0 }
}

/// A target that imports a scene: content goes before names, so each may hold what any format may.
const fn scene(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run, images: |bytes| declared::files(&[("", bytes)]) }
}

/// All of them.
pub const TARGETS: [Target; 22] = [
    scene("obj", |bytes| import("s.obj", bytes)),
    scene("mtl", mtl),
    scene("gltf", |bytes| import("s.gltf", bytes)),
    scene("glb", |bytes| import("s.glb", bytes)),
    scene("x3d_xml", |bytes| import("s.x3d", bytes)),
    scene("x3d_classic", |bytes| import("s.x3dv", bytes)),
    scene("x3d_json", |bytes| import("s.x3dj", bytes)),
    scene("x3d_gzip", |bytes| import("s.x3dz", bytes)),
    scene("x3d_rewrite", rewrite),
    Target { name: "bundle", run: files, images: |bytes| declared::files(&parts(bytes)) },
    target("zip", zip),
    Target { name: "image", run: crate::import::fuzz_image, images: declared::picture },
    Target { name: "hdr", run: |bytes| environment("e.hdr", bytes), images: declared::hdr },
    Target { name: "exr", run: |bytes| environment("e.exr", bytes), images: declared::exr },
    target("frame", frames),
    target("segment", segment),
    target("scene", |bytes| drop(Scene::from_bytes(bytes))),
    target("plan", |bytes| drop(Plan::from_bytes(bytes))),
    target("container", |bytes| with_sum(bytes, 24, &[(32, usize::MAX)], |bytes| drop(container::parse(bytes)))),
    target("header", headers),
    target("surface", surface),
    target("manifest", |bytes| drop(Manifest::from_bytes(bytes))),
];

/// The target of this name.
#[must_use]
pub fn find(name: &str) -> Option<Target> {
    TARGETS.into_iter().find(|t| t.name == name)
}

fn bundle(parts: Vec<(&str, &[u8])>, main: &str) -> Option<Bundle> {
    let parts = parts.into_iter().map(|(name, bytes)| Part { name: name.to_owned(), content: Content::Bytes(bytes.to_vec()) });
    // No archive is unpacked here, so nothing is written.
    Bundle::from_parts(parts.collect(), Some(main), Path::new("unused")).ok()
}

/// A scene by itself, at rest and at a time.
fn import(name: &str, bytes: &[u8]) {
    if let Some(bundle) = bundle(vec![(name, bytes)], name) {
        for time in [None, Some(1.5)] {
            drop(import_bundle(&bundle, &ImportOptions { time, ..ImportOptions::default() }));
        }
    }
}

/// Begins a file of the target `bundle`; its name and a line feed follow.
const FILE: &[u8] = b"\n#### ";

/// The files of an input, each with its name.
fn parts(bytes: &[u8]) -> Vec<(&str, &[u8])> {
    let (mut parts, mut rest) = (vec![], bytes);
    while let Some(named) = rest.strip_prefix(FILE) {
        let Some(line) = named.iter().position(|b| *b == b'\n') else { break };
        let content = &named[line + 1..];
        let length = content.windows(FILE.len()).position(|w| w == FILE).unwrap_or(content.len());
        let Ok(name) = std::str::from_utf8(&named[..line]) else { break };
        parts.push((name, &content[..length]));
        rest = &content[length..];
    }
    parts
}

/// Several files, the first of which is the scene: what one says of another is reached in no other way.
fn files(bytes: &[u8]) {
    let parts = parts(bytes);
    let main = parts.first().map_or("", |part| part.0);
    if let Some(bundle) = bundle(parts, main) {
        drop(import_bundle(&bundle, &ImportOptions::default()));
    }
}

fn mtl(bytes: &[u8]) {
    let scene = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\nusemtl n\nf 1/1 2/2 3/3\n";
    if let Some(bundle) = bundle(vec![("s.obj", scene), ("m.mtl", bytes)], "s.obj") {
        drop(import_bundle(&bundle, &ImportOptions::default()));
    }
}

/// A triangle under a sky.
fn environment(name: &str, bytes: &[u8]) {
    let options = ImportOptions { environment: Some(name.to_owned()), ..ImportOptions::default() };
    if let Some(bundle) = bundle(vec![("s.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), (name, bytes)], "s.obj") {
        drop(import_bundle(&bundle, &options));
    }
}

/// What was written of any X3D can be read again.
fn rewrite(bytes: &[u8]) {
    let Some(first) = bundle(vec![("s.x3d", bytes)], "s.x3d") else { return };
    for encoding in [X3dEncoding::Xml, X3dEncoding::Classic] {
        let Ok(written) = rewrite_x3d(&first, None, true, encoding) else { continue };
        let Some(second) = bundle(vec![("s.x3d", written.text.as_bytes())], "s.x3d") else { continue };
        let again = rewrite_x3d(&second, None, false, encoding);
        assert!(again.is_ok(), "{again:?} of {}", written.text);
    }
}

fn zip(bytes: &[u8]) {
    if let Ok(scratch) = tempfile::tempdir() {
        drop(Bundle::from_zip(Cursor::new(bytes), None, scratch.path()));
    }
}

/// Every message, with the length and the checksum that the bytes say and with the right ones, which chance does not hit.
fn frames(bytes: &[u8]) {
    let mut whole = bytes.to_vec();
    if let Some(length) = whole.len().checked_sub(frame::HEADER_BYTES) {
        whole[8..12].copy_from_slice(&(length as u32).to_le_bytes());
    }
    for bytes in [bytes, &whole] {
        with_sum(bytes, 16, &[(frame::HEADER_BYTES, usize::MAX)], |bytes| {
            drop((
                from_frame::<Hello>(bytes),
                from_frame::<Welcome>(bytes),
                from_frame::<LeaseRequest>(bytes),
                from_frame::<LeaseGrant>(bytes),
            ));
            drop((from_frame::<Heartbeat>(bytes), from_frame::<HeartbeatReply>(bytes), from_frame::<ChunkVerdict>(bytes)));
            drop((from_frame::<Finish>(bytes), from_frame::<Refusal>(bytes), from_frame::<ChunkTrailer>(bytes)));
        });
    }
}

fn segment(bytes: &[u8]) {
    with_sum(bytes, 36, &[(0, 36), (40, usize::MAX)], |bytes| {
        drop(Segment::from_bytes(bytes));
        drop(without_raw(bytes.to_vec()));
    });
}

/// Runs on the bytes as they are, and again with the CRC32C of some ranges where it belongs: four bytes at `at`.
fn with_sum(bytes: &[u8], at: usize, ranges: &[(usize, usize)], run: impl Fn(&[u8])) {
    run(bytes);
    let mut mended = bytes.to_vec();
    let sum = ranges.iter().fold(0, |sum, r| crc32c::crc32c_append(sum, mended.get(r.0..r.1.min(mended.len())).unwrap_or_default()));
    if let Some(place) = mended.get_mut(at..at + 4) {
        place.copy_from_slice(&sum.to_le_bytes());
        run(&mended);
    }
}

fn headers(bytes: &[u8]) {
    if let Some(first) = bytes.first_chunk::<{ header::BYTES }>() {
        for kind in [Kind::Mtex, Kind::Mtsp, Kind::Mti, Kind::Mtnc, Kind::Mtm] {
            drop(Header::parse(first, kind, bytes.len() as u64));
        }
    }
}

/// The four files of a surface, each behind its length in two bytes.
fn surface(bytes: &[u8]) {
    let mut rest = bytes;
    let files: [&[u8]; 4] = std::array::from_fn(|_| {
        let Some((length, behind)) = rest.split_first_chunk::<2>() else { return &[][..] };
        let (file, behind) = behind.split_at(usize::from(u16::from_le_bytes(*length)).min(behind.len()));
        rest = behind;
        file
    });
    if let Ok(surface) = SurfaceFiles::parse(files[0], files[1], files[2], files[3]) {
        let texels = surface.header().size.texels().min(4_096);
        (0..texels as usize).for_each(|texel| drop(surface.kept(texel)));
    }
}
