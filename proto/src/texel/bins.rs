//! Which triangles lie where in the texture: a list for each cell, cut into finer ones where a mesh is dense.
//!
//! A cell is as wide as a tile, which suits meshes of the texture's density. Of a scan with a million triangles in a small texture each
//! list would be walked for each of a thousand texels; there a cell is cut into 4, 16, … 1,024 blocks, the last of a texel each: the tiles
//! of such a texture take milliseconds instead of 20 s. A grid as fine as a texel everywhere lost: most of it would be empty, and large
//! triangles would stand in thousands of lists. Lists by the triangles' boxes lost too: that of a diagonal sliver meets half of all cells,
//! and a sheet of a hundred thousand of them took gigabytes. A triangle stands where its edges leave a place for it, row by row
//! ([`Flat::extent`]).
//!
//! Memory: 4 bytes for each triangle and cell that it meets, at most [`GROWTH`] times as much where cells are cut, [`LEAST_GROWTH`] times
//! once that would be more than [`ROOM`] entries.

use super::{
    flat::{Flat, SLACK},
    raster::BORDER,
};
use crate::tile::TILE_SIDE;
use std::ops::RangeInclusive;

/// Triangles of a block above which it is cut, if that helps.
const PER_BLOCK: usize = 32;
/// How often a cell may be cut in both directions: until a block is one texel.
const FINEST: u32 = TILE_SIDE.trailing_zeros();
/// How many times as long as that of the cell all lists of its blocks may be together: long triangles cross many.
const GROWTH: usize = 4;
/// The same for a texture whose lists are long already: enough for small triangles, which seldom stand in two blocks.
const LEAST_GROWTH: usize = 2;
/// Entries of all lists, 256 MiB, that cutting should not exceed.
const ROOM: usize = 1 << 26;
/// What of the longest list a finer level may leave, to be taken: about half, for slivers also stand in the blocks that they leave.
const SHORTER: [usize; 2] = [5, 8];

/// The triangles of a texture by place.
pub(super) struct Bins {
    columns: u32,
    rows: u32,
    cells: Vec<Blocks>,
    /// Of each block, and of all in the end.
    starts: Vec<usize>,
    /// Of each block those that may meet it, ascending.
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

/// A part of the texture that is laid out in squares.
#[derive(Debug, Clone, Copy)]
struct Grid {
    /// Texels along the side of a square.
    side: f64,
    /// Squares along u and v.
    count: [u32; 2],
    /// The first texel.
    first: [f64; 2],
    /// What belongs to it along u and v: on the texture's border also the [`BORDER`] beyond, which counts for the outermost squares.
    bounds: [[f64; 2]; 2],
}

impl Bins {
    /// Cost: linear in triangles, the cells that they meet and the rows of cells that their boxes meet.
    pub(super) fn new(flats: &[Flat], width: u32, height: u32) -> Self {
        let (columns, rows) = (width.div_ceil(TILE_SIDE), height.div_ceil(TILE_SIDE));
        let all: Vec<u32> = (0..flats.len() as u32).filter(|t| flats[*t as usize].inverse.is_some()).collect();
        let bounds = [columns, rows].map(|count| [-f64::from(BORDER), f64::from(count * TILE_SIDE + BORDER)]);
        let whole = Grid { side: f64::from(TILE_SIDE), count: [columns, rows], first: [0.0; 2], bounds };
        let (starts, coarse) = whole.sorted(&whole.lengths(&all, flats), &all, flats);
        let growth = (ROOM / coarse.len().max(1)).clamp(LEAST_GROWTH, GROWTH);
        let mut bins =
            Self { columns, rows, cells: Vec::with_capacity(starts.len()), starts: vec![], triangles: Vec::with_capacity(coarse.len()) };
        for cell in 0..columns * rows {
            let list = &coarse[starts[cell as usize]..starts[cell as usize + 1]];
            bins.cut([cell % columns, cell / columns], list, flats, growth);
        }
        bins.starts.push(bins.triangles.len());
        bins
    }

    /// Adds a cell. Of levels up to that where lists are short on average the finest is taken that has shortened the longest list by about
    /// half since the one taken before.
    fn cut(&mut self, cell: [u32; 2], list: &[u32], flats: &[Flat], growth: usize) {
        let finest = (0..FINEST).find(|level| list.len() <= PER_BLOCK << (2 * level)).unwrap_or(FINEST);
        let (mut level, mut longest, mut taken) = (0, list.len(), None);
        for finer in 1..=finest {
            let grid = self.grid(cell, finer);
            let lengths = grid.lengths(list, flats);
            if lengths.iter().sum::<usize>() > growth * list.len() {
                break;
            }
            let length = lengths.iter().copied().max().unwrap_or(0);
            if length * SHORTER[1] <= longest * SHORTER[0] {
                (level, longest, taken) = (finer, length, Some(lengths));
            }
        }
        let grid = self.grid(cell, level);
        let lengths = taken.unwrap_or_else(|| grid.lengths(list, flats));
        let (starts, triangles) = grid.sorted(&lengths, list, flats);
        let before = self.triangles.len();
        self.cells.push(Blocks { cell, level, first: self.starts.len() });
        self.starts.extend(starts[..starts.len() - 1].iter().map(|s| before + s));
        self.triangles.extend(triangles);
    }

