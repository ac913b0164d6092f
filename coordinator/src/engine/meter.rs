//! How fast things go right now: rays and texels of each job and each worker over the last half minute, who was heard lately;
//! and what was done over the last hour.
//!
//! What workers report is taken as it comes: sums saturate, so that no report, however wrong, stops the service.
//!
//! All of it is in memory and all of it may be lost: a restart forgets speeds, never work.

use super::history::History;
use crate::{
    lease::Speeds,
    records::{ThroughputPoint, UnixMillis},
};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    wire::message::Phase,
};
use std::collections::{HashMap, VecDeque};

/// The window over which rates are taken, milliseconds.
const WINDOW: i64 = 30_000;

/// What was done over the last half minute.
#[derive(Default)]
struct Window {
    /// When, rays, cost.
    samples: VecDeque<(UnixMillis, u64, u64)>,
    since: Option<UnixMillis>,
}

impl Window {
    fn add(&mut self, rays: u64, cost: u64, now: UnixMillis) {
        self.since.get_or_insert(now);
        self.samples.push_back((now, rays, cost));
        while self.samples.front().is_some_and(|(at, ..)| *at < now - WINDOW) {
            self.samples.pop_front();
        }
    }

    fn rates(&self, now: UnixMillis) -> Rates {
        let recent = self.samples.iter().filter(|(at, ..)| *at >= now - WINDOW);
        let (rays, cost) = recent.fold((0u64, 0u64), |(r, c), (_, rays, cost)| (r.saturating_add(*rays), c.saturating_add(*cost)));
        let seconds = self.since.map_or(WINDOW, |since| (now - since).clamp(1_000, WINDOW)) as f64 / 1_000.0;
        Rates { rays: rays as f64 / seconds, cost: cost as f64 / seconds }
    }

    fn is_over(&self, now: UnixMillis) -> bool {
        self.samples.back().is_none_or(|(at, ..)| *at < now - WINDOW)
    }
}

/// All meters.
#[derive(Default)]
pub(super) struct Meter {
    jobs: HashMap<JobId, Window>,
    workers: HashMap<WorkerId, Window>,
    rays: HashMap<Token, (JobId, u64)>,
    heard: HashMap<WorkerId, UnixMillis>,
    history: History,
    pub(super) speeds: Speeds,
}

/// Per second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rates {
    pub(super) rays: f64,
    pub(super) cost: f64,
}

impl Meter {
    fn add(&mut self, worker: WorkerId, job: JobId, rays: u64, cost: u64, now: UnixMillis) {
        self.jobs.entry(job).or_default().add(rays, cost, now);
        self.workers.entry(worker).or_default().add(rays, cost, now);
    }

    /// A worker says how many rays an attempt has traced so far.
    pub(super) fn rays(&mut self, token: Token, worker: WorkerId, job: JobId, total: u64, now: UnixMillis) {
        let before = self.rays.insert(token, (job, total)).map_or(0, |(_, before)| before);
        let rays = total.saturating_sub(before);
        self.add(worker, job, rays, 0, now);
        let point = self.history.at(now);
        point.rays = point.rays.saturating_add(rays);
    }

    /// Tiles worth `cost` texels were accepted.
    pub(super) fn accepted(&mut self, worker: WorkerId, job: JobId, tiles: u64, cost: u64, now: UnixMillis) {
        self.add(worker, job, 0, cost, now);
        let point = self.history.at(now);
        point.tiles = point.tiles.saturating_add(tiles);
        point.texels = point.texels.saturating_add(cost);
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
        self.jobs.get(&job).map(|window| window.rates(now)).unwrap_or_default()
    }

    /// The rates of a worker.
    pub(super) fn rates_of(&self, worker: WorkerId, now: UnixMillis) -> Rates {
        self.workers.get(&worker).map(|window| window.rates(now)).unwrap_or_default()
    }

    /// What was done over the last hour.
    pub(super) fn throughput(&self, now: UnixMillis) -> Vec<ThroughputPoint> {
        self.history.points(now)
    }

    /// A worker was heard.
    pub(super) fn heard(&mut self, worker: WorkerId, now: UnixMillis) {
        self.heard.insert(worker, now);
    }

    /// Workers heard since a moment; the others are forgotten. What is found here goes into the history too.
    pub(super) fn present(&mut self, since: UnixMillis, now: UnixMillis) -> u64 {
        self.heard.retain(|_, at| *at >= since);
        self.workers.retain(|_, window| !window.is_over(now));
        let present = self.heard.len() as u64;
        self.history.at(now).workers = present;
        present
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
        let worker = WorkerId::random();
        meter.rays(token, worker, job, 1_000, 0);
        meter.rays(token, worker, job, 5_000, 10_000);
        meter.accepted(worker, job, 1, 50, 10_000);
        for (now, expected) in [
            (10_000, Rates { rays: 500.0, cost: 5.0 }),
            (35_000, Rates { rays: 4_000.0 / 30.0, cost: 50.0 / 30.0 }),
            (90_000, Rates::default()),
        ] {
            assert_eq!((meter.rates(job, now), meter.rates_of(worker, now)), (expected, expected), "{now}");
        }
    }

    #[test]
    fn workers_have_rates_of_their_own_over_all_jobs() {
        let (mut meter, one, two) = (Meter::default(), WorkerId::random(), WorkerId::random());
        meter.rays(Token::random(), one, JobId::random(), 100, 0);
        meter.rays(Token::random(), one, JobId::random(), 200, 10_000);
        meter.rays(Token::random(), two, JobId::random(), 5_000, 10_000);
        assert_eq!(meter.rates_of(one, 10_000).rays, 30.0);
        assert_eq!(meter.rates_of(two, 20_000).rays, 500.0);
        assert_eq!(meter.rates_of(WorkerId::random(), 20_000), Rates::default());
        meter.present(0, 45_000);
        assert!(meter.workers.is_empty());
    }

    #[test]
    fn what_is_done_goes_into_the_history() {
        let (mut meter, worker, job, token) = (Meter::default(), WorkerId::random(), JobId::random(), Token::random());
        meter.heard(worker, 10_000);
        meter.present(0, 10_000);
        meter.rays(token, worker, job, 700, 10_100);
        meter.rays(token, worker, job, 900, 10_200);
        meter.accepted(worker, job, 2, 64, 10_300);
        meter.forget(job);
        assert_eq!(meter.throughput(12_000), [ThroughputPoint { at_ms: 10_000, rays: 900, texels: 64, tiles: 2, workers: 1 }]);
    }

    #[test]
    fn absurd_reports_are_added_up_without_overflow() {
        let (mut meter, worker, job) = (Meter::default(), WorkerId::random(), JobId::random());
        for _ in 0..2 {
            meter.rays(Token::random(), worker, job, u64::MAX, 10_000);
            meter.accepted(worker, job, u64::MAX, u64::MAX, 10_000);
        }
        let point = ThroughputPoint { at_ms: 10_000, rays: u64::MAX, texels: u64::MAX, tiles: u64::MAX, workers: 0 };
        assert_eq!(meter.throughput(10_000), [point]);
        assert_eq!(meter.rates(job, 10_000), Rates { rays: u64::MAX as f64, cost: u64::MAX as f64 });
    }

    #[test]
    fn silent_workers_are_not_present() {
        let mut meter = Meter::default();
        meter.heard(WorkerId::random(), 5);
        meter.heard(WorkerId::random(), 50);
        assert_eq!((meter.present(5, 50), meter.present(6, 50), meter.present(0, 50)), (2, 1, 1));
    }
}
