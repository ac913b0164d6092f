//! How a worker is set up.

use std::time::Duration;

/// The order in which a worker bakes the tiles of a lease. Results never depend on it; the choice exists so that tests can show that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TileOrder {
    /// First to last.
    #[default]
    Forward,
    /// Last to first.
    Reverse,
}

/// Configuration of one worker process.
#[derive(Debug, Clone)]
pub struct WorkerConfig {
    /// The coordinator's address, such as `http://127.0.0.1:8080`.
    pub server: String,
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
}
