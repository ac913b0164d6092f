//! Chunks: the transaction that makes work count.

use super::{
    attempts, events, jobs,
    rows::{count, int, parse, runs, runs_text},
    shards,
};
use crate::{
    job,
    lease::{self, Shard, shard_of},
    records::{EventKind, Problem, UnixMillis},
    store::{AttemptRow, ChunkOutcome, ChunkRow, NewChunk, StoreError},
};
use kiln_proto::{
    ids::{Digest, JobId, Token},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};
use std::collections::BTreeMap;

fn row(row: &SqliteRow) -> Result<ChunkRow, StoreError> {
    let text = |column: &str| row.try_get::<String, _>(column);
    Ok(ChunkRow {
        blob: parse("a blob name", &text("blob")?)?,
        trailer_at: count(row.try_get("trailer_at")?),
        length: count(row.try_get("length")?),
        accepted: runs(&text("accepted")?)?,
        conflicts: runs(&text("conflicts")?)?,
    })
}

pub(super) async fn get(c: &mut SqliteConnection, token: Token, n: u64) -> Result<Option<ChunkRow>, StoreError> {
    let query = sqlx::query("SELECT * FROM chunks WHERE token = ? AND n = ?").bind(token.to_string()).bind(int(n));
    query.fetch_optional(c).await?.as_ref().map(row).transpose()
}

/// Chunks with accepted tiles within a run. Chunks lie within shards, which bounds how far before the run one may begin.
pub(super) async fn covering(c: &mut SqliteConnection, job: JobId, phase: Phase, run: TileRun) -> Result<Vec<ChunkRow>, StoreError> {
    let query = sqlx::query(
        "SELECT * FROM chunks WHERE job = ? AND phase = ? AND accepted <> '' AND first >= ? AND first < ? AND last >= ?
         ORDER BY first, token, n",
    );
    let earliest = run.start.saturating_sub(lease::SHARD_TILES);
    let query = query.bind(job.to_string()).bind(phase.to_string()).bind(int(earliest)).bind(int(run.end)).bind(int(run.start));
    query.fetch_all(c).await?.iter().map(row).collect()
}

/// What a chunk's tiles turn out to be.
struct Sorted {
    fresh: Vec<TileIndex>,
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
                sorted.fresh.push(t.tile);
                sorted.cost += t.cost;
            }
            (true, Some(digest)) if *digest == t.digest => {}
            (true, Some(_)) => sorted.conflicts.insert_tile(t.tile),
            (true, None) => sorted.unknown.insert_tile(t.tile),
        }
    }
    sorted
}

pub(super) async fn record(
    c: &mut SqliteConnection,
    chunk: &NewChunk,
    known: &BTreeMap<TileIndex, Digest>,
    now: UnixMillis,
) -> Result<ChunkOutcome, StoreError> {
    if let Some(row) = get(c, chunk.token, chunk.n).await? {
        return Ok(ChunkOutcome::Recorded(row));
    }
    let Some(mut attempt) = attempts::get(c, chunk.token).await? else { return Ok(ChunkOutcome::Gone("unknown".into())) };
    let index = shard_of(TileIndex(attempt.run.start));
    let Some(mut shard) = shards::load(c, attempt.job, attempt.phase, index).await? else {
        return Ok(ChunkOutcome::Gone("of a job that has ended".into()));
    };
    let sorted = sort(chunk, known, &shard);
    if let Some(TileRun { start, .. }) = sorted.unknown.runs().first() {
        let span = TileRun { start: *start, end: sorted.unknown.runs().last().map_or(*start, |r| r.end) };
        return Ok(ChunkOutcome::NeedDigests(covering(c, attempt.job, attempt.phase, span).await?));
    }
    let tiles: TileRuns = chunk.tiles.iter().map(|t| t.tile).collect();
    if let Err(illegal) = attempts::happen(c, chunk.token, &mut attempt, lease::Event::Deliver(tiles), now).await? {
        return Ok(ChunkOutcome::Gone(illegal.state.into()));
    }
    let accepted: TileRuns = sorted.fresh.iter().copied().filter(|t| shard.accept(*t)).collect();
    shards::save(c, attempt.job, attempt.phase, index, &shard).await?;
    let row = ChunkRow {
        blob: chunk.blob,
        trailer_at: chunk.trailer_at,
        length: chunk.length,
        accepted: accepted.clone(),
        conflicts: sorted.conflicts.clone(),
    };
    insert(c, chunk, &attempt, &row, sorted.cost).await?;
    credit(c, chunk.token, &attempt, &accepted, sorted.cost, now).await?;
    if !sorted.conflicts.is_empty() {
        blame(c, &attempt, &sorted.conflicts, now).await?;
    }
    Ok(ChunkOutcome::Recorded(row))
}

