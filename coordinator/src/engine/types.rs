//! What callers of the engine hand in and get back, beside the API's own [records](crate::records).

use crate::{blob::ByteStream, records::JobRecord};
use kiln_proto::ids::JobId;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::PathBuf};
use utoipa::ToSchema;

/// One file of an uploaded scene, spooled to the local disk (see [`Engine::spool`](super::Engine::spool)).
#[derive(Debug)]
pub struct UploadedFile {
    /// The client's name for it, relative to the scene's folder, `/` between parts. An archive is one such file.
    pub name: String,
    /// Where its bytes are now. The engine moves or removes it.
    pub path: PathBuf,
}

/// Some jobs, youngest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobPage {
    /// The jobs.
    pub jobs: Vec<JobRecord>,
    /// The cursor of the next page, where there is one.
    #[schema(value_type = Option<String>)]
    pub next: Option<JobId>,
}

/// What a job would cost: the answer to `?dry_run`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Estimate {
    /// Covered texels.
    pub texels: u64,
    /// Tiles of the Bake phase.
    pub tiles: u64,
    /// Surfaces with their texture sizes, `WIDTHxHEIGHT`.
    pub surfaces: BTreeMap<String, String>,
    /// Bytes of the package without compression.
    pub raw_bytes: u64,
    /// Bytes of disk to expect while baking and assembling: segments and package together.
    pub disk_bytes: u64,
    /// Seconds to expect with the workers that are connected now; `None` without any.
    pub seconds: Option<f64>,
    /// What was repaired or bounded on the way.
    pub warnings: Vec<crate::records::Problem>,
}

/// Bytes on their way to a client.
pub struct Download {
    /// How many bytes the stream yields.
    pub length: u64,
    /// The bytes.
    pub stream: ByteStream,
}

/// Figures for `/metrics`, all taken at one moment. Counters count from the start of this process.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Statistics {
    /// Jobs by state, every state named.
    pub jobs: BTreeMap<String, u64>,
    /// Tiles that wait for a worker, over all baking jobs: what autoscaling looks at.
    pub tiles_pending: u64,
    /// Tiles in leases.
    pub tiles_leased: u64,
    /// Attempts held.
    pub attempts_held: u64,
    /// Workers heard within a lease's lifetime.
    pub workers: u64,
    /// Coordinator tasks that wait or run.
    pub tasks: u64,
    /// Bytes free on the disk of the data folder.
    pub disk_free_bytes: u64,
    /// Counter: leases granted.
    pub leases_granted: u64,
    /// Counter: attempts that expired.
    pub attempts_expired: u64,
    /// Counter: chunks accepted.
    pub chunks_accepted: u64,
    /// Counter: chunks refused as invalid.
    pub chunks_refused: u64,
    /// Counter: bytes of accepted chunks.
    pub chunk_bytes: u64,
    /// Counter: segments accepted.
    pub tiles_accepted: u64,
    /// Counter: segments that were there already.
    pub tiles_duplicate: u64,
    /// Counter: segments that differed from the accepted one.
    pub tiles_conflicting: u64,
}
