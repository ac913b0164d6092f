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
/// Attempts that every present worker may fail without a tile accepted between them, before the job is given up.
const FAILURES: u32 = 5;
/// A worker that failed gets no tile of the job for this long, milliseconds, ...
const REST: i64 = 1_000;
/// ... twice as long each time, up to this.
const REST_MOST: i64 = 60_000;

/// How one worker fails at one job.
#[derive(Default)]
struct Strikes {
    /// Failures since any tile of the job was accepted.
    now: u32,
    /// Failures since a tile of its own was accepted.
    all: u32,
    /// It gets no tile before this.
    until: UnixMillis,
}

#[derive(Default)]
struct JobMeter {
    /// When, rays, cost.
    samples: VecDeque<(UnixMillis, u64, u64)>,
    since: Option<UnixMillis>,
    strikes: HashMap<WorkerId, Strikes>,
    /// The first failure since a tile was accepted.
    failing_since: Option<UnixMillis>,
    /// Workers that fell silent over tiles without delivering one, since a tile was accepted.
    vanished: u32,
}

/// All meters.
#[derive(Default)]
pub(super) struct Meter {
    jobs: HashMap<JobId, JobMeter>,
    rays: HashMap<Token, (JobId, u64)>,
    /// When each worker was heard first and last.
    heard: HashMap<WorkerId, (UnixMillis, UnixMillis)>,
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

    /// Tiles worth `cost` texels were accepted from a worker.
    pub(super) fn accepted(&mut self, job: JobId, worker: WorkerId, cost: u64, now: UnixMillis) {
        self.add(job, 0, cost, now);
        if let Some(meter) = self.jobs.get_mut(&job) {
            meter.strikes.remove(&worker);
            meter.strikes.values_mut().for_each(|s| s.now = 0);
            (meter.failing_since, meter.vanished) = (None, 0);
        }
    }

    /// An attempt failed; `silent` where its worker fell silent. Whether the job is hopeless: every worker heard since `present` has failed
    /// often enough. Where workers keep vanishing over its tiles, those that joined meanwhile are not waited for: they are the same one,
    /// started again after each crash.
    pub(super) fn failed(&mut self, job: JobId, worker: WorkerId, silent: bool, now: UnixMillis, present: UnixMillis) -> bool {
        if silent {
            // Until it is heard again.
            self.heard.remove(&worker);
        }
        let meter = self.jobs.entry(job).or_default();
        let strikes = meter.strikes.entry(worker).or_default();
        (strikes.now, strikes.all) = (strikes.now + 1, strikes.all + 1);
        strikes.until = now + REST.saturating_mul(1 << (strikes.all - 1).min(10)).min(REST_MOST);
        let began = *meter.failing_since.get_or_insert(now);
        meter.vanished += u32::from(silent);
        let vanishing = meter.vanished >= FAILURES;
        let total: u32 = meter.strikes.values().map(|s| s.now).sum();
        let spent =
            |id: &WorkerId, first: UnixMillis| meter.strikes.get(id).is_some_and(|s| s.now >= FAILURES) || (vanishing && first > began);
        total >= FAILURES
            && self.heard.iter().filter(|(_, (_, last))| *last >= present).all(|(id, (first, _))| spent(id, *first))
            && (vanishing || !self.heard.is_empty())
    }

    /// Jobs that a worker gets no tile of for now, and when the first of them is open to it again.
    pub(super) fn resting(&self, worker: WorkerId, now: UnixMillis) -> (Vec<JobId>, Option<UnixMillis>) {
        let until = |meter: &JobMeter| meter.strikes.get(&worker).map(|s| s.until).filter(|until| *until > now);
        let all: Vec<(JobId, UnixMillis)> = self.jobs.iter().filter_map(|(job, meter)| Some((*job, until(meter)?))).collect();
        (all.iter().map(|(job, _)| *job).collect(), all.iter().map(|(_, until)| *until).min())
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
        self.heard.entry(worker).or_insert((now, now)).1 = now;
    }

    /// Workers heard since a moment; the others are forgotten.
    pub(super) fn present(&mut self, since: UnixMillis) -> u64 {
        self.heard.retain(|_, (_, last)| *last >= since);
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
        meter.accepted(job, WorkerId::random(), 50, 10_000);
        assert_eq!(meter.rates(job, 10_000), Rates { rays: 500.0, cost: 5.0 });
        assert_eq!(meter.rates(job, 35_000), Rates { rays: 4_000.0 / 30.0, cost: 50.0 / 30.0 });
        assert_eq!(meter.rates(job, 90_000), Rates::default());
    }

    #[test]
    fn a_job_is_hopeless_when_every_present_worker_has_failed_often_with_nothing_accepted() {
        let (mut meter, job, [a, b]) = (Meter::default(), JobId::random(), [WorkerId::random(), WorkerId::random()]);
        let fail = |meter: &mut Meter, worker| meter.failed(job, worker, false, 0, 0);
        meter.heard(a, 0);
        assert!((1..FAILURES).all(|_| !fail(&mut meter, a)));
        meter.accepted(job, b, 1, 0);
        assert!((1..FAILURES).all(|_| !fail(&mut meter, a)));
        // A burst of one broken worker is nothing to a job that another can bake.
        meter.heard(b, 0);
        assert!((0..50).all(|_| !fail(&mut meter, a)));
        assert!((1..FAILURES).all(|_| !fail(&mut meter, b)));
        assert!(fail(&mut meter, b));
    }

    #[test]
    fn a_worker_that_fails_rests_longer_each_time() {
        let (mut meter, job, worker) = (Meter::default(), JobId::random(), WorkerId::random());
        for rest in [1_000, 2_000, 4_000] {
            meter.failed(job, worker, false, 10, 0);
            assert_eq!(meter.resting(worker, 10), (vec![job], Some(10 + rest)));
        }
        assert_eq!(meter.resting(worker, 4_010), (vec![], None));
        assert_eq!(meter.resting(WorkerId::random(), 10), (vec![], None));
        for _ in 0..100 {
            meter.failed(job, worker, false, 10, 0);
        }
        assert_eq!(meter.resting(worker, 10).1, Some(10 + REST_MOST));
        meter.accepted(job, worker, 1, 10);
        assert_eq!(meter.resting(worker, 10), (vec![], None));
    }

    #[test]
    fn a_worker_that_dies_of_a_tile_and_is_started_again_ends_the_job() {
        let (mut meter, job) = (Meter::default(), JobId::random());
        let lives: Vec<bool> = (0..i64::from(FAILURES))
            .map(|life| {
                let (worker, next) = (WorkerId::random(), WorkerId::random());
                meter.heard(worker, life * 100);
                meter.heard(next, life * 100 + 99);
                meter.failed(job, worker, true, life * 100 + 90, 0)
            })
            .collect();
        assert_eq!(lives, [false, false, false, false, true]);
    }

    #[test]
    fn silent_workers_are_not_present() {
        let mut meter = Meter::default();
        meter.heard(WorkerId::random(), 5);
        meter.heard(WorkerId::random(), 50);
        assert_eq!((meter.present(5), meter.present(6), meter.present(0)), (2, 1, 1));
    }
}
