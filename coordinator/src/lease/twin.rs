//! Which attempt is so late that an idle worker bakes along.
//!
//! At the end of a phase everybody waits for the slowest machine. When nothing is pending and an attempt runs past twice the 95th
//! percentile of what attempts take, one idle worker gets a twin of it: the same tiles, another token. Whoever delivers first wins each
//! tile ([`Event::Overtaken`](super::Event::Overtaken) tells the other), so a twin costs baking twice at most and never a wrong result.
//! Times are compared per unit of cost, because leases differ in size. The alternative, twins of everything as soon as workers are idle,
//! shortens the end hardly more and doubles the energy of every bake's last minute.

use super::rule::Rule;
use crate::records::UnixMillis;
use kiln_proto::{
    ids::{Token, WorkerId},
    tile::{TileRun, TileRuns},
};

/// Finished attempts without which nobody knows what is late.
const SAMPLES: usize = 8;

/// How many times the 95th percentile is late.
const LATE: f64 = 2.0;

/// Of this many workers one may be busy with a twin: 5 % of capacity.
const CAPACITY: u64 = 20;

/// An attempt that is held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Running {
    /// Its name.
    pub token: Token,
    /// Who holds it.
    pub worker: WorkerId,
    /// When it was granted.
    pub since: UnixMillis,
    /// What its tiles cost, all that were leased, texels.
    pub cost: u64,
    /// Its tiles that nobody has delivered.
    pub remaining: TileRuns,
    /// The attempt that it is a twin of.
    pub twin_of: Option<Token>,
    /// Whether leases of its tiles have failed before (see [`Ceilings`](super::Ceilings)). What kills workers shall not get a second one
    /// at a time.
    pub suspected: bool,
}

/// An attempt that delivered everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finished {
    /// How long it took, milliseconds.
    pub ms: i64,
    /// What its tiles cost, texels.
    pub cost: u64,
}

/// One phase of a job at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Tiles of the phase that wait.
    pub pending: u64,
    /// Attempts that are held.
    pub running: &'a [Running],
    /// Attempts that finished lately.
    pub finished: &'a [Finished],
    /// Workers that could bake the phase.
    pub workers: u64,
}

/// A twin to grant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Twin {
    /// The attempt that is late.
    pub of: Token,
    /// The longest run of what it owes, which is what the twin gets.
    pub run: TileRun,
}

impl Field<'_> {
    /// The twin that an idle worker gets: of the attempt that is latest.
    #[must_use]
    pub fn twin(&self, idle: WorkerId, now: UnixMillis) -> Option<Twin> {
        let twins = self.running.iter().filter(|r| r.twin_of.is_some()).count() as u64;
        if self.pending > 0 || twins >= (self.workers / CAPACITY).max(1) {
            return None;
        }
        let limit = LATE * self.percentile()?;
        let has_twin = |token| self.running.iter().any(|r| r.twin_of == Some(token));
        let fits = |r: &&Running| {
            let free = r.twin_of.is_none() && !has_twin(r.token) && !r.suspected;
            free && !r.remaining.is_empty() && (r.worker != idle || !Rule::OtherTwin.holds())
        };
        let lateness = |r: &Running| (now - r.since) as f64 / (r.cost.max(1) as f64 * limit);
        let late = self.running.iter().filter(fits).map(|r| (lateness(r), r)).filter(|(late, _)| *late > 1.0);
        let (_, latest) = late.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.token.cmp(&a.1.token)))?;
        let run = latest.remaining.runs().iter().copied().max_by_key(|run| (run.len(), run.start))?;
        Some(Twin { of: latest.token, run })
    }

    /// The 95th percentile of milliseconds a texel (nearest rank); `None` with too few samples.
    fn percentile(&self) -> Option<f64> {
        let mut rates: Vec<f64> = self.finished.iter().filter(|f| f.cost > 0).map(|f| f.ms.max(1) as f64 / f.cost as f64).collect();
        if rates.len() < SAMPLES {
            return None;
        }
        rates.sort_unstable_by(f64::total_cmp);
        rates.get((rates.len() * 95).div_ceil(100) - 1).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;

    fn worker(n: u128) -> WorkerId {
        WorkerId(Uuid::from_u128(n))
    }

    fn token(n: u128) -> Token {
        Token(Uuid::from_u128(n))
    }

    fn running(n: u128, cost: u64) -> Running {
        Running { token: token(n), worker: worker(n), since: 0, cost, remaining: TileRuns::all(4), twin_of: None, suspected: false }
    }

    /// Nineteen of 100 ms, one of 900, each for 10 texels: the 95th percentile is 10 ms a texel.
    fn finished() -> Vec<Finished> {
        (0..20).map(|n| Finished { ms: if n == 3 { 900 } else { 100 }, cost: 10 }).collect()
    }

    fn twin(pending: u64, running: &[Running], finished: &[Finished], idle: u128, now: i64) -> Option<Token> {
        Field { pending, running, finished, workers: 3 }.twin(worker(idle), now).map(|t| t.of)
    }

    #[test]
    fn the_latest_attempt_beyond_twice_the_percentile_gets_a_twin_for_its_cost() {
        let (two, done) = ([running(1, 10), running(2, 5)], finished());
        assert_eq!(twin(0, &two, &done, 9, 100), None);
        assert_eq!(twin(0, &two, &done, 9, 101), Some(token(2)), "half the cost, late after half the time");
        assert_eq!(twin(0, &two[..1], &done, 9, 200), None);
        assert_eq!(twin(0, &two[..1], &done, 9, 201), Some(token(1)));
    }

    #[test]
    fn no_twin_while_tiles_wait_or_samples_lack_or_on_the_same_worker() {
        let (one, done) = ([running(1, 10)], finished());
        assert_eq!(twin(1, &one, &done, 9, 1_000), None);
        assert_eq!(twin(0, &one, &done[..SAMPLES - 1], 9, 1_000), None);
        assert_eq!(twin(0, &one, &done, 1, 1_000), None);
        let delivered = [Running { remaining: TileRuns::new(), ..running(1, 10) }];
        assert_eq!(twin(0, &delivered, &done, 9, 1_000), None);
        let suspected = [Running { suspected: true, ..running(1, 10) }];
        assert_eq!(twin(0, &suspected, &done, 9, 1_000), None);
    }

    #[test]
    fn one_twin_an_attempt_and_one_in_twenty_workers() {
        let own = Running { twin_of: Some(token(1)), ..running(3, 10) };
        let (all, done) = ([running(1, 10), running(2, 10), own], finished());
        let field = |workers| Field { pending: 0, running: &all, finished: &done, workers };
        assert_eq!(field(39).twin(worker(9), 1_000), None, "one is out");
        let second = field(40).twin(worker(9), 1_000);
        assert_eq!(second, Some(Twin { of: token(2), run: TileRun { start: 0, end: 4 } }), "neither a twin nor one that has a twin");
    }

    #[test]
    fn a_twin_gets_the_longest_run_of_what_is_left() {
        let rest: TileRuns = [0, 2, 3, 4, 6].into_iter().map(kiln_proto::tile::TileIndex).collect();
        let (one, done) = ([Running { remaining: rest, ..running(1, 10) }], finished());
        let field = Field { pending: 0, running: &one, finished: &done, workers: 1 };
        assert_eq!(field.twin(worker(9), 1_000).map(|t| t.run), Some(TileRun { start: 2, end: 5 }));
    }
}
