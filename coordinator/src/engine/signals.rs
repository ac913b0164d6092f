//! Who waits for what: workers for tiles, runners for tasks, event streams for their job.
//!
//! Signals are hints. Whoever is woken asks the store, and a lost hint costs a moment, never correctness.

use kiln_proto::ids::JobId;
use std::{
    collections::HashMap,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};
use tokio::sync::{Notify, watch};

/// Everything that can be waited for.
#[derive(Default)]
pub(super) struct Signals {
    /// Tiles may have become leasable.
    pub(super) work: Notify,
    /// Tasks may have become due.
    pub(super) tasks: Notify,
    /// Scenes may have changed.
    pub(super) scenes: Notify,
    /// The engine stops.
    pub(super) stop: Notify,
    stopping: AtomicBool,
    jobs: Mutex<HashMap<JobId, watch::Sender<()>>>,
}

impl Signals {
    /// Something happened to a job, and perhaps to everything that follows from it.
    pub(super) fn job_changed(&self, job: JobId) {
        self.touch(job);
        self.work.notify_waiters();
        self.tasks.notify_waiters();
    }

    /// Wakes only who watches the job.
    pub(super) fn touch(&self, job: JobId) {
        let mut jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        // Nobody listens any more: forget the job.
        if jobs.get(&job).is_some_and(|sender| sender.send(()).is_err()) {
            jobs.remove(&job);
        }
    }

    /// Sees every change of the job from now on.
    pub(super) fn watch(&self, job: JobId) -> watch::Receiver<()> {
        let mut jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        jobs.entry(job).or_insert_with(|| watch::channel(()).0).subscribe()
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::SeqCst)
    }

    /// Wakes everyone for the last time.
    pub(super) fn stop(&self) {
        self.stopping.store(true, Ordering::SeqCst);
        self.stop.notify_waiters();
        self.work.notify_waiters();
        self.tasks.notify_waiters();
        self.scenes.notify_waiters();
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
