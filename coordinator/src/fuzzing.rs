//! What fuzzing runs: one function per parser of bytes from outside, each of which must return, whatever the bytes are.
//!
//! The targets live here because parsers are private and bounds on them are part of the design: a test replays their corpus with the
//! same bodies and the same count of memory as `cargo fuzz` (folder `fuzz`). A cargo feature would hide them better and build everything
//! twice.

use crate::import::{Bundle, Content, Part, X3dEncoding, import_bundle, rewrite_x3d};
use exr::meta::MetaData;
use image::{ImageDecoder as _, ImageFormat, ImageReader, codecs::hdr::HdrDecoder};
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
    /// Bytes that it may hold for the images that its input declares.
    pub images: fn(&[u8]) -> u64,
}

const fn target(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run, images: |_| 0 }
}

/// A target whose input may have images in it.
const fn pictured(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run, images: declared_images }
}

/// All of them.
pub const TARGETS: [Target; 22] = [
    target("obj", |bytes| import("s.obj", bytes)),
    target("mtl", mtl),
    pictured("gltf", |bytes| import("s.gltf", bytes)),
    pictured("glb", |bytes| import("s.glb", bytes)),
    target("x3d_xml", |bytes| import("s.x3d", bytes)),
    target("x3d_classic", |bytes| import("s.x3dv", bytes)),
    target("x3d_json", |bytes| import("s.x3dj", bytes)),
    target("x3d_gzip", |bytes| import("s.x3dz", bytes)),
    target("x3d_rewrite", rewrite),
    pictured("bundle", files),
    target("zip", zip),
    Target { name: "image", run: crate::import::fuzz_image, images: |bytes| declared_images(bytes).max(declared_tga(bytes)) },
    Target { name: "hdr", run: |bytes| environment("e.hdr", bytes), images: declared_hdr },
    Target { name: "exr", run: |bytes| environment("e.exr", bytes), images: declared_exr },
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

/// Bytes that decoding the images in a file may take by what they say of their size: eight a pixel while they are decoded (four channels of
/// 16 bits), eight more for what is made of them. Images are found by the magic numbers of PNG, JPEG and BMP, as they are or in base64.
fn declared_images(bytes: &[u8]) -> u64 {
    let starts = (0..bytes.len()).filter(|at| begins_image(&bytes[*at..]));
    let sizes = starts.filter_map(|at| ImageReader::new(Cursor::new(&bytes[at..])).with_guessed_format().ok()?.into_dimensions().ok());
    let sum = sizes.map(pixels).fold(0, u64::saturating_add);
    let marks = bytes.windows(7).enumerate().filter(|(_, w)| *w == b"base64,").map(|(at, _)| &bytes[at + 7..]);
    marks.take(64).fold(sum, |sum, rest| sum.saturating_add(in_base64(rest)))
}

/// Two letters are too little of a BMP: chance writes them, and what follows would declare gigabytes. So its reserved zeros and the first three
/// bytes of the length of its second header are looked at as well.
fn begins_image(bytes: &[u8]) -> bool {
    let is_bmp = || bytes.starts_with(b"BM") && bytes.get(6..10) == Some(&[0; 4]) && bytes.get(15..18) == Some(&[0; 3]);
    bytes.starts_with(b"\x89PNG") || bytes.starts_with(b"\xff\xd8\xff") || is_bmp()
}

/// What the bytes declare if they are a TGA, which no magic number tells.
fn declared_tga(bytes: &[u8]) -> u64 {
    ImageReader::with_format(Cursor::new(bytes), ImageFormat::Tga).into_dimensions().map_or(0, pixels)
}

/// Two pictures of three floats each: what is decoded, and what is made of it.
fn declared_hdr(bytes: &[u8]) -> u64 {
    let size = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map(|decoder| decoder.dimensions());
    size.map_or(0, |size| pixels(size).saturating_mul(2))
}

/// The same for every layer of the file and for its display window, and its own samples.
fn declared_exr(bytes: &[u8]) -> u64 {
    let Ok(meta) = MetaData::read_from_buffered(Cursor::new(bytes), false) else { return 0 };
    let picture = |size: exr::prelude::Vec2<usize>| pixels((size.width() as u32, size.height() as u32));
    let layer = |header: &exr::meta::header::Header| {
        let data = picture(header.layer_size).saturating_mul(2 + header.channels.list.len() as u64);
        data.saturating_add(picture(header.shared_attributes.display_window.size).saturating_mul(2))
    };
    meta.headers.iter().map(layer).fold(0, u64::saturating_add)
}

fn pixels((width, height): (u32, u32)) -> u64 {
    (u64::from(width) * u64::from(height)).saturating_mul(16)
}

fn in_base64(text: &[u8]) -> u64 {
    use base64::{Engine as _, engine::general_purpose::STANDARD_NO_PAD};
    let is_digit = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'/');
    let length = text.iter().position(|b| !is_digit(b)).unwrap_or(text.len());
    let whole = length / 4 * 4;
    STANDARD_NO_PAD.decode(&text[..whole]).map_or(0, |bytes| declared_images(&bytes))
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

/// Several files, the first of which is the scene: what one says of another is reached in no other way.
fn files(bytes: &[u8]) {
    let (mut parts, mut rest) = (vec![], bytes);
    while let Some(named) = rest.strip_prefix(FILE) {
        let Some(line) = named.iter().position(|b| *b == b'\n') else { break };
        let content = &named[line + 1..];
        let length = content.windows(FILE.len()).position(|w| w == FILE).unwrap_or(content.len());
        let Ok(name) = std::str::from_utf8(&named[..line]) else { break };
        parts.push((name, &content[..length]));
        rest = &content[length..];
    }
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
