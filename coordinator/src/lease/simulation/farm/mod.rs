//! What the store does, without SQL: the core's values and the transactions that join them.

mod deliver;
mod grant;

use super::{
    super::{
        Accepted, Action, Attempt, Charges, Claim, Event, Field, Finished, Kind, Ledger, Refuted, Running, Shard, Suspicion, Verdict,
        is_checked,
    },
    Dice, Promise, Slip,
    oracle::Oracle,
};
use crate::{
    job::{self, Job, JobTask, OnPoison},
    records::Problem,
};
use kiln_proto::{
    ids::{Digest, JobId, Token, WorkerId},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};
use std::collections::{BTreeMap, BTreeSet};
use uuid::Uuid;

/// Without a sign of life for so long an attempt expires.
pub(super) const TTL: i64 = 30;
/// After so long it expires whatever comes.
pub(super) const CAP: i64 = 90;
/// Tiles of a shard: few, so that jobs have several.
pub(super) const SHARD: u64 = 8;
/// What a tile costs.
const COST: u64 = 10;

/// One job as stored.
pub(super) struct Bake {
    pub(super) id: JobId,
    pub(super) state: Job,
    /// Tiles of Probe and of Bake.
    pub(super) tiles: [u64; 2],
    pub(super) on_poison: OnPoison,
    /// The share of tiles that is verified.
    pub(super) share: f64,
    /// The phase that the shards are of, until they go.
    pub(super) open: Option<Phase>,
    pub(super) shards: Vec<Shard>,
    /// Who delivered a tile, and which bytes.
    pub(super) segments: BTreeMap<u64, (WorkerId, Digest)>,
    pub(super) tasks: Vec<JobTask>,
    finished: Vec<Finished>,
}

impl Bake {
    fn shard(&mut self, tile: TileIndex) -> &mut Shard {
        &mut self.shards[(tile.0 / SHARD) as usize]
    }

    /// Whether a tile is done and not yet believed.
    pub(super) fn is_checked(&self, tile: TileIndex) -> bool {
        self.shards.iter().any(|shard| shard.checks.is_open(tile))
    }
}

/// One row of attempts.
#[derive(Debug, Clone)]
pub(super) struct Lease {
    pub(super) job: usize,
    pub(super) phase: Phase,
    pub(super) kind: Kind,
    pub(super) run: TileRun,
    pub(super) worker: WorkerId,
    pub(super) token: Token,
    pub(super) since: i64,
    pub(super) state: Attempt,
}

impl Lease {
    /// What a held attempt owes.
    pub(super) fn remaining(&self) -> Option<&TileRuns> {
        if let Attempt::Held { remaining, .. } = &self.state { Some(remaining) } else { None }
    }
}

/// A coordinator: what it knows that is not stored.
#[derive(Default)]
pub(super) struct Coordinator {
    ledger: Ledger,
    /// Where it last saw pending tiles: job, shard, tile.
    view: Option<(usize, usize, u64)>,
}

pub(super) struct Farm {
    pub(super) dice: Dice,
    pub(super) slip: Option<Slip>,
    /// Attempts hear of others' deliveries only at their end, and there are no twins.
    pub(super) lazy: bool,
    pub(super) now: i64,
    pub(super) jobs: Vec<Bake>,
    pub(super) leases: Vec<Lease>,
    pub(super) coordinators: Vec<Coordinator>,
    /// Workers that are there and may get leases.
    pub(super) connected: BTreeSet<WorkerId>,
    pub(super) barred: BTreeSet<WorkerId>,
    refuted: BTreeMap<WorkerId, Refuted>,
    pub(super) oracle: Oracle,
}

impl Farm {
    pub(super) fn new(mut dice: Dice, slip: Option<Slip>) -> Self {
        let job = |n: u64, dice: &mut Dice| Bake {
            id: JobId(Uuid::from_u128(n.into())),
            state: Job::Preparing,
            tiles: [1 + dice.roll(4), 1 + dice.roll(22)],
            on_poison: if dice.once_in(2) { OnPoison::Skip } else { OnPoison::Fail },
            share: [0.0, 0.0, 0.3, 1.0][dice.roll(4) as usize],
            open: None,
            shards: vec![],
            segments: BTreeMap::new(),
            tasks: vec![JobTask::Prepare],
            finished: vec![Finished { ms: 5, cost: COST }; 8],
        };
        let jobs = (0..1 + dice.roll(2)).map(|n| job(n, &mut dice)).collect();
        let coordinators = (0..1 + dice.roll(3)).map(|_| Coordinator::default()).collect();
        Self {
            lazy: dice.once_in(4),
            dice,
            slip,
            now: 0,
            jobs,
            leases: vec![],
            coordinators,
            connected: BTreeSet::new(),
            barred: BTreeSet::new(),
            refuted: BTreeMap::new(),
            oracle: Oracle::default(),
        }
    }

