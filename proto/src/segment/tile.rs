//! The payload of a Tile segment:
//!
//! ```text
//! masks    32 x u32 covered texels, 32 x u32 gutter texels: one word per texel row of the cell, bit x for column x; disjoint
//! errors   u16 n, n x (u8 error, u32 samples) by ascending error, u64 sum of absolute errors; covered texels only
//! rows     per texel of the masks, row by row:
//!          u16 n kept samples, 2 to D; n - 1 gaps between their steps along the walk, 1 to D - 1 each, all together D - 1: one byte
//!          below 128, else two (low seven bits with the top bit set, then the rest); then n red, n green, n blue bytes, each the
//!          difference from the kept sample before it modulo 256 (the first from 0)
//! raw      nothing, or rows x D x 3 u8 or f32 in depth order
//! ```
//! Gaps and differences in planes are what zstd finds patterns in; (depth, colour) pairs, as in the files, would hide them.

use super::{Header, SegmentError, bytes::Reader, expect, field};
use crate::{
    codec::pwl::{ErrorStats, Kept, Order, Sample},
    grid::{SphericalGrid, Walk},
    settings::RawFormat,
    tile::{Cell, TILE_SIDE, TileIndex},
};

/// The light of one tile.
#[derive(Debug, Clone, PartialEq)]
pub struct TileSegment {
    /// Which tile of the Bake phase.
    pub tile: TileIndex,
    /// Index of its surface.
    pub surface: u32,
    /// Its cell in the surface's texture.
    pub cell: Cell,
    /// The direction grid.
    pub grid: SphericalGrid,
    /// The walk that the kept samples follow.
    pub walk: Walk,
    /// Which texels the rows belong to.
    pub mask: TexelMask,
    /// Errors over the covered texels.
    pub errors: ErrorStats,
    /// Kept samples of each texel.
    pub rows: Rows,
    /// Uncompressed samples where the settings ask for them.
    pub raw: Raw,
}

/// Which texels of a cell hold light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TexelMask {
    covered: [u32; TILE_SIDE as usize],
    gutter: [u32; TILE_SIDE as usize],
}

/// A texel of a mask, relative to its cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Texel {
    /// Column within the cell.
    pub x: u32,
    /// Row within the cell.
    pub y: u32,
    /// Whether it lies on a chart; gutter otherwise.
    pub covered: bool,
}

impl TexelMask {
    /// Marks a texel of the cell; `x` and `y` are below 32.
    pub fn insert(&mut self, x: u32, y: u32, covered: bool) {
        let (set, unset) = if covered { (&mut self.covered, &mut self.gutter) } else { (&mut self.gutter, &mut self.covered) };
        set[y as usize] |= 1 << x;
        unset[y as usize] &= !(1 << x);
    }

    /// Texels in the order of their rows: by texel row, then column.
    pub fn texels(&self) -> impl Iterator<Item = Texel> + '_ {
        let cells = (0..TILE_SIDE).flat_map(|y| (0..TILE_SIDE).map(move |x| (x, y)));
        cells.filter_map(|(x, y)| {
            let bit = |words: &[u32; 32]| words[y as usize] >> x & 1 == 1;
            (bit(&self.covered) || bit(&self.gutter)).then(|| Texel { x, y, covered: bit(&self.covered) })
        })
    }

    /// Covered texels.
    #[must_use]
    pub fn covered(&self) -> u32 {
        self.covered.iter().map(|w| w.count_ones()).sum()
    }

    /// Gutter texels.
    #[must_use]
    pub fn gutter(&self) -> u32 {
        self.gutter.iter().map(|w| w.count_ones()).sum()
    }

    /// All texels.
    #[must_use]
    pub fn len(&self) -> usize {
        (self.covered() + self.gutter()) as usize
    }

    /// Whether no texel holds light.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, SegmentError> {
        let mut mask = Self::default();
        for word in mask.covered.iter_mut().chain(mask.gutter.iter_mut()) {
            *word = reader.u32("masks")?;
        }
        if mask.covered.iter().zip(&mask.gutter).any(|(c, g)| c & g != 0) {
            return Err(field("masks", "overlapping", "no texel both covered and gutter"));
        }
        Ok(mask)
    }
}

