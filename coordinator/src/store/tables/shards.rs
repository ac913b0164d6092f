//! Shards of phases: rows around [`Shard`].

use crate::{
    lease::{SHARD_TILES, Shard},
    store::{
        Candidate, PlanRef, StoreError,
        rows::{count, parse, phase as parse_phase, runs, runs_text},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{ids::JobId, tile::TileRuns, wire::message::Phase};

pub(super) async fn open(c: &mut Tx, job: JobId, phase: Phase, tiles: u64) -> Result<(), StoreError> {
    for index in 0..tiles.div_ceil(SHARD_TILES) {
        save(c, job, phase, index, &Shard::fresh(index, tiles)).await?;
    }
    Ok(())
}

/// A shard, locked.
pub(super) async fn lock(c: &mut Tx, job: JobId, phase: Phase, index: u64) -> Result<Option<Shard>, StoreError> {
    let query = sql("SELECT * FROM shards WHERE job = $1 AND phase = $2 AND shard = $3").locking();
    c.one(query.bind(job.to_string()).bind(phase.to_string()).bind(index)).await?.as_ref().map(row).transpose()
}

fn row(row: &Row) -> Result<Shard, StoreError> {
    let set = |column: &str| runs(&row.text(column)?);
    Ok(Shard {
        pending: set("pending")?,
        done: set("done")?,
        quarantined: set("quarantined")?,
        twinned: set("twinned")?,
        ceilings: parse("bounds of leases", &row.text("ceilings")?)?,
        charges: parse("charges of tiles", &row.text("charges")?)?,
    })
}

pub(super) async fn save(c: &mut Tx, job: JobId, phase: Phase, index: u64, shard: &Shard) -> Result<(), StoreError> {
    let query = sql("INSERT INTO shards (job, phase, shard, pending, done, waiting, quarantined, twinned, ceilings, charges)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)
         ON CONFLICT (job, phase, shard) DO UPDATE SET pending = excluded.pending, done = excluded.done, waiting = excluded.waiting,
         quarantined = excluded.quarantined, twinned = excluded.twinned, ceilings = excluded.ceilings, charges = excluded.charges");
    let query = query.bind(job.to_string()).bind(phase.to_string()).bind(index).bind(runs_text(&shard.pending));
    let query = query.bind(runs_text(&shard.done)).bind(shard.pending.len()).bind(runs_text(&shard.quarantined));
    c.run(query.bind(runs_text(&shard.twinned)).bind(shard.ceilings.to_string()).bind(shard.charges.to_string())).await?;
    Ok(())
}

/// Gives the quarantined tiles of a phase a fresh start.
pub(super) async fn reopen(c: &mut Tx, job: JobId, phase: Phase) -> Result<(), StoreError> {
    let query = sql("SELECT * FROM shards WHERE job = $1 AND phase = $2 AND quarantined <> '' ORDER BY shard").locking();
    for found in c.all(query.bind(job.to_string()).bind(phase.to_string())).await? {
        let (index, mut shard) = (found.count("shard")?, row(&found)?);
        shard.reopen();
        save(c, job, phase, index, &shard).await?;
    }
    Ok(())
}

pub(super) async fn delete(c: &mut Tx, job: JobId) -> Result<(), StoreError> {
    c.run(sql("DELETE FROM shards WHERE job = $1").bind(job.to_string())).await?;
    Ok(())
}

/// Puts tiles of one shard back, but for those that are done. Nothing where the shard is gone with its job.
pub(super) async fn give_back(c: &mut Tx, job: JobId, phase: Phase, index: u64, tiles: &TileRuns) -> Result<(), StoreError> {
    let Some(mut shard) = lock(c, job, phase, index).await? else { return Ok(()) };
    shard.give_back(tiles);
    save(c, job, phase, index, &shard).await
}

/// Shards looked at for one batch of leases.
const SHARDS_AT_ONCE: u32 = 8;

/// What should be leased next: runs of pending tiles, at most `most`, in order.
pub(in super::super) async fn next_work(c: &mut Tx, bake_version: u32, most: usize) -> Result<Vec<Candidate>, StoreError> {
    // The first baking job with something pending, then the partial index over its shards; a join over all jobs would sort every shard.
    let query = sql("SELECT j.id, j.scene_hash, j.plan, j.plan_blob FROM jobs j WHERE j.public = 'baking' AND j.bake_version = $1
         AND EXISTS (SELECT 1 FROM shards s WHERE s.job = j.id AND s.waiting > 0) ORDER BY j.priority DESC, j.id LIMIT 1");
    let Some(job) = c.one(query.bind(bake_version)).await? else { return Ok(Vec::new()) };
    let id = job.text("id")?;
    let query = sql("SELECT phase, pending FROM shards WHERE job = $1 AND waiting > 0 ORDER BY phase, shard LIMIT $2");
    let shards = c.all(query.bind(&id).bind(SHARDS_AT_ONCE)).await?;
    let Some(first) = shards.first() else { return Ok(Vec::new()) };
    let phase = first.text("phase")?;
    let query = sql("SELECT CAST(SUM(waiting) AS BIGINT) AS waiting FROM shards WHERE job = $1 AND phase = $2 AND waiting > 0");
    let waiting = c.one(query.bind(&id).bind(&phase)).await?.and_then(|row| row.maybe_int("waiting").transpose()).transpose()?;
    candidates(&job, &phase, &shards, count(waiting.unwrap_or(0)), most)
}

fn candidates(job: &Row, phase: &str, shards: &[Row], pending: u64, most: usize) -> Result<Vec<Candidate>, StoreError> {
    let (id, scene) = (parse("a job id", &job.text("id")?)?, parse("a scene hash", &job.text("scene_hash")?)?);
    let plan = PlanRef { digest: parse("a digest", &job.text("plan")?)?, blob: parse("a blob name", &job.text("plan_blob")?)? };
    let of_phase = parse_phase(phase)?;
    let mut found = Vec::new();
    for shard in shards {
        if shard.text("phase")? != phase {
            continue;
        }
        for run in runs(&shard.text("pending")?)?.runs().iter().take(most - found.len()) {
            found.push(Candidate { job: id, phase: of_phase, scene, plan, run: *run, pending });
        }
        if found.len() == most {
            break;
        }
    }
    Ok(found)
}
