//! A job as clients see it: the stored row, plus what is known of the present moment.

use super::{core::Core, space};
use crate::{
    job::{self, Ahead, Facts, Job},
    records::{JobRecord, JobState, Progress},
    store::{ClaimRow, JobRow, StoreError},
};
use std::collections::{BTreeMap, btree_map::Entry};

/// What bears on every job at one moment.
struct Moment {
    /// Connected workers that are not barred, by bake version.
    workers: BTreeMap<u32, u64>,
    /// Connected workers that are barred, by bake version.
    barred: BTreeMap<u32, u64>,
    /// What waits of jobs that bake, by bake version.
    claims: BTreeMap<u32, Vec<ClaimRow>>,
    /// What is wrong with the storage for segments.
    storage: Option<String>,
}

impl Moment {
    async fn look(core: &Core, rows: &[JobRow]) -> Result<Self, StoreError> {
        let mut moment = Self { workers: BTreeMap::new(), barred: BTreeMap::new(), claims: BTreeMap::new(), storage: storage(core) };
        let baking = |row: &&JobRow| matches!(row.state, Job::Baking { .. });
        if !rows.iter().any(|row| baking(&row)) {
            return Ok(moment);
        }
        for worker in core.store.workers(core.now() - core.silence()).await? {
            let count = if worker.barred.is_some() { &mut moment.barred } else { &mut moment.workers };
            *count.entry(worker.bake_version).or_default() += 1;
        }
        for row in rows.iter().filter(baking) {
            if let Entry::Vacant(unknown) = moment.claims.entry(row.spec.bake_version) {
                unknown.insert(core.store.claims(row.spec.bake_version).await?);
            }
        }
        Ok(moment)
    }

    /// Jobs that go before this one, the next one first.
    fn ahead(&self, of: &JobRow) -> Vec<Ahead> {
        let before = |c: &&ClaimRow| {
            let waits = c.waiting + c.unasked > 0 && c.job != of.spec.id;
            waits && (c.priority, std::cmp::Reverse(c.job)) > (of.spec.priority, std::cmp::Reverse(of.spec.id))
        };
        let mut ahead: Vec<&ClaimRow> = self.claims.get(&of.spec.bake_version).into_iter().flatten().filter(before).collect();
        ahead.sort_by_key(|c| (std::cmp::Reverse(c.priority), c.job));
        // Whose jobs are not seen are not named either.
        let named = |c: &ClaimRow| (c.owner == of.spec.owner).then_some(c.job);
        ahead.iter().map(|c| Ahead { job: named(c), tiles: c.waiting + c.unasked }).collect()
    }

    /// Leases that the token of a job holds, where it may hold no more.
    fn bound(&self, of: &JobRow, most: Option<u64>) -> Option<(u64, u64)> {
        let owner = of.spec.owner?;
        let claims = self.claims.get(&of.spec.bake_version).into_iter().flatten();
        let held = claims.filter(|c| c.owner == Some(owner)).map(|c| c.leased).sum();
        most.filter(|most| held >= *most).map(|most| (held, most))
    }

    /// Why a job does not get on.
    fn why(&self, row: &JobRow, most: Option<u64>) -> Option<String> {
        let version = row.spec.bake_version;
        let left = match &row.state {
            Job::Baking { left, .. } | Job::Paused { left, .. } => *left,
            Job::Failed { retry: Some(retry), .. } => retry.left,
            _ => 0,
        };
        let rest = left.saturating_sub(row.pending).saturating_sub(row.unchecked);
        // What a job that failed has neither waiting nor done is what it failed for.
        let (leased, quarantined) = if row.state.is_final() { (0, rest) } else { (rest, 0) };
        job::why(&Facts {
            state: &row.state,
            put_off: row.put_off.as_deref(),
            storage: self.storage.as_deref(),
            bake_version: version,
            workers: &self.workers,
            barred: self.barred.get(&version).copied().unwrap_or(0),
            pending: row.pending,
            leased,
            checks: row.unchecked,
            quarantined,
            ahead: &self.ahead(row),
            bound: self.bound(row, most),
        })
    }
}

/// The records of jobs.
pub(super) async fn records(core: &Core, rows: Vec<JobRow>) -> Result<Vec<JobRecord>, StoreError> {
    let moment = Moment::look(core, &rows).await?;
    Ok(rows.into_iter().map(|row| record(core, &moment, row)).collect())
}

/// The record of a job.
pub(super) async fn one(core: &Core, row: JobRow) -> Result<JobRecord, StoreError> {
    let moment = Moment::look(core, std::slice::from_ref(&row)).await?;
    Ok(record(core, &moment, row))
}

fn record(core: &Core, moment: &Moment, row: JobRow) -> JobRecord {
    let rates = core.meter().rates(row.spec.id, core.now());
    let waiting = moment.why(&row, core.config.lease.per_token);
    let baking = matches!(row.state, Job::Baking { .. });
    let (cost, cost_done) = row.cost;
    let fraction = match row.state {
        Job::Queued | Job::Preparing => 0.0,
        Job::Assembling { .. } | Job::Done => 1.0,
        _ if cost == 0 => 0.0,
        _ => (cost_done as f64 / cost as f64).min(1.0),
    };
    let left = cost.saturating_sub(cost_done) as f64;
    let problem = match &row.state {
        Job::Failed { problem, .. } => Some(problem.clone()),
        _ => None,
    };
    let entered = |wanted: JobState| row.marks.iter().find(|(state, ..)| *state == wanted).map(|(.., at)| *at);
    // Whatever was not delivered when the last tile was, nobody will deliver.
    let holes = match row.state {
        Job::Assembling { .. } | Job::Done => row.tiles.0.saturating_sub(row.tiles.1),
        _ => 0,
    };
    JobRecord {
        id: row.spec.id,
        scene: row.scene_hash,
        state: row.state.public(),
        phase: row.state.phase(),
        priority: row.spec.priority,
        progress: Progress {
            tiles: row.tiles.0,
            tiles_done: row.tiles.1,
            tiles_unverified: row.unchecked,
            texels: row.texels,
            fraction,
            rays: row.rays,
            rays_per_second: if baking { rates.rays } else { 0.0 },
            workers: row.workers,
            eta_seconds: (baking && rates.cost > 0.0).then(|| left / rates.cost),
        },
        problem,
        waiting,
        created_ms: row.created_ms,
        started_ms: entered(JobState::Baking),
        finished_ms: row.marks.last().filter(|(state, ..)| state.is_final()).map(|(.., at)| *at),
        settings: row.spec.settings,
        labels: row.spec.labels,
        on_poison: row.spec.on_poison,
        holes,
        owner: row.spec.owner,
    }
}

fn storage(core: &Core) -> Option<String> {
    let folder = &core.config.data_dir;
    let full = space::free(folder).is_ok_and(|free| free < core.config.reserve_bytes);
    full.then(|| format!("the disk of {} is full; workers are put off until there is room", folder.display()))
}
