//! The tiles of a phase, in shards of consecutive tiles: which of them wait, which are done, which are given up. The rest is leased.
//!
//! A tile is exactly one of pending, leased, done, quarantined. Leased is what is none of the others: then the tile is in the `remaining`
//! of one held attempt, or of two where it is `twinned`. A lease never crosses a shard, so that one row of the store is all that a grant or
//! a chunk touches, and coordinators that share a database meet on different rows. A shard is a few sets kept as runs: its size follows the
//! work in flight, not the tiles. One row per tile was the alternative that lost: a million rows to insert before the first lease.

use super::{
    poison::{Ceilings, Charges, Suspicion},
    rule::Rule,
    verify::Checks,
};
use kiln_proto::{
    ids::WorkerId,
    tile::{TileIndex, TileRun, TileRuns},
};

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
    /// Tiles that nobody gets any more, because too many attempts at them failed.
    pub quarantined: TileRuns,
    /// Leased tiles that two attempts hold.
    pub twinned: TileRuns,
    /// How large leases may be where leases have failed.
    pub ceilings: Ceilings,
    /// Which single tiles have failed, and with whom.
    pub charges: Charges,
    /// Which tiles are done and wait for the opinion of another worker.
    pub checks: Checks,
}

/// What a valid segment turned out to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accepted {
    /// The first one of its tile: it counts.
    First,
    /// The first one of a tile that was given up: the hole is filled, and the job has counted it already.
    Filled,
    /// The tile is done.
    Known,
}

impl Shard {
    /// Shard `index` of a phase of `tiles` tiles, everything pending.
    #[must_use]
    pub fn fresh(index: u64, tiles: u64) -> Self {
        let run = TileRun { start: index * SHARD_TILES, end: ((index + 1) * SHARD_TILES).min(tiles) };
        Self { pending: TileRuns::from_run(run), ..Self::default() }
    }

    /// The first run of pending tiles.
    #[must_use]
    pub fn first(&self) -> Option<TileRun> {
        self.pending.runs().first().copied()
    }

    /// Takes up to `count` consecutive tiles: from `start` on, or where that is gone from the next pending tile behind it, or else from the
    /// first one. So a coordinator whose look at this shard is old still gets work, and `None` means that nothing waits here but what is to
    /// be avoided (see [`Charges::avoided`]). A lease ends at a ceiling.
    pub fn take(&mut self, start: TileIndex, count: u64, avoided: &TileRuns) -> Option<TileRun> {
        let free = self.pending.minus(avoided);
        let runs = free.runs();
        let run = runs.iter().find(|r| start.0 < r.end).or(runs.first())?;
        let first = if start.0 < run.end { run.start.max(start.0) } else { run.start };
        let end = run.end.min(first.saturating_add(count.max(1))).min(self.ceilings.end(TileIndex(first)));
        let taken = TileRun { start: first, end };
        self.pending.remove(taken);
        Some(taken)
    }

    /// Notes that a second attempt holds these tiles. Whether it may: every one of them is leased, and to one attempt only.
    pub fn twin(&mut self, run: TileRun) -> bool {
        let tiles = TileRuns::from_run(run);
        let open = [&self.pending, &self.done, &self.quarantined, &self.twinned];
        let fits = !run.is_empty() && open.iter().all(|set| set.intersection(&tiles).is_empty());
        if fits {
            self.twinned.insert(run);
        }
        fits
    }

    /// Puts back what an attempt did not deliver, but for tiles that somebody else delivered meanwhile or still holds.
    pub fn give_back(&mut self, tiles: &TileRuns) {
        let back = if Rule::Done.holds() { tiles.minus(&self.done) } else { tiles.clone() }.minus(&self.quarantined);
        let held = if Rule::TwinHolds.holds() { self.twinned.intersection(&back) } else { TileRuns::new() };
        self.twinned = self.twinned.minus(&back);
        self.pending = self.pending.union(&back.minus(&held));
    }

    /// Puts back what a failed attempt left: in halves, or charged where a single tile was leased. The tile that is quarantined by that.
    ///
    /// A tile that another attempt holds still waits for the outcome of that one.
    pub fn suspect(&mut self, of: &Suspicion<'_>) -> Option<TileIndex> {
        let rest = of.rest.minus(&self.done).minus(&self.quarantined);
        self.give_back(of.rest);
        if Rule::Halving.holds() {
            self.ceilings.lower(&rest, rest.len().div_ceil(2));
        }
        if of.leased.len() > 1 && Rule::Singles.holds() {
            return None;
        }
        let tile = rest.iter().next()?;
        self.charges.charge(tile, of.worker);
        if !self.pending.contains(tile) || !self.charges.is_poison(tile, of.connected) {
            return None;
        }
        self.pending.remove(TileRun { start: tile.0, end: tile.0 + 1 });
        self.quarantined.insert_tile(tile);
        Some(tile)
    }

