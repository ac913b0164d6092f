//! Assembly: the segments of a surface become its file set, the surfaces become a package.
//!
//! Segments come one at a time, in any order of the farm's choosing, and leave in row-major texel order. A band of 32 texel rows (one row
//! of cells) is decoded, spilled to an unnamed scratch file where it is wide, and replayed row by row. Colours go to a second scratch file
//! while a bitmap notes which occur; when all are known, each becomes its rank in the sorted colour map. Every segment is read once.
//!
//! Memory, at any job size: one segment (two beside a hole), [`SPOOL_BYTES`] of spill, 3 MiB of colour map, a few buffers. The alternative, a first pass over
//! all segments for the colour map and a second for the files, needs no colour scratch file and fetches and decodes everything twice.
//!
//! Synchronous and file-only: the engine calls it where blocking is allowed and brings the segments through [`SegmentSource`].

mod band;
mod holes;
mod output;
mod package;
mod palette;

pub use holes::{Hole, Holes, Patch};
pub use package::{Published, describe, write_manifest};

use band::Band;
use kiln_proto::{
    codec::pwl::ErrorStats,
    format::{FileRecord, Header, Kind},
    plan::{Plan, SurfacePlan},
    segment::{self, Segment, SegmentError, TileSegment},
    settings::RawFormat,
    tile::{TILE_SIDE, TileIndex},
    wire::message::Phase,
};
use output::{RawFile, StreamFile};
use palette::Palette;
use serde::{Deserialize, Serialize};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Bytes of spilled samples that stay in memory; few in tests, so that they spill.
const SPOOL_BYTES: usize = if cfg!(test) { 1 << 12 } else { 32 << 20 };

/// What a source fails with.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Where the segments of one surface come from. May block.
pub trait SegmentSource {
    /// The bytes, decompressed, of the segment of the surface's `index`-th planned tile. Each is asked for once, band by band; of a hole
    /// none is, but those around it are asked for again.
    ///
    /// # Errors
    /// Whatever keeps the source from giving it.
    fn tile(&mut self, index: usize) -> Result<Vec<u8>, SourceError>;
}

impl<F: FnMut(usize) -> Result<Vec<u8>, SourceError>> SegmentSource for F {
    fn tile(&mut self, index: usize) -> Result<Vec<u8>, SourceError> {
        self(index)
    }
}

/// What assembling a surface came to: everything that the manifest says of it, in integers, so that a trip through a store or JSON cannot
/// change a digit of the manifest.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SurfaceReport {
    /// Index of the surface.
    pub surface: usize,
    /// Kept samples, those of gutter texels included.
    pub kept_samples: u64,
    /// Colours in the colour map; 0 where colours are direct.
    pub colours: u32,
    /// Bits of a colour in `.mtnc`: 16 or 24.
    pub colour_bits: u16,
    /// How many samples of covered texels have each error (see [`ErrorStats`]).
    pub errors: Vec<(u8, u64)>,
    /// Sum of absolute errors of all channels.
    pub error_sum: u64,
    /// The files that were written, in byte order of their paths.
    pub files: Vec<FileRecord>,
    /// Tiles that nobody could bake, in order; their samples have no errors above.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Hole>,
}

/// Why a surface or a package cannot be assembled.
#[derive(Debug, thiserror::Error)]
pub enum AssembleError {
    /// A segment cannot be had.
    #[error("the segment of tile {tile} cannot be read")]
    Source {
        /// Its tile.
        tile: TileIndex,
        /// Why.
        #[source]
        source: SourceError,
    },
    /// A segment is not what the plan expects.
    #[error("the segment of tile {tile} cannot be used")]
    Segment {
        /// Its tile.
        tile: TileIndex,
        /// Why.
        #[source]
        source: SegmentError,
    },
    /// The staging directory fails.
    #[error("{} cannot be written", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// More kept samples than 32-bit starting points can address.
    #[error(
        "surface {stem} keeps more than {max} samples, which .mtsp cannot address; lower its texture size or the number of directions, or \
         allow a larger error",
        max = u32::MAX
    )]
    TooManySamples {
        /// The surface's file stem.
        stem: String,
    },
    /// Scene, plan and reports do not belong together.
    #[error("the package cannot be described: {reason}")]
    Mismatch {
        /// What does not fit.
        reason: String,
    },
}

/// Assembles the surface with index `surface` of `plan` into `dir/surfaces/STEM.*` and reports on it. Files of an earlier attempt are
/// overwritten; nothing is synced to disk, which is the publisher's to do.
///
/// # Errors
/// Segments that cannot be had or used, a directory that cannot be written, more samples than the format addresses.
pub fn assemble_surface(
    plan: &Plan,
    surface: usize,
    stem: &str,
    source: &mut dyn SegmentSource,
    dir: &Path,
) -> Result<SurfaceReport, AssembleError> {
    assemble(plan, surface, stem, None, source, dir)
}

/// Assembles a surface without the tiles that nobody could bake, filling their places; otherwise like [`assemble_surface`].
///
/// # Errors
/// As [`assemble_surface`].
pub fn assemble_around(holes: &Holes<'_>, stem: &str, source: &mut dyn SegmentSource, dir: &Path) -> Result<SurfaceReport, AssembleError> {
    let report = assemble(holes.plan, holes.surface, stem, Some(holes), source, dir)?;
    Ok(SurfaceReport { holes: holes.list.clone(), ..report })
}

