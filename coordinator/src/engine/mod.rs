//! The engine: the one module that joins state machines, store, blobs, import and assembly.
//!
//! HTTP handlers, tests and `kiln bake` call its methods. Everything it knows is in the store and the blobs, so that it may be dropped at
//! any moment, as a crash does, and opened again: held leases stay held until their deadline, tasks are taken over, accepted segments
//! stay accepted. What it keeps in memory (caches, speeds, who watches what) may be lost. Each sibling adds the methods of one concern.

mod assembly;
mod background;
mod chunks;
mod clock;
mod core;
mod dispatch;
mod done;
mod error;
mod hints;
mod history;
mod inspect;
mod jobs;
mod leases;
mod live;
mod meter;
mod notices;
mod offers;
mod open;
mod packages;
pub mod ports;
mod preview;
mod progress;
mod report;
mod retention;
mod roster;
mod runner;
mod scenes;
mod segments;
mod signals;
mod space;
mod tasks;
#[cfg(test)]
pub(crate) mod tests;
mod types;

pub use self::core::Clock;
pub use crate::{
    records::PackageFile,
    store::{EventPage, JobFilter},
};
pub use error::EngineError;
pub(crate) use jobs::check_share;
pub use live::LiveScene;
pub use open::Parts;
pub(crate) use open::private_folder;
pub use preview::{PictureError, StoredPackage};
pub use types::{Download, Estimate, JobPage, Statistics, UploadedFile};

use self::core::Core;
use crate::{
    config::Config,
    records::{Throughput, UnixMillis, WorkerRecord},
    store::{RequestStore, TokenStore},
};
use std::{
    fs::File,
    sync::{Arc, atomic::Ordering},
};
use tempfile::NamedTempFile;
use tokio::{sync::Mutex, task::JoinSet};

/// A running coordinator without its HTTP face.
pub struct Engine {
    core: Arc<Core>,
    /// Dropping the set stops the background work wherever it is.
    background: Mutex<JoinSet<()>>,
    /// Held for as long as this process owns the data folder.
    _lock: File,
}

impl Engine {
    /// Stops the background work and wakes every waiting worker with nothing. Work that is running is given up: its tasks are taken over by
    /// the next start. Dropping an engine without this is safe too: it is what a crash does.
    pub async fn shut_down(&self) {
        self.core.signals.stop();
        self.background.lock().await.shutdown().await;
    }

    /// What it was opened with.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.core.config
    }

    /// The time by this engine's clock.
    #[must_use]
    pub fn now(&self) -> UnixMillis {
        self.core.now()
    }

    /// Where tokens and owners are kept.
    #[must_use]
    pub fn tokens(&self) -> Arc<dyn TokenStore> {
        Arc::clone(&self.core.store) as Arc<dyn TokenStore>
    }

    /// Where requests that may be repeated are kept.
    #[must_use]
    pub fn requests(&self) -> Arc<dyn RequestStore> {
        Arc::clone(&self.core.store) as Arc<dyn RequestStore>
    }

    /// This engine's clock.
    #[must_use]
    pub fn clock(&self) -> Clock {
        Arc::clone(&self.core.clock)
    }

    /// Whether the store answers and the disk has room: `/readyz`.
    ///
    /// # Errors
    /// What does not answer.
    pub async fn ready(&self) -> Result<(), EngineError> {
        if self.core.signals.is_stopping() {
            return Err(EngineError::Unavailable("it is shutting down"));
        }
        self.core.store.figures().await?;
        let (path, needed) = (self.core.config.data_dir.clone(), self.core.config.reserve_bytes);
        let free = space::free(&path)?;
        if free < needed { Err(EngineError::NoSpace { needed, free, path }) } else { Ok(()) }
    }

    /// A file on the data folder's disk for a request body; removed when dropped, and at start-up.
    ///
    /// # Errors
    /// A full or failing disk.
    pub fn spool(&self) -> Result<NamedTempFile, EngineError> {
        NamedTempFile::new_in(&self.core.spool).map_err(|source| EngineError::DataFolder {
            path: self.core.spool.clone(),
            doing: "creating a temporary file",
            source,
        })
    }

    /// Workers that were heard not too long ago, youngest first.
    ///
    /// # Errors
    /// A failing store.
    pub async fn workers(&self) -> Result<Vec<WorkerRecord>, EngineError> {
        let since = self.now() - self.core.config.keep.dead_workers_ms as i64;
        let mut workers = self.core.store.workers(since).await?;
        let meter = self.core.meter();
        let roster = self.core.roster();
        for worker in &mut workers {
            worker.seen_ms = roster.last_heard(worker.id).map_or(worker.seen_ms, |heard| heard.max(worker.seen_ms));
            let rates = meter.rates_of(worker.id, self.now());
            (worker.rays_per_second, worker.texels_per_second) = (rates.rays, rates.cost);
        }
        Ok(workers)
    }

    /// What was done over the last hour, as far as this process has seen it.
    #[must_use]
    pub fn throughput(&self) -> Throughput {
        Throughput { interval_ms: history::INTERVAL, points: self.core.meter().throughput(self.now()) }
    }

    /// Figures for `/metrics`.
    ///
    /// # Errors
    /// A failing store.
    pub async fn statistics(&self) -> Result<Statistics, EngineError> {
        let figures = self.core.store.figures().await?;
        let counters = &self.core.counters;
        let count = |counter: &std::sync::atomic::AtomicU64| counter.load(Ordering::Relaxed);
        let states = ["queued", "preparing", "baking", "paused", "assembling", "done", "failed", "cancelled"];
        let jobs = states.iter().map(|s| ((*s).to_owned(), figures.jobs.get(*s).copied().unwrap_or(0))).collect();
        Ok(Statistics {
            jobs,
            tiles_pending: figures.tiles_pending,
            tiles_leased: figures.tiles_leased,
            attempts_held: figures.attempts_held,
            workers: self.core.present_workers(),
            tasks: figures.tasks,
            disk_free_bytes: space::free(&self.core.config.data_dir)?,
            leases_granted: count(&counters.leases_granted),
            attempts_expired: count(&counters.attempts_expired),
            chunks_accepted: count(&counters.chunks_accepted),
            chunks_refused: count(&counters.chunks_refused),
            chunk_bytes: count(&counters.chunk_bytes),
            tiles_accepted: count(&counters.tiles_accepted),
            tiles_duplicate: count(&counters.tiles_duplicate),
            tiles_conflicting: count(&counters.tiles_conflicting),
        })
    }
}
