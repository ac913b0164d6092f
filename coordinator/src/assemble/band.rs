//! One row of cells, turned from tiles into texel rows.
//!
//! Tiles are added from left to right; each appends its texels to a spool and remembers where each of its 32 texel rows begins. Replaying
//! texel row y reads that part of every tile. The spool is in memory up to [`SPOOL_BYTES`](super::SPOOL_BYTES), then in a scratch file that
//! vanishes with the process, so a texture of 8,192 texels keeps no more than a narrow one.

use super::{AssembleError, SPOOL_BYTES};
use kiln_proto::{segment::TileSegment, tile::TILE_SIDE};
use std::{
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};
use tempfile::SpooledTempFile;

/// Bytes of a kept sample in the spool: depth, colour.
const SAMPLE_BYTES: usize = 5;
/// Bytes before the samples of a texel: column within the cell, number of samples.
const TEXEL_BYTES: usize = 3;

/// The samples of a texel row in the form of the files.
#[derive(Default)]
pub(super) struct Samples {
    /// u16 each, little-endian.
    pub(super) depths: Vec<u8>,
    /// Red, green, blue each.
    pub(super) colours: Vec<u8>,
}

/// A tile in the spool.
struct Spilled {
    /// Its first column in the texture.
    x: u32,
    /// Where each texel row begins, and where the last one ends.
    at: [u64; TILE_SIDE as usize + 1],
}

pub(super) struct Band {
    folder: PathBuf,
    width: u32,
    spool: SpooledTempFile,
    length: u64,
    tiles: Vec<Spilled>,
}

impl Band {
    pub(super) fn new(folder: &Path, width: u32) -> Result<Self, AssembleError> {
        let spool = tempfile::spooled_tempfile_in(SPOOL_BYTES, folder);
        Ok(Self { folder: folder.to_owned(), width, spool, length: 0, tiles: vec![] })
    }

    /// Adds the next tile to the right.
    pub(super) fn add(&mut self, segment: &TileSegment) -> Result<(), AssembleError> {
        let mut bytes = Vec::new();
        let mut at = [0; TILE_SIDE as usize + 1];
        let mut next = 0;
        for (texel, kept) in segment.mask.texels().zip(segment.rows.iter()) {
            // Texel rows without texels begin where the next one does.
            while next <= texel.y as usize {
                at[next] = self.length + bytes.len() as u64;
                next += 1;
            }
            bytes.push(texel.x as u8); // below 32
            bytes.extend((kept.len() as u16).to_le_bytes()); // at most D
            for k in kept {
                bytes.extend(k.depth.to_le_bytes());
                bytes.extend(k.rgb);
            }
        }
        at[next..].fill(self.length + bytes.len() as u64);
        self.spool.write_all(&bytes).map_err(|source| self.fault(source))?;
        self.length += bytes.len() as u64;
        self.tiles.push(Spilled { x: u32::from(segment.cell.x) * TILE_SIDE, at });
        Ok(())
    }

    /// Calls `emit` for each of the first `rows` texel rows, in order, with the number of samples of every texel and all samples.
    pub(super) fn replay(
        mut self,
        rows: u32,
        mut emit: impl FnMut(&[u16], &Samples) -> Result<(), AssembleError>,
    ) -> Result<(), AssembleError> {
        let (mut bytes, mut samples) = (Vec::new(), Samples::default());
        for y in 0..rows as usize {
            let mut counts = vec![0; self.width as usize];
            samples.depths.clear();
            samples.colours.clear();
            for tile in 0..self.tiles.len() {
                self.read(tile, y, &mut bytes).map_err(|source| self.fault(source))?;
                unpack(&bytes, &mut counts[self.tiles[tile].x as usize..], &mut samples);
            }
            emit(&counts, &samples)?;
        }
        Ok(())
    }

    fn read(&mut self, tile: usize, y: usize, bytes: &mut Vec<u8>) -> io::Result<()> {
        let at = &self.tiles[tile].at;
        let (start, length) = (at[y], at[y + 1] - at[y]);
        bytes.resize(length as usize, 0); // 32 texels at most
        self.spool.seek(SeekFrom::Start(start))?;
        self.spool.read_exact(bytes)
    }

    fn fault(&self, source: io::Error) -> AssembleError {
        AssembleError::Io { path: self.folder.clone(), source }
    }
}

/// Takes apart what [`Band::add`] wrote of one texel row.
fn unpack(mut bytes: &[u8], counts: &mut [u16], samples: &mut Samples) {
    while let Some((head, rest)) = bytes.split_first_chunk::<TEXEL_BYTES>() {
        let count = u16::from_le_bytes([head[1], head[2]]);
        counts[usize::from(head[0])] = count;
        let (own, next) = rest.split_at(usize::from(count) * SAMPLE_BYTES);
        for k in own.as_chunks::<SAMPLE_BYTES>().0 {
            samples.depths.extend(&k[..2]);
            samples.colours.extend(&k[2..]);
        }
        bytes = next;
    }
}
