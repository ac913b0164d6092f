//! Chunks: checked outside any lock, stored, then recorded in one transaction.

use super::{
    Engine, EngineError,
    core::{Core, blocking},
    inspect::{Asked, BadChunk, Checked, check},
    leases::{busy, note_failure},
    segments, tasks,
};
use crate::{
    blob::BlobName,
    lease::{self, Attempt},
    store::{AttemptRow, ChunkOutcome, ChunkRow, ChunkTile, NewChunk},
};
use kiln_proto::{
    ids::{Digest, Token},
    tile::TileIndex,
    wire::message::{ChunkEntry, ChunkVerdict, Refusal, Verdict},
};
use std::{
    collections::BTreeMap,
    fs::File,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tempfile::TempPath;

/// How long a chunk waits for its turn before its worker is told to come back.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often digests are looked up before a chunk is put off: each round means that another worker was quicker meanwhile.
const ROUNDS: usize = 8;

impl Engine {
    /// A chunk of segments, spooled to a local file. Repeating (token, n) is a no-op with the same verdicts.
    ///
    /// # Errors
    /// [`Refusal::Gone`] for attempts that may not deliver, [`Refusal::Invalid`] for bytes that are not a chunk of theirs (this fences the
    /// attempt and puts its tiles back).
    pub async fn chunk(&self, token: Token, n: u64, body: TempPath) -> Result<ChunkVerdict, Refusal> {
        let core = &self.core;
        let attempt = core.store.attempt(token).await.map_err(busy)?.ok_or_else(|| Refusal::Gone { state: "unknown".into() })?;
        if let Some(row) = core.store.chunk(token, n).await.map_err(busy)? {
            match segments::entries(&*core.blobs, &row).await.map_err(busy)? {
                Ok(entries) => return Ok(verdict(&entries, &row)),
                // Its bytes are gone, and here they are again: as good as new.
                Err(gone) => lose(core, &attempt, gone).await?,
            }
        }
        if !matches!(attempt.state, Attempt::Held { .. } | Attempt::Expired) {
            return Err(Refusal::Gone { state: attempt.state.name().into() });
        }
        let slot = tokio::time::timeout(PATIENCE, core.slots.acquire()).await;
        let Ok(Ok(_slot)) = slot else { return Err(Refusal::Busy { retry_after_ms: 500 }) };
        let (checked, body, plan_costs) = match inspect(core, &attempt, body).await.map_err(busy)? {
            Ok(good) => good,
            Err(reason) => return Err(refuse(core, token, &attempt, reason).await),
        };
        self.record(token, n, &attempt, checked, body, &plan_costs).await
    }

    /// Stores and records a chunk that was found good.
    async fn record(
        &self,
        token: Token,
        n: u64,
        attempt: &AttemptRow,
        checked: Checked,
        body: TempPath,
        costs: &[u64],
    ) -> Result<ChunkVerdict, Refusal> {
        let core = &self.core;
        let tiles = checked.entries.iter().zip(costs).map(|(e, cost)| ChunkTile { tile: e.tile, digest: e.digest, cost: *cost }).collect();
        let chunk = NewChunk { token, n, blob: checked.blob, trailer_at: checked.trailer_at, length: checked.length, tiles };
        let _naming = core.gate.read().await;
        core.blobs.put_file(chunk.blob, body).await.map_err(busy)?;
        let mut known = BTreeMap::new();
        for _ in 0..ROUNDS {
            match core.store.record_chunk(&chunk, &known, self.now()).await.map_err(busy)? {
                ChunkOutcome::Recorded(row) => {
                    count(core, attempt, &chunk, &row);
                    core.signals.job_changed(attempt.job);
                    return Ok(verdict(&checked.entries, &row));
                }
                ChunkOutcome::NeedDigests(others) => match digests(core, &others).await.map_err(busy)? {
                    Ok(digests) => known.extend(digests),
                    Err(gone) => lose(core, attempt, gone).await?,
                },
                ChunkOutcome::Gone(state) => return Err(Refusal::Gone { state }),
            }
        }
        Err(Refusal::Busy { retry_after_ms: 500 })
    }
}

type Good = (Checked, TempPath, Vec<u64>);

/// Checks a spooled chunk; the inner error is the sender's fault.
async fn inspect(core: &Arc<Core>, attempt: &AttemptRow, body: TempPath) -> Result<Result<Good, String>, EngineError> {
    let row = tasks::job(core, attempt.job).await?;
    let (_, plan) = tasks::plan(core, &row).await?;
    let (pipeline, phase, run) = (Arc::clone(&core.pipeline), attempt.phase, attempt.run);
    let outcome = blocking(move || {
        let checked = check(&mut File::open(&body)?, &Asked { plan: &plan, phase, run }, &*pipeline)?;
        let costs = checked.entries.iter().map(|e| plan.tile_cost(phase, e.tile)).collect();
        Ok((checked, body, costs))
    });
    match outcome.await? {
        Ok(good) => Ok(Ok(good)),
        Err(BadChunk::Invalid(reason)) => Ok(Err(reason)),
        Err(BadChunk::Read(e)) => Err(EngineError::Broken(format!("the spooled chunk cannot be read: {e}"))),
    }
}

/// A chunk that is not acceptable costs its attempt.
async fn refuse(core: &Core, token: Token, attempt: &AttemptRow, reason: String) -> Refusal {
    core.counters.chunks_refused.fetch_add(1, Ordering::Relaxed);
    let text = format!("worker {} sent a chunk that was refused: {reason}", attempt.worker);
    let fenced = core.store.finish_attempt(token, lease::Event::Refuse, None, core.now()).await;
    if let Err(error) = fenced {
        return busy(error);
    }
    if let Err(error) = note_failure(core, attempt.job, text).await {
        return busy(error);
    }
    Refusal::Invalid { reason }
}

/// Takes back what a chunk brought whose blob is gone; a job that does not need it any more takes no late chunks either.
async fn lose(core: &Core, attempt: &AttemptRow, gone: BlobName) -> Result<(), Refusal> {
    tracing::warn!(job = %attempt.job, phase = %attempt.phase, blob = %gone, "a blob is gone; its tiles are baked again");
    if !core.store.lose_chunk(attempt.job, attempt.phase, gone, core.now()).await.map_err(busy)? {
        return Err(Refusal::Gone { state: "of a phase that is over".into() });
    }
    core.signals.job_changed(attempt.job);
    Ok(())
}

/// Digests of the accepted segments of some chunks; the inner error names one whose blob is gone.
async fn digests(core: &Core, chunks: &[ChunkRow]) -> Result<Result<BTreeMap<TileIndex, Digest>, BlobName>, EngineError> {
    let mut known = BTreeMap::new();
    for chunk in chunks {
        let entries = match segments::entries(&*core.blobs, chunk).await? {
            Ok(entries) => entries,
            Err(gone) => return Ok(Err(gone)),
        };
        known.extend(entries.iter().filter(|e| chunk.accepted.contains(e.tile)).map(|e| (e.tile, e.digest)));
    }
    Ok(Ok(known))
}

fn verdict(entries: &[ChunkEntry], row: &ChunkRow) -> ChunkVerdict {
    let of = |tile: TileIndex| match (row.accepted.contains(tile), row.conflicts.contains(tile)) {
        (true, _) => Verdict::Accepted,
        (false, true) => Verdict::Conflict,
        (false, false) => Verdict::Duplicate,
    };
    ChunkVerdict { tiles: entries.iter().map(|e| (e.tile, of(e.tile))).collect() }
}

fn count(core: &Core, attempt: &AttemptRow, chunk: &NewChunk, row: &ChunkRow) {
    let (accepted, conflicts) = (row.accepted.len(), row.conflicts.len());
    let counters = &core.counters;
    let add = |counter: &AtomicU64, n: u64| counter.fetch_add(n, Ordering::Relaxed);
    add(&counters.chunks_accepted, 1);
    add(&counters.chunk_bytes, chunk.length);
    add(&counters.tiles_accepted, accepted);
    add(&counters.tiles_conflicting, conflicts);
    add(&counters.tiles_duplicate, chunk.tiles.len() as u64 - accepted - conflicts);
    if accepted > 0 {
        let cost = chunk.tiles.iter().filter(|t| row.accepted.contains(t.tile)).map(|t| t.cost).sum();
        core.meter().accepted(attempt.worker, attempt.job, accepted, cost, core.now());
    }
}
