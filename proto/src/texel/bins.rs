//! Which triangles lie where in the texture: a list for each cell, cut into finer ones where a mesh is dense.
//!
//! A cell is as wide as a tile, which suits meshes of the texture's density. Of a scan with a million triangles in a small texture each list
//! would be walked for each of a thousand texels; there a cell is cut into 4, 16, … 1,024 blocks, the last of a texel each: the tiles of such a
//! texture take milliseconds instead of 20 s. A grid as fine as a texel everywhere lost: most of it would be empty, and large triangles would
//! stand in thousands of lists. Memory: 4 bytes for each triangle and cell that it touches, at most [`GROWTH`] times as much where cells are
//! cut.

use super::flat::{Flat, SLACK};
use crate::tile::TILE_SIDE;
use std::ops::RangeInclusive;

/// Triangles of a block above which it is cut, if that helps.
const PER_BLOCK: usize = 32;
/// How often a cell may be cut in both directions: until a block is one texel.
const FINEST: u32 = TILE_SIDE.trailing_zeros();
/// How many times as long as that of the cell all lists of its blocks may be together: long triangles cross many.
const GROWTH: usize = 4;

/// The triangles of a texture by place.
pub(super) struct Bins {
    columns: u32,
    rows: u32,
    cells: Vec<Blocks>,
    /// Of each block, and of all in the end.
    starts: Vec<usize>,
    /// Of each block those whose box meets it, ascending.
    triangles: Vec<u32>,
}

/// The blocks of a cell: `4^level` of them, row by row.
#[derive(Debug, Clone, Copy)]
struct Blocks {
    /// Column and row of the cell.
    cell: [u32; 2],
    level: u32,
    /// Index of the first one.
    first: usize,
}

impl Bins {
    /// Cost: linear in triangles and the cells that they touch.
    pub(super) fn new(flats: &[Flat], width: u32, height: u32) -> Self {
        let (columns, rows) = (width.div_ceil(TILE_SIDE), height.div_ceil(TILE_SIDE));
        let whole = Blocks { cell: [0, 0], level: 0, first: 0 };
        let all: Vec<u32> = (0..flats.len() as u32).filter(|t| flats[*t as usize].inverse.is_some()).collect();
        let (starts, coarse) = sorted(&all, columns * rows, |t| {
            let [xs, ys] = whole.span(&flats[t as usize], 1, [columns, rows]);
            (xs, ys, columns)
        });
        let mut bins = Self { columns, rows, cells: Vec::with_capacity(starts.len()), starts: vec![], triangles: vec![] };
        for cell in 0..columns * rows {
            let list = &coarse[starts[cell as usize]..starts[cell as usize + 1]];
            bins.cut([cell % columns, cell / columns], list, flats);
        }
        bins.starts.push(bins.triangles.len());
        bins
    }

    /// Adds a cell.
    fn cut(&mut self, cell: [u32; 2], list: &[u32], flats: &[Flat]) {
        let blocks = |level: u32| Blocks { cell, level, first: self.starts.len() };
        let mut level = (0..FINEST).find(|level| list.len() <= PER_BLOCK << (2 * level)).unwrap_or(FINEST);
        let entries = |level: u32| -> usize {
            list.iter().map(|t| blocks(level).of(&flats[*t as usize]).iter().map(|r| r.clone().count()).product::<usize>()).sum()
        };
        while level > 0 && entries(level) > GROWTH * list.len() {
            level -= 1;
        }
        let blocks = blocks(level);
        let side = 1 << level;
        let (starts, triangles) = sorted(list, side * side, |t| {
            let [xs, ys] = blocks.of(&flats[t as usize]);
            (xs, ys, side)
        });
        let before = self.triangles.len();
        self.starts.extend(starts[..starts.len() - 1].iter().map(|s| before + s));
        self.triangles.extend(triangles);
        self.cells.push(blocks);
    }

