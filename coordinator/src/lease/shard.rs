//! The tiles of a phase, in shards of consecutive tiles: which of them wait, which of them are done. The rest is leased.
//!
//! A tile is pending, or done, or in the `remaining` of exactly one held attempt (and then perhaps done too, by a late delivery). A lease
//! never crosses a shard, so that one row of the store is all that a grant or a chunk touches, and coordinators that share a database
//! meet on different rows. A shard is two sets kept as runs: its size follows the work in flight, not the tiles. One row per tile was
//! the alternative that lost: a million rows to insert before the first lease.

use kiln_proto::tile::{TileIndex, TileRun, TileRuns};

/// Tiles of one shard: as many as the largest lease.
pub const SHARD_TILES: u64 = kiln_proto::limits::LEASE_TILES;

/// The shard of a tile.
#[must_use]
pub fn shard_of(tile: TileIndex) -> u64 {
    tile.0 / SHARD_TILES
}

/// One shard of a phase.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Shard {
    /// Tiles that wait for a worker.
    pub pending: TileRuns,
    /// Tiles whose segment is accepted.
    pub done: TileRuns,
}

impl Shard {
    /// Shard `index` of a phase of `tiles` tiles, everything pending.
    #[must_use]
    pub fn fresh(index: u64, tiles: u64) -> Self {
        let run = TileRun { start: index * SHARD_TILES, end: ((index + 1) * SHARD_TILES).min(tiles) };
        Self { pending: TileRuns::from_run(run), done: TileRuns::new() }
    }

    /// The first run of pending tiles.
    #[must_use]
    pub fn first(&self) -> Option<TileRun> {
        self.pending.runs().first().copied()
    }

    /// Takes up to `count` tiles from `start` on, as far as they are pending; `None` where `start` itself is not pending any more.
    pub fn take(&mut self, start: TileIndex, count: u64) -> Option<TileRun> {
        let run = self.pending.runs().iter().find(|r| r.start <= start.0 && start.0 < r.end)?;
        let taken = TileRun { start: start.0, end: run.end.min(start.0 + count.max(1)) };
        self.pending.remove(taken);
        Some(taken)
    }

    /// Puts back what an attempt did not deliver, but for tiles that somebody else delivered meanwhile.
    pub fn give_back(&mut self, tiles: &TileRuns) {
        self.pending = self.pending.union(&tiles.minus(&self.done));
    }

    /// Puts tiles back that were done and whose segments are lost. One that a held attempt still owes too is baked twice at worst.
    pub fn lose(&mut self, tiles: &TileRuns) {
        self.done = self.done.minus(tiles);
        self.pending = self.pending.union(tiles);
    }

    /// Marks a tile done. Whether this is its first valid segment.
    pub fn accept(&mut self, tile: TileIndex) -> bool {
        if self.done.contains(tile) {
            return false;
        }
        self.done.insert_tile(tile);
        self.pending.remove(TileRun { start: tile.0, end: tile.0 + 1 });
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_a_phase_exactly() {
        let tiles = 2 * SHARD_TILES + 5;
        let runs: Vec<TileRun> = (0..3).filter_map(|k| Shard::fresh(k, tiles).first()).collect();
        assert!(runs.windows(2).all(|w| w[0].end == w[1].start));
        assert_eq!((runs[0].start, runs[2].end), (0, tiles));
        assert_eq!(shard_of(TileIndex(SHARD_TILES)), 1);
    }

    #[test]
    fn a_tile_delivered_late_is_neither_leased_again_nor_given_back() {
        let mut shard = Shard::fresh(0, 10);
        let lease = shard.take(TileIndex(0), 4).unwrap();
        shard.give_back(&TileRuns::from_run(lease));
        assert!(shard.accept(TileIndex(2)), "late, but first");
        assert!(!shard.accept(TileIndex(2)));
        assert_eq!(shard.take(TileIndex(0), 100).unwrap(), TileRun { start: 0, end: 2 });
        assert_eq!(shard.take(TileIndex(0), 1), None);
        shard.give_back(&TileRuns::all(10));
        assert_eq!(shard.pending.len(), 9);
        shard.lose(&TileRuns::from_run(TileRun { start: 2, end: 3 }));
        assert_eq!((shard.pending.len(), shard.done.len()), (10, 0));
        assert!(shard.accept(TileIndex(2)));
    }
}
