//! Deliveries: what is accepted, what is checked, who is barred for it.

use super::*;

impl Farm {
    /// A checked chunk. The tiles of which the worker hears that they are safe; `None` where the attempt may not deliver.
    pub(in super::super) fn deliver(&mut self, k: usize, tiles: &[(u64, Digest)]) -> Promise<Option<Vec<u64>>> {
        let lease = self.leases[k].clone();
        let (j, phase) = (lease.job, lease.phase);
        if self.jobs[j].state.phase() != Some(phase) {
            return Ok(None);
        }
        let set: TileRuns = tiles.iter().map(|(tile, _)| TileIndex(*tile)).collect();
        let fits = self.attempt(k, Event::Deliver(set))?;
        self.oracle.may_deliver(&lease, fits)?;
        if !fits {
            return Ok(None);
        }
        if lease.kind == Kind::Check {
            for (tile, digest) in tiles {
                self.opinion(&lease, *tile, *digest)?;
            }
        } else {
            self.accept(k, &lease, tiles)?;
        }
        Ok(Some(tiles.iter().map(|(tile, _)| *tile).collect()))
    }

    fn accept(&mut self, k: usize, lease: &Lease, tiles: &[(u64, Digest)]) -> Promise {
        let (j, phase, worker) = (lease.job, lease.phase, lease.worker);
        let (mut fresh, mut counted, mut guilty) = (TileRuns::new(), 0, vec![]);
        for (tile, digest) in tiles {
            let bake = &mut self.jobs[j];
            let (index, shard) = (TileIndex(*tile), &mut bake.shards[(tile / SHARD) as usize]);
            let refuted = shard.refuted(index, worker);
            let accepted = shard.accept(index);
            if accepted == Accepted::Known {
                continue;
            }
            self.oracle.accepted(j, *tile, accepted, &refuted, worker)?;
            if bake.segments.insert(*tile, (worker, *digest)).is_some() {
                return Err(format!("tile {tile} was accepted twice"));
            }
            fresh.insert_tile(index);
            guilty.extend(refuted.into_iter().map(|worker| (worker, index)));
            match accepted {
                Accepted::First if is_checked("secret", bake.id, phase, index, bake.share) => {
                    bake.shard(index).checks.open(index, worker, *digest);
                }
                Accepted::First => counted += 1,
                _ => {}
            }
        }
        if !self.lazy && self.slip != Some(Slip::Untold) {
            self.overtake(k, lease, &fresh)?;
        }
        self.count(j, phase, counted)?;
        for (worker, tile) in guilty {
            let refuted = self.refuted.entry(worker).or_default();
            refuted.note(self.jobs[j].id, phase, tile);
            if refuted.bars() {
                self.bar(worker, false)?;
            }
        }
        Ok(())
    }

    /// Tells the others that owe these tiles.
    fn overtake(&mut self, k: usize, by: &Lease, tiles: &TileRuns) -> Promise {
        for other in (0..self.leases.len()).filter(|other| *other != k) {
            let lease = &self.leases[other];
            if lease.job == by.job && lease.phase == by.phase && lease.kind != Kind::Check && lease.remaining().is_some() {
                self.attempt(other, Event::Overtaken(tiles.clone()))?;
            }
        }
        Ok(())
    }

    pub(super) fn count(&mut self, j: usize, phase: Phase, tiles: u64) -> Promise {
        if tiles == 0 || self.happen(j, &job::Event::Accepted { phase, tiles })? {
            return Ok(());
        }
        Err(format!("{tiles} delivered tiles of {phase} did not count for a job that is {}", self.jobs[j].state.name()))
    }

    /// What one more worker says of a tile.
    fn opinion(&mut self, lease: &Lease, tile: u64, digest: Digest) -> Promise {
        let (j, phase, index) = (lease.job, lease.phase, TileIndex(tile));
        self.oracle.met.insert("an opinion");
        let liars = match self.jobs[j].shard(index).checks.hear(index, lease.worker, digest) {
            Verdict::Open => vec![],
            Verdict::Unsettled => return self.count(j, phase, 1),
            Verdict::Right(liars) => {
                self.count(j, phase, 1)?;
                liars
            }
            Verdict::Wrong(liars) => {
                self.oracle.met.insert("a lie found");
                self.take_back(j, &[index].into_iter().collect());
                liars
            }
        };
        liars.into_iter().try_for_each(|worker| self.bar(worker, true))
    }

    /// Tiles that had been done are not any more. They are no matter of the job where they had not counted yet.
    fn take_back(&mut self, j: usize, tiles: &TileRuns) {
        let bake = &mut self.jobs[j];
        bake.shards.iter_mut().for_each(|shard| shard.lose(tiles));
        bake.segments.retain(|tile, _| !tiles.contains(TileIndex(*tile)));
    }

    /// The segments of tiles are gone. Whether the job still needs them.
    pub(in super::super) fn lose(&mut self, j: usize, tiles: &TileRuns) -> Promise<bool> {
        let bake = &mut self.jobs[j];
        let Some(phase) = bake.open else { return Ok(false) };
        let counted = tiles.iter().filter(|tile| !bake.is_checked(*tile)).count() as u64;
        if counted > 0 && !self.happen(j, &job::Event::Lost { phase, tiles: counted })? {
            return Ok(false);
        }
        self.take_back(j, tiles);
        Ok(true)
    }

    /// A worker gets no lease any more. Where it lied, what it delivered is baked again.
    fn bar(&mut self, worker: WorkerId, lied: bool) -> Promise {
        self.connected.remove(&worker);
        if self.slip == Some(Slip::BarredWorks) {
            self.barred.insert(worker);
            return Ok(());
        }
        if self.barred.insert(worker) {
            self.oracle.met.insert(if lied { "a liar barred" } else { "a clumsy worker barred" });
            self.fence(|lease| lease.worker == worker)?;
        }
        for j in (0..self.jobs.len()).filter(|_| lied) {
            let own: TileRuns = self.jobs[j].segments.iter().filter(|(_, (by, _))| *by == worker).map(|(t, _)| TileIndex(*t)).collect();
            if !own.is_empty() {
                self.lose(j, &own)?;
            }
            self.jobs[j].shards.iter_mut().for_each(|shard| drop(shard.checks.distrust(worker)));
        }
        Ok(())
    }
}
