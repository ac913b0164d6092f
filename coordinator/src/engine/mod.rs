//! The engine: the one module that joins state machines, store, blobs, import and assembly.
//!
//! HTTP handlers, tests and `kiln bake` call its methods; everything it knows is in the store and the blobs, so that it may be dropped at any
//! moment and opened again.

mod error;
mod types;

pub use crate::{
    records::PackageFile,
    store::{EventPage, JobFilter},
};
pub use error::EngineError;
pub use types::{Download, Estimate, JobPage, Statistics, UploadedFile};

use crate::{
    config::Config,
    records::{JobRecord, NewJob, SceneRecord, UnixMillis, WorkerRecord},
};
use bytes::Bytes;
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token},
    wire::message::{ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Refusal, Welcome},
};
use std::{ops::Range, sync::Arc, time::Duration};
use tempfile::{NamedTempFile, TempPath};
use uuid::Uuid;

/// A running coordinator without its HTTP face.
pub struct Engine {
    config: Config,
}

const LATER: EngineError = EngineError::Unavailable("this part is being written");
const BUSY: Refusal = Refusal::Busy { retry_after_ms: 1_000 };

#[allow(clippy::unused_async, unused_variables)]
impl Engine {
    /// Opens the data folder (created when missing), continues what an earlier coordinator began, and starts the background work.
    ///
    /// # Errors
    /// A folder that cannot be created or written, is used by another coordinator, or holds a database that is damaged or of a later version.
    pub async fn open(config: Config) -> Result<Arc<Engine>, EngineError> {
        Ok(Arc::new(Engine { config }))
    }

    /// Stops the background work and wakes every waiting worker with nothing. Calls after this are refused as unavailable. Dropping an
    /// engine without this is safe too: it is what a crash does.
    pub async fn shut_down(&self) {}

    /// What it was opened with.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The time by this engine's clock.
    #[must_use]
    pub fn now(&self) -> UnixMillis {
        0
    }

    /// Whether store and blobs answer and the disk has room: `/readyz`.
    ///
    /// # Errors
    /// What does not answer.
    pub async fn ready(&self) -> Result<(), EngineError> {
        Err(LATER)
    }

    /// A file on the data folder's disk for a request body; removed when dropped, and at start-up.
    ///
    /// # Errors
    /// A full or failing disk.
    pub fn spool(&self) -> Result<NamedTempFile, EngineError> {
        Err(LATER)
    }

    /// Stores an uploaded scene and queues its import. The files are moved.
    ///
    /// # Errors
    /// No file at all, names that leave the scene's folder, or a full disk.
    pub async fn add_scene(&self, files: Vec<UploadedFile>) -> Result<SceneRecord, EngineError> {
        Err(LATER)
    }

