//! What goes into a store and what comes out of it.

use crate::{
    auth::{Scope, TokenId},
    blob::BlobName,
    job::{Job, JobTask, OnPoison},
    lease::{self, Attempt},
    records::{JobEvent, JobState, PackageFile, Problem, SceneRecord, SceneStatistics, UnixMillis},
};
use futures_util::stream::BoxStream;
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    settings::BakeSettings,
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::{Finish, Phase},
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use uuid::Uuid;

/// A file of an upload.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredFile {
    /// Its name within the upload.
    pub name: String,
    /// Its bytes.
    pub blob: BlobName,
}

/// An uploaded scene as stored.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneRow {
    /// What clients see.
    pub record: SceneRecord,
    /// What was uploaded.
    pub files: Vec<StoredFile>,
    /// The canonical bytes, compressed, once it is ready.
    pub canonical: Option<BlobName>,
    /// The token that brought it.
    pub owner: Option<TokenId>,
}

/// A plan: its name and where its compressed bytes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanRef {
    /// Hash of the bytes before compression.
    pub digest: Digest,
    /// The compressed bytes.
    pub blob: BlobName,
}

/// A job to create.
#[derive(Debug, Clone, PartialEq)]
pub struct JobSpec {
    /// Its id.
    pub id: JobId,
    /// The upload that holds its scene.
    pub scene: Uuid,
    /// Settings with every value decided.
    pub settings: BakeSettings,
    /// Higher goes first.
    pub priority: i32,
    /// The client's own.
    pub labels: BTreeMap<String, String>,
    /// Only workers of this bake version get its tiles.
    pub bake_version: u32,
    /// What becomes of it when a tile is given up.
    pub on_poison: OnPoison,
    /// The token that brought it.
    pub owner: Option<TokenId>,
    /// The share of its tiles that two workers bake, in [0, 1].
    pub verify: f64,
    /// Decides which tiles those are; workers are never told.
    pub secret: String,
    /// Whom to tell when it has ended: an address.
    pub webhook: Option<String>,
}

/// A job as stored.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRow {
    /// What it was created with.
    pub spec: JobSpec,
    /// The hash of its scene, once known.
    pub scene_hash: Option<SceneHash>,
    /// Where it is.
    pub state: Job,
    /// Its present plan.
    pub plan: Option<PlanRef>,
    /// Tiles of the current phase, and how many are done.
    pub tiles: (u64, u64),
    /// Cost of the current phase in texels, and how much is done.
    pub cost: (u64, u64),
    /// Covered texels.
    pub texels: u64,
    /// Rays by the workers' word: attempts that ended, and those that are held.
    pub rays: u64,
    /// Workers that hold an attempt of it.
    pub workers: u32,
    /// Tiles of the phase that wait for a worker.
    pub pending: u64,
    /// Tiles of the phase that are done and wait for the opinion of a second worker.
    pub unchecked: u64,
    /// What a task of it waits for that storage failed under.
    pub put_off: Option<String>,
    /// When it was created.
    pub created_ms: UnixMillis,
    /// Every state it entered, in order: the state, the phase while baking, when.
    pub marks: Vec<(JobState, Option<Phase>, UnixMillis)>,
    /// The sequence number of its latest event.
    pub seq: i64,
}

/// Which jobs to list.
#[derive(Debug, Clone, Default)]
pub struct JobFilter {
    /// Whose jobs.
    pub scope: Scope,
    /// Only jobs in this state.
    pub state: Option<JobState>,
    /// Only jobs with this label (name, value).
    pub label: Option<(String, String)>,
    /// Only jobs older than this one: the last of the page before.
    pub cursor: Option<JobId>,
    /// At most this many; 0 means 100, and never more than 1,000.
    pub limit: u32,
}

/// Events of a job behind a sequence number.
#[derive(Debug, Clone, PartialEq)]
pub struct EventPage {
    /// In order, without gaps.
    pub events: Vec<JobEvent>,
    /// Events between the one asked for and the first of these have been dropped: send a snapshot first.
    pub dropped: bool,
}

/// Coordinator work, leased with tokens like tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Import an upload.
    Import(Uuid),
    /// Something for a job.
    Job(JobId, JobTask),
    /// Tells the webhook of a job that it has ended. Not the job's own: whatever becomes of it changes nothing for the job, and nothing that
    /// happens to the job recalls it.
    Notify(Notice),
}

