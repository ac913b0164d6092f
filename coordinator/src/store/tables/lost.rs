//! Chunks whose bytes are gone: what they brought is taken back.

use super::{events, jobs, shards};
use crate::{
    blob::BlobName,
    job,
    lease::shard_of,
    records::{EventKind, Problem, UnixMillis},
    store::{
        StoreError,
        rows::runs,
        sql::{Tx, sql},
    },
};
use kiln_proto::{
    ids::JobId,
    tile::{TileIndex, TileRuns},
    wire::message::Phase,
};

/// Takes back what the chunks with this blob brought to a phase. Whether the job still needs it; if not, the transaction must be dropped.
pub(in super::super) async fn lose(c: &mut Tx, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError> {
    jobs::lock(c, job).await?;
    let query = sql("DELETE FROM chunks WHERE job = $1 AND phase = $2 AND blob = $3 RETURNING accepted, cost");
    let rows = c.all(query.bind(job.to_string()).bind(phase.to_string()).bind(blob.to_string())).await?;
    let (mut tiles, mut cost) = (TileRuns::new(), 0);
    for row in &rows {
        tiles = tiles.union(&runs(&row.text("accepted")?)?);
        cost += row.count("cost")?;
    }
    if tiles.is_empty() {
        // Somebody else noticed first, or every tile of it was a duplicate: there is nothing to take back.
        return Ok(!rows.is_empty() && jobs::state(c, job).await?.is_some_and(|(state, _)| state.phase() == Some(phase)));
    }
    // Before the shards, which go with a job that has ended.
    let event = job::Event::Lost { phase, tiles: tiles.len() };
    if !matches!(jobs::happen(c, job, &event, now).await?, Some(Ok(()))) {
        return Ok(false);
    }
    give_back(c, job, phase, &tiles).await?;
    let query = sql("UPDATE jobs SET tiles_done = tiles_done - $1, cost_done = CASE WHEN cost_done > $2 THEN cost_done - $2 ELSE 0 END
         WHERE id = $3");
    c.run(query.bind(tiles.len()).bind(cost).bind(job.to_string())).await?;
    let message = format!("the chunk {blob} is gone; its {} tiles of {phase} are baked again", tiles.len());
    events::append(c, job, &EventKind::Problem { problem: Problem::new(message) }, now).await?;
    Ok(true)
}

/// Chunks lie within shards, but several with the same bytes are one loss all the same.
async fn give_back(c: &mut Tx, job: JobId, phase: Phase, tiles: &TileRuns) -> Result<(), StoreError> {
    let mut indices: Vec<u64> = tiles.runs().iter().map(|run| shard_of(TileIndex(run.start))).collect();
    indices.dedup();
    for index in indices {
        if let Some(mut shard) = shards::lock(c, job, phase, index).await? {
            shard.lose(tiles);
            shards::save(c, job, phase, index, &shard).await?;
        }
    }
    Ok(())
}