/// Kept samples of several texels, one after another.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rows {
    kept: Vec<Kept>,
    ends: Vec<u32>,
}

impl Rows {
    /// Adds a texel. Its samples must pass [`check_row`](crate::codec::pwl::check_row), or the segment cannot be read back.
    pub fn push(&mut self, kept: &[Kept]) {
        self.kept.extend_from_slice(kept);
        self.ends.push(self.kept.len() as u32); // 1,024 texels of 4,096 samples at most
    }

    /// Number of texels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no texel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The kept samples of texel `row`.
    #[must_use]
    pub fn row(&self, row: usize) -> &[Kept] {
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.kept[start as usize..self.ends[row] as usize]
    }

    /// All texels in order.
    pub fn iter(&self) -> impl Iterator<Item = &[Kept]> {
        (0..self.len()).map(|row| self.row(row))
    }
}

/// Uncompressed samples, texel by texel in depth order, three channels each.
#[derive(Debug, Clone, PartialEq)]
pub enum Raw {
    /// Not kept.
    None,
    /// Coded to 8 bits with the job's exposure.
    U8(Vec<u8>),
    /// Linear radiance, W/(sr m²).
    F32(Vec<f32>),
}

impl Raw {
    /// What the settings call it.
    #[must_use]
    pub fn format(&self) -> Option<RawFormat> {
        match self {
            Raw::None => None,
            Raw::U8(_) => Some(RawFormat::U8),
            Raw::F32(_) => Some(RawFormat::F32),
        }
    }
}

pub(super) fn flags(walk: Walk, raw: Option<RawFormat>) -> u16 {
    let raw = match raw {
        None => 0,
        Some(RawFormat::U8) => 1,
        Some(RawFormat::F32) => 2,
    };
    u16::from(walk == Walk::Theta) | raw << 1
}

impl TileSegment {
    pub(super) fn write_payload(&self, out: &mut Vec<u8>) {
        let words = self.mask.covered.iter().chain(&self.mask.gutter);
        words.for_each(|w| out.extend(w.to_le_bytes()));
        out.extend((self.errors.counts().count() as u16).to_le_bytes());
        for (error, count) in self.errors.counts() {
            out.push(error);
            out.extend((count as u32).to_le_bytes()); // at most 1,024 x 4,096
        }
        out.extend(self.errors.sum().to_le_bytes());
        let order = Order::new(self.grid, self.walk);
        self.rows.iter().for_each(|row| write_row(row, &order, out));
        match &self.raw {
            Raw::None => {}
            Raw::U8(bytes) => out.extend_from_slice(bytes),
            Raw::F32(values) => out.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        }
    }

    pub(super) fn read_payload(header: &Header, reader: &mut Reader<'_>) -> Result<Self, SegmentError> {
        let walk = if header.flags & 1 == 1 { Walk::Theta } else { Walk::Phi };
        let mask = TexelMask::read(reader)?;
        expect("row count", &(header.rows as usize), &mask.len())?;
        let errors = read_errors(reader, u64::from(mask.covered()) * u64::from(header.grid.len()))?;
        let order = Order::new(header.grid, walk);
        let mut rows = Rows::default();
        let mut scratch = Vec::new();
        for row in 0..mask.len() {
            read_row(row, &order, reader, &mut scratch)?;
            rows.push(&scratch);
        }
        let raw = read_raw(header.flags >> 1, mask.len() * order.len(), order.len(), reader)?;
        Ok(Self { tile: header.tile, surface: header.surface, cell: header.cell, grid: header.grid, walk, mask, errors, rows, raw })
    }
}

