//! Segments: the self-contained result of one tile, as a worker sends it and the coordinator stores it.
//!
//! ```text
//! offset  size
//!      0     4  magic "KSEG"
//!      4     2  version
//!      6     1  kind: 1 Probe, 2 Tile
//!      7     1  phase: 0 Probe, 1 Bake
//!      8     8  tile index within the phase
//!     16     4  surface            (Probe: 0xffffffff)
//!     20   2+2  cell x, cell y     (Probe: 0, 0)
//!     24   2+2  inclinations, azimuths of the direction grid; D is their product
//!     28     4  rows: covered and gutter texels   (Probe: 0)
//!     32     2  flags: bit 0 walk (0 phi, 1 theta), bits 1-2 raw (0 none, 1 u8, 2 f32), the others 0   (Probe: 0)
//!     34     2  zero
//!     36     4  CRC32C of bytes 0..36 followed by bytes 40..
//!     40        Probe: bincode of ProbeSums.
//!               Tile: masks, errors, rows, raw samples (see `tile`)
//! ```
//! Everything is little-endian and every field is checked before memory is reserved on its word. The masks make a segment readable
//! without the scene: the assembler and the live preview need no rasteriser to know which texel a row belongs to; they cost 256 bytes
//! that compress to a few. Compression belongs to the transport, so that digests cover bytes that no zstd version can change.

mod bytes;
mod check;
mod tile;

pub use check::{check, open};
pub use tile::{Raw, Rows, Texel, TexelMask, TileSegment};

use crate::{
    codec::pwl::BadErrorStats,
    grid::SphericalGrid,
    limits,
    probe::ProbeSums,
    settings::RawFormat,
    tile::{Cell, TileIndex},
    wire::{self, DecodeError, message::Phase},
};
use bytes::Reader;

/// Version 1: the first.
pub const SEGMENT_VERSION: u16 = 1;
/// Bytes before the payload.
pub const HEADER_BYTES: usize = 40;
const MAGIC: [u8; 4] = *b"KSEG";
const CRC_AT: usize = 36;
const NO_SURFACE: u32 = u32::MAX;

/// The result of one tile.
#[derive(Debug, Clone, PartialEq)]
pub enum Segment {
    /// Of the Probe phase: sums over its texels.
    Probe(ProbeSegment),
    /// Of the Bake phase: the light of its texels.
    Tile(Box<TileSegment>),
}

/// What one tile of the Probe phase found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProbeSegment {
    /// Which tile of the phase.
    pub tile: TileIndex,
    /// The direction grid that was probed.
    pub grid: SphericalGrid,
    /// The sums.
    pub sums: ProbeSums,
}

/// Why bytes are not the segment that was expected.
#[derive(Debug, thiserror::Error)]
pub enum SegmentError {
    /// Above [`limits::SEGMENT_BYTES`].
    #[error("the segment has {found} bytes; at most {max} are allowed", max = limits::SEGMENT_BYTES)]
    TooLarge {
        /// Bytes found.
        found: usize,
    },
    /// It ends within a field.
    #[error("the segment ends within its {field}: {needed} bytes needed, {left} left")]
    Truncated {
        /// Which field.
        field: &'static str,
        /// Bytes it needs.
        needed: usize,
        /// Bytes there are.
        left: usize,
    },
    /// It goes on after its last field.
    #[error("{extra} bytes follow the end of the segment")]
    Trailing {
        /// How many.
        extra: usize,
    },
    /// Damaged.
    #[error("the segment's checksum is {found:08x}; its bytes give {expected:08x}")]
    Checksum {
        /// In the header.
        found: u32,
        /// Of the bytes.
        expected: u32,
    },
    /// A field has a value that it cannot have, or not in this place.
    #[error("the segment's {field} is {found}; expected {expected}")]
    Field {
        /// Which field.
        field: &'static str,
        /// What it says.
        found: String,
        /// What it should say.
        expected: String,
    },
    /// A texel's kept samples do not lead from the first direction to the last.
    #[error("row {row}: {reason}")]
    Row {
        /// Which texel of the tile.
        row: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// Errors that do not add up.
    #[error("the segment's error statistics are impossible")]
    Errors(#[from] BadErrorStats),
    /// NaN or infinite raw radiance.
    #[error("row {row}, depth {depth}: the raw radiance is not finite")]
    NotFinite {
        /// Which texel of the tile.
        row: usize,
        /// Which direction.
        depth: usize,
    },
    /// Probe sums that cannot be read or written.
    #[error("the segment's probe sums are unusable")]
    Probe(#[from] DecodeError),
}

/// What the header says.
struct Header {
    probe: bool,
    phase: u8,
    tile: TileIndex,
    surface: u32,
    cell: Cell,
    grid: SphericalGrid,
    rows: u32,
    flags: u16,
}

impl Segment {
    /// Which tile this is the result of.
    #[must_use]
    pub fn tile(&self) -> TileIndex {
        match self {
            Segment::Probe(p) => p.tile,
            Segment::Tile(t) => t.tile,
        }
    }

    /// The phase it belongs to.
    #[must_use]
    pub fn phase(&self) -> Phase {
        match self {
            Segment::Probe(_) => Phase::Probe,
            Segment::Tile(_) => Phase::Bake,
        }
    }

    /// The bytes that are hashed, sent and stored.
    ///
    /// # Errors
    /// Results above [`limits::SEGMENT_BYTES`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, SegmentError> {
        let mut out = Vec::new();
        match self {
            Segment::Probe(p) => {
                Header {
                    probe: true,
                    phase: 0,
                    tile: p.tile,
                    surface: NO_SURFACE,
                    cell: Cell { x: 0, y: 0 },
                    grid: p.grid,
                    rows: 0,
                    flags: 0,
                }
                .write(&mut out);
                out.extend(wire::encode(&p.sums, limits::SEGMENT_BYTES)?);
            }
            Segment::Tile(t) => {
                let rows = t.mask.len() as u32;
                let flags = tile::flags(t.walk, t.raw.format());
                Header { probe: false, phase: 1, tile: t.tile, surface: t.surface, cell: t.cell, grid: t.grid, rows, flags }
                    .write(&mut out);
                t.write_payload(&mut out);
            }
        }
        if out.len() > limits::SEGMENT_BYTES {
            return Err(SegmentError::TooLarge { found: out.len() });
        }
        let crc = checksum(&out);
        out[CRC_AT..HEADER_BYTES].copy_from_slice(&crc.to_le_bytes());
        Ok(out)
    }

    /// Reads [`Segment::to_bytes`] back. Memory is bounded by a small multiple of the input. Whether it is the segment of a certain tile
    /// is [`open`]'s question.
    ///
    /// # Errors
    /// Bytes that are not a segment of this version, whole and undamaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SegmentError> {
        if bytes.len() > limits::SEGMENT_BYTES {
            return Err(SegmentError::TooLarge { found: bytes.len() });
        }
        let mut reader = Reader::new(bytes);
        let header = Header::read(&mut reader)?;
        let found = reader.u32("checksum")?;
        let expected = checksum(bytes);
        if found != expected {
            return Err(SegmentError::Checksum { found, expected });
        }
        if header.probe {
            let sums = wire::decode(reader.rest(), limits::SEGMENT_BYTES)?;
            return Ok(Segment::Probe(ProbeSegment { tile: header.tile, grid: header.grid, sums }));
        }
        let segment = TileSegment::read_payload(&header, &mut reader)?;
        reader.finish()?;
        Ok(Segment::Tile(Box::new(segment)))
    }
}

/// The same segment without its raw samples, for who only looks at the light: raw samples are most of a segment that has them.
///
/// # Errors
/// Bytes that are not a segment.
pub fn without_raw(bytes: Vec<u8>) -> Result<Vec<u8>, SegmentError> {
    match Segment::from_bytes(&bytes)? {
        Segment::Tile(mut segment) if segment.raw != Raw::None => {
            segment.raw = Raw::None;
            Segment::Tile(segment).to_bytes()
        }
        _ => Ok(bytes),
    }
}

fn checksum(bytes: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&bytes[..CRC_AT]), &bytes[HEADER_BYTES..])
}

