//! Skyline packing: pieces, longest first, sink onto the skyline of those before them, in the place and of the four turns that leave the
//! texture lowest.
//!
//! What counts is the outline of a piece from below, not its box: a triangle's tip sinks between two others (the "Tetris" of Lévy et al.
//! 2002, Least Squares Conformal Maps, section 4). Cost: pieces x columns x columns of a piece, bounded by trying fewer places where that
//! is too much.

use super::{GAP, Packed, Piece, Place, aligned};

/// Columns compared for one packing, about: a second.
const WORK: u64 = 400_000_000;

/// A piece as turned: what it takes of each of its columns.
struct Turned {
    turns: u8,
    width: u32,
    height: u32,
    /// First and last + 1 taken row of each column.
    columns: Vec<(u32, u32)>,
    /// The lowest taken row within a gap of each column, from a gap before the first to a gap behind the last.
    low: Vec<u32>,
}

/// A place that a piece may take: the fields are compared in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    top: u64,
    waste: u64,
    turned: usize,
    x: u32,
    y: u64,
}

pub(super) fn pack(pieces: &[Piece], width: u32, height: u32) -> Option<Packed> {
    let taken: u64 = pieces.iter().map(Piece::taken).sum();
    let outside = |p: &Piece| p.size.0.min(p.size.1) > width.min(height) || p.size.0.max(p.size.1) > width.max(height);
    if taken > u64::from(width) * u64::from(height) || pieces.iter().any(outside) {
        return None;
    }
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    let sides = |p: &Piece| (p.size.0.max(p.size.1), p.size.0.min(p.size.1));
    order.sort_unstable_by_key(|i| (std::cmp::Reverse(sides(&pieces[*i])), *i));
    let work: u64 = pieces.iter().map(|p| 2 * u64::from(width) * (u64::from(p.size.0) + u64::from(p.size.1))).sum();
    let step = work.div_ceil(WORK).max(1) as u32;
    let mut skyline = vec![0u64; width as usize];
    let mut packed = Packed { places: vec![Place::default(); pieces.len()], width: 0, height: 0 };
    for i in order {
        let turned = turns(&pieces[i]);
        let best = best(&turned, &skyline, width, height, step)?;
        let piece = &turned[best.turned];
        for (c, (_, high)) in piece.columns.iter().enumerate() {
            let column = &mut skyline[best.x as usize + c];
            *column = (*column).max(best.y + u64::from(*high));
        }
        packed.places[i] = Place { origin: (best.x, best.y as u32), turns: piece.turns };
        packed.width = packed.width.max(best.x + piece.width);
        packed.height = packed.height.max(best.y as u32 + piece.height);
    }
    Some(packed)
}

/// The best place for a piece, `None` where it would stand out of the texture everywhere.
fn best(turned: &[Turned], skyline: &[u64], width: u32, height: u32, step: u32) -> Option<Candidate> {
    let mut best: Option<Candidate> = None;
    for (index, piece) in turned.iter().enumerate().filter(|(_, t)| t.width <= width && t.height <= height) {
        let last = width - piece.width;
        let Some(most) = best.map_or(u64::from(height), |b| b.top).checked_sub(u64::from(piece.height)) else { continue };
        // The last place too: a piece as wide as the texture has no other, and a border needs no gap.
        for x in (0..=last).step_by(step as usize).chain((!last.is_multiple_of(step)).then_some(last)) {
            let x = u32::try_from(aligned(u64::from(x), u64::from(piece.width))).map_or(x, |a| if a <= last { a } else { x });
            let Some(y) = rest(piece, skyline, x, most) else { continue };
            let snapped = aligned(y, u64::from(piece.height));
            let y = if snapped + u64::from(piece.height) <= u64::from(height) { snapped } else { y };
            let top = y + u64::from(piece.height);
            if top > u64::from(height) || best.is_some_and(|b| top > b.top) {
                continue;
            }
            let below = piece.columns.iter().zip(&skyline[x as usize..]);
            let waste = below.map(|((low, _), line)| (y + u64::from(*low)).saturating_sub(*line)).sum();
            let candidate = Candidate { top, waste, turned: index, x, y };
            if best.is_none_or(|b| candidate < b) {
                best = Some(candidate);
            }
        }
    }
    best
}

/// The lowest row on which a piece may stand in column `x`; `None` where that is above `most`.
fn rest(piece: &Turned, skyline: &[u64], x: u32, most: u64) -> Option<u64> {
    let mut y = 0;
    let first = i64::from(x) - GAP as i64;
    for (k, low) in piece.low.iter().enumerate() {
        let column = first + k as i64;
        if (0..skyline.len() as i64).contains(&column) && skyline[column as usize] > 0 {
            y = y.max((skyline[column as usize] + GAP).saturating_sub(u64::from(*low)));
            if y > most {
                return None;
            }
        }
    }
    Some(y)
}

/// The ways in which a piece may lie that differ.
fn turns(piece: &Piece) -> Vec<Turned> {
    let (width, height) = piece.size;
    let wide = |v: &[(u16, u16)]| v.iter().map(|(a, b)| (u32::from(*a), u32::from(*b))).collect::<Vec<_>>();
    let flip = |v: &[(u32, u32)], side: u32| v.iter().map(|(low, high)| (side - high, side - low)).collect::<Vec<_>>();
    let reversed = |mut v: Vec<(u32, u32)>| {
        v.reverse();
        v
    };
    match &piece.outline {
        None => {
            let full = |turns, width: u32, height: u32| Turned::new(turns, width, height, vec![(0, height); width as usize]);
            if width == height { vec![full(0, width, height)] } else { vec![full(0, width, height), full(1, height, width)] }
        }
        Some([columns, rows]) => {
            let (columns, rows) = (wide(columns), wide(rows));
            vec![
                Turned::new(0, width, height, columns.clone()),
                Turned::new(1, height, width, reversed(rows.clone())),
                Turned::new(2, width, height, reversed(flip(&columns, height))),
                Turned::new(3, height, width, flip(&rows, width)),
            ]
        }
    }
}

impl Turned {
    fn new(turns: u8, width: u32, height: u32, columns: Vec<(u32, u32)>) -> Self {
        let gap = GAP as usize;
        let around = |k: usize| &columns[k.saturating_sub(2 * gap)..(k + 1).min(columns.len())];
        let low = (0..columns.len() + 2 * gap).map(|k| around(k).iter().map(|(low, _)| *low).min().unwrap_or(0)).collect();
        Self { turns, width, height, columns, low }
    }
}
