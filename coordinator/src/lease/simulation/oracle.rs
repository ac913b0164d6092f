//! What must be true, counted naively: one list entry a charge, one map entry a tile, no runs and no sets of the core's own.

use super::{
    super::{Accepted, Attempt, Event, Kind},
    Promise,
    farm::{CAP, Farm, Lease, SHARD},
};
use crate::job::{Job, OnPoison};
use kiln_proto::{
    ids::WorkerId,
    tile::{TileIndex, TileRuns},
};
use std::collections::{BTreeMap, BTreeSet};

/// Job and tile.
type At = (usize, u64);

#[derive(Default)]
pub(super) struct Oracle {
    charges: BTreeMap<At, Vec<WorkerId>>,
    ceilings: BTreeMap<At, u64>,
    /// Holes that were filled: nobody verifies them.
    pub(super) filled: BTreeSet<At>,
    /// Jobs with tiles that nobody could check.
    pub(super) waived: BTreeSet<usize>,
    /// What has come to pass.
    pub(super) met: BTreeSet<&'static str>,
}

/// What an event must do to an attempt.
#[derive(Debug, Default)]
pub(super) struct Expected {
    ends: bool,
    quarantined: Option<u64>,
}

impl Oracle {
    pub(super) fn forget(&mut self, j: usize) {
        self.charges.retain(|(job, _), _| *job != j);
        self.ceilings.retain(|(job, _), _| *job != j);
        self.filled.retain(|(job, _)| *job != j);
    }

    pub(super) fn fresh_start(&mut self, j: usize, tile: u64) {
        self.charges.remove(&(j, tile));
        self.ceilings.remove(&(j, tile));
    }

    fn workers(&self, at: At) -> BTreeSet<WorkerId> {
        self.charges.get(&at).into_iter().flatten().copied().collect()
    }

    /// A tile's first valid segment.
    pub(super) fn accepted(&mut self, j: usize, tile: u64, accepted: Accepted, refuted: &[WorkerId], by: WorkerId) -> Promise {
        let failed: Vec<WorkerId> = self.workers((j, tile)).into_iter().filter(|worker| *worker != by).collect();
        if failed != refuted {
            return Err(format!("tile {tile} was failed by {failed:?}, and {refuted:?} are refuted"));
        }
        self.fresh_start(j, tile);
        if !failed.is_empty() {
            self.met.insert("a failure refuted");
        }
        if accepted == Accepted::Filled {
            self.met.insert("a hole filled");
            self.filled.insert((j, tile));
        }
        Ok(())
    }

    /// Whether an attempt's delivery had to be taken.
    pub(super) fn may_deliver(&mut self, lease: &Lease, fits: bool) -> Promise {
        self.met.insert(match lease.state {
            Attempt::Held { .. } => "a delivery",
            Attempt::Expired => "a late delivery",
            _ => "a delivery of a fenced or finished attempt",
        });
        let may = matches!(lease.state, Attempt::Held { .. } | Attempt::Expired);
        let name = lease.state.name();
        match (may, fits) {
            (true, false) => Err(format!("good work of an attempt that is {name} was thrown away")),
            (false, true) => Err(format!("an attempt that is {name} delivered")),
            _ => Ok(()),
        }
    }
}

impl Farm {
    fn is_open(&self, lease: &Lease) -> bool {
        self.jobs[lease.job].open == Some(lease.phase) && lease.kind != Kind::Check
    }

    /// What an attempt still owes for certain.
    fn owed(&self, lease: &Lease) -> Vec<u64> {
        let shards = &self.jobs[lease.job].shards;
        let is_open = |tile: &TileIndex| {
            let shard = &shards[(tile.0 / SHARD) as usize];
            !shard.done.contains(*tile) && !shard.quarantined.contains(*tile)
        };
        lease.remaining().into_iter().flat_map(TileRuns::iter).filter(is_open).map(|tile| tile.0).collect()
    }

    /// What an event will have to do, and the naive books of it.
    pub(super) fn expect(&mut self, lease: &Lease, event: &Event) -> Promise<Expected> {
        let Attempt::Held { deadline, cap, remaining } = &lease.state else { return Ok(Expected::default()) };
        let late = self.now >= *deadline.min(cap);
        let blamed = match event {
            Event::Tick | Event::Heartbeat { .. } => late,
            Event::Fail | Event::Refuse => true,
            Event::Complete => !remaining.is_empty(),
            Event::Deliver(_) | Event::Overtaken(_) | Event::Release | Event::Fence => false,
        };
        let mut expected = Expected { ends: blamed, quarantined: None };
        if !blamed || !self.is_open(lease) {
            return Ok(expected);
        }
        let owed = self.owed(lease);
        for tile in &owed {
            let most = self.oracle.ceilings.entry((lease.job, *tile)).or_insert(u64::MAX);
            *most = (*most).min((owed.len() as u64).div_ceil(2));
        }
        if let ([tile], 1) = (owed.as_slice(), lease.run.len()) {
            let at = (lease.job, *tile);
            self.oracle.charges.entry(at).or_default().push(lease.worker);
            let enough = self.oracle.workers(at).len() >= 2 || self.connected.len() < 2;
            let others = self.leases.iter().filter(|l| l.token != lease.token && l.job == lease.job && l.phase == lease.phase);
            let held = others.filter(|l| l.kind != Kind::Check).any(|l| self.owed(l).contains(tile));
            if held {
                self.oracle.met.insert("a charge beside a twin");
            }
            expected.quarantined = (enough && self.oracle.charges[&at].len() >= 3 && !held).then_some(*tile);
        }
        Ok(expected)
    }

