//! Shards of phases: rows around [`Shard`].

use crate::{
    lease::{Kind, SHARD_TILES, Shard},
    store::{
        Candidate, PlanRef, StoreError,
        rows::{parse, phase as parse_phase, runs, runs_text},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{ids::JobId, tile::TileRun, wire::message::Phase};

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

pub(super) fn row(row: &Row) -> Result<Shard, StoreError> {
    let set = |column: &str| runs(&row.text(column)?);
    Ok(Shard {
        pending: set("pending")?,
        done: set("done")?,
        quarantined: set("quarantined")?,
        twinned: set("twinned")?,
        ceilings: parse("bounds of leases", &row.text("ceilings")?)?,
        charges: parse("charges of tiles", &row.text("charges")?)?,
        checks: parse("checks of tiles", &row.text("checks")?)?,
    })
}

pub(super) async fn save(c: &mut Tx, job: JobId, phase: Phase, index: u64, shard: &Shard) -> Result<(), StoreError> {
    let query = sql("INSERT INTO shards (job, phase, shard, pending, done, waiting, quarantined, twinned, ceilings, charges, checks,
         unchecked, unasked) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)
         ON CONFLICT (job, phase, shard) DO UPDATE SET pending = excluded.pending, done = excluded.done, waiting = excluded.waiting,
         quarantined = excluded.quarantined, twinned = excluded.twinned, ceilings = excluded.ceilings, charges = excluded.charges,
         checks = excluded.checks, unchecked = excluded.unchecked, unasked = excluded.unasked");
    let query = query.bind(job.to_string()).bind(phase.to_string()).bind(index).bind(runs_text(&shard.pending));
    let query = query.bind(runs_text(&shard.done)).bind(shard.pending.len()).bind(runs_text(&shard.quarantined));
    let query = query.bind(runs_text(&shard.twinned)).bind(shard.ceilings.to_string()).bind(shard.charges.to_string());
    c.run(query.bind(shard.checks.to_string()).bind(shard.checks.tiles().len()).bind(shard.checks.unasked())).await?;
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

/// Shards of a phase with tiles that must be baked twice and that nobody is asked about, locked.
pub(super) async fn unasked(c: &mut Tx, job: JobId, phase: Phase) -> Result<Vec<(u64, Shard)>, StoreError> {
    let query = sql("SELECT * FROM shards WHERE job = $1 AND phase = $2 AND unasked > 0 ORDER BY shard").locking();
    numbered(&c.all(query.bind(job.to_string()).bind(phase.to_string())).await?)
}

/// Shards of a phase with tiles that are done and not yet believed, locked.
pub(super) async fn unchecked(c: &mut Tx, job: JobId, phase: Phase) -> Result<Vec<(u64, Shard)>, StoreError> {
    let query = sql("SELECT * FROM shards WHERE job = $1 AND phase = $2 AND unchecked > 0 ORDER BY shard").locking();
    numbered(&c.all(query.bind(job.to_string()).bind(phase.to_string())).await?)
}

fn numbered(rows: &[Row]) -> Result<Vec<(u64, Shard)>, StoreError> {
    rows.iter().map(|found| Ok((found.count("shard")?, row(found)?))).collect()
}

/// Shards looked at for one batch of leases.
const SHARDS_AT_ONCE: u32 = 8;

/// Work of a job for at most `most` workers: runs of pending tiles in order, then a check for each tile that nobody is asked about.
pub(in super::super) async fn next_work(c: &mut Tx, job: JobId, most: usize) -> Result<Vec<Candidate>, StoreError> {
    let query = sql("SELECT id, scene_hash, plan, plan_blob FROM jobs WHERE id = $1 AND public = 'baking'").bind(job.to_string());
    let Some(of) = c.one(query).await?.as_ref().map(of_job).transpose()? else { return Ok(Vec::new()) };
    let mut found = pending(c, of, most).await?;
    if found.len() < most {
        let query = sql("SELECT phase, CAST(SUM(unasked) AS BIGINT) AS unasked FROM shards WHERE job = $1 AND unasked > 0 GROUP BY phase");
        for row in c.all(query.bind(job.to_string())).await? {
            let check = Candidate { phase: parse_phase(&row.text("phase")?)?, kind: Kind::Check, ..of };
            let checks = usize::try_from(row.count("unasked")?).unwrap_or(usize::MAX);
            found.extend(std::iter::repeat_n(check, checks.min(most - found.len())));
        }
    }
    Ok(found)
}

async fn pending(c: &mut Tx, of: Candidate, most: usize) -> Result<Vec<Candidate>, StoreError> {
    let job = of.job.to_string();
    let query = sql("SELECT phase, CAST(SUM(waiting) AS BIGINT) AS waiting FROM shards WHERE job = $1 AND waiting > 0 GROUP BY phase");
    let Some(sum) = c.one(query.bind(&job)).await? else { return Ok(Vec::new()) };
    let (phase, pending) = (parse_phase(&sum.text("phase")?)?, sum.count("waiting")?);
    let query = sql("SELECT pending FROM shards WHERE job = $1 AND phase = $2 AND waiting > 0 ORDER BY shard LIMIT $3");
    let mut found = Vec::new();
    for shard in c.all(query.bind(&job).bind(phase.to_string()).bind(SHARDS_AT_ONCE)).await? {
        let runs = runs(&shard.text("pending")?)?;
        found.extend(runs.runs().iter().take(most - found.len()).map(|run| Candidate { phase, run: *run, pending, ..of }));
        if found.len() == most {
            break;
        }
    }
    Ok(found)
}

/// A candidate of a job, its tiles not yet known.
pub(super) fn of_job(job: &Row) -> Result<Candidate, StoreError> {
    let (id, scene) = (parse("a job id", &job.text("id")?)?, parse("a scene hash", &job.text("scene_hash")?)?);
    let plan = PlanRef { digest: parse("a digest", &job.text("plan")?)?, blob: parse("a blob name", &job.text("plan_blob")?)? };
    Ok(Candidate { job: id, phase: Phase::Probe, kind: Kind::Work, scene, plan, run: TileRun { start: 0, end: 0 }, pending: 0 })
}
