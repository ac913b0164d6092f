//! Tiles: the 32 x 32-texel cells of a surface's texture in Morton order, and sets of tile indices kept as runs.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Texels along one side of a tile.
pub const TILE_SIDE: u32 = 32;

/// The number of a tile within one phase of a job: surfaces in order, non-empty cells in Morton order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileIndex(pub u64);

impl fmt::Display for TileIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A cell of the 32-texel grid laid over a surface's texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Cell {
    /// Column of the cell: texels 32 x .. 32 x + 31.
    pub x: u16,
    /// Row of the cell; row 0 holds v = 0.
    pub y: u16,
}

impl Cell {
    /// The Morton code of the cell: x in the even bits, y in the odd ones.
    #[must_use]
    pub fn morton(self) -> u32 {
        spread(self.x) | (spread(self.y) << 1)
    }
}

fn spread(v: u16) -> u32 {
    let mut v = u32::from(v);
    v = (v | (v << 8)) & 0x00ff_00ff;
    v = (v | (v << 4)) & 0x0f0f_0f0f;
    v = (v | (v << 2)) & 0x3333_3333;
    (v | (v << 1)) & 0x5555_5555
}

/// The tiles `start .. end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TileRun {
    /// First tile.
    pub start: u64,
    /// One past the last tile.
    pub end: u64,
}

impl TileRun {
    /// Number of tiles.
    #[must_use]
    pub fn len(self) -> u64 {
        self.end.saturating_sub(self.start)
    }

    /// Whether the run holds no tile.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.end <= self.start
    }
}

/// A set of tile indices as sorted, disjoint, non-adjacent, non-empty runs: a job of a million tiles whose work is nearly done is a
/// handful of these.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "Vec<TileRun>", into = "Vec<TileRun>")]
pub struct TileRuns(Vec<TileRun>);

impl TileRuns {
    /// The empty set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The set 0 .. n.
    #[must_use]
    pub fn all(n: u64) -> Self {
        Self::from_run(TileRun { start: 0, end: n })
    }

    /// The set of one run.
    #[must_use]
    pub fn from_run(run: TileRun) -> Self {
        Self(if run.is_empty() { vec![] } else { vec![run] })
    }

    /// The runs, in order.
    #[must_use]
    pub fn runs(&self) -> &[TileRun] {
        &self.0
    }

    /// Number of tiles in the set.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.0.iter().map(|r| r.len()).sum()
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether `tile` is in the set.
    #[must_use]
    pub fn contains(&self, tile: TileIndex) -> bool {
        let after = self.0.partition_point(|r| r.start <= tile.0);
        after > 0 && tile.0 < self.0[after - 1].end
    }

    /// The tiles in order.
    pub fn iter(&self) -> impl Iterator<Item = TileIndex> + '_ {
        self.0.iter().flat_map(|r| (r.start..r.end).map(TileIndex))
    }

    /// Adds a run.
    pub fn insert(&mut self, run: TileRun) {
        if run.is_empty() {
            return;
        }
        let first = self.0.partition_point(|r| r.end < run.start);
        let last = self.0.partition_point(|r| r.start <= run.end);
        let merged = self.0[first..last].iter().fold(run, |m, r| TileRun { start: m.start.min(r.start), end: m.end.max(r.end) });
        self.0.splice(first..last, [merged]);
    }

    /// Adds one tile.
    pub fn insert_tile(&mut self, tile: TileIndex) {
        self.insert(TileRun { start: tile.0, end: tile.0 + 1 });
    }

    /// Removes a run.
    pub fn remove(&mut self, run: TileRun) {
        if run.is_empty() {
            return;
        }
        let mut kept = Vec::with_capacity(self.0.len() + 1);
        for r in &self.0 {
            let left = TileRun { start: r.start, end: r.end.min(run.start) };
            let right = TileRun { start: r.start.max(run.end), end: r.end };
            kept.extend([left, right].into_iter().filter(|p| !p.is_empty()));
        }
        self.0 = kept;
    }

    /// The tiles of either set.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = self.clone();
        other.0.iter().for_each(|r| out.insert(*r));
        out
    }

    /// The tiles of both sets. Cost: the number of runs.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let (mut out, mut a, mut b) = (vec![], self.0.iter().peekable(), other.0.iter().peekable());
        while let (Some(x), Some(y)) = (a.peek(), b.peek()) {
            let both = TileRun { start: x.start.max(y.start), end: x.end.min(y.end) };
            if !both.is_empty() {
                out.push(both);
            }
            if x.end < y.end {
                a.next()
            } else {
                b.next()
            };
        }
        // Runs of a set do not touch, so that what lies in both of two sets does not either.
        Self(out)
    }

    /// The tiles of this set that are not in `other`.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        let mut out = self.clone();
        other.0.iter().for_each(|r| out.remove(*r));
        out
    }
}