    /// The triangles whose boxes meet the texel's block, ascending.
    pub(super) fn at(&self, x: u32, y: u32) -> &[u32] {
        let blocks = self.cells[(y / TILE_SIDE * self.columns + x / TILE_SIDE) as usize];
        let shift = FINEST - blocks.level;
        self.list(blocks, (x % TILE_SIDE) >> shift, (y % TILE_SIDE) >> shift)
    }

    /// The triangles whose boxes come within `reach` texels of a texel's square, each at least once, in no order; a few that are farther.
    pub(super) fn around(&self, x: u32, y: u32, reach: u32) -> impl Iterator<Item = u32> + '_ {
        let span = |at: u32, cells: u32| (at.saturating_sub(reach), (at + reach).min(cells * TILE_SIDE - 1));
        let ((x0, x1), (y0, y1)) = (span(x, self.columns), span(y, self.rows));
        let cells = move |low: u32, high: u32| low / TILE_SIDE..=high / TILE_SIDE;
        cells(y0, y1).flat_map(move |cy| cells(x0, x1).map(move |cx| self.cells[(cy * self.columns + cx) as usize])).flat_map(
            move |blocks| {
                let shift = FINEST - blocks.level;
                let within = |low: u32, high: u32, cell: u32| {
                    let first = cell * TILE_SIDE;
                    (low.max(first) - first) >> shift..=(high.min(first + TILE_SIDE - 1) - first) >> shift
                };
                let (xs, ys) = (within(x0, x1, blocks.cell[0]), within(y0, y1, blocks.cell[1]));
                ys.flat_map(move |y| xs.clone().flat_map(move |x| self.list(blocks, x, y).iter().copied()))
            },
        )
    }

    fn list(&self, blocks: Blocks, x: u32, y: u32) -> &[u32] {
        let block = blocks.first + ((y << blocks.level) + x) as usize;
        &self.triangles[self.starts[block]..self.starts[block + 1]]
    }
}

impl Blocks {
    /// The blocks that a triangle's box meets, by column and row.
    fn of(self, flat: &Flat) -> [RangeInclusive<u32>; 2] {
        self.span(flat, 1 << self.level, [1 << self.level; 2])
    }

    /// The same of blocks of which `per_cell` stand in a cell and `count` along each side; what lies beside them counts for the outermost.
    fn span(self, flat: &Flat, per_cell: u32, count: [u32; 2]) -> [RangeInclusive<u32>; 2] {
        let side = f64::from(TILE_SIDE / per_cell);
        [0, 1].map(|axis| {
            let first = f64::from(self.cell[axis] * TILE_SIDE);
            let block = |v: f64| (((v - first) / side).floor().max(0.0) as u32).min(count[axis] - 1);
            block(flat.low[axis] - SLACK)..=block(flat.high[axis] + SLACK)
        })
    }
}

/// Triangles sorted into `count` lists, whose rows are `stride` long: where each starts, and all of them one after the other. `place` tells
/// columns, rows and stride.
fn sorted(list: &[u32], count: u32, place: impl Fn(u32) -> (RangeInclusive<u32>, RangeInclusive<u32>, u32)) -> (Vec<usize>, Vec<u32>) {
    let mut starts = vec![0usize; count as usize + 1];
    let each = |visit: &mut dyn FnMut(usize, u32)| {
        for t in list {
            let (xs, ys, stride) = place(*t);
            ys.for_each(|y| xs.clone().for_each(|x| visit((y * stride + x) as usize, *t)));
        }
    };
    each(&mut |at, _| starts[at + 1] += 1);
    for at in 1..starts.len() {
        starts[at] += starts[at - 1];
    }
    let mut next = starts.clone();
    let mut triangles = vec![0; starts[starts.len() - 1]];
    each(&mut |at, t| {
        triangles[next[at]] = t;
        next[at] += 1;
    });
    (starts, triangles)
}
