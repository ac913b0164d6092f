//! Shards of phases: rows around [`Shard`].

use super::rows::{count, int, parse, phase as parse_phase, runs, runs_text};
use crate::{
    lease::{SHARD_TILES, Shard},
    store::{Candidate, PlanRef, StoreError},
};
use kiln_proto::{ids::JobId, tile::TileRuns, wire::message::Phase};
use sqlx::SqliteConnection;

pub(super) async fn open(c: &mut SqliteConnection, job: JobId, phase: Phase, tiles: u64) -> Result<(), StoreError> {
    for index in 0..tiles.div_ceil(SHARD_TILES) {
        save(c, job, phase, index, &Shard::fresh(index, tiles)).await?;
    }
    Ok(())
}

pub(super) async fn load(c: &mut SqliteConnection, job: JobId, phase: Phase, index: u64) -> Result<Option<Shard>, StoreError> {
    let query = sqlx::query_as("SELECT pending, done FROM shards WHERE job = ? AND phase = ? AND shard = ?");
    let row: Option<(String, String)> = query.bind(job.to_string()).bind(phase.to_string()).bind(int(index)).fetch_optional(c).await?;
    row.map(|(pending, done)| Ok(Shard { pending: runs(&pending)?, done: runs(&done)? })).transpose()
}

pub(super) async fn save(c: &mut SqliteConnection, job: JobId, phase: Phase, index: u64, shard: &Shard) -> Result<(), StoreError> {
    sqlx::query("INSERT OR REPLACE INTO shards (job, phase, shard, pending, done, waiting) VALUES (?, ?, ?, ?, ?, ?)")
        .bind(job.to_string())
        .bind(phase.to_string())
        .bind(int(index))
        .bind(runs_text(&shard.pending))
        .bind(runs_text(&shard.done))
        .bind(int(shard.pending.len()))
        .execute(c)
        .await?;
    Ok(())
}

/// Puts tiles of one shard back, but for those that are done. Nothing where the shard is gone with its job.
pub(super) async fn give_back(c: &mut SqliteConnection, job: JobId, phase: Phase, index: u64, tiles: &TileRuns) -> Result<(), StoreError> {
    let Some(mut shard) = load(c, job, phase, index).await? else { return Ok(()) };
    shard.give_back(tiles);
    save(c, job, phase, index, &shard).await
}

pub(super) async fn next_work(c: &mut SqliteConnection, bake_version: u32) -> Result<Option<Candidate>, StoreError> {
    // The join order is fixed (CROSS JOIN): a few baking jobs, then the partial index over their shards that have something waiting.
    let query = sqlx::query_as(
        "SELECT j.id, s.phase, j.scene_hash, j.plan, j.plan_blob, s.pending
         FROM jobs j CROSS JOIN shards s ON s.job = j.id AND s.waiting > 0
         WHERE j.public = 'baking' AND j.bake_version = ?
         ORDER BY j.priority DESC, j.id, s.phase, s.shard LIMIT 1",
    );
    type Found = (String, String, String, String, String, String);
    let found: Option<Found> = query.bind(bake_version).fetch_optional(&mut *c).await?;
    let Some((job, phase, scene, plan, plan_blob, pending)) = found else { return Ok(None) };
    let Some(run) = runs(&pending)?.runs().first().copied() else { return Ok(None) };
    let waiting: i64 = sqlx::query_scalar("SELECT SUM(waiting) FROM shards WHERE job = ? AND phase = ? AND waiting > 0")
        .bind(&job)
        .bind(&phase)
        .fetch_one(c)
        .await?;
    Ok(Some(Candidate {
        job: parse("a job id", &job)?,
        phase: parse_phase(&phase)?,
        scene: parse("a scene hash", &scene)?,
        plan: PlanRef { digest: parse("a digest", &plan)?, blob: parse("a blob name", &plan_blob)? },
        run,
        pending: count(waiting),
    }))
}