async fn insert(c: &mut SqliteConnection, chunk: &NewChunk, attempt: &AttemptRow, row: &ChunkRow, cost: u64) -> Result<(), StoreError> {
    let first = row.accepted.runs().first().map_or(attempt.run.start, |r| r.start);
    let last = row.accepted.runs().last().map_or(first, |r| r.end - 1);
    sqlx::query(
        "INSERT INTO chunks (token, n, job, phase, blob, trailer_at, length, first, last, accepted, conflicts, cost)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(chunk.token.to_string())
    .bind(int(chunk.n))
    .bind(attempt.job.to_string())
    .bind(attempt.phase.to_string())
    .bind(row.blob.to_string())
    .bind(int(row.trailer_at))
    .bind(int(row.length))
    .bind(int(first))
    .bind(int(last))
    .bind(runs_text(&row.accepted))
    .bind(runs_text(&row.conflicts))
    .bind(int(cost))
    .execute(c)
    .await?;
    Ok(())
}

/// Counts accepted tiles for the attempt and the job, tells about them, and lets the job move on.
async fn credit(
    c: &mut SqliteConnection,
    token: Token,
    attempt: &AttemptRow,
    accepted: &TileRuns,
    cost: u64,
    now: UnixMillis,
) -> Result<(), StoreError> {
    if accepted.is_empty() {
        return Ok(());
    }
    let job = attempt.job.to_string();
    sqlx::query("UPDATE attempts SET texels = texels + ? WHERE token = ?").bind(int(cost)).bind(token.to_string()).execute(&mut *c).await?;
    let query =
        sqlx::query_as("UPDATE jobs SET tiles_done = tiles_done + ?, cost_done = cost_done + ? WHERE id = ? RETURNING tiles_done, tiles");
    let (done, tiles): (i64, i64) = query.bind(int(accepted.len())).bind(int(cost)).bind(job).fetch_one(&mut *c).await?;
    let kind = EventKind::Tiles { phase: attempt.phase, runs: accepted.runs().to_vec(), tiles_done: count(done), tiles: count(tiles) };
    events::append(c, attempt.job, &kind, now).await?;
    let event = job::Event::Accepted { phase: attempt.phase, tiles: accepted.len() };
    match jobs::happen(c, attempt.job, &event, now).await? {
        Some(Ok(())) => Ok(()),
        // Shards and job are saved together; where they disagree, the database is not ours any more.
        Some(Err(illegal)) => Err(super::rows::strange("a job whose shards agree with its state", illegal.to_string())),
        None => Err(super::rows::strange("the job of an attempt", "nothing")),
    }
}

/// Records that two workers baked different bytes for the same tiles: one of them is wrong, or the estimator is not deterministic.
async fn blame(c: &mut SqliteConnection, attempt: &AttemptRow, conflicts: &TileRuns, now: UnixMillis) -> Result<(), StoreError> {
    let tile = TileIndex(conflicts.runs().first().map_or(attempt.run.start, |r| r.start));
    let query = sqlx::query_as(
        "SELECT a.worker, k.accepted FROM chunks k JOIN attempts a ON a.token = k.token
         WHERE k.job = ? AND k.phase = ? AND k.accepted <> '' AND k.first >= ? AND k.first <= ? AND k.last >= ?",
    );
    let earliest = tile.0.saturating_sub(lease::SHARD_TILES);
    let query = query.bind(attempt.job.to_string()).bind(attempt.phase.to_string()).bind(int(earliest)).bind(int(tile.0)).bind(int(tile.0));
    let around: Vec<(String, String)> = query.fetch_all(&mut *c).await?;
    let mut other = None;
    // The chunks of several workers may reach across each other; one of them brought the tile.
    for (worker, accepted) in around {
        if runs(&accepted)?.contains(tile) {
            other = Some(worker);
        }
    }
    let message = format!(
        "determinism: worker {} baked other bytes for tiles {} of {} than worker {}; the first ones were kept",
        attempt.worker,
        runs_text(conflicts),
        attempt.phase,
        other.as_deref().unwrap_or("(forgotten)"),
    );
    events::append(c, attempt.job, &EventKind::Problem { problem: Problem { message, file: None, line: None } }, now).await
}