    /// Whether an event did what it had to.
    pub(super) fn as_expected(&self, k: usize, expected: &Expected) -> Promise {
        let lease = &self.leases[k];
        if expected.ends && lease.remaining().is_some() {
            return Err("an attempt outlived its end".into());
        }
        if !self.is_open(lease) {
            return Ok(());
        }
        for tile in lease.run.start..lease.run.end {
            let shard = &self.jobs[lease.job].shards[(tile / SHARD) as usize];
            let (charges, naive) = (shard.charges.of(TileIndex(tile)), self.oracle.charges.get(&(lease.job, tile)).map_or(0, Vec::len));
            if charges != naive as u64 {
                return Err(format!("tile {tile} has {charges} charges, and {naive} are due"));
            }
            let quarantined = shard.quarantined.contains(TileIndex(tile));
            let wanted = expected.quarantined == Some(tile);
            if expected.ends && self.oracle.charges.contains_key(&(lease.job, tile)) && quarantined != wanted {
                return Err(format!("tile {tile}: quarantined is {quarantined} and has to be {wanted}"));
            }
        }
        Ok(())
    }

    /// After a look at the clock nobody holds what has run out.
    pub(super) fn nobody_outlives(&self) -> Promise {
        let late = |l: &&Lease| matches!(l.state, Attempt::Held { deadline, .. } if self.now >= deadline || self.now >= l.since + CAP);
        self.leases.iter().find(late).map_or(Ok(()), |l| Err(format!("the attempt of {} lives on at {}", l.since, self.now)))
    }

    /// Whether a worker may be sent away, or given something else than pending tiles.
    pub(super) fn nothing_waits(&self, worker: WorkerId) -> Promise {
        for j in self.leasing() {
            let alone = |tile: &TileIndex| {
                let failed = self.oracle.workers((j, tile.0));
                self.connected.len() >= 2 && failed.len() == 1 && failed.contains(&worker)
            };
            let waiting = self.jobs[j].shards.iter().flat_map(|shard| shard.pending.iter()).find(|tile| !alone(tile));
            if let Some(tile) = waiting {
                return Err(format!("a worker was sent away while tile {tile} waits"));
            }
        }
        Ok(())
    }

    /// Whether this lease may be granted.
    pub(super) fn may_grant(&self, lease: &Lease) -> Promise {
        let bake = &self.jobs[lease.job];
        if !matches!(bake.state, Job::Baking { .. }) {
            return Err(format!("a lease of a job that is {}", bake.state.name()));
        }
        if self.barred.contains(&lease.worker) {
            return Err("a lease for a barred worker".into());
        }
        match lease.kind {
            Kind::Work => {
                let bounds = (lease.run.start..lease.run.end).filter_map(|tile| self.oracle.ceilings.get(&(lease.job, tile)));
                match bounds.min() {
                    Some(most) if lease.run.len() > *most => Err(format!("a lease of {} where {most} may be leased", lease.run.len())),
                    _ => Ok(()),
                }
            }
            Kind::Twin(of) => {
                let held = |l: &&Lease| l.job == lease.job && l.remaining().is_some();
                let twins = self.leases.iter().filter(held).filter(|l| matches!(l.kind, Kind::Twin(_))).count();
                let own = self.leases.iter().any(|l| l.token == of && l.worker == lease.worker);
                if own || twins > 0 { Err(format!("a twin for its own worker ({own}), or beside {twins} others")) } else { Ok(()) }
            }
            Kind::Check if bake.segments.get(&lease.run.start).is_some_and(|(by, _)| *by == lease.worker) => {
                Err("a worker is to check itself".into())
            }
            Kind::Check => Ok(()),
        }
    }

    /// What holds after every step: each tile is in one place, and the job knows how many are left.
    pub(super) fn check(&self) -> Promise {
        for (j, bake) in self.jobs.iter().enumerate() {
            let Some(phase) = bake.open else { continue };
            let mut held = vec![0; bake.shards.len() * SHARD as usize];
            for lease in self.leases.iter().filter(|l| l.job == j && l.phase == phase && l.kind != Kind::Check) {
                let tiles = if self.lazy {
                    self.owed(lease)
                } else {
                    lease.remaining().into_iter().flat_map(TileRuns::iter).map(|t| t.0).collect()
                };
                tiles.iter().for_each(|tile| held[*tile as usize] += 1);
            }
            let (mut left, mut holes) = (0, 0);
            for tile in 0..bake.tiles[usize::from(phase == kiln_proto::wire::message::Phase::Bake)] {
                let (index, shard) = (TileIndex(tile), &bake.shards[(tile / SHARD) as usize]);
                let [pending, done, quarantined, twinned] =
                    [&shard.pending, &shard.done, &shard.quarantined, &shard.twinned].map(|set| u64::from(set.contains(index)));
                let places = pending + done + quarantined + held[tile as usize];
                if places != 1 + twinned {
                    return Err(format!("job {j}, tile {tile} is in {places} places (p{pending} d{done} q{quarantined} t{twinned})"));
                }
                if bake.segments.contains_key(&tile) != (done == 1) {
                    return Err(format!("job {j}: tile {tile} is done ({done}) or its segment is there, not both"));
                }
                let believed = done == 1 && !bake.is_checked(index);
                left += u64::from(!believed);
                holes += quarantined;
            }
            let left = if bake.on_poison == OnPoison::Skip { left - holes } else { left };
            let told = match &bake.state {
                Job::Baking { left, .. } | Job::Paused { left, .. } => *left,
                Job::Failed { retry: Some(retry), .. } => retry.left,
                _ => 0,
            };
            if left != told {
                return Err(format!("job {j} is {} with {told} tiles left, and {left} are", bake.state.name()));
            }
        }
        Ok(())
    }
}
