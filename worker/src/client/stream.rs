//! Segments on their way: packed one by one as tiles are ready, closed into chunks by size or age.
//!
//! A chunk is the unit of acceptance: one upload, one blob, one transaction on the other side. Larger chunks cost fewer transactions,
//! smaller ones show up sooner in a live preview and lose less when a worker dies; 8 MiB or 2 s is the coordinator's word.

use bytes::Bytes;
use kiln_proto::{
    ids::Digest,
    limits,
    tile::TileIndex,
    wire::{
        frame::{self, FrameError},
        message::{ChunkEntry, ChunkTrailer},
    },
};
use std::time::Instant;

/// Level 3 packs `pwl` segments to within a few per cent of level 19 at a hundredth of its time.
const ZSTD_LEVEL: i32 = 3;

/// A segment ready to travel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packed {
    tile: TileIndex,
    bytes: Vec<u8>,
    plain_length: u64,
    digest: Digest,
}

impl Packed {
    /// Compresses and fingerprints a segment's bytes.
    ///
    /// # Errors
    /// Only if the compressor cannot allocate.
    pub fn new(tile: TileIndex, segment: &[u8]) -> std::io::Result<Self> {
        let bytes = zstd::bulk::compress(segment, ZSTD_LEVEL)?;
        Ok(Self { tile, bytes, plain_length: segment.len() as u64, digest: Digest::of(segment) })
    }
}

/// Segments collected for the next chunk.
#[derive(Debug, Default)]
pub struct Chunk {
    bytes: Vec<u8>,
    entries: Vec<ChunkEntry>,
    since: Option<Instant>,
}

impl Chunk {
    /// Whether nothing is waiting.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// When its first segment came.
    #[must_use]
    pub fn since(&self) -> Option<Instant> {
        self.since
    }

    /// Adds a segment that became ready at `now`.
    pub fn push(&mut self, packed: &Packed, now: Instant) {
        self.since.get_or_insert(now);
        self.entries.push(ChunkEntry {
            tile: packed.tile,
            offset: self.bytes.len() as u64,
            length: packed.bytes.len() as u64,
            plain_length: packed.plain_length,
            digest: packed.digest,
        });
        self.bytes.extend_from_slice(&packed.bytes);
    }

    /// Whether it should be sent although it is young.
    #[must_use]
    pub fn is_full(&self, chunk_bytes: u64) -> bool {
        self.bytes.len() as u64 >= chunk_bytes || self.entries.len() >= limits::CHUNK_SEGMENTS
    }

    /// Closes the chunk: its bytes with the trailer behind them, and how many tiles it holds.
    ///
    /// # Errors
    /// Only if the trailer cannot be encoded.
    pub fn close(&mut self) -> Result<(Bytes, usize), FrameError> {
        let mut bytes = std::mem::take(&mut self.bytes);
        let trailer = ChunkTrailer { entries: std::mem::take(&mut self.entries) };
        self.since = None;
        let frame = frame::to_frame(&trailer)?;
        bytes.extend_from_slice(&frame);
        bytes.extend_from_slice(&(frame.len() as u32).to_le_bytes());
        Ok((Bytes::from(bytes), trailer.entries.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_chunk_can_be_taken_apart_by_its_trailer() {
        let now = Instant::now();
        let segments: Vec<Vec<u8>> = (0..3u8).map(|k| vec![k; 1000 * (usize::from(k) + 1)]).collect();
        let mut chunk = Chunk::default();
        for (k, s) in segments.iter().enumerate() {
            chunk.push(&Packed::new(TileIndex(k as u64 + 7), s).unwrap(), now);
        }
        assert!(!chunk.is_full(1 << 20) && chunk.is_full(10) && chunk.since() == Some(now));
        let (bytes, count) = chunk.close().unwrap();
        assert!(chunk.is_empty() && chunk.since().is_none() && count == 3);

        let (rest, length) = bytes.split_last_chunk::<4>().unwrap();
        let (body, frame) = rest.split_at(rest.len() - u32::from_le_bytes(*length) as usize);
        let trailer: ChunkTrailer = frame::from_frame(frame).unwrap();
        let mut end = 0;
        for (entry, segment) in trailer.entries.iter().zip(&segments) {
            assert_eq!(entry.offset, end);
            end += entry.length;
            let packed = &body[entry.offset as usize..end as usize];
            let plain = zstd::bulk::decompress(packed, entry.plain_length as usize).unwrap();
            assert_eq!((&plain, Digest::of(&plain)), (segment, entry.digest));
        }
        assert_eq!(end as usize, body.len());
    }
}