/// Which tasks are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lane {
    /// What jobs wait for.
    Work,
    /// What others are told of.
    Notices,
}

/// The end of a job, to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Notice {
    /// The job.
    pub job: JobId,
    /// How it ended.
    pub state: JobState,
    /// When.
    pub at_ms: UnixMillis,
    /// The number of its event, which tells apart the ends of a job that was tried again.
    pub seq: i64,
}

/// A task that its holder may work on until the deadline.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskLease {
    /// The fence.
    pub token: Token,
    /// What to do.
    pub task: Task,
    /// How often storage has failed under it already.
    pub put_off: u32,
}

/// A file of a package as stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredPackageFile {
    /// What clients see.
    pub file: PackageFile,
    /// Its bytes.
    pub blob: BlobName,
}

/// What came of a task.
#[derive(Debug, Clone, PartialEq)]
pub enum TaskResult {
    /// An import succeeded.
    Imported {
        /// The canonical scene.
        scene: SceneHash,
        /// Its compressed bytes.
        canonical: BlobName,
        /// Counts.
        statistics: SceneStatistics,
        /// What was repaired or ignored.
        warnings: Vec<Problem>,
    },
    /// An import found that the upload is not usable.
    Rejected(Vec<Problem>),
    /// A job has its plan.
    Prepared {
        /// The plan.
        plan: PlanRef,
        /// Tiles of Probe.
        tiles: u64,
        /// Their cost, texels.
        cost: u64,
        /// Surfaces.
        surfaces: u32,
        /// Covered texels.
        texels: u64,
        /// What was bounded or replaced.
        warnings: Vec<Problem>,
    },
    /// A phase's results are in the plan.
    Merged {
        /// The phase that ended.
        phase: Phase,
        /// The new plan.
        plan: PlanRef,
        /// Tiles of the next phase.
        tiles: u64,
        /// Their cost, texels.
        cost: u64,
        /// The first of them of each surface, and its name.
        places: Vec<(u64, String)>,
    },
    /// A surface's files are written.
    Assembled {
        /// The surface.
        surface: u32,
        /// Its report, for the manifest.
        report: serde_json::Value,
        /// Its files.
        files: Vec<StoredPackageFile>,
    },
    /// Manifest and report are written: the package is whole.
    Published(Vec<StoredPackageFile>),
    /// It cannot be done: the job fails.
    Failed(Problem),
    /// A webhook was told, or there is nothing to tell any more.
    Notified,
    /// It cannot be done yet: the bytes of a chunk of this phase are gone (see [`Store::lose_chunk`](super::Store::lose_chunk)).
    Lost(Phase, BlobName),
}

/// What a job that bakes asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClaimRow {
    /// The job.
    pub job: JobId,
    /// Its priority.
    pub priority: i32,
    /// The token that brought it.
    pub owner: Option<TokenId>,
    /// Its tiles that wait for a worker.
    pub waiting: u64,
    /// Its tiles that are done, must be baked by a second worker, and that nobody is asked about.
    pub unasked: u64,
    /// Its attempts that are held.
    pub leased: u64,
}

/// A phase in which nothing waits any more, while something is held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Late {
    /// Whose phase; no tiles.
    pub candidate: Candidate,
    /// What is held.
    pub running: Vec<lease::Running>,
    /// What ended lately.
    pub finished: Vec<lease::Finished>,
    /// Workers that could bake it.
    pub workers: u64,
}

/// Tiles that wait for a worker, or for a second one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    /// Whose tiles.
    pub job: JobId,
    /// Of which phase.
    pub phase: Phase,
    /// What for.
    pub kind: lease::Kind,
    /// The scene.
    pub scene: SceneHash,
    /// The plan.
    pub plan: PlanRef,
    /// A run of pending tiles within one shard. Empty for a check: which tile it is of depends on who makes it.
    pub run: TileRun,
    /// Pending tiles of the phase.
    pub pending: u64,
}

/// A lease to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grant {
    /// The fence.
    pub token: Token,
    /// Who gets it.
    pub worker: WorkerId,
    /// Whose tiles.
    pub job: JobId,
    /// Of which phase.
    pub phase: Phase,
    /// What for.
    pub kind: lease::Kind,
    /// Which tiles: the beginning of a candidate's run; of a twin, what the late attempt still owes. Nothing for a check.
    pub run: TileRun,
    /// What they cost, texels; nothing for a check.
    pub cost: u64,
    /// When it expires without heartbeats.
    pub deadline: UnixMillis,
    /// When it expires whatever comes.
    pub cap: UnixMillis,
}