fn read_errors(reader: &mut Reader<'_>, samples: u64) -> Result<ErrorStats, SegmentError> {
    let count = reader.u16("error histogram")?;
    if count > 256 {
        return Err(field("error histogram", format!("{count} entries"), "at most 256"));
    }
    let mut counts: Vec<(u8, u64)> = Vec::with_capacity(count.into());
    for _ in 0..count {
        let entry = (reader.u8("error histogram")?, u64::from(reader.u32("error histogram")?));
        if entry.1 == 0 || counts.last().is_some_and(|last| last.0 >= entry.0) {
            return Err(field("error histogram", format!("{entry:?} out of place"), "ascending errors that occur"));
        }
        counts.push(entry);
    }
    Ok(ErrorStats::from_parts(&counts, reader.u64("sum of errors")?, samples)?)
}

fn write_row(row: &[Kept], order: &Order, out: &mut Vec<u8>) {
    out.extend((row.len() as u16).to_le_bytes());
    let steps = row.iter().map(|k| order.step(k.depth).unwrap_or_default());
    for (from, to) in steps.clone().zip(steps.skip(1)) {
        let gap = to.saturating_sub(from);
        if gap < 128 {
            out.push(gap as u8);
        } else {
            out.extend([gap as u8 | 128, (gap >> 7) as u8]); // gaps are below 4,096
        }
    }
    for channel in 0..3 {
        let mut last = 0u8;
        for k in row {
            out.push(k.rgb[channel].wrapping_sub(last));
            last = k.rgb[channel];
        }
    }
}

fn read_row(row: usize, order: &Order, reader: &mut Reader<'_>, kept: &mut Vec<Kept>) -> Result<(), SegmentError> {
    let bad = |reason| SegmentError::Row { row, reason };
    let count = usize::from(reader.u16("kept samples")?);
    if !(2..=order.len()).contains(&count) {
        return Err(bad("it keeps fewer than two samples, or more than there are directions"));
    }
    kept.clear();
    let mut step = 0;
    kept.push(Kept { depth: order.depth(0), rgb: Sample::default() });
    for _ in 1..count {
        step += read_gap(row, reader)?;
        if step >= order.len() {
            return Err(bad("its kept samples go beyond the last direction"));
        }
        kept.push(Kept { depth: order.depth(step), rgb: Sample::default() });
    }
    if step + 1 != order.len() {
        return Err(bad("its last kept sample is not the last direction"));
    }
    for channel in 0..3 {
        let mut last = 0u8;
        for (k, difference) in kept.iter_mut().zip(reader.take("kept samples", count)?) {
            last = last.wrapping_add(*difference);
            k.rgb[channel] = last;
        }
    }
    Ok(())
}

/// One way to write each gap, so that a tile has one right digest.
fn read_gap(row: usize, reader: &mut Reader<'_>) -> Result<usize, SegmentError> {
    match usize::from(reader.u8("kept samples")?) {
        0 => Err(SegmentError::Row { row, reason: "two kept samples have the same direction" }),
        low @ 1..128 => Ok(low),
        low => match usize::from(reader.u8("kept samples")?) {
            0 => Err(SegmentError::Row { row, reason: "a gap is written longer than it need be" }),
            high => Ok(high << 7 | (low - 128)),
        },
    }
}

fn read_raw(code: u16, samples: usize, directions: usize, reader: &mut Reader<'_>) -> Result<Raw, SegmentError> {
    match code {
        0 => Ok(Raw::None),
        1 => Ok(Raw::U8(reader.take("raw samples", samples * 3)?.to_vec())),
        2 => {
            let bytes = reader.take("raw samples", samples * 12)?;
            let (words, _) = bytes.as_chunks::<4>();
            let values: Vec<f32> = words.iter().map(|w| f32::from_le_bytes(*w)).collect();
            match values.iter().position(|v| !v.is_finite()) {
                None => Ok(Raw::F32(values)),
                Some(at) => Err(SegmentError::NotFinite { row: at / 3 / directions, depth: at / 3 % directions }),
            }
        }
        _ => Err(field("flags", format!("{:#06x}", code << 1), "a known raw format and no unknown bits")),
    }
}
