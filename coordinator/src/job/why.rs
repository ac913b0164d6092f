//! Why is it not running? One sentence, from facts that the caller has gathered: what holds a job up, and what to do where something can be
//! done. Only the first cause is told, in the order in which they have to be removed.

use super::state::Job;
use kiln_proto::ids::JobId;
use std::collections::BTreeMap;

/// What bears on whether a job gets on.
#[derive(Debug, Clone, Copy)]
pub struct Facts<'a> {
    /// The job's state.
    pub state: &'a Job,
    /// What a task of it waits for that storage failed under.
    pub put_off: Option<&'a str>,
    /// What is wrong with the storage for segments (a full disk, a bucket that does not answer), with what to do about it.
    pub storage: Option<&'a str>,
    /// The bake version of the job.
    pub bake_version: u32,
    /// Connected workers by their bake version, none of them barred.
    pub workers: &'a BTreeMap<u32, u64>,
    /// Workers of the job's bake version that are barred.
    pub barred: u64,
    /// Tiles of the phase that wait.
    pub pending: u64,
    /// Tiles of the phase that are leased.
    pub leased: u64,
    /// Tiles that are done and wait for a second worker's opinion.
    pub checks: u64,
    /// Tiles in quarantine.
    pub quarantined: u64,
    /// Jobs that go first, the next one first.
    pub ahead: &'a [Ahead],
    /// Leases that the job's token holds, and how many it may, where that is all of them.
    pub bound: Option<(u64, u64)>,
}

/// A job that goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ahead {
    /// Which; nothing where it is somebody else's, who may not want to be known.
    pub job: Option<JobId>,
    /// Its tiles that wait.
    pub tiles: u64,
}

/// Why the job does not get on; `None` where it does, or where nothing is to come.
#[must_use]
pub fn why(facts: &Facts<'_>) -> Option<String> {
    if facts.state.is_final() {
        return ended(facts);
    }
    // Nothing else would help.
    if let Some(put_off) = facts.put_off {
        return Some(put_off.to_owned());
    }
    match facts.state {
        Job::Queued => Some("its scene is being imported".into()),
        Job::Preparing => Some("it is being prepared: its surfaces are laid out and cut into tiles".into()),
        Job::Paused { .. } if facts.leased > 0 => {
            Some(format!("it is paused ({} still leased); `kiln resume` lets it go on", tiles(facts.leased)))
        }
        Job::Paused { .. } => Some("it is paused; `kiln resume` lets it go on".into()),
        Job::Baking { left: 0, phase, .. } => Some(format!("the results of phase {phase} are being merged")),
        Job::Baking { .. } => baking(facts),
        _ => None,
    }
}

fn ended(facts: &Facts<'_>) -> Option<String> {
    let (Job::Failed { retry: Some(_), .. }, n) = (facts.state, facts.quarantined) else { return None };
    Some(format!("{} in quarantine; mend the cause, and `kiln retry` bakes {} again", tiles(n), if n == 1 { "it" } else { "them" }))
}

fn baking(facts: &Facts<'_>) -> Option<String> {
    if let Some(storage) = facts.storage {
        return Some(storage.to_owned());
    }
    let able = facts.workers.get(&facts.bake_version).copied().unwrap_or(0);
    if able == 0 && facts.leased == 0 {
        return Some(nobody(facts));
    }
    match (facts.pending, facts.leased) {
        (0, 0) if facts.checks > 0 => Some(format!("{} must be baked by a second worker to be verified", tiles(facts.checks))),
        (0, 0) => None,
        (0, 1) => Some("it waits for the last tile that is leased".into()),
        (0, leased) => Some(format!("it waits for the last {leased} tiles, which are leased")),
        (_, 0) => Some(match facts.bound {
            Some((held, most)) => format!("its token holds {held} leases already, and may hold {most} at a time"),
            None => behind(facts, able),
        }),
        _ => None,
    }
}

/// No worker could take a tile.
fn nobody(facts: &Facts<'_>) -> String {
    let others: Vec<String> = facts.workers.iter().filter(|(_, n)| **n > 0).map(|(version, n)| format!("{n} of {version}")).collect();
    match (facts.barred, others.as_slice()) {
        (0, []) => "no worker is connected; start one with `kiln work --join URL`".into(),
        (0, others) => format!(
            "it needs workers of bake version {}, and those connected are others: {}; start one of its version",
            facts.bake_version,
            others.join(", ")
        ),
        (n, _) => format!("every worker that could bake it is barred for its failures ({n}); see GET /v1/workers, and start others"),
    }
}

