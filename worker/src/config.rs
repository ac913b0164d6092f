//! How a worker is set up.

use kiln_proto::secret::Secret;
use std::{path::PathBuf, time::Duration};

/// The order in which a worker bakes the tiles of a lease. Results never depend on it; the choice exists so that tests can show that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TileOrder {
    /// First to last.
    #[default]
    Forward,
    /// Last to first.
    Reverse,
}

/// Where finished chunks wait for the coordinator's verdict.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpoolConfig {
    /// The folder; workers of one machine share it, each with a folder of its own inside.
    pub folder: PathBuf,
    /// Bytes that this worker may keep there. Beyond them tracing waits for delivery.
    pub bytes: u64,
}

/// How a client says who it is, and whom it believes.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// The access token, where the coordinator asks for one.
    pub token: Option<Secret>,
    /// A file of root certificates (PEM) to believe beside the system's own.
    pub ca: Option<PathBuf>,
}

/// Configuration of one worker process.
#[derive(Debug, Clone)]
pub struct WorkerConfig {
    /// The coordinator's address, such as `http://127.0.0.1:8080`.
    pub server: String,
    /// Access to it.
    pub access: Access,
    /// What people call this worker.
    pub name: String,
    /// Threads that trace.
    pub threads: usize,
    /// Which vector instructions the kernels may use.
    pub simd: crate::simd::Simd,
    /// Order of tiles within a lease.
    pub order: TileOrder,
    /// How long a worker that was told to stop may take to finish its tile and hand back the rest.
    pub drain_timeout: Duration,
    /// Where finished chunks wait; without one each waits in memory, and tracing with it.
    pub spool: Option<SpoolConfig>,
}
