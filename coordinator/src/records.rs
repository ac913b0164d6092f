//! What the coordinator knows of scenes, jobs, workers and packages: the shapes that the engine hands to HTTP, the event stream and the
//! dashboard. They are serialised as they stand, so every name here is part of the API.

use crate::{auth::TokenId, job::OnPoison};
use kiln_proto::{
    ids::{JobId, SceneHash, WorkerId},
    options::ImportOptions,
    settings::{BakeSettings, SettingsPatch},
    tile::TileRun,
    wire::message::{Hello, Phase},
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Milliseconds since 1970-01-01 UTC, by the store's clock.
pub type UnixMillis = i64;

/// Something wrong with an input, located.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// What is wrong and what to do about it: one sentence.
    pub message: String,
    /// The file of the bundle, where one is to blame.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub file: Option<String>,
    /// Its line, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<u32>,
}

impl Problem {
    /// A problem that is of no place in a file.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), file: None, line: None }
    }
}

/// What an import found: `file:line: message` in print.
impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (&self.file, self.line) {
            (Some(file), Some(line)) => write!(f, "{file}:{line}: {}", self.message),
            (Some(file), None) => write!(f, "{file}: {}", self.message),
            _ => f.write_str(&self.message),
        }
    }
}

/// `Uploaded -> Importing -> Ready | Rejected`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SceneState {
    /// The bundle is stored; nobody has looked at it.
    Uploaded,
    /// A task is importing it.
    Importing,
    /// Canonical and stored.
    Ready,
    /// Not usable; the problems say why.
    Rejected,
}

/// An uploaded scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SceneRecord {
    /// Identifies the upload before its canonical hash is known.
    #[schema(value_type = String)]
    pub id: uuid::Uuid,
    /// The canonical scene's hash once it is ready.
    #[schema(value_type = Option<String>)]
    pub scene: Option<SceneHash>,
    /// Where it is.
    pub state: SceneState,
    /// When it was uploaded.
    pub created_ms: UnixMillis,
    /// How it was to be read.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub options: ImportOptions,
    /// Statistics once it is ready.
    pub statistics: Option<SceneStatistics>,
    /// What was repaired, ignored or approximated.
    pub warnings: Vec<Problem>,
    /// Why it was rejected.
    pub problems: Vec<Problem>,
}

/// Counts of a canonical scene. What of the file is not in it is told by the warnings beside.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(default)]
pub struct SceneStatistics {
    /// Triangles.
    pub triangles: u64,
    /// Surfaces, with their names.
    pub surfaces: Vec<String>,
    /// Materials.
    pub materials: u64,
    /// Decoded textures.
    pub textures: u64,
    /// Triangles that emit.
    pub emissive_triangles: u64,
    /// Parts of surfaces: runs of triangles with a material each.
    pub parts: u64,
    /// Surfaces that are the back of another: what is seen from both sides counts twice.
    pub backs: u64,
    /// Surfaces with normals of their own; the others are flat in each triangle.
    pub smooth_surfaces: u64,
    /// Surfaces with vertex colours.
    pub colored_surfaces: u64,
    /// Surfaces with at least one set of texture coordinates.
    pub mapped_surfaces: u64,
    /// The most sets of texture coordinates that a surface has.
    pub uv_sets: u64,
    /// Triangles that light passes: cut out, blended or transmitting.
    pub transparent_triangles: u64,
    /// Lights without area, by kind.
    pub lights: LightCounts,
    /// Width and height of the environment map, pixels; absent where there is none.
    pub environment: Option<[u32; 2]>,
    /// Cameras.
    pub cameras: u64,
    /// Projectors of textures and shadow maps.
    pub projectors: u64,
    /// Lower corner of the bounding box, metres.
    pub low: [f32; 3],
    /// Upper corner of the bounding box, metres.
    pub high: [f32; 3],
}

/// Lights without area.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct LightCounts {
    /// From a point to all sides.
    pub point: u64,
    /// From a point into a cone.
    pub spot: u64,
    /// From a direction.
    pub directional: u64,
}

