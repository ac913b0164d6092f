//! How fast things go right now: rays and texels of each job over the last half minute, who was heard lately, how often attempts fail.
//!
//! All of it is in memory and all of it may be lost: a restart forgets speeds, never work.

use crate::{lease::Speeds, records::UnixMillis};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    wire::message::Phase,
};
use std::collections::{HashMap, VecDeque};

/// The window over which rates are taken, milliseconds.
const WINDOW: i64 = 30_000;
/// Attempts of a job that may fail in a row without a tile accepted between them, before the job is given up.
const FAILURES: u32 = 10;

#[derive(Default)]
struct JobMeter {
    /// When, rays, cost.
    samples: VecDeque<(UnixMillis, u64, u64)>,
    since: Option<UnixMillis>,
    failures: u32,
}

/// All meters.
#[derive(Default)]
pub(super) struct Meter {
    jobs: HashMap<JobId, JobMeter>,
    rays: HashMap<Token, (JobId, u64)>,
    heard: HashMap<WorkerId, UnixMillis>,
    pub(super) speeds: Speeds,
}

/// Per second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rates {
    pub(super) rays: f64,
    pub(super) cost: f64,
}

impl Meter {
    fn add(&mut self, job: JobId, rays: u64, cost: u64, now: UnixMillis) {
        let meter = self.jobs.entry(job).or_default();
        meter.since.get_or_insert(now);
        meter.samples.push_back((now, rays, cost));
        while meter.samples.front().is_some_and(|(at, ..)| *at < now - WINDOW) {
            meter.samples.pop_front();
        }
    }

    /// A worker says how many rays an attempt has traced so far.
    pub(super) fn rays(&mut self, token: Token, job: JobId, total: u64, now: UnixMillis) {
        let before = self.rays.insert(token, (job, total)).map_or(0, |(_, before)| before);
        self.add(job, total.saturating_sub(before), 0, now);
    }

    /// Tiles worth `cost` texels were accepted.
    pub(super) fn accepted(&mut self, job: JobId, cost: u64, now: UnixMillis) {
        self.add(job, 0, cost, now);
        if let Some(meter) = self.jobs.get_mut(&job) {
            meter.failures = 0;
        }
    }

    /// An attempt failed. Whether that is once too often.
    pub(super) fn failed(&mut self, job: JobId) -> bool {
        let meter = self.jobs.entry(job).or_default();
        meter.failures += 1;
        meter.failures >= FAILURES
    }

    /// An attempt is over.
    pub(super) fn ended(&mut self, token: Token) {
        self.rays.remove(&token);
    }

    /// How much an attempt got done.
    pub(super) fn measured(&mut self, worker: WorkerId, job: JobId, phase: Phase, texels: u64, ms: i64) {
        self.speeds.measured(worker, job, phase, texels, ms);
    }

    /// The rates of a job.
    pub(super) fn rates(&self, job: JobId, now: UnixMillis) -> Rates {
        let Some(meter) = self.jobs.get(&job) else { return Rates::default() };
        let recent = meter.samples.iter().filter(|(at, ..)| *at >= now - WINDOW);
        let (rays, cost) = recent.fold((0u64, 0u64), |(r, c), (_, rays, cost)| (r + rays, c + cost));
        let seconds = meter.since.map_or(WINDOW, |since| (now - since).clamp(1_000, WINDOW)) as f64 / 1_000.0;
        Rates { rays: rays as f64 / seconds, cost: cost as f64 / seconds }
    }

    /// A worker was heard.
    pub(super) fn heard(&mut self, worker: WorkerId, now: UnixMillis) {
        self.heard.insert(worker, now);
    }

    /// Workers heard since a moment; the others are forgotten.
    pub(super) fn present(&mut self, since: UnixMillis) -> u64 {
        self.heard.retain(|_, at| *at >= since);
        self.heard.len() as u64
    }

    /// Forgets a job.
    pub(super) fn forget(&mut self, job: JobId) {
        self.jobs.remove(&job);
        self.rays.retain(|_, (of, _)| *of != job);
        self.speeds.forget(job);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_look_half_a_minute_back() {
        let (mut meter, job, token) = (Meter::default(), JobId::random(), Token::random());
        meter.rays(token, job, 1_000, 0);
        meter.rays(token, job, 5_000, 10_000);
        meter.accepted(job, 50, 10_000);
        assert_eq!(meter.rates(job, 10_000), Rates { rays: 500.0, cost: 5.0 });
        assert_eq!(meter.rates(job, 35_000), Rates { rays: 4_000.0 / 30.0, cost: 50.0 / 30.0 });
        assert_eq!(meter.rates(job, 90_000), Rates::default());
    }

    #[test]
    fn failures_count_only_while_nothing_is_accepted() {
        let (mut meter, job) = (Meter::default(), JobId::random());
        assert!((1..FAILURES).all(|_| !meter.failed(job)));
        meter.accepted(job, 1, 0);
        assert!((1..FAILURES).all(|_| !meter.failed(job)));
        assert!(meter.failed(job));
    }

    #[test]
    fn silent_workers_are_not_present() {
        let mut meter = Meter::default();
        meter.heard(WorkerId::random(), 5);
        meter.heard(WorkerId::random(), 50);
        assert_eq!((meter.present(5), meter.present(6), meter.present(0)), (2, 1, 1));
    }
}
