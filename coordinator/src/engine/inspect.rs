//! Is this file a chunk, and are its segments what the lease asked for? Bytes from outside; nothing they say is believed.
//!
//! The trailer at the end is read first and must describe the file exactly: segments from offset 0 without gaps up to the trailer. Each
//! segment is decompressed alone, so that memory is bounded by the largest segment and not by the chunk.

use super::ports::Pipeline;
use crate::blob::BlobName;
use kiln_proto::{
    ids::Digest,
    limits,
    plan::Plan,
    tile::{TileRun, TileRuns},
    wire::{
        frame::from_frame,
        message::{ChunkEntry, ChunkTrailer, Phase},
    },
};
use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
};

/// A chunk that was found good.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Checked {
    /// Its name as a blob.
    pub(super) blob: BlobName,
    /// Its length.
    pub(super) length: u64,
    /// Where its trailer's frame begins.
    pub(super) trailer_at: u64,
    /// Its segments.
    pub(super) entries: Vec<ChunkEntry>,
}

/// Why a file is not an acceptable chunk.
#[derive(Debug, thiserror::Error)]
pub(super) enum BadChunk {
    /// The sender's fault.
    #[error("{0}")]
    Invalid(String),
    /// Ours.
    #[error("the spooled chunk cannot be read")]
    Read(#[from] io::Error),
}

fn invalid(reason: impl Into<String>) -> BadChunk {
    BadChunk::Invalid(reason.into())
}

/// What the lease asked for.
pub(super) struct Asked<'a> {
    pub(super) plan: &'a Plan,
    pub(super) phase: Phase,
    pub(super) run: TileRun,
}

/// Checks a spooled chunk from end to end.
pub(super) fn check(file: &mut File, asked: &Asked<'_>, pipeline: &dyn Pipeline) -> Result<Checked, BadChunk> {
    let length = file.metadata()?.len();
    if length > limits::CHUNK_BYTES {
        return Err(invalid(format!("the chunk has {length} bytes; at most {} are allowed", limits::CHUNK_BYTES)));
    }
    let (entries, trailer_at, trailer) = trailer(file, length)?;
    layout(&entries, trailer_at, asked.run)?;
    let mut hasher = blake3::Hasher::new();
    file.seek(SeekFrom::Start(0))?;
    let mut packed = Vec::new();
    for entry in &entries {
        packed.resize(entry.length as usize, 0);
        file.read_exact(&mut packed)?;
        hasher.update(&packed);
        let plain = unpack(&packed, entry).map_err(BadChunk::Invalid)?;
        let bad = |p: crate::records::Problem| invalid(format!("the segment of tile {}: {p}", entry.tile));
        pipeline.check(&plain, asked.plan, asked.phase, entry.tile).map_err(bad)?;
    }
    hasher.update(&trailer);
    Ok(Checked { blob: BlobName(Digest(*hasher.finalize().as_bytes())), length, trailer_at, entries })
}

/// The table at the end of a chunk, where it begins, and its bytes up to the end of the file.
fn trailer(file: &mut File, length: u64) -> Result<(Vec<ChunkEntry>, u64, Vec<u8>), BadChunk> {
    let truncated = || invalid(format!("the chunk has {length} bytes; that is too short for its trailer"));
    let end = length.checked_sub(4).ok_or_else(truncated)?;
    file.seek(SeekFrom::Start(end))?;
    let mut size = [0; 4];
    file.read_exact(&mut size)?;
    let begin = end.checked_sub(u64::from(u32::from_le_bytes(size))).ok_or_else(truncated)?;
    if end - begin > limits::FRAME_BYTES as u64 {
        return Err(invalid(format!("the trailer has {} bytes; at most {} are allowed", end - begin, limits::FRAME_BYTES)));
    }
    file.seek(SeekFrom::Start(begin))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let entries = parse_trailer(&bytes).map_err(BadChunk::Invalid)?;
    Ok((entries, begin, bytes))
}

/// The entries in the last bytes of a chunk: the trailer's frame and its length.
pub(super) fn parse_trailer(bytes: &[u8]) -> Result<Vec<ChunkEntry>, String> {
    let frame = bytes.len().checked_sub(4).map(|n| &bytes[..n]).ok_or("the trailer is cut off")?;
    from_frame::<ChunkTrailer>(frame).map(|t| t.entries).map_err(|e| format!("the trailer cannot be read: {e}"))
}

/// Whether the entries describe the bytes before the trailer exactly, and tiles of the run, none twice.
fn layout(entries: &[ChunkEntry], trailer_at: u64, run: TileRun) -> Result<(), BadChunk> {
    if entries.is_empty() || entries.len() > limits::CHUNK_SEGMENTS {
        return Err(invalid(format!("{} segments in the chunk; expected 1 to {}", entries.len(), limits::CHUNK_SEGMENTS)));
    }
    let (mut offset, mut seen) = (0u64, TileRuns::new());
    for entry in entries {
        if !(run.start..run.end).contains(&entry.tile.0) {
            return Err(invalid(format!("tile {} is not of this lease, which holds {} to {}", entry.tile, run.start, run.end - 1)));
        }
        if seen.contains(entry.tile) {
            return Err(invalid(format!("tile {} is in the chunk twice", entry.tile)));
        }
        seen.insert_tile(entry.tile);
        if entry.offset != offset {
            return Err(invalid(format!("the segment of tile {} begins at {}; expected {offset}", entry.tile, entry.offset)));
        }
        if entry.plain_length > limits::SEGMENT_BYTES as u64 {
            let (n, max) = (entry.plain_length, limits::SEGMENT_BYTES);
            return Err(invalid(format!("the segment of tile {} claims {n} bytes; at most {max} are allowed", entry.tile)));
        }
        let end = offset.checked_add(entry.length).filter(|end| *end <= trailer_at);
        offset = end.ok_or_else(|| invalid(format!("the segment of tile {} reaches into the trailer", entry.tile)))?;
    }
    if offset == trailer_at {
        Ok(())
    } else {
        Err(invalid(format!("{} bytes between the last segment and the trailer belong to nothing", trailer_at - offset)))
    }
}

/// One segment's bytes, of the promised length and digest.
pub(super) fn unpack(packed: &[u8], entry: &ChunkEntry) -> Result<Vec<u8>, String> {
    let ChunkEntry { tile, plain_length, digest, .. } = entry;
    let plain = zstd::bulk::decompress(packed, *plain_length as usize)
        .map_err(|e| format!("the segment of tile {tile} does not decompress to {plain_length} bytes: {e}"))?;
    if plain.len() as u64 != *plain_length {
        return Err(format!("the segment of tile {tile} has {} bytes; {plain_length} were promised", plain.len()));
    }
    if Digest::of(&plain) != *digest {
        return Err(format!("the segment of tile {tile} does not have its digest"));
    }
    Ok(plain)
}