    /// Gives quarantined tiles a fresh start.
    pub fn reopen(&mut self) {
        self.quarantined.iter().for_each(|tile| self.charges.forget(tile));
        self.ceilings.lift(&self.quarantined);
        self.pending = self.pending.union(&std::mem::take(&mut self.quarantined));
    }

    /// Puts tiles back that were done and whose segments are lost or not to be trusted.
    pub fn lose(&mut self, tiles: &TileRuns) {
        let lost = self.done.intersection(tiles);
        self.done = self.done.minus(&lost);
        self.checks.forget(&lost);
        self.pending = self.pending.union(&lost);
    }

    /// The workers that failed a tile which `by` has managed. Ask before [`Shard::accept`], which forgets them.
    #[must_use]
    pub fn refuted(&self, tile: TileIndex, by: WorkerId) -> Vec<WorkerId> {
        self.charges.workers(tile).filter(|worker| *worker != by).collect()
    }

    /// Marks a tile done, and says what its valid segment is worth.
    pub fn accept(&mut self, tile: TileIndex) -> Accepted {
        if self.done.contains(tile) && Rule::Once.holds() {
            return Accepted::Known;
        }
        let run = TileRun { start: tile.0, end: tile.0 + 1 };
        let filled = self.quarantined.contains(tile);
        for set in [&mut self.pending, &mut self.quarantined, &mut self.twinned] {
            set.remove(run);
        }
        self.done.insert(run);
        self.ceilings.lift(&TileRuns::from_run(run));
        self.charges.forget(tile);
        if filled { Accepted::Filled } else { Accepted::First }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use uuid::Uuid;

    fn run(start: u64, end: u64) -> TileRun {
        TileRun { start, end }
    }

    fn tiles(start: u64, end: u64) -> TileRuns {
        TileRuns::from_run(run(start, end))
    }

    fn none() -> TileRuns {
        TileRuns::new()
    }

    fn worker(n: u128) -> WorkerId {
        WorkerId(Uuid::from_u128(n))
    }

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
        let lease = shard.take(TileIndex(0), 4, &none()).unwrap();
        shard.give_back(&TileRuns::from_run(lease));
        assert_eq!(shard.accept(TileIndex(2)), Accepted::First, "late, but first");
        assert_eq!(shard.accept(TileIndex(2)), Accepted::Known);
        assert_eq!(shard.take(TileIndex(0), 100, &none()).unwrap(), run(0, 2));
        shard.give_back(&TileRuns::all(10));
        assert_eq!(shard.pending.len(), 9);
        shard.lose(&tiles(2, 3));
        assert_eq!((shard.pending.len(), shard.done.len()), (10, 0));
        assert_eq!(shard.accept(TileIndex(2)), Accepted::First);
    }

    #[test]
    fn only_tiles_of_this_shard_that_were_done_are_lost() {
        let mut shard = Shard::fresh(0, 10);
        shard.accept(TileIndex(3));
        shard.lose(&TileRuns::all(SHARD_TILES * 2));
        assert_eq!(shard, Shard::fresh(0, 10));
    }

    #[test]
    fn coordinators_with_the_same_view_all_find_work() {
        let mut shard = Shard::fresh(0, 12);
        let taken: Vec<TileRun> = (0..4).filter_map(|_| shard.take(TileIndex(4), 4, &none())).collect();
        assert_eq!(taken, [run(4, 8), run(8, 12), run(0, 4)]);
        let mut shard = Shard::fresh(0, 4);
        assert_eq!(shard.take(TileIndex(0), 1, &tiles(0, 3)), Some(run(3, 4)));
        assert_eq!(shard.take(TileIndex(0), 1, &tiles(0, 3)), None, "what is left is avoided");
    }