fn assemble(
    plan: &Plan,
    surface: usize,
    stem: &str,
    holes: Option<&Holes<'_>>,
    source: &mut dyn SegmentSource,
    dir: &Path,
) -> Result<SurfaceReport, AssembleError> {
    let layout = plan.surfaces.get(surface).ok_or_else(|| AssembleError::Mismatch { reason: format!("there is no surface {surface}") })?;
    let folder = dir.join("surfaces");
    std::fs::create_dir_all(&folder).map_err(|source| AssembleError::Io { path: folder.clone(), source })?;
    let mut streams = Streams::create(dir, stem, plan, layout)?;
    let mut errors = ErrorStats::default();
    let first = plan.first_tile(surface).0;
    let mut read = |index: usize| {
        let tile = TileIndex(first + index as u64);
        let bytes = source.tile(index).map_err(|source| AssembleError::Source { tile, source })?;
        open(&bytes, plan, tile)
    };
    for cells in bands(layout) {
        let mut band = Band::new(&folder, layout.size.width)?;
        for index in cells {
            let segment = match holes.filter(|holes| holes.contains(index)) {
                Some(holes) => holes.segment(index, &mut read)?,
                None => read(index)?,
            };
            errors.add(&segment.errors);
            streams.raw(&segment)?;
            band.add(&segment)?;
        }
        let rows = streams.next_rows(layout);
        band.replay(rows, |counts, kept| streams.texel_row(counts, kept))?;
    }
    streams.finish(surface, &errors)
}

fn open(bytes: &[u8], plan: &Plan, tile: TileIndex) -> Result<Box<TileSegment>, AssembleError> {
    let fault = |source| AssembleError::Segment { tile, source };
    match segment::open(bytes, plan, Phase::Bake, tile).map_err(fault)? {
        Segment::Tile(segment) => Ok(segment),
        // `open` gives the kind of the phase that it was asked for.
        Segment::Probe(_) => Err(AssembleError::Mismatch { reason: format!("tile {tile} is a probe") }),
    }
}

/// The planned tiles of a surface in the order in which [`assemble_surface`] asks for their segments.
#[must_use]
pub fn reading_order(layout: &SurfacePlan) -> Vec<usize> {
    bands(layout).concat()
}

/// The planned tiles of each row of cells, from left to right; rows without tiles are there, too.
fn bands(layout: &SurfacePlan) -> Vec<Vec<usize>> {
    let mut bands = vec![vec![]; layout.size.height.div_ceil(TILE_SIDE) as usize];
    for (index, tile) in layout.tiles.iter().enumerate() {
        if let Some(band) = bands.get_mut(usize::from(tile.cell.y)) {
            band.push(index);
        }
    }
    bands.iter_mut().for_each(|band| band.sort_by_key(|index| layout.tiles[*index].cell.x));
    bands
}

/// The file set of a surface while it grows.
struct Streams<'a> {
    dir: &'a Path,
    stem: &'a str,
    /// Size and depth of every header.
    header: Header,
    raw: Option<RawFile>,
    starts: StreamFile,
    depths: StreamFile,
    palette: Palette,
    samples: u64,
    rows_done: u32,
}

impl<'a> Streams<'a> {
    fn create(dir: &'a Path, stem: &'a str, plan: &Plan, layout: &SurfacePlan) -> Result<Self, AssembleError> {
        let header = Header { kind: Kind::Mtsp, bits: 32, size: layout.size, depth: plan.settings.directions.len(), count: 0, crc: 0 };
        let bits = |format| if format == RawFormat::U8 { 8 } else { 32 };
        let raw_header =
            |format| Header { kind: Kind::Mtex, bits: bits(format), count: layout.size.texels() * u64::from(header.depth), ..header };
        Ok(Self {
            dir,
            stem,
            header,
            raw: plan.settings.raw.map(|format| RawFile::create(dir, stem, raw_header(format))).transpose()?,
            starts: StreamFile::create(dir, stem, Kind::Mtsp)?,
            depths: StreamFile::create(dir, stem, Kind::Mti)?,
            palette: Palette::new(&dir.join("surfaces"))?,
            samples: 0,
            rows_done: 0,
        })
    }

    /// How many texel rows the next band has.
    fn next_rows(&mut self, layout: &SurfacePlan) -> u32 {
        let rows = (layout.size.height - self.rows_done).min(TILE_SIDE);
        self.rows_done += rows;
        rows
    }

    fn raw(&mut self, segment: &TileSegment) -> Result<(), AssembleError> {
        self.raw.as_mut().map_or(Ok(()), |raw| raw.write(segment))
    }

    /// One whole texel row: how many samples each texel keeps, and the samples.
    fn texel_row(&mut self, counts: &[u16], kept: &band::Samples) -> Result<(), AssembleError> {
        for count in counts {
            self.starts.write(&(self.samples as u32).to_le_bytes())?;
            self.samples += u64::from(*count);
        }
        if self.samples > u64::from(u32::MAX) {
            return Err(AssembleError::TooManySamples { stem: self.stem.to_owned() });
        }
        self.depths.write(&kept.depths)?;
        self.palette.write(&kept.colours)
    }

    fn finish(mut self, surface: usize, errors: &ErrorStats) -> Result<SurfaceReport, AssembleError> {
        self.starts.write(&(self.samples as u32).to_le_bytes())?;
        let header = self.header;
        let coded = self.palette.finish(self.dir, self.stem, header)?;
        let mut files = vec![self.starts.finish(Header { count: header.size.texels() + 1, ..header })?];
        files.push(self.depths.finish(Header { kind: Kind::Mti, bits: 16, count: self.samples, ..header })?);
        files.extend(coded.files);
        files.extend(self.raw.map(RawFile::finish).transpose()?);
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(SurfaceReport {
            surface,
            kept_samples: self.samples,
            colours: coded.colours,
            colour_bits: coded.bits,
            errors: errors.counts().collect(),
            error_sum: errors.sum(),
            files,
            holes: vec![],
        })
    }
}

#[cfg(test)]
mod tests;