/// `Queued -> Preparing -> Baking -> Assembling -> Done`, or `Failed`, `Cancelled`; `Paused` from `Baking` and back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waiting for its scene or its turn.
    Queued,
    /// Surfaces are being laid out and cut into tiles.
    Preparing,
    /// Tiles are leased to workers.
    Baking,
    /// Someone paused it while it was baking: nothing is leased until it is resumed.
    Paused,
    /// Segments are being assembled into the package.
    Assembling,
    /// The package is published.
    Done,
    /// It cannot finish; the problem says why.
    Failed,
    /// Someone cancelled it.
    Cancelled,
}

impl JobState {
    /// Whether nothing will change any more.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, JobState::Done | JobState::Failed | JobState::Cancelled)
    }
}

/// What a client asks for.
#[derive(Debug, Clone, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewJob {
    /// Hash of a scene that is ready, or the id of an upload.
    pub scene: String,
    /// Settings that differ from the preset's.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub settings: SettingsPatch,
    /// Higher goes first.
    #[serde(default)]
    pub priority: i32,
    /// For the client's own use.
    #[serde(default)]
    pub labels: BTreeMap<String, String>,
    /// The share of its tiles that two workers bake and whose bytes are compared, in [0, 1]; what the service is configured for, where
    /// nothing is said. A worker that disagrees with two others is barred, and what it baked is baked again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 1)]
    pub verify: Option<f64>,
    /// Whom to tell when it is done, has failed or was cancelled: an address that the service is configured to allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(format = "uri", example = "https://ci.example/kiln")]
    pub webhook: Option<String>,
    /// What becomes of the job when one of its tiles is given up: it fails, or ends without the tile.
    #[serde(default)]
    pub on_poison: OnPoison,
}

/// What a webhook is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WebhookMessage {
    /// Names the message: the same in every try to deliver it, and in the header `webhook-id`.
    pub id: String,
    /// What happened.
    #[serde(rename = "type")]
    #[schema(example = "job.done")]
    pub kind: WebhookEvent,
    /// When it happened.
    pub at_ms: UnixMillis,
    /// The job as it was when the message was sent.
    pub job: JobRecord,
}

/// What may have happened to a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum WebhookEvent {
    /// Its package is published.
    #[serde(rename = "job.done")]
    Done,
    /// It failed.
    #[serde(rename = "job.failed")]
    Failed,
    /// Someone cancelled it.
    #[serde(rename = "job.cancelled")]
    Cancelled,
}

/// What is to be changed of a job; what is not named stays.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobChange {
    /// Whether nothing of it shall be leased for now.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paused: Option<bool>,
    /// Higher goes first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<i32>,
}

/// A job as clients see it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobRecord {
    /// Its id.
    #[schema(value_type = String)]
    pub id: JobId,
    /// The scene: a hash once known.
    #[schema(value_type = Option<String>)]
    pub scene: Option<SceneHash>,
    /// Where it is.
    pub state: JobState,
    /// The phase it bakes.
    #[schema(value_type = Option<String>)]
    pub phase: Option<Phase>,
    /// Settings with every value decided.
    #[schema(value_type = Object)]
    pub settings: BakeSettings,
    /// Higher goes first.
    pub priority: i32,
    /// The client's own.
    pub labels: BTreeMap<String, String>,
    /// What becomes of it when one of its tiles is given up.
    #[serde(default)]
    pub on_poison: OnPoison,
    /// Tiles that it ends without, from the moment that it is assembled; absent where there are none. The manifest lists those of its package.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub holes: u64,
    /// The id of the token that brought it; absent where it came while the service asked for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub owner: Option<TokenId>,
    /// How far it is.
    pub progress: Progress,
    /// Why it failed.
    pub problem: Option<Problem>,
    /// Why nothing happens, where nothing happens: no worker connected, waiting behind another job, …
    pub waiting: Option<String>,
    /// When it was created.
    pub created_ms: UnixMillis,
    /// When it began to bake.
    pub started_ms: Option<UnixMillis>,
    /// When it reached a final state.
    pub finished_ms: Option<UnixMillis>,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// How far a job is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Tiles of the current phase.
    pub tiles: u64,
    /// Of them, done.
    pub tiles_done: u64,
    /// Of those that are done, tiles that a second worker must bake before they count.
    pub tiles_unverified: u64,
    /// Covered texels of the job.
    pub texels: u64,
    /// Of the current phase's cost (texels with gutters), what is done, in [0, 1].
    pub fraction: f64,
    /// Rays traced so far, by the workers' word.
    pub rays: u64,
    /// Rays per second over the last half minute.
    pub rays_per_second: f64,
    /// Workers that hold a lease of this job.
    pub workers: u32,
    /// Seconds until the current phase is done, where that can be told.
    pub eta_seconds: Option<f64>,
}

