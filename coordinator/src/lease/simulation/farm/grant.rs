//! Leases: who gets which tiles.

use super::*;

impl Farm {
    /// Work for a worker that asks a coordinator: pending tiles, else a twin, else a check.
    pub(in super::super) fn grant(&mut self, worker: WorkerId, c: usize) -> Promise<Option<usize>> {
        if self.barred.contains(&worker) && self.slip != Some(Slip::BarredWorks) {
            return Ok(None);
        }
        let found = match self.pending(worker, c) {
            Some((j, run)) => Some((j, Kind::Work, run)),
            None => {
                self.nothing_waits(worker)?;
                self.twin(worker)?.or_else(|| self.check_for(worker))
            }
        };
        let Some((job, kind, run)) = found else { return Ok(None) };
        let Some(phase) = self.jobs[job].open else { return Err("a lease of a job without a phase".into()) };
        let token = Token(Uuid::from_u128(self.leases.len() as u128));
        let state = Attempt::Held { deadline: self.now + TTL, cap: self.now + CAP, remaining: TileRuns::from_run(run) };
        let lease = Lease { job, phase, kind, run, worker, token, since: self.now, state };
        self.may_grant(&lease)?;
        self.oracle.met.insert(match kind {
            Kind::Work => "a lease",
            Kind::Twin(_) => "a twin",
            Kind::Check => "a check",
        });
        self.leases.push(lease);
        Ok(Some(self.leases.len() - 1))
    }

    /// Jobs whose tiles are leased.
    pub(in super::super) fn leasing(&self) -> Vec<usize> {
        let is_leasing = |bake: &Bake| match bake.state {
            Job::Baking { .. } => true,
            Job::Paused { .. } => self.slip == Some(Slip::PausedLeases),
            _ => false,
        };
        (0..self.jobs.len()).filter(|j| is_leasing(&self.jobs[*j])).collect()
    }

    pub(super) fn avoided(&self, charges: &Charges, worker: WorkerId) -> TileRuns {
        charges.avoided(worker, self.connected.len() as u64)
    }

    /// Pending tiles, from where the coordinator last saw some, however long ago, or from the job that is next.
    fn pending(&mut self, worker: WorkerId, c: usize) -> Option<(usize, TileRun)> {
        let (count, mut open) = (1 + self.dice.roll(6), self.leasing());
        if let Some((j, s, at)) = self.coordinators[c].view
            && open.contains(&j)
            && let Some(run) = self.take(j, s, at, count, worker)
        {
            return Some((j, run));
        }
        while !open.is_empty() {
            let waiting = |j: &usize| self.jobs[*j].shards.iter().map(|s| s.pending.len()).sum();
            let claim = |j: &usize| Claim { job: self.jobs[*j].id, priority: *j as i32, pending: waiting(j), leased: 0, owner: None };
            let claims: Vec<Claim> = open.iter().map(claim).collect();
            let next = self.coordinators[c].ledger.choose(&claims, None)?;
            let j = self.jobs.iter().position(|bake| bake.id == next)?;
            for s in 0..self.jobs[j].shards.len() {
                let Some(first) = self.jobs[j].shards[s].first() else { continue };
                self.coordinators[c].view = Some((j, s, first.start));
                if let Some(run) = self.take(j, s, first.start, count, worker) {
                    self.coordinators[c].ledger.granted(next, j as i32, run.len() * COST);
                    return Some((j, run));
                }
            }
            open.retain(|other| *other != j);
        }
        None
    }

    fn take(&mut self, j: usize, s: usize, at: u64, count: u64, worker: WorkerId) -> Option<TileRun> {
        let avoided = self.avoided(&self.jobs[j].shards.get(s)?.charges, worker);
        self.jobs[j].shards.get_mut(s)?.take(TileIndex(at), count, &avoided)
    }

    fn twin(&mut self, worker: WorkerId) -> Promise<Option<(usize, Kind, TileRun)>> {
        for j in self.leasing().into_iter().filter(|_| !self.lazy) {
            let bake = &self.jobs[j];
            let held = self.leases.iter().filter(|l| l.job == j && Some(l.phase) == bake.open && l.kind != Kind::Check);
            let running = |l: &Lease| {
                let (remaining, ceilings) = (l.remaining()?.clone(), &bake.shards[(l.run.start / SHARD) as usize].ceilings);
                let suspected = remaining.iter().any(|tile| ceilings.of(tile).is_some());
                Some(Running {
                    token: l.token,
                    worker: l.worker,
                    since: l.since,
                    cost: l.run.len() * COST,
                    remaining,
                    twin_of: l.kind.twin_of(),
                    suspected,
                })
            };
            let running: Vec<Running> = held.filter_map(running).collect();
            let pending = bake.shards.iter().map(|shard| shard.pending.len()).sum();
            let field = Field { pending, running: &running, finished: &bake.finished, workers: self.connected.len() as u64 };
            if let Some(twin) = field.twin(worker, self.now) {
                if !self.jobs[j].shards[(twin.run.start / SHARD) as usize].twin(twin.run) {
                    return Err(format!("{:?} cannot be twinned", twin.run));
                }
                return Ok(Some((j, Kind::Twin(twin.of), twin.run)));
            }
        }
        Ok(None)
    }

    /// Lets tiles count that nobody who is there can check.
    pub(in super::super) fn waive(&mut self) -> Promise {
        let connected: Vec<WorkerId> = self.connected.iter().copied().collect();
        for j in self.leasing() {
            let Some(phase) = self.jobs[j].open else { continue };
            let waits = self.jobs[j].shards.iter().any(|shard| shard.first().is_some());
            if waits || self.leases.iter().any(|l| l.job == j && l.remaining().is_some_and(|rest| !rest.is_empty())) {
                continue;
            }
            let waived: u64 = self.jobs[j].shards.iter_mut().map(|shard| shard.checks.waive(&connected).len()).sum();
            if waived > 0 {
                self.oracle.met.insert("a check waived");
                self.oracle.waived.insert(j);
            }
            self.count(j, phase, waived)?;
        }
        Ok(())
    }

    fn check_for(&mut self, worker: WorkerId) -> Option<(usize, Kind, TileRun)> {
        let open = self.leasing();
        open.into_iter().find_map(|j| {
            let tile = self.jobs[j].shards.iter_mut().find_map(|shard| shard.checks.take(worker))?;
            Some((j, Kind::Check, TileRun { start: tile.0, end: tile.0 + 1 }))
        })
    }
}
