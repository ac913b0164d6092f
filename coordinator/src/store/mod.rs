//! The durable state of the farm behind one trait.
//!
//! Every method is one transaction: it happens whole or not at all, and is durable when it returns. Decisions are those of the pure
//! machines ([`job`](crate::job), [`lease`](crate::lease)); a store loads, lets them decide, saves and performs their actions. Time comes
//! in as a value, so that tests own the clock; on a shared database it is that database's. [`conformance`] holds what every implementation must
//! do.

#[cfg(test)]
pub mod conformance;
mod error;
mod model;
mod requests;
mod retention;
mod rows;
mod sql;
mod tables;
mod tokens;

pub use error::StoreError;
pub use model::{
    AttemptRow, Candidate, ChunkOutcome, ChunkRow, ChunkTile, ClaimRow, Contribution, EventPage, Expiry, Figures, FinishOutcome, Grant,
    Hints, JobFilter, JobRow, JobSpec, Lane, Late, NewChunk, Notice, PlanRef, SceneRow, StoredFile, StoredPackageFile, Task, TaskLease,
    TaskResult,
};
use model::{Beat, Delivery, Ending};
pub use requests::{Claimed, KeptAnswer, NewRequest, REQUEST_KEPT, RequestStore};
pub use retention::RetentionStore;
pub use sql::SqlStore;
pub use tokens::TokenStore;

use crate::{
    auth::{Scope, TokenId},
    blob::BlobName,
    job, lease,
    records::{UnixMillis, WorkerRecord},
};
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    options::ImportOptions,
    tile::{TileIndex, TileRun},
    wire::message::{Finish, Heartbeat, Phase},
};
use std::collections::BTreeMap;
use uuid::Uuid;

/// How often a task may be taken and not finished before its job fails: a task that kills its coordinator must not do so for ever.
pub const TASK_TRIES: u32 = 20;

/// The state of the farm. All errors are failures of the store itself; what does not exist or does not fit is part of the answers.
#[async_trait::async_trait]
pub trait Store: TokenStore + RequestStore + RetentionStore {
    /// Whether other coordinators may use it too.
    fn is_shared(&self) -> bool;

    /// The time by the clock that all who use this store share, milliseconds.
    async fn clock(&self) -> Result<UnixMillis, StoreError>;

    /// Tells other coordinators on this store that something happened to these jobs; an empty list means to anything at all. It may be lost.
    async fn hint(&self, jobs: &[JobId]) -> Result<(), StoreError>;

    /// What others tell by [`Store::hint`].
    async fn hints(&self) -> Result<Hints, StoreError>;

    /// Records an upload and queues its import.
    async fn add_scene(
        &self,
        id: Uuid,
        files: &[StoredFile],
        options: &ImportOptions,
        owner: Option<TokenId>,
        now: UnixMillis,
    ) -> Result<SceneRow, StoreError>;

    /// An upload.
    async fn scene(&self, id: Uuid) -> Result<Option<SceneRow>, StoreError>;

    /// The oldest upload within `scope` that came to this canonical scene.
    async fn scene_by_hash(&self, scene: SceneHash, scope: Scope) -> Result<Option<SceneRow>, StoreError>;

    /// Creates a job. It goes on at once where its scene is ready, and fails at once where that was rejected. Its scene must exist.
    async fn add_job(&self, spec: &JobSpec, now: UnixMillis) -> Result<JobRow, StoreError>;

    /// A job.
    async fn job(&self, id: JobId) -> Result<Option<JobRow>, StoreError>;

    /// Jobs, youngest first.
    async fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError>;

    /// Something happens to a job; the inner error says that it does not fit. `None` where there is no such job.
    async fn job_event(&self, id: JobId, event: &job::Event, now: UnixMillis) -> Result<Option<Result<(), job::Illegal>>, StoreError>;

    /// Changes a job's priority. Whether it exists.
    async fn set_priority(&self, id: JobId, priority: i32) -> Result<bool, StoreError>;

    /// Removes every row of a job. Its blobs are no longer named then, unless others name them. Whether it existed.
    async fn delete_job(&self, id: JobId) -> Result<bool, StoreError>;

    /// Adds an event for people to a job's stream; nothing where the job is gone.
    async fn add_problem(&self, id: JobId, problem: &crate::records::Problem, now: UnixMillis) -> Result<(), StoreError>;

    /// At most `limit` events with a sequence number above `after`. `None` where there is no such job.
    async fn events(&self, id: JobId, after: i64, limit: u32) -> Result<Option<EventPage>, StoreError>;

    /// The compressed bytes of a plan that a job has or had.
    async fn plan(&self, digest: Digest) -> Result<Option<BlobName>, StoreError>;

    /// Takes the oldest task that waits and is due, until `deadline`; notices have a method of their own, so that receivers who keep them
    /// waiting keep no job waiting.
    async fn take_task(&self, token: Token, deadline: UnixMillis, now: UnixMillis) -> Result<Option<TaskLease>, StoreError>;

    /// As [`Store::take_task`], the oldest [`Task::Notify`].
    async fn take_notice(&self, token: Token, deadline: UnixMillis, now: UnixMillis) -> Result<Option<TaskLease>, StoreError>;

    /// Extends a task. Whether the token still holds it.
    async fn renew_task(&self, token: Token, deadline: UnixMillis) -> Result<bool, StoreError>;

    /// Ends a task with its result, all effects included, if the token still holds it: publishing is this compare-and-set.
    async fn finish_task(&self, token: Token, result: &TaskResult, now: UnixMillis) -> Result<bool, StoreError>;

