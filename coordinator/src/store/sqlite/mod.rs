//! The store in one SQLite file: nothing to install, and enough for one machine and a hundred workers.
//!
//! WAL with `synchronous = FULL`: a transaction that returned survives a power cut. One connection writes, so that requests queue in order
//! instead of failing busy; a few others read beside it. Each method below is one transaction around functions of the sibling modules.

mod attempts;
mod chunks;
mod events;
mod jobs;
mod lost;
mod open;
mod packages;
mod rows;
mod scenes;
mod shards;
mod tasks;
#[cfg(test)]
mod tests;
mod workers;

use super::{
    AttemptRow, Candidate, ChunkOutcome, ChunkRow, Contribution, EventPage, Expiry, Figures, FinishOutcome, Grant, JobFilter, JobRow,
    JobSpec, NewChunk, SceneRow, Store, StoreError, StoredFile, StoredPackageFile, TaskLease, TaskResult,
};
use crate::{
    blob::BlobName,
    job, lease,
    records::{Problem, UnixMillis, WorkerRecord},
};
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    options::ImportOptions,
    tile::{TileIndex, TileRun},
    wire::message::{Finish, Heartbeat, Phase},
};
use sqlx::{Sqlite, SqliteConnection, SqlitePool, Transaction, pool::PoolConnection};
use std::{collections::BTreeMap, path::Path};
use uuid::Uuid;

/// A store in one SQLite file.
pub struct SqliteStore {
    writer: SqlitePool,
    readers: SqlitePool,
}

impl SqliteStore {
    /// Opens the file, creates it when missing, and brings its schema up to date.
    ///
    /// # Errors
    /// A file that cannot be opened or written, is no database, is damaged, or was written by a later Kiln.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        let (writer, readers) = open::open(path).await?;
        Ok(Self { writer, readers })
    }

    /// Waits until every connection is closed, so that another process may take the file over.
    pub async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }

    /// Begins a transaction that writes.
    ///
    /// On a full or failing disk SQLite may roll back by itself; sqlx's own rollback then meets no transaction and fails, and sqlx believes
    /// for ever that the connection is within one. Such a connection is given up for a new one, or a disk that was full once would stop all
    /// writes until a restart.
    async fn write(&self) -> Result<Transaction<'static, Sqlite>, StoreError> {
        const BEGIN: &str = "BEGIN IMMEDIATE";
        match self.writer.begin_with(BEGIN).await {
            Err(sqlx::Error::InvalidSavePointStatement) => {
                self.writer.acquire().await?.close().await?;
                Ok(self.writer.begin_with(BEGIN).await?)
            }
            begun => Ok(begun?),
        }
    }

    async fn read(&self) -> Result<PoolConnection<Sqlite>, StoreError> {
        Ok(self.readers.acquire().await?)
    }
}

fn there<T>(found: Option<T>, what: &'static str) -> Result<T, StoreError> {
    found.ok_or_else(|| rows::strange(what, "nothing"))
}

async fn named(c: &mut SqliteConnection, blob: BlobName) -> Result<bool, StoreError> {
    let query = sqlx::query_scalar(
        "SELECT EXISTS (SELECT 1 FROM chunks WHERE blob = ?1) OR EXISTS (SELECT 1 FROM package_files WHERE blob = ?1)
         OR EXISTS (SELECT 1 FROM plans WHERE blob = ?1) OR EXISTS (SELECT 1 FROM scenes WHERE canonical = ?1)
         OR EXISTS (SELECT 1 FROM scenes WHERE instr(files, ?1) > 0)",
    );
    Ok(query.bind(blob.to_string()).fetch_one(c).await?)
}

async fn figures(c: &mut SqliteConnection) -> Result<Figures, StoreError> {
    let jobs: Vec<(String, i64)> = sqlx::query_as("SELECT public, COUNT(*) FROM jobs GROUP BY public").fetch_all(&mut *c).await?;
    let query =
        "SELECT COALESCE(SUM(s.waiting), 0) FROM jobs j CROSS JOIN shards s ON s.job = j.id AND s.waiting > 0 WHERE j.public = 'baking'";
    let pending: i64 = sqlx::query_scalar(query).fetch_one(&mut *c).await?;
    let held: Vec<String> = sqlx::query_scalar("SELECT remaining FROM attempts WHERE state = 'held'").fetch_all(&mut *c).await?;
    let leased = held.iter().map(|text| Ok(rows::runs(text)?.len())).sum::<Result<u64, StoreError>>()?;
    let tasks: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM tasks").fetch_one(c).await?;
    Ok(Figures {
        jobs: jobs.into_iter().map(|(state, n)| (state, rows::count(n))).collect(),
        tiles_pending: rows::count(pending),
        tiles_leased: leased,
        attempts_held: held.len() as u64,
        tasks: rows::count(tasks),
    })
}

