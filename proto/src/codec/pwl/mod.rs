//! `pwl`: a texel's D radiances as a line with corners, the thesis's codec (7.2).
//!
//! A texel's samples are 8-bit RGB (see [`radiance_to_byte`](crate::units::radiance_to_byte)) walked in its surface's
//! [`Walk`](crate::grid::Walk) order. A rule keeps some of them, always the first and the last; what lies between two kept samples is
//! their straight line, rounded to whole levels per channel in integers, so that every decoder gives the same bytes. This module is the
//! reference decoder and the shared types; the rules that pick samples are the worker's. The alternative, a transform codec, compresses
//! better and cannot be read at one direction without decoding the rest; here one lookup is a binary search.

mod stats;

pub use stats::{BadErrorStats, ErrorStats};

use crate::grid::{SphericalGrid, Walk};

/// One direction's radiance, 8 bits a channel: red, green, blue.
pub type Sample = [u8; 3];

/// A sample that a rule kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kept {
    /// The direction, as depth in the grid.
    pub depth: u16,
    /// Its value: the radiance itself, or with the bounded rule a value within eps of it.
    pub rgb: Sample,
}

/// A walk written out as a table: which depth each step visits, and back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Order {
    depth_of: Vec<u16>,
    step_of: Vec<u16>,
}

impl Order {
    /// The order of `walk` over `grid`. Grids have at most 64 x 64 directions, so 16 bits hold any depth.
    #[must_use]
    pub fn new(grid: SphericalGrid, walk: Walk) -> Self {
        let table = |f: &dyn Fn(u32) -> u32| (0..grid.len()).map(|k| f(k) as u16).collect();
        Self { depth_of: table(&|step| walk.depth(grid, step)), step_of: table(&|depth| walk.step(grid, depth)) }
    }

    /// D, the number of directions: at least 2.
    #[must_use]
    pub fn len(&self) -> usize {
        self.depth_of.len()
    }

    /// Never: a grid has at least two directions.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.depth_of.is_empty()
    }

    /// The depth that the walk visits at `step` < D.
    #[must_use]
    pub fn depth(&self, step: usize) -> u16 {
        self.depth_of[step]
    }

    /// The step at which the walk visits `depth`, or `None` beyond the grid.
    #[must_use]
    pub fn step(&self, depth: u16) -> Option<usize> {
        self.step_of.get(usize::from(depth)).map(|s| usize::from(*s))
    }
}

/// Kept samples that are no texel of their walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BadRow {
    /// A depth that the grid does not have.
    #[error("kept sample {at} has depth {depth}, but there are only {directions} directions")]
    Depth {
        /// Which kept sample.
        at: usize,
        /// Its depth.
        depth: u16,
        /// D.
        directions: usize,
    },
    /// Not after the one before it.
    #[error("kept sample {at} does not come after the one before it")]
    Order {
        /// Which kept sample.
        at: usize,
    },
    /// The first or last direction of the walk is missing.
    #[error("the first or the last direction of the walk is not among the kept samples")]
    Ends,
}

/// Checks that `kept` begins with the walk's first direction, ends with its last and moves forward in between.
///
/// # Errors
/// The first fault found.
pub fn check_row(kept: &[Kept], order: &Order) -> Result<(), BadRow> {
    let mut next = 0;
    for (at, k) in kept.iter().enumerate() {
        let step = order.step(k.depth).ok_or(BadRow::Depth { at, depth: k.depth, directions: order.len() })?;
        if at == 0 && step != 0 {
            return Err(BadRow::Ends);
        }
        if step < next {
            return Err(BadRow::Order { at });
        }
        next = step + 1;
    }
    if next == order.len() { Ok(()) } else { Err(BadRow::Ends) }
}

/// `floor(a + (b - a) t / length + 1/2)` per channel for 0 <= t <= length, exactly; always between `a` and `b`.
#[must_use]
#[inline]
pub fn between(a: Sample, b: Sample, t: usize, length: usize) -> Sample {
    let (t, length) = (t as i32, length as i32); // both at most 4,095
    std::array::from_fn(|c| {
        let (a, b) = (i32::from(a[c]), i32::from(b[c]));
        // The numerator is 2 length (value + 1/2) >= 0, so that truncating division is the floor.
        ((2 * a * length + 2 * (b - a) * t + length) / (2 * length)) as u8
    })
}

/// The radiance at one direction of a checked row (see [`check_row`]), found by binary search; `None` for a depth beyond the grid or a
/// row without samples around it.
#[must_use]
pub fn sample_at(kept: &[Kept], order: &Order, depth: u16) -> Option<Sample> {
    let step = order.step(depth)?;
    let after = kept.partition_point(|k| order.step(k.depth).is_some_and(|s| s <= step));
    let a = kept.get(after.checked_sub(1)?)?;
    let from = order.step(a.depth)?;
    if from == step {
        return Some(a.rgb);
    }
    let b = kept.get(after)?;
    Some(between(a.rgb, b.rgb, step - from, order.step(b.depth)? - from))
}

/// All D radiances of a row, in depth order, into `out`.
///
/// # Errors
/// Rows that [`check_row`] refuses; `out` is then unspecified.
///
/// # Panics
/// Where `out` has not D elements.
pub fn decode_row(kept: &[Kept], order: &Order, out: &mut [Sample]) -> Result<(), BadRow> {
    assert_eq!(out.len(), order.len(), "one value per direction");
    check_row(kept, order)?;
    for pair in kept.windows(2) {
        let (from, to) = (usize::from(order.step_of[usize::from(pair[0].depth)]), usize::from(order.step_of[usize::from(pair[1].depth)]));
        for step in from..=to {
            out[usize::from(order.depth_of[step])] = between(pair[0].rgb, pair[1].rgb, step - from, to - from);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