impl Header {
    fn write(&self, out: &mut Vec<u8>) {
        out.extend(MAGIC);
        out.extend(SEGMENT_VERSION.to_le_bytes());
        out.extend([if self.probe { 1 } else { 2 }, self.phase]);
        out.extend(self.tile.0.to_le_bytes());
        out.extend(self.surface.to_le_bytes());
        out.extend(self.cell.x.to_le_bytes());
        out.extend(self.cell.y.to_le_bytes());
        out.extend((self.grid.n_theta() as u16).to_le_bytes());
        out.extend((self.grid.n_phi() as u16).to_le_bytes());
        out.extend(self.rows.to_le_bytes());
        out.extend(self.flags.to_le_bytes());
        out.extend([0; 2]);
        out.extend([0; 4]); // the checksum, once everything is written
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, SegmentError> {
        let magic = reader.array::<4>("magic")?;
        expect("magic", &magic, &MAGIC)?;
        expect("version", &reader.u16("version")?, &SEGMENT_VERSION)?;
        let [kind, phase] = reader.array("kind")?;
        let probe = match (kind, phase) {
            (1, 0) => true,
            (2, 1) => false,
            _ => return Err(field("kind and phase", format!("{kind}, {phase}"), "1, 0 (Probe) or 2, 1 (Tile)")),
        };
        let tile = TileIndex(reader.u64("tile")?);
        let surface = reader.u32("surface")?;
        let cell = Cell { x: reader.u16("cell")?, y: reader.u16("cell")? };
        let (n_theta, n_phi) = (reader.u16("directions")?, reader.u16("directions")?);
        let grid = SphericalGrid::new(n_theta.into(), n_phi.into())
            .map_err(|e| field("directions", format!("{n_theta}x{n_phi}"), e.to_string()))?;
        let rows = reader.u32("row count")?;
        let flags = reader.u16("flags")?;
        expect("reserved field", &reader.u16("reserved field")?, &0)?;
        if probe {
            expect("surface, cell, rows and flags", &(surface, cell.x, cell.y, rows, flags), &(NO_SURFACE, 0, 0, 0, 0))?;
        }
        Ok(Self { probe, phase, tile, surface, cell, grid, rows, flags })
    }
}

fn field(field: &'static str, found: impl Into<String>, expected: impl Into<String>) -> SegmentError {
    SegmentError::Field { field, found: found.into(), expected: expected.into() }
}

fn expect<T: PartialEq + std::fmt::Debug>(name: &'static str, found: &T, expected: &T) -> Result<(), SegmentError> {
    if found == expected { Ok(()) } else { Err(field(name, format!("{found:?}"), format!("{expected:?}"))) }
}

fn raw_name(format: Option<RawFormat>) -> &'static str {
    match format {
        None => "none",
        Some(RawFormat::U8) => "u8",
        Some(RawFormat::F32) => "f32",
    }
}

#[cfg(test)]
mod tests;