    /// A scene by the id of its upload or by its hash.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn scene(&self, name: &str) -> Result<SceneRecord, EngineError> {
        Err(LATER)
    }

    /// The scene of an upload once it is ready or rejected, or as it is after `wait`.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn wait_for_scene(&self, id: Uuid, wait: Duration) -> Result<SceneRecord, EngineError> {
        Err(LATER)
    }

    /// The canonical bytes of a scene, one zstd frame.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn scene_bytes(&self, scene: SceneHash) -> Result<Download, EngineError> {
        Err(LATER)
    }

    /// The bytes of a plan, one zstd frame.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn plan_bytes(&self, plan: Digest) -> Result<Download, EngineError> {
        Err(LATER)
    }

    /// Creates a job. Its scene may still be importing.
    ///
    /// # Errors
    /// Settings out of range, an unknown or rejected scene.
    pub async fn create_job(&self, new: NewJob) -> Result<JobRecord, EngineError> {
        Err(LATER)
    }

    /// What a job would cost, without creating it. The scene must be ready.
    ///
    /// # Errors
    /// As [`Engine::create_job`], and a scene that is still importing.
    pub async fn estimate(&self, new: &NewJob) -> Result<Estimate, EngineError> {
        Err(LATER)
    }

    /// A job.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn job(&self, job: JobId) -> Result<JobRecord, EngineError> {
        Err(LATER)
    }

    /// Some jobs, youngest first.
    ///
    /// # Errors
    /// A failing store.
    pub async fn jobs(&self, filter: &JobFilter) -> Result<JobPage, EngineError> {
        Err(LATER)
    }

    /// Cancels a job that has not ended; a job that has is left as it is.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn cancel_job(&self, job: JobId) -> Result<JobRecord, EngineError> {
        Err(LATER)
    }

    /// Cancels a job and removes every trace of it, its package included.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn delete_job(&self, job: JobId) -> Result<(), EngineError> {
        Err(LATER)
    }

    /// At most `limit` events of a job with a sequence number above `after`.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn events(&self, job: JobId, after: i64, limit: u32) -> Result<EventPage, EngineError> {
        Err(LATER)
    }

    /// Resolves when the job has events above `after`, when it is deleted, or on shut-down; then ask again. May resolve without cause.
    pub async fn wait_for_events(&self, job: JobId, after: i64) {}

    /// The files of a finished job's package, by path; `manifest.json` and `report.json` are among them.
    ///
    /// # Errors
    /// [`EngineError::NotFound`], and [`EngineError::Conflict`] before the job is done.
    pub async fn package(&self, job: JobId) -> Result<Vec<PackageFile>, EngineError> {
        Err(LATER)
    }

    /// One file of a finished job's package: its description, to decide on ETag and Range.
    ///
    /// # Errors
    /// As [`Engine::package`], and a path that the package does not have.
    pub async fn package_file(&self, job: JobId, path: &str) -> Result<PackageFile, EngineError> {
        Err(LATER)
    }

    /// Bytes of a package file; `range` is clipped to its length.
    ///
    /// # Errors
    /// As [`Engine::package_file`].
    pub async fn read_package_file(&self, job: JobId, path: &str, range: Option<Range<u64>>) -> Result<Download, EngineError> {
        Err(LATER)
    }

    /// The manifest of a finished job's package.
    ///
    /// # Errors
    /// As [`Engine::package`].
    pub async fn manifest(&self, job: JobId) -> Result<Bytes, EngineError> {
        Err(LATER)
    }

    /// Workers that were heard not too long ago, youngest first.
    ///
    /// # Errors
    /// A failing store.
    pub async fn workers(&self) -> Result<Vec<WorkerRecord>, EngineError> {
        Err(LATER)
    }

    /// Figures for `/metrics`.
    ///
    /// # Errors
    /// A failing store.
    pub async fn statistics(&self) -> Result<Statistics, EngineError> {
        Err(LATER)
    }

    /// A worker introduces itself.
    ///
    /// # Errors
    /// [`Refusal::Incompatible`]; [`Refusal::Busy`] while store or disk fail, here and in every call below.
    pub async fn hello(&self, hello: &Hello) -> Result<Welcome, Refusal> {
        Err(BUSY)
    }

    /// Work for a worker, as soon as there is some; `None` when the time it is willing to wait has passed.
    ///
    /// # Errors
    /// [`Refusal::UnknownWorker`].
    pub async fn lease(&self, request: &LeaseRequest) -> Result<Option<LeaseGrant>, Refusal> {
        Err(BUSY)
    }

    /// A sign of life of an attempt.
    ///
    /// # Errors
    /// Only [`Refusal::Busy`]: an attempt that is gone is answered with [`HeartbeatReply::Cancel`].
    pub async fn heartbeat(&self, token: Token, heartbeat: &Heartbeat) -> Result<HeartbeatReply, Refusal> {
        Err(BUSY)
    }

    /// A chunk of segments, spooled to a local file. Repeating (token, n) is a no-op with the same verdicts.
    ///
    /// # Errors
    /// [`Refusal::Gone`] for attempts that may not deliver, [`Refusal::Invalid`] for bytes that are not a chunk of theirs (this fences the
    /// attempt and puts its tiles back).
    pub async fn chunk(&self, token: Token, n: u64, body: TempPath) -> Result<ChunkVerdict, Refusal> {
        Err(BUSY)
    }

    /// The worker is done with an attempt: every tile has been delivered.
    ///
    /// # Errors
    /// [`Refusal::Gone`]; [`Refusal::Invalid`] where tiles are missing, which go back to work.
    pub async fn complete(&self, token: Token, finish: &Finish) -> Result<(), Refusal> {
        Err(BUSY)
    }

    /// The worker gives the rest of an attempt back.
    ///
    /// # Errors
    /// [`Refusal::Gone`].
    pub async fn release(&self, token: Token, finish: &Finish) -> Result<(), Refusal> {
        Err(BUSY)
    }
}
