//! Chunks: the transaction that makes work count.

use super::{attempts, events, jobs, locks, opinions, opinions::Sample, poison, shards};
use crate::{
    job,
    lease::{self, Accepted, Attempt, Kind, Shard, shard_of},
    records::{EventKind, Problem, UnixMillis},
    store::{
        AttemptRow, ChunkOutcome, ChunkRow, ChunkTile, Delivery, NewChunk, StoreError,
        rows::{parse, runs, runs_text, strange},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{
    ids::{Digest, JobId, Token, WorkerId},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};
use std::{collections::BTreeMap, sync::Arc};

fn row(row: &Row) -> Result<ChunkRow, StoreError> {
    Ok(ChunkRow {
        blob: parse("a blob name", &row.text("blob")?)?,
        trailer_at: row.count("trailer_at")?,
        length: row.count("length")?,
        accepted: runs(&row.text("accepted")?)?,
        conflicts: runs(&row.text("conflicts")?)?,
    })
}

pub(in super::super) async fn get(c: &mut Tx, token: Token, n: u64) -> Result<Option<ChunkRow>, StoreError> {
    let query = sql("SELECT * FROM chunks WHERE token = $1 AND n = $2").bind(token.to_string()).bind(n);
    c.one(query).await?.as_ref().map(row).transpose()
}

/// Chunks with accepted tiles within a run. Chunks lie within shards, which bounds how far before the run one may begin.
pub(in super::super) async fn covering(c: &mut Tx, job: JobId, phase: Phase, run: TileRun) -> Result<Vec<ChunkRow>, StoreError> {
    let query = sql("SELECT * FROM chunks WHERE job = $1 AND phase = $2 AND accepted <> '' AND first >= $3 AND first < $4 AND last >= $5
         ORDER BY first, token, n");
    let earliest = run.start.saturating_sub(lease::SHARD_TILES);
    let query = query.bind(job.to_string()).bind(phase.to_string()).bind(earliest).bind(run.end).bind(run.start);
    c.all(query).await?.iter().map(row).collect()
}

/// What a chunk's tiles turn out to be.
struct Sorted {
    fresh: Vec<ChunkTile>,
    cost: u64,
    conflicts: TileRuns,
    /// Done, and nobody has told the digest.
    unknown: TileRuns,
}

fn sort(chunk: &NewChunk, known: &BTreeMap<TileIndex, Digest>, shard: &Shard) -> Sorted {
    let mut sorted = Sorted { fresh: vec![], cost: 0, conflicts: TileRuns::new(), unknown: TileRuns::new() };
    for t in &chunk.tiles {
        match (shard.done.contains(t.tile), known.get(&t.tile)) {
            (false, _) => {
                sorted.fresh.push(*t);
                sorted.cost += t.cost;
            }
            (true, Some(digest)) if *digest == t.digest => {}
            (true, Some(_)) => sorted.conflicts.insert_tile(t.tile),
            (true, None) => sorted.unknown.insert_tile(t.tile),
        }
    }
    sorted
}

/// Records several chunks, of whichever jobs: an answer for each, in order.
pub(in super::super) async fn record_all(
    c: &mut Tx,
    deliveries: &[Arc<Delivery>],
    now: UnixMillis,
) -> Result<Vec<ChunkOutcome>, StoreError> {
    locks::of_attempts(c, deliveries.iter().map(|d| d.chunk.token)).await?;
    let mut outcomes = Vec::with_capacity(deliveries.len());
    for delivery in deliveries {
        outcomes.push(record(c, &delivery.chunk, &delivery.known, now).await?);
    }
    Ok(outcomes)
}

async fn record(c: &mut Tx, chunk: &NewChunk, known: &BTreeMap<TileIndex, Digest>, now: UnixMillis) -> Result<ChunkOutcome, StoreError> {
    if let Some(row) = get(c, chunk.token, chunk.n).await? {
        return Ok(ChunkOutcome::Recorded(row));
    }
    let Some((mut attempt, sample)) = opinions::sampled(c, chunk.token).await? else { return Ok(ChunkOutcome::Gone("unknown".into())) };
    let index = shard_of(TileIndex(attempt.run.start));
    let Some(mut shard) = shards::lock(c, attempt.job, attempt.phase, index).await? else {
        return Ok(ChunkOutcome::Gone("of a job that has ended".into()));
    };
    // A lease may have been granted in the moment in which its job failed or ended: nothing of it counts then.
    if jobs::state(c, attempt.job).await?.is_none_or(|(state, _)| state.phase() != Some(attempt.phase)) {
        return Ok(ChunkOutcome::Gone("of a job that does not bake".into()));
    }
    if attempt.kind == Kind::Check {
        return opinions::hear(c, chunk, attempt, shard, now).await;
    }
    let sorted = sort(chunk, known, &shard);
    if let Some(TileRun { start, .. }) = sorted.unknown.runs().first() {
        let span = TileRun { start: *start, end: sorted.unknown.runs().last().map_or(*start, |r| r.end) };
        return Ok(ChunkOutcome::NeedDigests(covering(c, attempt.job, attempt.phase, span).await?));
    }
    if let Err(illegal) = attempts::happen(c, chunk.token, &mut attempt, lease::Event::Deliver(chunk.set()), "", now).await? {
        return Ok(ChunkOutcome::Gone(illegal.state.into()));
    }
    // While an attempt is held and has no twin, nobody else owes its tiles.
    let shared = matches!(attempt.state, Attempt::Expired) || !shard.twinned.is_empty();
    let taken = accept(&mut shard, &sorted.fresh, &attempt, &sample);
    shards::save(c, attempt.job, attempt.phase, index, &shard).await?;
    if shared {
        attempts::overtake(c, chunk.token, &attempt, &taken.accepted, now).await?;
    }
    for (worker, tile) in taken.refuted {
        poison::refute(c, worker, &attempt, tile, now).await?;
    }
    let row = ChunkRow {
        blob: chunk.blob,
        trailer_at: chunk.trailer_at,
        length: chunk.length,
        accepted: taken.accepted.clone(),
        conflicts: sorted.conflicts.clone(),
    };
    insert(c, chunk, &attempt, &row, sorted.cost).await?;
    credit(c, chunk.token, &attempt, &Credit { accepted: &taken.accepted, counted: taken.counted, cost: sorted.cost }, now).await?;
    if !sorted.conflicts.is_empty() {
        blame(c, &attempt, &sorted.conflicts, now).await?;
    }
    Ok(ChunkOutcome::Recorded(row))
}

/// What a chunk's tiles were worth.
struct Taken {
    accepted: TileRuns,
    /// Of them, those that count for the job now: not filled holes, and not what another worker must confirm first.
    counted: u64,
    /// Workers that failed tiles which this one managed.
    refuted: Vec<(WorkerId, TileIndex)>,
}

/// Accepts tiles that nobody had delivered when they were sorted.
fn accept(shard: &mut Shard, fresh: &[ChunkTile], attempt: &AttemptRow, sample: &Sample) -> Taken {
    let mut taken = Taken { accepted: TileRuns::new(), counted: 0, refuted: vec![] };
    for ChunkTile { tile, digest, .. } in fresh.iter().copied() {
        let failed = shard.refuted(tile, attempt.worker).into_iter().map(|worker| (worker, tile));
        taken.refuted.extend(failed);
        match shard.accept(tile) {
            Accepted::First if sample.takes(attempt, tile) => shard.checks.open(tile, attempt.worker, digest),
            Accepted::First => taken.counted += 1,
            Accepted::Filled => {}
            Accepted::Known => continue,
        }
        taken.accepted.insert_tile(tile);
    }
    taken
}

pub(super) async fn insert(c: &mut Tx, chunk: &NewChunk, attempt: &AttemptRow, row: &ChunkRow, cost: u64) -> Result<(), StoreError> {
    let first = row.accepted.runs().first().map_or(attempt.run.start, |r| r.start);
    let last = row.accepted.runs().last().map_or(first, |r| r.end - 1);
    let query = sql("INSERT INTO chunks (token, n, job, phase, blob, trailer_at, length, first, last, accepted, conflicts, cost, worker)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)");
    let query = query.bind(chunk.token.to_string()).bind(chunk.n).bind(attempt.job.to_string()).bind(attempt.phase.to_string());
    let query = query.bind(row.blob.to_string()).bind(row.trailer_at).bind(row.length).bind(first).bind(last);
    let query = query.bind(runs_text(&row.accepted)).bind(runs_text(&row.conflicts)).bind(cost);
    c.run(query.bind(attempt.worker.to_string())).await?;
    Ok(())
}

/// What a chunk brought.
struct Credit<'a> {
    accepted: &'a TileRuns,
    counted: u64,
    cost: u64,
}

/// Counts accepted tiles for the attempt and the job, tells about them, and lets the job move on.
async fn credit(c: &mut Tx, token: Token, attempt: &AttemptRow, credit: &Credit<'_>, now: UnixMillis) -> Result<(), StoreError> {
    let Credit { accepted, counted, cost } = *credit;
    if accepted.is_empty() {
        return Ok(());
    }
    c.run(sql("UPDATE attempts SET texels = texels + $1 WHERE token = $2").bind(cost).bind(token.to_string())).await?;
    let query = sql("UPDATE jobs SET tiles_done = tiles_done + $1, cost_done = cost_done + $2 WHERE id = $3 RETURNING tiles_done, tiles");
    let job = c.one(query.bind(accepted.len()).bind(cost).bind(attempt.job.to_string())).await?;
    let job = job.ok_or_else(|| strange("the job of an attempt", "nothing"))?;
    let (tiles_done, tiles) = (job.count("tiles_done")?, job.count("tiles")?);
    let kind = EventKind::Tiles { phase: attempt.phase, runs: accepted.runs().to_vec(), tiles_done, tiles };
    events::append(c, attempt.job, &kind, now).await?;
    count(c, attempt.job, attempt.phase, counted, now).await
}

/// Lets tiles count for the job, which may move on by that.
pub(super) async fn count(c: &mut Tx, of: JobId, phase: Phase, tiles: u64, now: UnixMillis) -> Result<(), StoreError> {
    if tiles == 0 {
        return Ok(());
    }
    match jobs::happen(c, of, &job::Event::Accepted { phase, tiles }, now).await? {
        Some(Ok(())) => Ok(()),
        // Shards and job are saved together; where they disagree, the database is not ours any more.
        Some(Err(illegal)) => Err(strange("a job whose shards agree with its state", illegal.to_string())),
        None => Err(strange("the job of an attempt", "nothing")),
    }
}

/// Records that two workers baked different bytes for the same tiles: one of them is wrong, or the estimator is not deterministic.
async fn blame(c: &mut Tx, attempt: &AttemptRow, conflicts: &TileRuns, now: UnixMillis) -> Result<(), StoreError> {
    let tile = TileIndex(conflicts.runs().first().map_or(attempt.run.start, |r| r.start));
    let query = sql("SELECT worker, accepted FROM chunks WHERE job = $1 AND phase = $2 AND accepted <> '' AND first >= $3 AND first <= $4
         AND last >= $4");
    let earliest = tile.0.saturating_sub(lease::SHARD_TILES);
    let query = query.bind(attempt.job.to_string()).bind(attempt.phase.to_string()).bind(earliest).bind(tile.0);
    let mut other = None;
    // The chunks of several workers may reach across each other; one of them brought the tile.
    for row in c.all(query).await? {
        if runs(&row.text("accepted")?)?.contains(tile) {
            other = Some(row.text("worker")?);
        }
    }
    let message = format!(
        "determinism: worker {} baked other bytes for tiles {} of {} than worker {}; the first ones were kept",
        attempt.worker,
        runs_text(conflicts),
        attempt.phase,
        other.as_deref().unwrap_or("(unknown)"),
    );
    events::append(c, attempt.job, &EventKind::Problem { problem: Problem::new(message) }, now).await
}
