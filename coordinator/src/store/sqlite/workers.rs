//! Workers, and what each did for which job.

use super::rows::{count, from_json, int, json, parse, phase as parse_phase};
use crate::{
    records::{UnixMillis, WorkerRecord},
    store::{AttemptRow, Contribution, StoreError},
};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    wire::message::Finish,
};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

pub(super) async fn put(c: &mut SqliteConnection, worker: &WorkerRecord) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT OR REPLACE INTO workers (id, name, threads, features, bake_version, since, seen, texels, rays, core_seconds, peak_rss)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(worker.id.to_string())
    .bind(&worker.name)
    .bind(worker.threads)
    .bind(json(&worker.features)?)
    .bind(worker.bake_version)
    .bind(worker.since_ms)
    .bind(worker.seen_ms)
    .bind(int(worker.texels_done))
    .bind(int(worker.rays))
    .bind(worker.core_seconds)
    .bind(int(worker.peak_rss_bytes))
    .execute(c)
    .await?;
    Ok(())
}

const SELECT: &str = "SELECT workers.*,
    (SELECT job FROM attempts a WHERE a.worker = workers.id AND a.state = 'held' ORDER BY granted DESC LIMIT 1) AS job FROM workers";

fn row(row: &SqliteRow) -> Result<WorkerRecord, StoreError> {
    let number = |column: &str| row.try_get::<i64, _>(column).map(count);
    Ok(WorkerRecord {
        id: parse("a worker id", &row.try_get::<String, _>("id")?)?,
        name: row.try_get("name")?,
        threads: row.try_get("threads")?,
        features: from_json("features", &row.try_get::<String, _>("features")?)?,
        bake_version: row.try_get("bake_version")?,
        since_ms: row.try_get("since")?,
        seen_ms: row.try_get("seen")?,
        job: row.try_get::<Option<String>, _>("job")?.map(|t| parse("a job id", &t)).transpose()?,
        texels_done: number("texels")?,
        rays: number("rays")?,
        core_seconds: row.try_get("core_seconds")?,
        peak_rss_bytes: number("peak_rss")?,
        // Of the moment: the engine knows them.
        rays_per_second: 0.0,
        texels_per_second: 0.0,
    })
}

pub(super) async fn get(c: &mut SqliteConnection, id: WorkerId) -> Result<Option<WorkerRecord>, StoreError> {
    let mut query = sqlx::QueryBuilder::new(SELECT);
    query.push(" WHERE id = ").push_bind(id.to_string());
    query.build().fetch_optional(c).await?.as_ref().map(row).transpose()
}

pub(super) async fn list(c: &mut SqliteConnection, since: UnixMillis) -> Result<Vec<WorkerRecord>, StoreError> {
    let mut query = sqlx::QueryBuilder::new(SELECT);
    query.push(" WHERE seen >= ").push_bind(since).push(" ORDER BY id DESC");
    query.build().fetch_all(c).await?.iter().map(row).collect()
}

pub(super) async fn seen(c: &mut SqliteConnection, id: WorkerId, now: UnixMillis) -> Result<(), StoreError> {
    sqlx::query("UPDATE workers SET seen = MAX(seen, ?) WHERE id = ?").bind(now).bind(id.to_string()).execute(c).await?;
    Ok(())
}

/// Credits an attempt that just ended to its worker and its job.
pub(super) async fn contribute(
    c: &mut SqliteConnection,
    token: Token,
    row: &AttemptRow,
    finish: Option<&Finish>,
    now: UnixMillis,
) -> Result<(), StoreError> {
    let query = sqlx::query_as("SELECT texels, rays FROM attempts WHERE token = ?").bind(token.to_string());
    let (texels, beaten): (i64, i64) = query.fetch_one(&mut *c).await?;
    let rays = finish.map_or(beaten, |f| int(f.rays).max(beaten));
    // What a worker says is for the record only; a nonsense number must not poison the sums.
    let core_seconds = finish.map_or(0.0, |f| f.core_seconds).clamp(0.0, 1e9);
    let core_seconds = if core_seconds.is_nan() { 0.0 } else { core_seconds };
    let peak = finish.map_or(0, |f| int(f.peak_rss_bytes));
    let (worker, job) = (row.worker.to_string(), row.job.to_string());
    sqlx::query("UPDATE jobs SET rays = rays + ? WHERE id = ?").bind(rays).bind(&job).execute(&mut *c).await?;
    sqlx::query(
        "UPDATE workers SET texels = texels + ?, rays = rays + ?, core_seconds = core_seconds + ?, peak_rss = MAX(peak_rss, ?),
         seen = MAX(seen, ?) WHERE id = ?",
    )
    .bind(texels)
    .bind(rays)
    .bind(core_seconds)
    .bind(peak)
    .bind(if finish.is_some() { now } else { 0 })
    .bind(&worker)
    .execute(&mut *c)
    .await?;
    sqlx::query(
        "INSERT INTO contributions (job, phase, worker, name, attempts, texels, rays, core_seconds, peak_rss)
         VALUES (?1, ?2, ?3, COALESCE((SELECT name FROM workers WHERE id = ?3), ?3), 1, ?4, ?5, ?6, ?7)
         ON CONFLICT (job, phase, worker) DO UPDATE SET attempts = attempts + 1, texels = texels + ?4, rays = rays + ?5,
         core_seconds = core_seconds + ?6, peak_rss = MAX(peak_rss, ?7)",
    )
    .bind(job)
    .bind(row.phase.to_string())
    .bind(worker)
    .bind(texels)
    .bind(rays)
    .bind(core_seconds)
    .bind(peak)
    .execute(c)
    .await?;
    Ok(())
}

pub(super) async fn contributions(c: &mut SqliteConnection, job: JobId) -> Result<Vec<Contribution>, StoreError> {
    let query = sqlx::query("SELECT * FROM contributions WHERE job = ? ORDER BY phase DESC, name, worker").bind(job.to_string());
    let one = |row: &SqliteRow| {
        let number = |column: &str| row.try_get::<i64, _>(column).map(count);
        Ok(Contribution {
            worker: row.try_get("name")?,
            phase: parse_phase(&row.try_get::<String, _>("phase")?)?,
            attempts: number("attempts")?,
            texels: number("texels")?,
            rays: number("rays")?,
            core_seconds: row.try_get("core_seconds")?,
            peak_rss_bytes: number("peak_rss")?,
        })
    };
    query.fetch_all(c).await?.iter().map(one).collect()
}