/// Workers are there and none holds a tile of it.
fn behind(facts: &Facts<'_>, able: u64) -> String {
    match facts.ahead {
        [] => format!("{able} {} connected, and none has taken a tile of it yet", if able == 1 { "worker is" } else { "workers are" }),
        [one] => format!("{} goes first: {} to do there", name(one), tiles(one.tiles)),
        [first, ..] => {
            let all = facts.ahead.iter().map(|a| a.tiles).sum();
            format!("{} jobs go first, {} the next of them: {} to do there", facts.ahead.len(), name(first), tiles(all))
        }
    }
}

fn name(ahead: &Ahead) -> String {
    ahead.job.map_or_else(|| "somebody else's job".into(), |job| format!("job {job}"))
}

fn tiles(n: u64) -> String {
    format!("{n} {}", if n == 1 { "tile" } else { "tiles" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{job::Retry, records::Problem};
    use kiln_proto::wire::message::Phase;
    use uuid::Uuid;

    const BAKING: Job = Job::Baking { phase: Phase::Bake, left: 9, surfaces: 1 };
    const PAUSED: Job = Job::Paused { phase: Phase::Bake, left: 9, surfaces: 1 };

    #[test]
    fn the_first_cause_is_told() {
        let (none, some, other) = (BTreeMap::new(), BTreeMap::from([(1, 3)]), BTreeMap::from([(2, 3), (4, 1)]));
        let [a, b] = [7, 8].map(|n| Ahead { job: Some(JobId(Uuid::from_u128(n))), tiles: 5 });
        let stranger = Ahead { job: None, tiles: 1 };
        let failed = |retry| Job::Failed { problem: Problem::new("no"), retry };
        let stopped = failed(Some(Retry { phase: Phase::Bake, left: 2, surfaces: 1 }));
        let broken = failed(None);
        let merging = Job::Baking { phase: Phase::Probe, left: 0, surfaces: 1 };
        let assembling = Job::Assembling { left: 1, surfaces: 1 };
        let base = Facts {
            state: &BAKING,
            put_off: None,
            storage: None,
            bake_version: 1,
            workers: &some,
            barred: 0,
            pending: 4,
            leased: 0,
            checks: 0,
            quarantined: 0,
            ahead: &[],
            bound: None,
        };
        let id = a.job.unwrap();
        let queue = format!("2 jobs go first, job {id} the next of them: 10 tiles to do there");
        let one = format!("job {id} goes first: 5 tiles to do there");
        let table: &[(Facts<'_>, Option<&str>)] = &[
            (Facts { state: &Job::Queued, ..base }, Some("its scene is being imported")),
            (Facts { state: &Job::Preparing, ..base }, Some("it is being prepared: its surfaces are laid out and cut into tiles")),
            (Facts { state: &Job::Preparing, put_off: Some("the disk is full"), ..base }, Some("the disk is full")),
            (Facts { state: &PAUSED, ..base }, Some("it is paused; `kiln resume` lets it go on")),
            (Facts { state: &PAUSED, leased: 2, ..base }, Some("it is paused (2 tiles still leased); `kiln resume` lets it go on")),
            (Facts { state: &merging, ..base }, Some("the results of phase probe are being merged")),
            (Facts { storage: Some("the disk is full"), workers: &none, ..base }, Some("the disk is full")),
            (Facts { workers: &none, ..base }, Some("no worker is connected; start one with `kiln work --join URL`")),
            (
                Facts { workers: &other, ..base },
                Some("it needs workers of bake version 1, and those connected are others: 3 of 2, 1 of 4; start one of its version"),
            ),
            (
                Facts { workers: &none, barred: 2, ..base },
                Some("every worker that could bake it is barred for its failures (2); see GET /v1/workers, and start others"),
            ),
            (Facts { ahead: &[a], ..base }, Some(&one)),
            (Facts { ahead: &[a, b], ..base }, Some(&queue)),
            (Facts { ahead: &[stranger], ..base }, Some("somebody else's job goes first: 1 tile to do there")),
            (Facts { ahead: &[a], bound: Some((2, 2)), ..base }, Some("its token holds 2 leases already, and may hold 2 at a time")),
            (base, Some("3 workers are connected, and none has taken a tile of it yet")),
            (Facts { pending: 0, leased: 1, ..base }, Some("it waits for the last tile that is leased")),
            (Facts { pending: 0, leased: 5, ..base }, Some("it waits for the last 5 tiles, which are leased")),
            (Facts { pending: 0, checks: 2, ..base }, Some("2 tiles must be baked by a second worker to be verified")),
            (Facts { leased: 3, ..base }, None),
            (Facts { state: &assembling, ..base }, None),
            (
                Facts { state: &stopped, quarantined: 2, ..base },
                Some("2 tiles in quarantine; mend the cause, and `kiln retry` bakes them again"),
            ),
            (Facts { state: &broken, ..base }, None),
            (Facts { state: &Job::Done, ..base }, None),
        ];
        for (facts, expected) in table {
            assert_eq!(why(facts).as_deref(), *expected, "{facts:?}");
        }
    }
}
