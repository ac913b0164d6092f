//! From wherever chaos left it, honest workers bring every job to its end; and what a package must hold.

use super::{
    super::{Event, Kind},
    Promise,
    crew::{World, truth},
    farm::CAP,
};
use crate::job::{self, Job, OnPoison};
use kiln_proto::{
    ids::{Digest, WorkerId},
    tile::TileIndex,
};

/// Rounds in which every job must end.
const ROUNDS: usize = 200;
/// After this one whoever can mends what kills workers, and tries again.
const MENDED: usize = 40;

impl World {
    pub(super) fn end(&mut self) -> Promise {
        self.silence();
        self.farm.now += CAP;
        self.farm.tick()?;
        let alone = self.farm.dice.once_in(6);
        let workers: Vec<WorkerId> = (0..if alone { 1 } else { 3 }).map(|_| self.join_honest()).collect();
        for round in 0..ROUNDS {
            self.farm.now += 1;
            for j in 0..self.farm.jobs.len() {
                self.farm.happen(j, &job::Event::Resume)?;
                if round > MENDED && matches!(self.farm.jobs[j].state, Job::Failed { .. }) {
                    self.poison.clear();
                    self.farm.happen(j, &job::Event::Retry)?;
                }
            }
            for (c, worker) in workers.iter().enumerate() {
                if let Some(k) = self.farm.grant(*worker, c % self.farm.coordinators.len())? {
                    self.serve(k)?;
                }
            }
            self.farm.waive()?;
            self.farm.check()?;
            for _ in 0..4 {
                self.task()?;
            }
            if self.farm.jobs.iter().all(|bake| matches!(bake.state, Job::Done | Job::Cancelled)) {
                return Ok(());
            }
        }
        let states: Vec<&Job> = self.farm.jobs.iter().map(|bake| &bake.state).collect();
        Err(format!("some job never ends: {states:?}"))
    }

    /// An honest worker bakes what can be baked of a lease.
    fn serve(&mut self, k: usize) -> Promise {
        let lease = self.farm.leases[k].clone();
        let is_good = |tile: &u64| !self.poison.contains(&(lease.job, lease.phase, *tile));
        let good: Vec<(u64, Digest)> = (lease.run.start..lease.run.end).filter(is_good).map(|tile| (tile, truth(tile))).collect();
        let all = good.len() as u64 == lease.run.len();
        if !good.is_empty() {
            self.farm.deliver(k, &good)?;
        }
        self.farm.finish(k, if all { Event::Complete } else { Event::Fail }).map(drop)
    }

    /// Whether the package that is about to be published holds what it must.
    pub(super) fn package(&self, j: usize) -> Promise {
        let (bake, oracle) = (&self.farm.jobs[j], &self.farm.oracle);
        // Nobody verifies the late delivery of a tile that had been given up, or what the only worker delivers.
        let is_checked = |tile: &u64| bake.share >= 1.0 && !oracle.waived.contains(&j) && !oracle.filled.contains(&(j, *tile));
        for tile in 0..bake.tiles[1] {
            let hole = bake.shards[(tile / super::farm::SHARD) as usize].quarantined.contains(TileIndex(tile));
            match bake.segments.get(&tile) {
                None if hole && bake.on_poison == OnPoison::Skip => {}
                None => return Err(format!("tile {tile} is not in the package")),
                Some((_, digest)) if is_checked(&tile) && *digest != truth(tile) => {
                    return Err(format!("tile {tile} of the package is a lie"));
                }
                Some(_) => {}
            }
        }
        let checks = self.farm.leases.iter().filter(|lease| lease.job == j && lease.kind == Kind::Check).count();
        if checks == 0 && bake.segments.keys().any(is_checked) {
            return Err("everything was to be checked, and nothing was".into());
        }
        Ok(())
    }
}