#[async_trait::async_trait]
impl Store for SqliteStore {
    async fn add_scene(&self, id: Uuid, files: &[StoredFile], options: &ImportOptions, now: UnixMillis) -> Result<SceneRow, StoreError> {
        let mut tx = self.write().await?;
        scenes::add(&mut tx, id, files, options, now).await?;
        let row = there(scenes::get(&mut tx, id).await?, "the new scene")?;
        tx.commit().await?;
        Ok(row)
    }

    async fn scene(&self, id: Uuid) -> Result<Option<SceneRow>, StoreError> {
        scenes::get(&mut *self.read().await?, id).await
    }

    async fn scene_by_hash(&self, scene: SceneHash) -> Result<Option<SceneRow>, StoreError> {
        scenes::by_hash(&mut *self.read().await?, scene).await
    }

    async fn add_job(&self, spec: &JobSpec, now: UnixMillis) -> Result<JobRow, StoreError> {
        let mut tx = self.write().await?;
        jobs::add(&mut tx, spec, now).await?;
        let row = there(jobs::get(&mut tx, spec.id).await?, "the new job")?;
        tx.commit().await?;
        Ok(row)
    }

    async fn job(&self, id: JobId) -> Result<Option<JobRow>, StoreError> {
        jobs::get(&mut *self.read().await?, id).await
    }