    #[test]
    fn a_failing_lease_is_halved_down_to_the_one_tile_that_is_charged() {
        let (mut shard, mut lengths) = (Shard::fresh(0, 8), vec![]);
        let mut failures = 0;
        let culprit = loop {
            let taken = shard.take(TileIndex(0), 8, &none()).unwrap();
            if !(taken.start..taken.end).contains(&5) {
                (taken.start..taken.end).for_each(|t| assert_eq!(shard.accept(TileIndex(t)), Accepted::First));
                continue;
            }
            lengths.push(taken.len());
            failures += 1;
            let suspicion = Suspicion { leased: taken, rest: &TileRuns::from_run(taken), worker: worker(failures % 2), connected: 2 };
            if let Some(tile) = shard.suspect(&suspicion) {
                break tile;
            }
        };
        assert_eq!((culprit, lengths.as_slice()), (TileIndex(5), [8, 4, 2, 1, 1, 1].as_slice()));
        assert_eq!(shard.quarantined, tiles(5, 6));
        assert_eq!(shard.take(TileIndex(0), 8, &none()), Some(run(6, 8)), "the others got a lease each");
        shard.reopen();
        assert!(shard.pending.contains(TileIndex(5)) && shard.charges == Charges::default());
        assert_eq!(shard.ceilings.of(TileIndex(5)), None);
    }

    #[test]
    fn a_hole_that_is_filled_late_is_told_from_a_first_delivery() {
        let mut shard = Shard { quarantined: tiles(1, 2), ..Shard::fresh(0, 1) };
        assert_eq!((shard.accept(TileIndex(1)), shard.accept(TileIndex(0))), (Accepted::Filled, Accepted::First));
        assert!(shard.quarantined.is_empty());
    }

    #[test]
    fn whoever_failed_what_another_managed_is_named() {
        let mut shard = Shard::fresh(0, 1);
        let one = shard.take(TileIndex(0), 1, &none()).unwrap();
        shard.suspect(&Suspicion { leased: one, rest: &tiles(0, 1), worker: worker(1), connected: 2 });
        assert_eq!(shard.refuted(TileIndex(0), worker(2)), [worker(1)]);
        assert_eq!(shard.refuted(TileIndex(0), worker(1)), []);
        shard.accept(TileIndex(0));
        assert_eq!(shard.refuted(TileIndex(0), worker(2)), []);
    }

    /// What a random history does next, with the number of the lease it does it to.
    #[derive(Debug, Clone)]
    enum Step {
        Take(u64, u64),
        Twin(usize),
        Deliver(usize),
        Fail(usize),
        Release(usize),
        Lose(u64),
        Reopen,
    }

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![
            (0u64..20, 1u64..8).prop_map(|(at, n)| Step::Take(at, n)),
            (0usize..4).prop_map(Step::Twin),
            (0usize..4).prop_map(Step::Deliver),
            (0usize..4).prop_map(Step::Fail),
            (0usize..4).prop_map(Step::Release),
            (0u64..16).prop_map(Step::Lose),
            Just(Step::Reopen),
        ]
    }

    proptest! {
        /// Whatever happens, a tile is in exactly one place, and twinned tiles are in two leases.
        #[test]
        fn every_tile_is_in_one_place(steps in prop::collection::vec(step(), 0..80)) {
            let mut shard = Shard::fresh(0, 16);
            let mut held: Vec<(TileRun, TileRuns)> = vec![];
            for (n, step) in steps.into_iter().enumerate() {
                let open = held.len().max(1);
                match step {
                    Step::Take(at, count) => held.extend(shard.take(TileIndex(at), count, &none()).map(|r| (r, TileRuns::from_run(r)))),
                    Step::Twin(k) => {
                        let last = held.get(k % open).and_then(|(_, rest)| rest.runs().last().copied());
                        held.extend(last.filter(|run| shard.twin(*run)).map(|run| (run, TileRuns::from_run(run))));
                    }
                    Step::Deliver(k) => if let Some(tile) = held.get(k % open).and_then(|(_, rest)| rest.iter().next()) {
                        prop_assert_eq!(shard.accept(tile), Accepted::First);
                        held.iter_mut().for_each(|(_, rest)| rest.remove(run(tile.0, tile.0 + 1)));
                    },
                    Step::Fail(k) if !held.is_empty() => {
                        let (leased, rest) = held.swap_remove(k % open);
                        shard.suspect(&Suspicion { leased, rest: &rest, worker: worker(n as u128 % 3), connected: 3 });
                    }
                    Step::Release(k) if !held.is_empty() => shard.give_back(&held.swap_remove(k % open).1),
                    Step::Lose(tile) => shard.lose(&tiles(tile, tile + 1)),
                    Step::Reopen => shard.reopen(),
                    Step::Fail(_) | Step::Release(_) => {}
                }
                for tile in (0..16).map(TileIndex) {
                    let leases = held.iter().filter(|(_, rest)| rest.contains(tile)).count();
                    let places = [&shard.pending, &shard.done, &shard.quarantined].iter().filter(|set| set.contains(tile)).count();
                    prop_assert_eq!(places + leases, if shard.twinned.contains(tile) { 2 } else { 1 }, "tile {}", tile);
                }
            }
        }
    }
}