/// One entry of a job's event stream. `seq` grows by one per job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobEvent {
    /// Position in the job's stream, from 1.
    pub seq: i64,
    /// When it happened.
    pub at_ms: UnixMillis,
    /// What happened.
    #[serde(flatten)]
    pub kind: EventKind,
}

/// What may happen to a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum EventKind {
    /// It changed state or phase.
    State {
        /// The new state.
        state: JobState,
        /// The phase while baking.
        #[schema(value_type = Option<String>)]
        phase: Option<Phase>,
    },
    /// Tiles were accepted.
    Tiles {
        /// Of which phase.
        #[schema(value_type = String)]
        phase: Phase,
        /// Which.
        #[schema(value_type = Vec<Object>)]
        runs: Vec<TileRun>,
        /// Done in this phase after this event.
        tiles_done: u64,
        /// Tiles of this phase.
        tiles: u64,
    },
    /// Something went wrong that the job survived, or did not.
    Problem {
        /// What.
        problem: Problem,
    },
}

/// A worker as the dashboard sees it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorkerRecord {
    /// Its id.
    #[schema(value_type = String)]
    pub id: WorkerId,
    /// What a person calls it.
    pub name: String,
    /// Threads that it traces with.
    pub threads: u32,
    /// CPU features in use.
    pub features: Vec<String>,
    /// Its bake version.
    pub bake_version: u32,
    /// Why it gets no more work, where it gets none.
    #[serde(default)]
    pub barred: Option<String>,
    /// When it said hello.
    pub since_ms: UnixMillis,
    /// When it was last heard.
    pub seen_ms: UnixMillis,
    /// The job that it bakes now.
    #[schema(value_type = Option<String>)]
    pub job: Option<JobId>,
    /// Texels (gutters included) it finished, ever.
    pub texels_done: u64,
    /// Rays it traced, ever.
    pub rays: u64,
    /// Processor seconds it reported, ever.
    pub core_seconds: f64,
    /// Largest resident memory it reported, bytes.
    pub peak_rss_bytes: u64,
    /// Rays per second over the last half minute, as far as the coordinator has seen them.
    #[serde(default)]
    pub rays_per_second: f64,
    /// Texels (gutters included) per second over the last half minute, as far as the coordinator has seen them.
    #[serde(default)]
    pub texels_per_second: f64,
}

impl WorkerRecord {
    /// A worker that has just said hello. More threads than any machine has are not believed.
    #[must_use]
    pub fn new(id: WorkerId, hello: &Hello, now: UnixMillis) -> Self {
        Self {
            id,
            name: hello.name.clone(),
            threads: hello.threads.clamp(1, 4_096),
            features: hello.features.clone(),
            bake_version: hello.bake_version,
            barred: None,
            since_ms: now,
            seen_ms: now,
            job: None,
            texels_done: 0,
            rays: 0,
            core_seconds: 0.0,
            peak_rss_bytes: 0,
            rays_per_second: 0.0,
            texels_per_second: 0.0,
        }
    }
}

/// What the farm did over the last hour. Kept in memory: a coordinator that has just started knows only what happened since.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Throughput {
    /// The span of a point, milliseconds.
    pub interval_ms: i64,
    /// Oldest first. Spans in which nothing was noted are left out.
    pub points: Vec<ThroughputPoint>,
}

/// What the farm did within one span.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct ThroughputPoint {
    /// When the span began.
    pub at_ms: UnixMillis,
    /// Rays reported within it.
    pub rays: u64,
    /// Texels (gutters included) of tiles accepted within it, of both phases.
    pub texels: u64,
    /// Tiles accepted within it, of both phases.
    pub tiles: u64,
    /// Workers that were there when last looked.
    pub workers: u64,
}

/// One file of a published package.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct PackageFile {
    /// Path within the package, `/` between parts.
    pub path: String,
    /// Its media type.
    pub media_type: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256, 64 hexadecimal digits: the strong ETag.
    pub sha256: String,
}