    /// Puts a task back that storage failed under, if the token still holds it: it is due again at `due`, and `why` tells people what it
    /// waits for. Such a try does not count against [`TASK_TRIES`]. Whether it was held.
    async fn put_off_task(&self, token: Token, why: &str, due: UnixMillis) -> Result<bool, StoreError>;

    /// Puts every held task back. Only for a coordinator that knows itself to be alone.
    async fn take_over_tasks(&self, now: UnixMillis) -> Result<u64, StoreError>;

    /// Records a worker, or replaces what was known of it.
    async fn put_worker(&self, worker: &WorkerRecord) -> Result<(), StoreError>;

    /// A worker.
    async fn worker(&self, id: WorkerId) -> Result<Option<WorkerRecord>, StoreError>;

    /// Notes when workers were heard last.
    async fn heard_workers(&self, workers: &[(WorkerId, UnixMillis)]) -> Result<(), StoreError>;

    /// Workers heard since a moment, youngest first, with the job that each bakes.
    async fn workers(&self, since: UnixMillis) -> Result<Vec<WorkerRecord>, StoreError>;

    /// Jobs of a bake version that lease tiles, by age, those among them of which nothing waits.
    async fn claims(&self, bake_version: u32) -> Result<Vec<ClaimRow>, StoreError>;

    /// Work of a job for at most `most` workers: runs of pending tiles, lowest first, then a check for each tile that a second worker must
    /// bake and that nobody is asked about.
    async fn next_work(&self, job: JobId, most: usize) -> Result<Vec<Candidate>, StoreError>;

    /// Phases of jobs of a bake version in which nothing waits while something is held, the most urgent first.
    async fn late(&self, bake_version: u32, now: UnixMillis) -> Result<Vec<Late>, StoreError>;

    /// Lets tiles count that must be baked by a second worker, where nothing else is left to do and nobody who is connected could. How many.
    async fn waive_checks(&self, now: UnixMillis) -> Result<u64, StoreError>;

    /// Records leases in one transaction: each gets what is pending of its run, or of its shard where that is gone; a twin what it asks for,
    /// a check any tile that its worker may check. The run of each; `None` where there is none any more.
    async fn grant(&self, grants: &[Grant], now: UnixMillis) -> Result<Vec<Option<TileRun>>, StoreError>;

    /// An attempt.
    async fn attempt(&self, token: Token) -> Result<Option<AttemptRow>, StoreError>;

    /// A heartbeat: moves the deadline `ttl` milliseconds ahead of now. The attempt where it goes on, `None` where it must stop.
    async fn heartbeat(&self, token: Token, beat: &Heartbeat, ttl: i64, now: UnixMillis) -> Result<Option<AttemptRow>, StoreError>;

    /// A chunk that was recorded under (token, n).
    async fn chunk(&self, token: Token, n: u64) -> Result<Option<ChunkRow>, StoreError>;

    /// Records a chunk, claims its tiles that nobody has delivered, shortens the attempt, moves the job and appends the event. `known`
    /// holds digests of accepted segments, from the chunks of an earlier [`ChunkOutcome::NeedDigests`].
    async fn record_chunk(
        &self,
        chunk: &NewChunk,
        known: &BTreeMap<TileIndex, Digest>,
        now: UnixMillis,
    ) -> Result<ChunkOutcome, StoreError>;

    /// Takes back what a chunk of a phase brought, because its blob is gone: its rows go, its accepted tiles wait for a worker again, and
    /// the job bakes them before anything that needs them is done. Whether the job still needs them; if not, nothing changes.
    async fn lose_chunk(&self, job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> Result<bool, StoreError>;

    /// Ends an attempt by [`lease::Event::Complete`], `Release` or `Fence`. What it owes and nobody delivered goes back to work.
    async fn finish_attempt(
        &self,
        token: Token,
        event: lease::Event,
        finish: Option<&Finish>,
        now: UnixMillis,
    ) -> Result<FinishOutcome, StoreError>;

    /// Chunks with accepted tiles of a run.
    async fn chunks(&self, job: JobId, phase: Phase, run: TileRun) -> Result<Vec<ChunkRow>, StoreError>;

    /// Tiles of a run that are in quarantine, and that nobody has delivered since; each with how it failed, a predicate without a full stop.
    async fn holes(&self, job: JobId, phase: Phase, run: TileRun) -> Result<BTreeMap<TileIndex, String>, StoreError>;

    /// What each worker did for a job.
    async fn contributions(&self, job: JobId) -> Result<Vec<Contribution>, StoreError>;

    /// The reports of a job's assembled surfaces, in order of surface.
    async fn surface_reports(&self, job: JobId) -> Result<Vec<serde_json::Value>, StoreError>;

    /// Files of a job's package so far, by path.
    async fn package(&self, job: JobId) -> Result<Vec<StoredPackageFile>, StoreError>;

    /// Lets attempts and tasks expire whose time has come.
    async fn expire(&self, now: UnixMillis) -> Result<Expiry, StoreError>;

    /// Forgets attempts that ended, and workers that were last heard, before these moments.
    async fn forget(&self, attempts_before: UnixMillis, workers_before: UnixMillis) -> Result<(), StoreError>;

    /// Whether any row names a blob.
    async fn names(&self, blob: BlobName) -> Result<bool, StoreError>;

    /// Counts for metrics.
    async fn figures(&self) -> Result<Figures, StoreError>;
}