    /// Something happens to a job. Whether it fits.
    pub(super) fn happen(&mut self, j: usize, event: &job::Event) -> Promise<bool> {
        let Ok((state, actions)) = job::apply(&self.jobs[j].state, event) else { return Ok(false) };
        if matches!((&self.jobs[j].state, event), (Job::Paused { .. }, job::Event::Accepted { .. })) {
            self.oracle.met.insert("a delivery to a paused job");
        }
        if *event == job::Event::Retry {
            self.oracle.met.insert("a retry");
        }
        self.jobs[j].state = state;
        for action in actions {
            let bake = &mut self.jobs[j];
            match action {
                job::Action::Enqueue(task) => bake.tasks.push(task),
                job::Action::OpenPhase { phase, tiles } => {
                    let runs = (0..tiles.div_ceil(SHARD)).map(|k| TileRun { start: k * SHARD, end: ((k + 1) * SHARD).min(tiles) });
                    bake.shards = runs.map(|run| Shard { pending: TileRuns::from_run(run), ..Shard::default() }).collect();
                    bake.open = Some(phase);
                    bake.segments.clear();
                    self.oracle.forget(j);
                }
                job::Action::Announce => {}
                job::Action::Recall => bake.tasks.clear(),
                job::Action::Reopen { .. } if self.slip == Some(Slip::ShutQuarantine) => {}
                job::Action::Reopen { .. } => {
                    for shard in &mut bake.shards {
                        shard.quarantined.iter().for_each(|tile| self.oracle.fresh_start(j, tile.0));
                        shard.reopen();
                    }
                }
                job::Action::Suspend => {
                    bake.tasks.clear();
                    self.fence(|lease| lease.job == j)?;
                }
                job::Action::Withdraw | job::Action::Retire => {
                    bake.tasks.clear();
                    bake.open = None;
                    self.fence(|lease| lease.job == j)?;
                }
            }
        }
        Ok(true)
    }

    /// Fences the attempts of which this is true, those that might still deliver late among them.
    fn fence(&mut self, which: impl Fn(&Lease) -> bool) -> Promise {
        for k in 0..self.leases.len() {
            if which(&self.leases[k]) && matches!(self.leases[k].state, Attempt::Held { .. } | Attempt::Expired) {
                self.attempt(k, Event::Fence)?;
            }
        }
        Ok(())
    }

    /// Something happens to an attempt. Whether it fits.
    pub(super) fn attempt(&mut self, k: usize, event: Event) -> Promise<bool> {
        let lease = self.leases[k].clone();
        let expected = self.expect(&lease, &event)?;
        let Ok((state, actions)) = lease.state.apply(event, self.now) else { return Ok(false) };
        if state == Attempt::Completed && self.leases[k].remaining().is_some() {
            let of = Finished { ms: self.now - lease.since, cost: lease.run.len() * COST };
            self.jobs[lease.job].finished.push(of);
        }
        self.leases[k].state = state;
        for action in actions {
            match action {
                Action::Return(tiles) => self.give_back(k, &tiles),
                Action::Suspect(tiles) => self.suspect(k, &tiles)?,
            }
        }
        self.as_expected(k, &expected)?;
        Ok(true)
    }

    fn give_back(&mut self, k: usize, tiles: &TileRuns) {
        let lease = &self.leases[k];
        let bake = &mut self.jobs[lease.job];
        if bake.open != Some(lease.phase) {
            return;
        }
        match lease.kind {
            Kind::Check => bake.shard(TileIndex(lease.run.start)).checks.give_back(TileIndex(lease.run.start)),
            Kind::Work | Kind::Twin(_) => bake.shard(TileIndex(lease.run.start)).give_back(tiles),
        }
    }

    fn suspect(&mut self, k: usize, tiles: &TileRuns) -> Promise {
        let lease = self.leases[k].clone();
        let bake = &mut self.jobs[lease.job];
        if bake.open != Some(lease.phase) {
            return Ok(());
        }
        if lease.kind == Kind::Check {
            let tile = TileIndex(lease.run.start);
            bake.shard(tile).checks.fail(tile, lease.worker);
            return Ok(());
        }
        let connected = self.connected.len() as u64;
        let suspicion = Suspicion { leased: lease.run, rest: tiles, worker: lease.worker, connected };
        let Some(tile) = bake.shards[(lease.run.start / SHARD) as usize].suspect(&suspicion) else { return Ok(()) };
        let on_poison = bake.on_poison;
        let problem = Problem::new(format!("tile {tile} kills workers"));
        self.oracle.met.insert(if on_poison == OnPoison::Skip { "a hole" } else { "a job failed for a tile" });
        let fits = self.happen(lease.job, &job::Event::Quarantined { phase: lease.phase, on_poison, problem })?;
        if fits { Ok(()) } else { Err(format!("tile {tile} was quarantined, and the job did not hear of it")) }
    }

    /// The clock is looked at.
    pub(super) fn tick(&mut self) -> Promise {
        for k in 0..self.leases.len() {
            if self.leases[k].remaining().is_some() {
                self.attempt(k, Event::Tick)?;
            }
        }
        self.nobody_outlives()
    }

    /// A worker says that an attempt ends.
    pub(super) fn finish(&mut self, k: usize, event: Event) -> Promise<bool> {
        let lease = &mut self.leases[k];
        if let (true, Attempt::Held { remaining, .. }, bake) = (self.lazy, &mut lease.state, &self.jobs[lease.job])
            && bake.open == Some(lease.phase)
            && lease.kind == Kind::Work
        {
            *remaining = remaining.minus(&bake.shards[(lease.run.start / SHARD) as usize].done);
        }
        self.attempt(k, event)
    }
}
