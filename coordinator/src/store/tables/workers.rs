//! Workers, and what each did for which job.

use crate::{
    lease::RAYS,
    records::{UnixMillis, WorkerRecord},
    store::{
        AttemptRow, Contribution, StoreError,
        rows::{from_json, int, json, parse, phase as parse_phase, strange},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    wire::message::Finish,
};
use std::collections::BTreeSet;

pub(in super::super) async fn put(c: &mut Tx, worker: &WorkerRecord) -> Result<(), StoreError> {
    let query = sql("INSERT INTO workers (id, name, threads, features, bake_version, since, seen, texels, rays, core_seconds, peak_rss)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)
         ON CONFLICT (id) DO UPDATE SET name = excluded.name, threads = excluded.threads, features = excluded.features,
         bake_version = excluded.bake_version, since = excluded.since, seen = excluded.seen, texels = excluded.texels,
         rays = excluded.rays, core_seconds = excluded.core_seconds, peak_rss = excluded.peak_rss");
    let query = query.bind(worker.id.to_string()).bind(&worker.name).bind(worker.threads).bind(json(&worker.features)?);
    let query = query.bind(worker.bake_version).bind(worker.since_ms).bind(worker.seen_ms).bind(worker.texels_done);
    c.run(query.bind(worker.rays).bind(worker.core_seconds).bind(worker.peak_rss_bytes)).await?;
    Ok(())
}

macro_rules! select {
    ($rest:literal) => {
        concat!(
            "SELECT workers.*, (SELECT job FROM attempts a WHERE a.worker = workers.id AND a.state = 'held'
             ORDER BY granted DESC LIMIT 1) AS job FROM workers ",
            $rest
        )
    };
}

fn row(row: &Row) -> Result<WorkerRecord, StoreError> {
    Ok(WorkerRecord {
        id: parse("a worker id", &row.text("id")?)?,
        name: row.text("name")?,
        threads: row.small("threads")?,
        features: from_json("features", &row.text("features")?)?,
        bake_version: row.small("bake_version")?,
        barred: row.maybe_text("barred")?,
        since_ms: row.int("since")?,
        seen_ms: row.int("seen")?,
        job: row.maybe_text("job")?.map(|t| parse("a job id", &t)).transpose()?,
        texels_done: row.count("texels")?,
        rays: row.count("rays")?,
        core_seconds: row.real("core_seconds")?,
        peak_rss_bytes: row.count("peak_rss")?,
        // Of the moment: the engine knows them.
        rays_per_second: 0.0,
        texels_per_second: 0.0,
    })
}

pub(in super::super) async fn get(c: &mut Tx, id: WorkerId) -> Result<Option<WorkerRecord>, StoreError> {
    c.one(sql(select!("WHERE id = $1")).bind(id.to_string())).await?.as_ref().map(row).transpose()
}

pub(in super::super) async fn list(c: &mut Tx, since: UnixMillis) -> Result<Vec<WorkerRecord>, StoreError> {
    c.all(sql(select!("WHERE seen >= $1 ORDER BY id DESC")).bind(since)).await?.iter().map(row).collect()
}

/// Notes when workers were heard last, in the order of their ids.
pub(in super::super) async fn heard(c: &mut Tx, workers: &[(WorkerId, UnixMillis)]) -> Result<(), StoreError> {
    if c.is_postgres() {
        let (ids, times): (Vec<String>, Vec<i64>) = workers.iter().map(|(id, at)| (id.to_string(), *at)).unzip();
        let query = sql("WITH heard AS (SELECT * FROM unnest($1::TEXT[], $2::BIGINT[]) AS h (id, at)),
             known AS (SELECT id FROM workers WHERE id = ANY($1) ORDER BY id FOR NO KEY UPDATE)
             UPDATE workers w SET seen = GREATEST(w.seen, h.at) FROM heard h JOIN known k ON k.id = h.id WHERE w.id = h.id");
        c.run(query.bind(ids).bind(times)).await?;
        return Ok(());
    }
    for (id, at) in workers {
        c.run(sql("UPDATE workers SET seen = MAX(seen, $1) WHERE id = $2").bind(*at).bind(id.to_string())).await?;
    }
    Ok(())
}

/// A worker that was not heard for this long is not connected, milliseconds: a lease's lifetime and a long poll.
pub(super) const SILENCE: i64 = 90_000;

/// How many workers could bake for a job.
pub(super) async fn connected(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<u64, StoreError> {
    let query = sql("SELECT COUNT(*) AS connected FROM workers WHERE seen >= $1 AND barred IS NULL
         AND bake_version = (SELECT bake_version FROM jobs WHERE id = $2)");
    let row = c.one(query.bind(now - SILENCE).bind(job.to_string())).await?;
    row.map_or(Ok(0), |row| row.count("connected"))
}

/// Workers that get nothing any more.
pub(super) async fn barred(c: &mut Tx) -> Result<BTreeSet<WorkerId>, StoreError> {
    let rows = c.all(sql("SELECT id FROM workers WHERE barred IS NOT NULL")).await?;
    rows.iter().map(|row| parse("a worker id", &row.text("id")?)).collect()
}

/// The workers that [`connected`] counts.
pub(super) async fn present(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<Vec<WorkerId>, StoreError> {
    let query = sql("SELECT id FROM workers WHERE seen >= $1 AND barred IS NULL
         AND bake_version = (SELECT bake_version FROM jobs WHERE id = $2) ORDER BY id");
    let rows = c.all(query.bind(now - SILENCE).bind(job.to_string())).await?;
    rows.iter().map(|row| parse("a worker id", &row.text("id")?)).collect()
}

/// Credits an attempt that just ended to its worker and its job.
pub(super) async fn contribute(
    c: &mut Tx,
    token: Token,
    row: &AttemptRow,
    finish: Option<&Finish>,
    now: UnixMillis,
) -> Result<(), StoreError> {
    let told = c.one(sql("SELECT texels, rays FROM attempts WHERE token = $1").bind(token.to_string())).await?;
    let told = told.ok_or_else(|| strange("an attempt that just ended", "nothing"))?;
    let (texels, beaten) = (told.int("texels")?, told.int("rays")?);
    let rays = finish.map_or(beaten, |f| int(f.rays.min(RAYS)).max(beaten));
    // What a worker says is for the record only; a nonsense number must not poison the sums.
    let core_seconds = finish.map_or(0.0, |f| f.core_seconds).clamp(0.0, 1e9);
    let core_seconds = if core_seconds.is_nan() { 0.0 } else { core_seconds };
    let peak = finish.map_or(0, |f| int(f.peak_rss_bytes));
    let (worker, job) = (row.worker.to_string(), row.job.to_string());
    c.run(sql("UPDATE jobs SET rays = rays + $1 WHERE id = $2").bind(rays).bind(&job)).await?;
    let query = sql("UPDATE workers SET texels = texels + $1, rays = rays + $2, core_seconds = core_seconds + $3,
         peak_rss = CASE WHEN peak_rss > $4 THEN peak_rss ELSE $4 END, seen = CASE WHEN seen > $5 THEN seen ELSE $5 END WHERE id = $6");
    let seen = if finish.is_some() { now } else { 0 };
    c.run(query.bind(texels).bind(rays).bind(core_seconds).bind(peak).bind(seen).bind(&worker)).await?;
    let query = sql("INSERT INTO contributions (job, phase, worker, name, attempts, texels, rays, core_seconds, peak_rss)
         VALUES ($1, $2, $3, COALESCE((SELECT name FROM workers WHERE id = $3), $3), 1, $4, $5, $6, $7)
         ON CONFLICT (job, phase, worker) DO UPDATE SET attempts = contributions.attempts + 1,
         texels = contributions.texels + excluded.texels, rays = contributions.rays + excluded.rays,
         core_seconds = contributions.core_seconds + excluded.core_seconds,
         peak_rss = CASE WHEN contributions.peak_rss > excluded.peak_rss THEN contributions.peak_rss ELSE excluded.peak_rss END");
    let query = query.bind(job).bind(row.phase.to_string()).bind(worker).bind(texels).bind(rays);
    c.run(query.bind(core_seconds).bind(peak)).await?;
    Ok(())
}

pub(in super::super) async fn contributions(c: &mut Tx, job: JobId) -> Result<Vec<Contribution>, StoreError> {
    let one = |row: &Row| {
        Ok(Contribution {
            worker: row.text("name")?,
            phase: parse_phase(&row.text("phase")?)?,
            attempts: row.count("attempts")?,
            texels: row.count("texels")?,
            rays: row.count("rays")?,
            core_seconds: row.real("core_seconds")?,
            peak_rss_bytes: row.count("peak_rss")?,
        })
    };
    let query = sql("SELECT * FROM contributions WHERE job = $1 ORDER BY phase DESC, name, worker").bind(job.to_string());
    c.all(query).await?.iter().map(one).collect()
}

/// Forgets workers that were last heard before a moment.
pub(in super::super) async fn forget(c: &mut Tx, before: UnixMillis) -> Result<(), StoreError> {
    c.run(sql("DELETE FROM workers WHERE seen < $1").bind(before)).await?;
    Ok(())
}