    /// The blocks of a cell.
    fn grid(&self, cell: [u32; 2], level: u32) -> Grid {
        let first = cell.map(|c| f64::from(c * TILE_SIDE));
        let bounds = [0, 1].map(|axis| {
            let beyond = |is_border: bool| if is_border { f64::from(BORDER) } else { 0.0 };
            let is_last = cell[axis] + 1 == [self.columns, self.rows][axis];
            [first[axis] - beyond(cell[axis] == 0), first[axis] + f64::from(TILE_SIDE) + beyond(is_last)]
        });
        Grid { side: f64::from(TILE_SIDE >> level), count: [1 << level; 2], first, bounds }
    }

    /// The triangles that may meet the texel's block, ascending.
    pub(super) fn at(&self, x: u32, y: u32) -> &[u32] {
        let blocks = self.cells[(y / TILE_SIDE * self.columns + x / TILE_SIDE) as usize];
        let shift = FINEST - blocks.level;
        self.list(blocks, (x % TILE_SIDE) >> shift, (y % TILE_SIDE) >> shift)
    }

    /// The triangles that come within `reach` texels of a texel's square, each at least once, in no order; a few that are farther. `reach`
    /// is at most [`BORDER`].
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

impl Grid {
    /// The squares that a triangle may meet: rows, and columns of each.
    fn squares(self, flat: &Flat) -> impl Iterator<Item = (u32, RangeInclusive<u32>)> {
        let square = move |axis: usize, v: f64| (((v - self.first[axis]) / self.side).floor().max(0.0) as u32).min(self.count[axis] - 1);
        let [[left, right], [bottom, top]] = self.bounds;
        let last = self.count[1] - 1;
        (square(1, flat.low.y - SLACK)..=square(1, flat.high.y + SLACK)).filter_map(move |y| {
            let border = |row: u32| self.first[1] + f64::from(row) * self.side;
            let (low, high) = (if y == 0 { bottom } else { border(y) }, if y == last { top } else { border(y + 1) });
            let (from, to) = flat.extent(low, high).filter(|(from, to)| *from < right && *to >= left)?;
            Some((y, square(0, from)..=square(0, to)))
        })
    }

    /// How long the list of each square is, row by row.
    fn lengths(self, list: &[u32], flats: &[Flat]) -> Vec<usize> {
        let mut lengths = vec![0; (self.count[0] * self.count[1]) as usize];
        self.each(list, flats, |at, _| lengths[at] += 1);
        lengths
    }

    fn each(self, list: &[u32], flats: &[Flat], mut visit: impl FnMut(usize, u32)) {
        for t in list {
            for (y, xs) in self.squares(&flats[*t as usize]) {
                xs.for_each(|x| visit((y * self.count[0] + x) as usize, *t));
            }
        }
    }

    /// Triangles sorted into lists of these `lengths`: where each starts, and all of them one after the other.
    fn sorted(self, lengths: &[usize], list: &[u32], flats: &[Flat]) -> (Vec<usize>, Vec<u32>) {
        let mut starts = vec![0];
        for length in lengths {
            starts.push(starts[starts.len() - 1] + length);
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[starts.len() - 1]];
        self.each(list, flats, |at, t| {
            triangles[next[at]] = t;
            next[at] += 1;
        });
        (starts, triangles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet of 1,024 x 1,024 texels of parallel slivers from its left to its right, which rise by `rise` texels.
    fn sheet(count: u32, rise: f32) -> Vec<Flat> {
        let at = |k: u32| -rise + (1024.0 + rise) * k as f32 / (count / 2) as f32;
        let uv = |x: f32, y: f32| [x / 1024.0, y / 1024.0];
        let pair = |k: u32| {
            let (low, high) = (at(k), at(k + 1));
            let [a, b, c, d] = [uv(0.0, low), uv(1024.0, low + rise), uv(1024.0, high + rise), uv(0.0, high)];
            [[a, b, c], [a, c, d]]
        };
        (0..count / 2).flat_map(pair).map(|uv| Flat::new(uv, 1024.0, 1024.0)).collect()
    }

    #[test]
    fn diagonal_slivers_stand_only_in_the_cells_that_they_cross() {
        let flats = sheet(10_000, 1024.0);
        let bins = Bins::new(&flats, 1024, 1024);
        // Within the texture a sliver crosses 2 x 32 cells at most, half of that on average: by its box ten times as many.
        let crossed = 10_000 * 32;
        assert!(bins.triangles.len() < 3 * crossed, "{}", bins.triangles.len());
        let longest = (0..1024 * 1024).step_by(37).map(|k| bins.at(k % 1024, k / 1024).len()).max().unwrap();
        // 10,000 over 2,048 rows: 5 a texel; a cell is 64 rows high across its diagonal, and is cut once.
        assert!(longest < 64 * 5 * 2 / 3, "{longest}");
    }

    #[test]
    fn a_cell_is_cut_only_where_that_shortens_its_lists() {
        // Each covers the cell; and small ones.
        let cover: Vec<Flat> = (0..200).map(|_| Flat::new([[-1.0, -1.0], [5.0, -1.0], [-1.0, 5.0]], 32.0, 32.0)).collect();
        let bins = Bins::new(&cover, 32, 32);
        assert_eq!((bins.cells[0].level, bins.triangles.len()), (0, 200));
        let small = |k: u32| {
            let [x, y] = [(k % 16) as f32 / 16.0 + 0.01, (k / 16) as f32 / 16.0 + 0.01];
            Flat::new([[x, y], [x + 0.02, y], [x, y + 0.02]], 32.0, 32.0)
        };
        let bins = Bins::new(&(0..256).map(small).collect::<Vec<Flat>>(), 32, 32);
        assert_eq!((bins.cells[0].level, bins.triangles.len()), (2, 256));
    }
}