impl FromIterator<TileIndex> for TileRuns {
    fn from_iter<I: IntoIterator<Item = TileIndex>>(tiles: I) -> Self {
        let mut out = Self::new();
        tiles.into_iter().for_each(|t| out.insert_tile(t));
        out
    }
}

/// Runs that are empty, out of order, overlapping or touching: not something this program wrote.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("tile runs are not sorted, disjoint and non-empty")]
pub struct BadRuns;

impl TryFrom<Vec<TileRun>> for TileRuns {
    type Error = BadRuns;
    fn try_from(runs: Vec<TileRun>) -> Result<Self, BadRuns> {
        let ordered = runs.windows(2).all(|w| w[0].end < w[1].start) && runs.iter().all(|r| !r.is_empty());
        if ordered { Ok(Self(runs)) } else { Err(BadRuns) }
    }
}

impl From<TileRuns> for Vec<TileRun> {
    fn from(runs: TileRuns) -> Self {
        runs.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn morton_order_interleaves_x_first() {
        let code = |x, y| Cell { x, y }.morton();
        assert_eq!([code(0, 0), code(1, 0), code(0, 1), code(1, 1), code(2, 0)], [0, 1, 2, 3, 4]);
        assert_eq!(code(u16::MAX, u16::MAX), u32::MAX);
    }

    proptest! {
        /// Any history of inserts and removals leaves the same set as the naive one, in canonical form.
        #[test]
        fn runs_agree_with_a_set(ops in prop::collection::vec((any::<bool>(), 0u64..60, 0u64..12), 0..40)) {
            let (mut runs, mut set) = (TileRuns::new(), BTreeSet::new());
            for (add, start, len) in ops {
                let run = TileRun { start, end: start + len };
                if add { runs.insert(run); set.extend(run.start..run.end); }
                else { runs.remove(run); set.retain(|t| !(run.start..run.end).contains(t)); }
                prop_assert!(TileRuns::try_from(runs.runs().to_vec()).is_ok());
                prop_assert!(runs.iter().map(|t| t.0).eq(set.iter().copied()));
                prop_assert_eq!(runs.len(), set.len() as u64);
                prop_assert!((0..80).all(|t| runs.contains(TileIndex(t)) == set.contains(&t)));
            }
        }

        #[test]
        fn union_and_minus_agree_with_sets(a in prop::collection::btree_set(0u64..50, 0..30), b in prop::collection::btree_set(0u64..50, 0..30)) {
            let runs = |s: &BTreeSet<u64>| s.iter().copied().map(TileIndex).collect::<TileRuns>();
            prop_assert_eq!(runs(&a).union(&runs(&b)), runs(&a.union(&b).copied().collect()));
            prop_assert_eq!(runs(&a).intersection(&runs(&b)), runs(&a.intersection(&b).copied().collect()));
            prop_assert_eq!(runs(&a).minus(&runs(&b)), runs(&a.difference(&b).copied().collect()));
        }
    }
}
