//! Chunks whose bytes are gone or not to be trusted: what they brought is taken back.

use super::{events, jobs, shards};
use crate::{
    blob::BlobName,
    job,
    lease::{Shard, shard_of},
    records::{EventKind, Problem, UnixMillis},
    store::{
        StoreError,
        rows::runs,
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, WorkerId},
    tile::{TileIndex, TileRuns},
    wire::message::Phase,
};

/// Takes back what the chunks with this blob brought to a phase. Whether the job still needs it; if not, the transaction must be dropped.
pub(in super::super) async fn lose(c: &mut Tx, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError> {
    jobs::lock(c, job).await?;
    let query = sql("DELETE FROM chunks WHERE job = $1 AND phase = $2 AND blob = $3 RETURNING accepted, cost");
    let rows = c.all(query.bind(job.to_string()).bind(phase.to_string()).bind(blob.to_string())).await?;
    let brought = Brought::of(&rows)?;
    if brought.tiles.is_empty() {
        // Somebody else noticed first, or every tile of it was a duplicate: there is nothing to take back.
        return Ok(!rows.is_empty() && jobs::state(c, job).await?.is_some_and(|(state, _)| state.phase() == Some(phase)));
    }
    let message = format!("the chunk {blob} is gone; its {} tiles of {phase} are baked again", brought.tiles.len());
    undo(c, job, phase, &brought, message, now).await
}

/// Takes back what a worker brought to a phase, where the job can still bake it again; a phase that is over stays as it is.
pub(super) async fn take_back(c: &mut Tx, job: JobId, phase: Phase, worker: WorkerId, now: UnixMillis) -> Result<(), StoreError> {
    jobs::lock(c, job).await?;
    let query = sql("SELECT accepted, cost FROM chunks WHERE job = $1 AND phase = $2 AND worker = $3 AND accepted <> ''");
    let rows = c.all(query.bind(job.to_string()).bind(phase.to_string()).bind(worker.to_string())).await?;
    let brought = Brought::of(&rows)?;
    let n = brought.tiles.len();
    let message = format!("the {n} tiles of {phase} that worker {worker} delivered are not to be trusted, and are baked again");
    if n > 0 && undo(c, job, phase, &brought, message, now).await? {
        let query = sql("DELETE FROM chunks WHERE job = $1 AND phase = $2 AND worker = $3");
        c.run(query.bind(job.to_string()).bind(phase.to_string()).bind(worker.to_string())).await?;
    }
    Ok(())
}

/// What chunks brought.
struct Brought {
    tiles: TileRuns,
    cost: u64,
}

impl Brought {
    fn of(rows: &[Row]) -> Result<Self, StoreError> {
        let mut all = Self { tiles: TileRuns::new(), cost: 0 };
        for row in rows {
            all.tiles = all.tiles.union(&runs(&row.text("accepted")?)?);
            all.cost += row.count("cost")?;
        }
        Ok(all)
    }
}

/// Puts tiles that were delivered back to work. Whether the job still needs them; if not, nothing has changed.
async fn undo(c: &mut Tx, job: JobId, phase: Phase, of: &Brought, message: String, now: UnixMillis) -> Result<bool, StoreError> {
    let mut shards = locked(c, job, phase, &of.tiles).await?;
    // What another worker had not yet confirmed has not counted for the job either.
    let unchecked: u64 = shards.iter().map(|(_, shard)| shard.checks.tiles().intersection(&of.tiles).len()).sum();
    let counted = of.tiles.len() - unchecked;
    let event = job::Event::Lost { phase, tiles: counted };
    if counted > 0 && !matches!(jobs::happen(c, job, &event, now).await?, Some(Ok(()))) {
        return Ok(false);
    }
    for (index, shard) in &mut shards {
        shard.lose(&of.tiles);
        shards::save(c, job, phase, *index, shard).await?;
    }
    jobs::undo(c, job, of.tiles.len(), of.cost).await?;
    events::append(c, job, &EventKind::Problem { problem: Problem::new(message) }, now).await?;
    Ok(true)
}

/// The shards of tiles. Chunks lie within shards, but several with the same bytes are one loss all the same.
async fn locked(c: &mut Tx, job: JobId, phase: Phase, tiles: &TileRuns) -> Result<Vec<(u64, Shard)>, StoreError> {
    let mut indices: Vec<u64> = tiles.runs().iter().map(|run| shard_of(TileIndex(run.start))).collect();
    indices.dedup();
    let mut found = Vec::with_capacity(indices.len());
    for index in indices {
        found.extend(shards::lock(c, job, phase, index).await?.map(|shard| (index, shard)));
    }
    Ok(found)
}
