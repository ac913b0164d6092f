//! The end of a phase, where nothing waits any more: attempts that are late, and checks that nobody is there to make.

use super::{attempts, chunks, events, jobs, shards, workers};
use crate::{
    lease::{Attempt, Ceilings, Finished, Running, SHARD_TILES},
    records::{EventKind, Problem, UnixMillis},
    store::{
        Candidate, Late, StoreError,
        rows::parse,
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::ids::JobId;

/// Attempts looked at to tell what is usual.
const SAMPLES: u32 = 64;

/// Phases of jobs of a bake version in which nothing waits and something is held, the most urgent job first.
pub(in super::super) async fn late(c: &mut Tx, bake_version: u32, now: UnixMillis) -> Result<Vec<Late>, StoreError> {
    let query = sql("SELECT id, scene_hash, plan, plan_blob FROM jobs j WHERE public = 'baking' AND bake_version = $1
         AND EXISTS (SELECT 1 FROM attempts a WHERE a.job = j.id AND a.state = 'held' AND a.kind <> 'check')
         AND NOT EXISTS (SELECT 1 FROM shards s WHERE s.job = j.id AND s.waiting > 0) ORDER BY priority DESC, id");
    let mut found = Vec::new();
    for row in c.all(query.bind(bake_version)).await? {
        found.extend(of_job(c, shards::of_job(&row)?, now).await?);
    }
    Ok(found)
}

async fn of_job(c: &mut Tx, candidate: Candidate, now: UnixMillis) -> Result<Option<Late>, StoreError> {
    let job = candidate.job.to_string();
    let query =
        sql("SELECT a.*, s.ceilings FROM attempts a JOIN shards s ON s.job = a.job AND s.phase = a.phase AND s.shard = a.first / $2
         WHERE a.job = $1 AND a.state = 'held' AND a.kind <> 'check' ORDER BY a.token");
    let rows = c.all(query.bind(&job).bind(SHARD_TILES)).await?;
    let Some(first) = rows.first() else { return Ok(None) };
    let phase = attempts::row(first)?.phase;
    let query = sql("SELECT cost, ended - granted AS ms FROM attempts WHERE job = $1 AND phase = $2 AND state = 'completed'
         AND kind = 'work' AND cost > 0 ORDER BY ended DESC LIMIT $3");
    let finished = c.all(query.bind(&job).bind(phase.to_string()).bind(SAMPLES)).await?;
    let finished = finished.iter().map(|row| Ok(Finished { ms: row.int("ms")?, cost: row.count("cost")? }));
    Ok(Some(Late {
        candidate: Candidate { phase, ..candidate },
        running: rows.iter().filter_map(|row| running(row).transpose()).collect::<Result<_, StoreError>>()?,
        finished: finished.collect::<Result<_, StoreError>>()?,
        workers: workers::connected(c, candidate.job, now).await?,
    }))
}

fn running(row: &Row) -> Result<Option<Running>, StoreError> {
    let attempt = attempts::row(row)?;
    let Attempt::Held { remaining, .. } = attempt.state else { return Ok(None) };
    let ceilings: Ceilings = parse("bounds of leases", &row.text("ceilings")?)?;
    let suspected = remaining.iter().any(|tile| ceilings.of(tile).is_some());
    Ok(Some(Running {
        token: parse("a token", &row.text("token")?)?,
        worker: attempt.worker,
        since: attempt.granted_ms,
        cost: attempt.cost,
        twin_of: attempt.kind.twin_of(),
        suspected,
        remaining,
    }))
}

/// Jobs that wait for nothing but checks which nobody makes just now.
/// Nor was anything a while ago: a coordinator that was away, or a worker that restarts, must not cost the checks of everybody.
pub(in super::super) async fn unchecked(c: &mut Tx, now: UnixMillis) -> Result<Vec<JobId>, StoreError> {
    let query = sql("SELECT id FROM jobs j WHERE public = 'baking'
         AND EXISTS (SELECT 1 FROM shards s WHERE s.job = j.id AND s.unchecked > 0)
         AND NOT EXISTS (SELECT 1 FROM shards s WHERE s.job = j.id AND s.waiting > 0)
         AND NOT EXISTS (SELECT 1 FROM attempts a WHERE a.job = j.id AND (a.state = 'held' OR a.ended > $1)) ORDER BY id");
    c.all(query.bind(now - workers::SILENCE)).await?.iter().map(|row| parse("a job id", &row.text("id")?)).collect()
}

/// Lets tiles of a job count unchecked that no connected worker could check, because each has baked them. How many.
pub(in super::super) async fn waive(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<u64, StoreError> {
    jobs::lock(c, job).await?;
    let Some(phase) = jobs::state(c, job).await?.and_then(|(state, _)| state.phase()) else { return Ok(0) };
    if !unchecked(c, now).await?.contains(&job) {
        return Ok(0);
    }
    let (connected, mut waived, mut disputed) = (workers::present(c, job, now).await?, 0, 0);
    for (index, mut shard) in shards::unchecked(c, job, phase).await? {
        // Nothing is held: whoever was asked has gone.
        shard.checks.give_all_back();
        let open = shard.checks.disputed();
        let tiles = shard.checks.waive(&connected);
        (waived, disputed) = (waived + tiles.len(), disputed + tiles.intersection(&open).len());
        shards::save(c, job, phase, index, &shard).await?;
    }
    if waived > 0 {
        let message = format!(
            "verify: {waived} tiles of {phase} count unconfirmed, {disputed} of them although workers disagree: nobody is connected who \
             could still be asked; the first bytes were kept"
        );
        events::append(c, job, &EventKind::Problem { problem: Problem::new(message) }, now).await?;
        chunks::count(c, job, phase, waived, now).await?;
    }
    Ok(waived)
}