/// An attempt as stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AttemptRow {
    /// Whose it is.
    pub worker: WorkerId,
    /// Whose tiles.
    pub job: JobId,
    /// Of which phase.
    pub phase: Phase,
    /// Which tiles were leased.
    pub run: TileRun,
    /// What for.
    pub kind: lease::Kind,
    /// What they cost, texels.
    pub cost: u64,
    /// What became of it.
    pub state: Attempt,
    /// When it was granted.
    pub granted_ms: UnixMillis,
    /// Texels it delivered first, gutters included.
    pub texels: u64,
}

/// A tile of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChunkTile {
    /// The tile.
    pub tile: TileIndex,
    /// Hash of its segment.
    pub digest: Digest,
    /// Its cost, texels.
    pub cost: u64,
}

/// A checked chunk to record. Its blob is durable already.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewChunk {
    /// The attempt.
    pub token: Token,
    /// Its number within the attempt.
    pub n: u64,
    /// Its bytes.
    pub blob: BlobName,
    /// Where its trailer's frame begins.
    pub trailer_at: u64,
    /// Its length.
    pub length: u64,
    /// Its tiles, none twice, all of the attempt's run.
    pub tiles: Vec<ChunkTile>,
}

impl NewChunk {
    /// Its tiles.
    pub(super) fn set(&self) -> TileRuns {
        self.tiles.iter().map(|t| t.tile).collect()
    }
}

/// A chunk as stored. Its tiles, in order, stand in its trailer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChunkRow {
    /// Its bytes.
    pub blob: BlobName,
    /// Where its trailer's frame begins.
    pub trailer_at: u64,
    /// Its length.
    pub length: u64,
    /// Tiles whose first valid segment it brought.
    pub accepted: TileRuns,
    /// Tiles that were done already with other bytes.
    pub conflicts: TileRuns,
}

/// What became of a chunk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChunkOutcome {
    /// Recorded now, or earlier under the same (token, n).
    Recorded(ChunkRow),
    /// Some tiles are done and the store does not keep digests: look them up in these chunks and ask again. Nothing was recorded.
    NeedDigests(Vec<ChunkRow>),
    /// The attempt, in this state, may not deliver.
    Gone(String),
}

/// What became of an attempt's end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FinishOutcome {
    /// It is over; tiles in its run that it owed go back.
    Finished(AttemptRow),
    /// It was over before, in this state.
    Gone(String),
}

/// What one worker did for a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contribution {
    /// The worker's name.
    pub worker: String,
    /// The phase.
    pub phase: Phase,
    /// Attempts that it ended.
    pub attempts: u64,
    /// Texels it delivered, gutters included.
    pub texels: u64,
    /// Rays by its word.
    pub rays: u64,
    /// Processor seconds by its word.
    pub core_seconds: f64,
    /// Largest resident memory by its word, bytes.
    pub peak_rss_bytes: u64,
}

/// What a look at the clock changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Expiry {
    /// Attempts that expired.
    pub attempts: u64,
    /// Tasks that went back to the queue.
    pub tasks: u64,
}

/// Counts at one moment.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Figures {
    /// Jobs by state.
    pub jobs: BTreeMap<String, u64>,
    /// Tiles that wait, for a worker or for a second one, over all jobs.
    pub tiles_pending: u64,
    /// Tiles in held attempts.
    pub tiles_leased: u64,
    /// Attempts held.
    pub attempts_held: u64,
    /// Tasks that wait or run, without notices.
    pub tasks: u64,
}

/// Jobs that other coordinators did something to.
pub type Hints = BoxStream<'static, Vec<JobId>>;

/// A heartbeat on its way into a group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beat {
    pub(super) token: Token,
    pub(super) rays: u64,
    pub(super) ttl: i64,
    pub(super) now: UnixMillis,
}

/// A chunk on its way into a group, with the digests that are known of accepted segments.
#[derive(Debug)]
pub(super) struct Delivery {
    pub(super) chunk: NewChunk,
    pub(super) known: BTreeMap<TileIndex, Digest>,
    pub(super) now: UnixMillis,
}

/// The end of an attempt on its way into a group.
#[derive(Debug, Clone)]
pub(super) struct Ending {
    pub(super) token: Token,
    pub(super) event: lease::Event,
    pub(super) finish: Option<Finish>,
    pub(super) now: UnixMillis,
}
