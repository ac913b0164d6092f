//! Chunks whose bytes are gone: what they brought is taken back.

use super::{
    events, jobs,
    rows::{count, int, runs},
    shards,
};
use crate::{
    blob::BlobName,
    job,
    lease::shard_of,
    records::{EventKind, Problem, UnixMillis},
    store::StoreError,
};
use kiln_proto::{ids::JobId, tile::TileRuns, wire::message::Phase};
use sqlx::SqliteConnection;

/// Takes back what the chunks with this blob brought to a phase. Whether the job still needs it; if not, the transaction must be dropped.
pub(super) async fn lose(c: &mut SqliteConnection, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError> {
    let query = sqlx::query_as("DELETE FROM chunks WHERE job = ? AND phase = ? AND blob = ? RETURNING accepted, cost");
    let query = query.bind(job.to_string()).bind(phase.to_string()).bind(blob.to_string());
    let rows: Vec<(String, i64)> = query.fetch_all(&mut *c).await?;
    let (mut tiles, mut cost) = (TileRuns::new(), 0);
    for (accepted, of) in &rows {
        tiles = tiles.union(&runs(accepted)?);
        cost += count(*of);
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
    sqlx::query("UPDATE jobs SET tiles_done = tiles_done - ?, cost_done = MAX(cost_done - ?, 0) WHERE id = ?")
        .bind(int(tiles.len()))
        .bind(int(cost))
        .bind(job.to_string())
        .execute(&mut *c)
        .await?;
    let message = format!("the chunk {blob} is gone; its {} tiles of {phase} are baked again", tiles.len());
    events::append(c, job, &EventKind::Problem { problem: Problem { message, file: None, line: None } }, now).await?;
    Ok(true)
}

/// Chunks lie within shards, but several with the same bytes are one loss all the same.
async fn give_back(c: &mut SqliteConnection, job: JobId, phase: Phase, tiles: &TileRuns) -> Result<(), StoreError> {
    let mut indices: Vec<u64> = tiles.runs().iter().map(|run| shard_of(kiln_proto::tile::TileIndex(run.start))).collect();
    indices.dedup();
    for index in indices {
        if let Some(mut shard) = shards::load(c, job, phase, index).await? {
            shard.lose(tiles);
            shards::save(c, job, phase, index, &shard).await?;
        }
    }
    Ok(())
}
