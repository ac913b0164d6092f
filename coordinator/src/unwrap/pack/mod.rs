//! Packing: pieces of a texture are put side by side, two gutters of [`GUTTER`] texels apart; at the border of the texture no gutter is
//! needed, because samplers clamp there.
//!
//! Up to some thousands of pieces are let down onto the skyline of those before them (`skyline`), turned by quarters; more are stood on
//! shelves (`shelves`), which is n log n. Packers that also fill holes below the skyline save a few per cent more and cost a search over
//! the texture for every piece.

mod shelves;
mod skyline;

use kiln_proto::{texel::GUTTER, tile::TILE_SIDE};

/// Texels between two charts: a gutter for each.
pub(super) const GAP: u64 = 2 * GUTTER as u64;
/// Pieces that are let down one by one, at most.
const SKYLINE_PIECES: usize = 20_000;

/// Pieces for which many widths are tried.
const FEW: usize = 1_000;

/// What is packed: a box of whole texels, and what of it is taken where that is less.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Piece {
    /// Columns and rows of the box.
    pub(super) size: (u32, u32),
    /// First and last + 1 taken row of each column, and first and last + 1 taken column of each row; `None` where all is taken.
    pub(super) outline: Option<[Vec<(u16, u16)>; 2]>,
}

/// Where a piece was put.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Place {
    /// Lower corner of its box as turned.
    pub(super) origin: (u32, u32),
    /// Quarter turns, counter-clockwise.
    pub(super) turns: u8,
}

/// Where pieces were put.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Packed {
    /// In the order given.
    pub(super) places: Vec<Place>,
    /// Columns in use.
    pub(super) width: u32,
    /// Rows in use.
    pub(super) height: u32,
}

/// Packs pieces into `width` columns and at most `height` rows; `None` where they do not fit.
pub(super) fn pack(pieces: &[Piece], width: u32, height: u32) -> Option<Packed> {
    if pieces.len() > SKYLINE_PIECES { shelves::pack(pieces, width, height) } else { skyline::pack(pieces, width, height) }
}

/// Packs into whatever shape wastes least, with sides of at most `side` texels.
pub(super) fn pack_free(pieces: &[Piece], side: u32) -> Option<Packed> {
    if let [one] = pieces {
        let (width, height) = one.size;
        return (width.max(height) <= side).then(|| Packed { places: vec![Place::default()], width, height });
    }
    let taken = |p: &Piece| p.taken() as f64 + GAP as f64 * (f64::from(p.size.0) + f64::from(p.size.1) + GAP as f64);
    let area: f64 = pieces.iter().map(taken).sum();
    // Wide enough for the longest piece, whichever way it lies.
    let widest = pieces.iter().map(|p| p.size.0.min(p.size.1)).max().unwrap_or(1).max(narrowest(pieces));
    let (steps, widest) = (if pieces.len() > FEW { 6u32 } else { 24 }, widest.min(side));
    let widths = (0..=steps).map(|k| ((area.sqrt() * (0.6 + 1.4 * f64::from(k) / f64::from(steps))) as u32).clamp(widest, side));
    let texels = |p: &Packed| u64::from(p.width) * u64::from(p.height);
    // `min_by_key` keeps the first of equals.
    widths.filter_map(|w| pack(pieces, w, side)).min_by_key(texels)
}

/// Columns that shelves need, which do not turn pieces.
fn narrowest(pieces: &[Piece]) -> u32 {
    if pieces.len() > SKYLINE_PIECES { pieces.iter().map(|p| p.size.0).max().unwrap_or(1) } else { 1 }
}

/// Charts longer than a tile begin at one where that wastes less than a quarter of their length: fewer tiles, and fewer borders in them.
fn aligned(start: u64, length: u64) -> u64 {
    let tile = u64::from(TILE_SIDE);
    let next = start.next_multiple_of(tile);
    if length > tile && (next - start) * 4 <= length { next } else { start }
}

impl Piece {
    /// A piece that takes its whole box.
    pub(super) fn full(width: u32, height: u32) -> Self {
        Self { size: (width, height), outline: None }
    }

    /// Texels that it keeps others from, about.
    pub(super) fn taken(&self) -> u64 {
        match &self.outline {
            None => u64::from(self.size.0) * u64::from(self.size.1),
            Some([columns, _]) => columns.iter().map(|(low, high)| u64::from(high.saturating_sub(*low))).sum(),
        }
    }
}

#[cfg(test)]
mod tests;
