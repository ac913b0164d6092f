//! How many tiles a worker gets at once.
//!
//! A lease should last about ten seconds: shorter ones cost round trips, longer ones lose more when a worker dies. What a tile costs is
//! known (its texels), how fast a worker is must be measured, for each job and phase anew because samples and depth differ. Before the
//! first measurement a worker gets one tile a thread. Near the end of a phase leases shrink (half of an even share of what waits, "guided
//! self-scheduling", Polychronopoulos and Kuck 1987), so that the workers finish together.

use kiln_proto::{
    ids::{JobId, WorkerId},
    wire::message::Phase,
};
use std::collections::HashMap;

/// What the size of a lease follows from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizing {
    /// How long the lease should last, milliseconds.
    pub target_ms: u64,
    /// Texels a millisecond that the worker manages in this job and phase, where it is known.
    pub speed: Option<f64>,
    /// Threads of the worker.
    pub threads: u32,
    /// Tiles of the phase that wait.
    pub pending: u64,
    /// Workers that share them.
    pub workers: u64,
}

/// How many of the tiles with these `costs` (texels each, in order) to lease: at least one, where there is one.
pub fn run_length(sizing: &Sizing, costs: impl Iterator<Item = u64>) -> u64 {
    let threads = u64::from(sizing.threads.max(1));
    let share = sizing.pending.div_ceil(2 * sizing.workers.max(1));
    // A lease below one tile a thread leaves cores idle; that is worth less than an even end only where there is little left at all.
    let most = share.max(threads.min(sizing.pending.div_ceil(sizing.workers.max(1)))).max(1);
    let Some(speed) = sizing.speed else {
        return costs.take(most.min(threads) as usize).count() as u64;
    };
    let budget = speed * sizing.target_ms as f64;
    let mut spent = 0.0;
    let mut count = 0;
    for cost in costs.take(most as usize) {
        spent += cost as f64;
        if count >= threads.min(most) && spent > budget {
            break;
        }
        count += 1;
    }
    count
}

/// Measured speeds, texels a millisecond. Kept in memory: a restart costs each worker one small lease.
#[derive(Debug, Default)]
pub struct Speeds {
    of: HashMap<(WorkerId, JobId, Phase), f64>,
}

impl Speeds {
    /// Takes in that a worker baked `texels` in `ms` milliseconds.
    pub fn measured(&mut self, worker: WorkerId, job: JobId, phase: Phase, texels: u64, ms: i64) {
        if texels == 0 || ms <= 0 {
            return;
        }
        let speed = texels as f64 / ms as f64;
        let known = self.of.entry((worker, job, phase)).or_insert(speed);
        *known = 0.5 * *known + 0.5 * speed;
    }

    /// The speed of a worker, texels a millisecond.
    #[must_use]
    pub fn of(&self, worker: WorkerId, job: JobId, phase: Phase) -> Option<f64> {
        self.of.get(&(worker, job, phase)).copied()
    }

    /// Forgets a job.
    pub fn forget(&mut self, job: JobId) {
        self.of.retain(|(_, j, _), _| *j != job);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLENTY: Sizing = Sizing { target_ms: 10_000, speed: Some(1.0), threads: 4, pending: 100_000, workers: 3 };

    fn length(sizing: Sizing) -> u64 {
        run_length(&sizing, std::iter::repeat_n(1_000, sizing.pending as usize))
    }

    #[test]
    fn a_lease_is_worth_its_target_time() {
        assert_eq!(length(PLENTY), 10);
        assert_eq!(length(Sizing { speed: Some(10.0), ..PLENTY }), 100);
    }

    #[test]
    fn a_worker_starts_with_a_tile_a_thread_and_never_gets_less_while_there_is_plenty() {
        assert_eq!(length(Sizing { speed: None, ..PLENTY }), 4);
        assert_eq!(length(Sizing { speed: Some(1e-6), ..PLENTY }), 4);
    }

    #[test]
    fn leases_shrink_toward_the_end_but_never_to_nothing() {
        assert_eq!(length(Sizing { pending: 30, speed: Some(100.0), ..PLENTY }), 5);
        assert_eq!(length(Sizing { pending: 3, speed: Some(100.0), ..PLENTY }), 1);
        assert_eq!(length(Sizing { pending: 1, speed: Some(100.0), ..PLENTY }), 1);
        assert_eq!(length(Sizing { pending: 3, speed: Some(100.0), workers: 0, ..PLENTY }), 3);
    }

    #[test]
    fn speeds_follow_the_measurements_of_each_job_and_phase() {
        let (worker, job) = (WorkerId::random(), JobId::random());
        let mut speeds = Speeds::default();
        speeds.measured(worker, job, Phase::Bake, 1_000, 0);
        assert_eq!(speeds.of(worker, job, Phase::Bake), None);
        speeds.measured(worker, job, Phase::Bake, 1_000, 100);
        speeds.measured(worker, job, Phase::Bake, 2_000, 100);
        assert_eq!((speeds.of(worker, job, Phase::Bake), speeds.of(worker, job, Phase::Probe)), (Some(15.0), None));
        speeds.forget(job);
        assert_eq!(speeds.of(worker, job, Phase::Bake), None);
    }
}
