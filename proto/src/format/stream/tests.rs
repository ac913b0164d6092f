use super::*;
use crate::{
    codec::pwl::Kept,
    format::surface::SurfaceFiles,
    settings::RawFormat,
    units::{Exposure, byte_to_radiance},
};

fn memory(bytes: Vec<u8>) -> InMemory {
    InMemory { name: "memory".into(), bytes }
}

const DEPTH: u32 = 4;

fn shape() -> Shape {
    Shape { size: TextureSize::new(3, 1).unwrap(), directions: DEPTH }
}

fn file(kind: Kind, bits: u16, count: u64, payload: &[u8]) -> Vec<u8> {
    let header = Header { kind, bits, size: shape().size, depth: DEPTH, count, crc: crc32c::crc32c(payload) };
    [&header.to_bytes()[..], payload].concat()
}

/// Three texels: two kept samples, none, three.
fn files() -> [Vec<u8>; 4] {
    let starts: Vec<u8> = [0u32, 2, 2, 5].iter().flat_map(|s| s.to_le_bytes()).collect();
    [
        file(Kind::Mtsp, 32, 4, &starts),
        file(Kind::Mti, 16, 5, &[0, 0, 3, 0, 0, 0, 1, 0, 3, 0]),
        file(Kind::Mtnc, 16, 5, &[0, 0, 1, 0, 1, 0, 0, 0, 1, 0]),
        file(Kind::Mtm, 8, 2, &[1, 2, 3, 7, 8, 9]),
    ]
}

fn open(files: &[Vec<u8>; 4], trust: Trust) -> Result<CodedFiles<InMemory>, ReadError> {
    let found = |kind| match kind {
        Kind::Mtsp => 0,
        Kind::Mti => 1,
        Kind::Mtnc => 2,
        _ => 3,
    };
    CodedFiles::open("s", shape(), trust, |kind| Ok(memory(files[found(kind)].clone())))
}

#[test]
fn every_run_gives_what_the_small_reader_gives() {
    let files = files();
    let (coded, whole) = (open(&files, Trust::Checksum).unwrap(), SurfaceFiles::parse(&files[0], &files[1], &files[2], &files[3]).unwrap());
    for (first, count) in [(0, 1), (0, 3), (1, 1), (1, 2), (2, 1)] {
        let read = coded.read(Run { first, count }).unwrap();
        let expected: Vec<Vec<Kept>> = (first..first + count).map(|t| whole.kept(t as usize)).collect();
        assert!(read.iter().eq(expected.iter().map(Vec::as_slice)), "{first} {count}");
    }
    assert_eq!((coded.samples(), coded.colour_map(), coded.map_ascends()), (5, (2, 16), true));
}

#[test]
fn direct_colours_need_no_map() {
    let mut direct = files();
    let colours: Vec<u8> = [[1, 2, 3], [7, 8, 9], [7, 8, 9], [1, 2, 3], [7, 8, 9]].concat();
    direct[2] = file(Kind::Mtnc, 24, 5, &colours);
    direct[3] = file(Kind::Mtm, 8, 0, &[]);
    let all = Run { first: 0, count: 3 };
    assert_eq!(open(&direct, Trust::Checksum).unwrap().read(all).unwrap(), open(&files(), Trust::Checksum).unwrap().read(all).unwrap());
}

#[test]
fn damage_is_found_when_a_file_is_opened_or_when_it_is_read() {
    let mut flipped = files();
    flipped[1][34] ^= 8;
    assert!(matches!(open(&flipped, Trust::Checksum), Err(ReadError::Header { source: HeaderError::Checksum { .. }, .. })));
    assert!(open(&flipped, Trust::Hashed).is_ok());
    let mut short = files();
    short[0].truncate(31);
    assert!(matches!(open(&short, Trust::Hashed), Err(ReadError::Header { source: HeaderError::TooShort { found: 31 }, .. })));
    let wrong = |starts: [u32; 4], run| {
        let mut files = files();
        files[0] = file(Kind::Mtsp, 32, 4, &starts.map(u32::to_le_bytes).concat());
        open(&files, Trust::Hashed).unwrap().read(run).unwrap_err().to_string()
    };
    assert!(wrong([0, 2, 1, 5], Run { first: 1, count: 1 }).contains("go down"));
    assert!(wrong([0, 0, 0, 5], Run { first: 2, count: 1 }).contains("more samples than directions"));
    assert!(wrong([0, 2, 3, 6], Run { first: 2, count: 1 }).contains("beyond the samples"));
    let mut alien = files();
    alien[2] = file(Kind::Mtnc, 16, 5, &[0, 0, 1, 0, 1, 0, 0, 0, 2, 0]);
    assert!(open(&alien, Trust::Hashed).unwrap().read(Run { first: 2, count: 1 }).unwrap_err().to_string().contains("colour map"));
    let other = Shape { directions: 6, ..shape() };
    let opened = Starts::open(memory(files()[0].clone()), other, Trust::Hashed);
    assert!(opened.unwrap_err().to_string().contains("not that of the package's plan"));
}

#[test]
fn raw_samples_are_read_in_either_format() {
    let exposure = Exposure { eighths: -8 };
    let bytes: Vec<u8> = (0..36).collect();
    let open = |file: Vec<u8>, format| RawFiles::open(memory(file), shape(), Trust::Checksum, format, exposure);
    let coded = open(file(Kind::Mtex, 8, 12, &bytes), RawFormat::U8).unwrap();
    let runs = [Run { first: 2, count: 1 }, Run { first: 0, count: 1 }];
    let expected: Vec<[u8; 3]> = [&bytes[24..36], &bytes[..12]].concat().as_chunks().0.to_vec();
    assert_eq!(coded.read(&runs).unwrap(), RawTexels::Coded(expected.clone()));
    let linear: Vec<f32> = bytes.iter().map(|b| byte_to_radiance(*b, exposure.factor())).collect();
    let payload: Vec<u8> = linear.iter().flat_map(|v| v.to_le_bytes()).collect();
    let floats = open(file(Kind::Mtex, 32, 12, &payload), RawFormat::F32).unwrap();
    assert_eq!(floats.read(&runs).unwrap(), RawTexels::Linear([&linear[24..36], &linear[..12]].concat()));
    assert_eq!(floats.read_coded(&runs).unwrap(), expected);
    assert!(open(file(Kind::Mtex, 8, 12, &bytes), RawFormat::F32).is_err());
    assert!(floats.read(&[Run { first: 3, count: 1 }]).is_err());
}