    async fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
        jobs::list(&mut *self.read().await?, filter).await
    }

    async fn job_event(&self, id: JobId, event: &job::Event, now: UnixMillis) -> Result<Option<Result<(), job::Illegal>>, StoreError> {
        let mut tx = self.write().await?;
        let outcome = jobs::happen(&mut tx, id, event, now).await?;
        tx.commit().await?;
        Ok(outcome)
    }

    async fn delete_job(&self, id: JobId) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let existed = jobs::delete(&mut tx, id).await?;
        tx.commit().await?;
        Ok(existed)
    }

    async fn add_problem(&self, id: JobId, problem: &Problem, now: UnixMillis) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        jobs::add_problem(&mut tx, id, problem, now).await?;
        Ok(tx.commit().await?)
    }

    async fn events(&self, id: JobId, after: i64, limit: u32) -> Result<Option<EventPage>, StoreError> {
        events::page(&mut *self.read().await?, id, after, limit).await
    }

    async fn plan(&self, digest: Digest) -> Result<Option<BlobName>, StoreError> {
        let query = sqlx::query_scalar("SELECT blob FROM plans WHERE digest = ? LIMIT 1").bind(digest.to_string());
        let blob: Option<String> = query.fetch_optional(&mut *self.read().await?).await?;
        blob.map(|text| rows::parse("a blob name", &text)).transpose()
    }

    async fn take_task(&self, token: Token, deadline: UnixMillis, now: UnixMillis) -> Result<Option<TaskLease>, StoreError> {
        let mut tx = self.write().await?;
        let task = tasks::take(&mut tx, token, deadline, now).await?;
        tx.commit().await?;
        Ok(task)
    }

    async fn renew_task(&self, token: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let held = tasks::renew(&mut tx, token, deadline).await?;
        tx.commit().await?;
        Ok(held)
    }

    async fn finish_task(&self, token: Token, result: &TaskResult, now: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let held = tasks::finish(&mut tx, token, result, now).await?;
        tx.commit().await?;
        Ok(held)
    }

    async fn put_off_task(&self, token: Token, why: &str, due: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let held = tasks::put_off(&mut tx, token, why, due).await?;
        tx.commit().await?;
        Ok(held)
    }

    async fn take_over_tasks(&self, now: UnixMillis) -> Result<u64, StoreError> {
        let mut tx = self.write().await?;
        let count = tasks::take_over(&mut tx, now).await?;
        tx.commit().await?;
        Ok(count)
    }

    async fn put_worker(&self, worker: &WorkerRecord) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        workers::put(&mut tx, worker).await?;
        Ok(tx.commit().await?)
    }

    async fn hear_worker(&self, id: WorkerId, now: UnixMillis) -> Result<Option<WorkerRecord>, StoreError> {
        let mut tx = self.write().await?;
        workers::seen(&mut tx, id, now).await?;
        let row = workers::get(&mut tx, id).await?;
        tx.commit().await?;
        Ok(row)
    }

    async fn workers(&self, since: UnixMillis) -> Result<Vec<WorkerRecord>, StoreError> {
        workers::list(&mut *self.read().await?, since).await
    }

    async fn next_work(&self, bake_version: u32) -> Result<Option<Candidate>, StoreError> {
        shards::next_work(&mut *self.read().await?, bake_version).await
    }

    async fn grant(&self, grant: &Grant, now: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let granted = attempts::grant(&mut tx, grant, now).await?;
        tx.commit().await?;
        Ok(granted)
    }

    async fn attempt(&self, token: Token) -> Result<Option<AttemptRow>, StoreError> {
        attempts::get(&mut *self.read().await?, token).await
    }

    async fn heartbeat(&self, token: Token, beat: &Heartbeat, ttl: i64, now: UnixMillis) -> Result<Option<AttemptRow>, StoreError> {
        let mut tx = self.write().await?;
        let row = attempts::heartbeat(&mut tx, token, beat, ttl, now).await?;
        tx.commit().await?;
        Ok(row)
    }

    async fn chunk(&self, token: Token, n: u64) -> Result<Option<ChunkRow>, StoreError> {
        chunks::get(&mut *self.read().await?, token, n).await
    }

    async fn record_chunk(
        &self,
        chunk: &NewChunk,
        known: &BTreeMap<TileIndex, Digest>,
        now: UnixMillis,
    ) -> Result<ChunkOutcome, StoreError> {
        let mut tx = self.write().await?;
        let outcome = chunks::record(&mut tx, chunk, known, now).await?;
        tx.commit().await?;
        Ok(outcome)
    }

    async fn lose_chunk(&self, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let needed = lost::lose(&mut tx, job, phase, blob, now).await?;
        if needed {
            tx.commit().await?;
        }
        Ok(needed)
    }

    async fn finish_attempt(
        &self,
        token: Token,
        event: lease::Event,
        finish: Option<&Finish>,
        now: UnixMillis,
    ) -> Result<FinishOutcome, StoreError> {
        let mut tx = self.write().await?;
        let outcome = attempts::finish(&mut tx, token, event, finish, now).await?;
        tx.commit().await?;
        Ok(outcome)
    }

    async fn chunks(&self, job: JobId, phase: Phase, run: TileRun) -> Result<Vec<ChunkRow>, StoreError> {
        chunks::covering(&mut *self.read().await?, job, phase, run).await
    }

    async fn contributions(&self, job: JobId) -> Result<Vec<Contribution>, StoreError> {
        workers::contributions(&mut *self.read().await?, job).await
    }

    async fn surface_reports(&self, job: JobId) -> Result<Vec<serde_json::Value>, StoreError> {
        packages::reports(&mut *self.read().await?, job).await
    }

    async fn package(&self, job: JobId) -> Result<Vec<StoredPackageFile>, StoreError> {
        packages::files(&mut *self.read().await?, job).await
    }

    async fn expire(&self, now: UnixMillis) -> Result<Expiry, StoreError> {
        let mut tx = self.write().await?;
        let expiry = Expiry { attempts: attempts::expire(&mut tx, now).await?, tasks: tasks::expire(&mut tx, now).await? };
        tx.commit().await?;
        Ok(expiry)
    }

    async fn forget(&self, attempts_before: UnixMillis, workers_before: UnixMillis) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        // Expired attempts may still deliver while their job bakes; the others only answer repeated calls.
        sqlx::query("DELETE FROM attempts WHERE ended < ? AND state <> 'expired'").bind(attempts_before).execute(&mut *tx).await?;
        sqlx::query("DELETE FROM workers WHERE seen < ?").bind(workers_before).execute(&mut *tx).await?;
        Ok(tx.commit().await?)
    }

    async fn names(&self, blob: BlobName) -> Result<bool, StoreError> {
        named(&mut *self.read().await?, blob).await
    }

    async fn figures(&self) -> Result<Figures, StoreError> {
        figures(&mut *self.read().await?).await
    }
}
