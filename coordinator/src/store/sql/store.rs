//! The store over either database: each call is one transaction around functions of [`tables`](super::super::tables).

use super::{
    super::{
        AttemptRow, Beat, Candidate, ChunkOutcome, ChunkRow, ClaimRow, Contribution, Delivery, Ending, EventPage, Expiry, Figures,
        FinishOutcome, Grant, Hints, JobFilter, JobRow, JobSpec, Lane, Late, NewChunk, SceneRow, Store, StoreError, StoredFile,
        StoredPackageFile, TaskLease, TaskResult, rows,
        tables::{attempts, chunks, claims, events, figures, grants, jobs, late, lost, packages, poison, scenes, shards, tasks, workers},
    },
    database::{Database, writing},
    group::{Group, Together},
};
use crate::{
    auth::{Scope, TokenId},
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
use std::{collections::BTreeMap, path::Path, sync::Arc};
use uuid::Uuid;

/// A store in a database.
pub struct SqlStore {
    pub(super) database: Arc<Database>,
    beats: Group<Beats>,
    deliveries: Group<Deliveries>,
    endings: Group<Endings>,
}

impl SqlStore {
    /// The database at `url`, or where there is none the SQLite file of a data folder.
    ///
    /// # Errors
    /// As [`SqlStore::postgres`] and [`SqlStore::sqlite`].
    pub async fn open(url: Option<&str>, data: &Path) -> Result<Self, StoreError> {
        match url {
            Some(url) => Self::postgres(url).await,
            None => Self::sqlite(&data.join("kiln.db")).await,
        }
    }

    /// Opens a SQLite file, creates it when missing, and brings its schema up to date.
    ///
    /// # Errors
    /// A file that cannot be opened or written, is no database, is damaged, or was written by a later Kiln.
    pub async fn sqlite(path: &Path) -> Result<Self, StoreError> {
        Ok(Self::over(Database::sqlite(path).await?))
    }

    /// Connects to PostgreSQL by a `postgres://` URL, and brings the schema up to date.
    ///
    /// # Errors
    /// A URL that cannot be read, a server that cannot be reached, or a database that a later Kiln has changed beyond use.
    pub async fn postgres(url: &str) -> Result<Self, StoreError> {
        Ok(Self::over(Database::postgres(url).await?))
    }

    fn over(database: Database) -> Self {
        let database = Arc::new(database);
        Self {
            beats: Group::new(Arc::new(Beats(Arc::clone(&database)))),
            deliveries: Group::new(Arc::new(Deliveries(Arc::clone(&database)))),
            endings: Group::new(Arc::new(Endings(Arc::clone(&database)))),
            database,
        }
    }

    /// Waits until every connection is closed, so that another process may take a file over.
    pub async fn close(&self) {
        self.database.close().await;
    }

    async fn expire_attempts(&self, due: BTreeMap<JobId, Vec<Token>>, now: UnixMillis) -> Result<u64, StoreError> {
        let mut expired = 0;
        for tokens in due.values() {
            expired += writing!(self.database, tx => attempts::expire(tx, tokens, now).await)?;
        }
        Ok(expired)
    }
}

struct Beats(Arc<Database>);

#[async_trait::async_trait]
impl Together for Beats {
    type Ask = Beat;
    type Answer = Option<AttemptRow>;

    async fn together(&self, asks: &[Beat]) -> Result<Vec<Option<AttemptRow>>, StoreError> {
        let (now, ttl) = asks.iter().fold((0, 0), |(now, ttl), beat| (beat.now.max(now), beat.ttl.max(ttl)));
        let held = writing!(self.0, tx => attempts::heartbeats(tx, asks, ttl, now).await)?;
        Ok(asks.iter().map(|beat| held.get(&beat.token).cloned()).collect())
    }
}

struct Deliveries(Arc<Database>);

#[async_trait::async_trait]
impl Together for Deliveries {
    type Ask = Arc<Delivery>;
    type Answer = ChunkOutcome;

    async fn together(&self, asks: &[Arc<Delivery>]) -> Result<Vec<ChunkOutcome>, StoreError> {
        let now = asks.iter().map(|d| d.now).max().unwrap_or(0);
        writing!(self.0, tx => chunks::record_all(tx, asks, now).await)
    }
}

struct Endings(Arc<Database>);

#[async_trait::async_trait]
impl Together for Endings {
    type Ask = Ending;
    type Answer = FinishOutcome;

    async fn together(&self, asks: &[Ending]) -> Result<Vec<FinishOutcome>, StoreError> {
        let now = asks.iter().map(|e| e.now).max().unwrap_or(0);
        writing!(self.0, tx => attempts::finish_all(tx, asks, now).await)
    }
}

fn there<T>(found: Option<T>, what: &'static str) -> Result<T, StoreError> {
    found.ok_or_else(|| rows::strange(what, "nothing"))
}

#[async_trait::async_trait]
impl Store for SqlStore {
    fn is_shared(&self) -> bool {
        self.database.is_shared()
    }

    async fn clock(&self) -> Result<UnixMillis, StoreError> {
        self.database.clock().await
    }

    async fn hint(&self, jobs: &[JobId]) -> Result<(), StoreError> {
        self.database.hint(jobs).await
    }

    async fn hints(&self) -> Result<Hints, StoreError> {
        self.database.hints().await
    }

    async fn add_scene(
        &self,
        id: Uuid,
        files: &[StoredFile],
        options: &ImportOptions,
        owner: Option<TokenId>,
        now: UnixMillis,
    ) -> Result<SceneRow, StoreError> {
        writing!(self.database, tx => {
            scenes::add(tx, id, files, options, owner, now).await?;
            there(scenes::get(tx, id).await?, "the new scene")
        })
    }

    async fn scene(&self, id: Uuid) -> Result<Option<SceneRow>, StoreError> {
        scenes::get(&mut self.database.read().await?, id).await
    }

    async fn scene_by_hash(&self, scene: SceneHash, scope: Scope) -> Result<Option<SceneRow>, StoreError> {
        scenes::by_hash(&mut self.database.read().await?, scene, scope).await
    }

    async fn add_job(&self, spec: &JobSpec, now: UnixMillis) -> Result<JobRow, StoreError> {
        writing!(self.database, tx => {
            jobs::add(tx, spec, now).await?;
            there(jobs::get(tx, spec.id).await?, "the new job")
        })
    }

    async fn job(&self, id: JobId) -> Result<Option<JobRow>, StoreError> {
        jobs::get(&mut self.database.read().await?, id).await
    }

    async fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
        jobs::list(&mut self.database.read().await?, filter).await
    }

    async fn job_event(&self, id: JobId, event: &job::Event, now: UnixMillis) -> Result<Option<Result<(), job::Illegal>>, StoreError> {
        writing!(self.database, tx => jobs::happen(tx, id, event, now).await)
    }

    async fn set_priority(&self, id: JobId, priority: i32) -> Result<bool, StoreError> {
        writing!(self.database, tx => jobs::set_priority(tx, id, priority).await)
    }

    async fn delete_job(&self, id: JobId) -> Result<bool, StoreError> {
        writing!(self.database, tx => jobs::delete(tx, id).await)
    }

    async fn add_problem(&self, id: JobId, problem: &Problem, now: UnixMillis) -> Result<(), StoreError> {
        writing!(self.database, tx => jobs::add_problem(tx, id, problem, now).await)
    }

    async fn events(&self, id: JobId, after: i64, limit: u32) -> Result<Option<EventPage>, StoreError> {
        events::page(&mut self.database.read().await?, id, after, limit).await
    }

    async fn plan(&self, digest: Digest) -> Result<Option<BlobName>, StoreError> {
        jobs::plan(&mut self.database.read().await?, &digest.to_string()).await
    }

    async fn take_task(&self, token: Token, deadline: UnixMillis, now: UnixMillis) -> Result<Option<TaskLease>, StoreError> {
        writing!(self.database, tx => tasks::take(tx, Lane::Work, token, deadline, now).await)
    }

    async fn take_notice(&self, token: Token, deadline: UnixMillis, now: UnixMillis) -> Result<Option<TaskLease>, StoreError> {
        writing!(self.database, tx => tasks::take(tx, Lane::Notices, token, deadline, now).await)
    }

    async fn renew_task(&self, token: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => tasks::renew(tx, token, deadline).await)
    }

    async fn finish_task(&self, token: Token, result: &TaskResult, now: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => tasks::finish(tx, token, result, now).await)
    }

    async fn put_off_task(&self, token: Token, why: &str, due: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => tasks::put_off(tx, token, why, due).await)
    }

    async fn take_over_tasks(&self, now: UnixMillis) -> Result<u64, StoreError> {
        writing!(self.database, tx => tasks::take_over(tx, now).await)
    }

    async fn put_worker(&self, worker: &WorkerRecord) -> Result<(), StoreError> {
        writing!(self.database, tx => workers::put(tx, worker).await)
    }

    async fn worker(&self, id: WorkerId) -> Result<Option<WorkerRecord>, StoreError> {
        workers::get(&mut self.database.read().await?, id).await
    }

    async fn heard_workers(&self, workers: &[(WorkerId, UnixMillis)]) -> Result<(), StoreError> {
        writing!(self.database, tx => workers::heard(tx, workers).await)
    }

    async fn workers(&self, since: UnixMillis) -> Result<Vec<WorkerRecord>, StoreError> {
        workers::list(&mut self.database.read().await?, since).await
    }

    async fn claims(&self, bake_version: u32) -> Result<Vec<ClaimRow>, StoreError> {
        claims::claims(&mut self.database.read().await?, bake_version).await
    }

    async fn next_work(&self, job: JobId, most: usize) -> Result<Vec<Candidate>, StoreError> {
        shards::next_work(&mut self.database.read().await?, job, most).await
    }

    async fn late(&self, bake_version: u32, now: UnixMillis) -> Result<Vec<Late>, StoreError> {
        late::late(&mut self.database.read().await?, bake_version, now).await
    }

    async fn waive_checks(&self, now: UnixMillis) -> Result<u64, StoreError> {
        let (jobs, mut waived) = (late::unchecked(&mut self.database.read().await?, now).await?, 0);
        for job in jobs {
            waived += writing!(self.database, tx => late::waive(tx, job, now).await)?;
        }
        Ok(waived)
    }

    async fn grant(&self, grants: &[Grant], now: UnixMillis) -> Result<Vec<Option<TileRun>>, StoreError> {
        writing!(self.database, tx => grants::grant(tx, grants, now).await)
    }

    async fn attempt(&self, token: Token) -> Result<Option<AttemptRow>, StoreError> {
        attempts::get(&mut self.database.read().await?, token).await
    }

    async fn heartbeat(&self, token: Token, beat: &Heartbeat, ttl: i64, now: UnixMillis) -> Result<Option<AttemptRow>, StoreError> {
        self.beats.call(Beat { token, rays: beat.rays.min(lease::RAYS), ttl, now }).await
    }

    async fn chunk(&self, token: Token, n: u64) -> Result<Option<ChunkRow>, StoreError> {
        chunks::get(&mut self.database.read().await?, token, n).await
    }

    async fn record_chunk(
        &self,
        chunk: &NewChunk,
        known: &BTreeMap<TileIndex, Digest>,
        now: UnixMillis,
    ) -> Result<ChunkOutcome, StoreError> {
        self.deliveries.call(Arc::new(Delivery { chunk: chunk.clone(), known: known.clone(), now })).await
    }

    async fn lose_chunk(&self, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError> {
        let mut tx = self.database.write().await?;
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
        self.endings.call(Ending { token, event, finish: finish.cloned(), now }).await
    }

    async fn chunks(&self, job: JobId, phase: Phase, run: TileRun) -> Result<Vec<ChunkRow>, StoreError> {
        chunks::covering(&mut self.database.read().await?, job, phase, run).await
    }

    async fn holes(&self, job: JobId, phase: Phase, run: TileRun) -> Result<BTreeMap<TileIndex, String>, StoreError> {
        poison::holes(&mut self.database.read().await?, job, phase, run).await
    }

    async fn contributions(&self, job: JobId) -> Result<Vec<Contribution>, StoreError> {
        workers::contributions(&mut self.database.read().await?, job).await
    }

    async fn surface_reports(&self, job: JobId) -> Result<Vec<serde_json::Value>, StoreError> {
        packages::reports(&mut self.database.read().await?, job).await
    }

    async fn package(&self, job: JobId) -> Result<Vec<StoredPackageFile>, StoreError> {
        packages::files(&mut self.database.read().await?, job).await
    }

    async fn expire(&self, now: UnixMillis) -> Result<Expiry, StoreError> {
        let due = attempts::due(&mut self.database.read().await?, now).await?;
        let attempts = self.expire_attempts(due, now).await?;
        let tasks = writing!(self.database, tx => tasks::expire(tx, now).await)?;
        Ok(Expiry { attempts, tasks })
    }

    async fn forget(&self, attempts_before: UnixMillis, workers_before: UnixMillis) -> Result<(), StoreError> {
        writing!(self.database, tx => {
            attempts::forget(tx, attempts_before).await?;
            workers::forget(tx, workers_before).await
        })
    }

    async fn names(&self, blob: BlobName) -> Result<bool, StoreError> {
        figures::named(&mut self.database.read().await?, blob).await
    }

    async fn figures(&self) -> Result<Figures, StoreError> {
        figures::figures(&mut self.database.read().await?).await
    }
}
