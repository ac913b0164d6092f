//! Who waits for what: workers for tiles, runners for tasks, event streams for their job.
//!
//! Signals are hints. Whoever is woken asks the store, and a lost hint costs a moment, never correctness.

use kiln_proto::ids::JobId;
use std::{
    collections::{BTreeSet, HashMap},
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
    /// What other coordinators have not been told; nothing where there are none.
    changed: Option<Mutex<BTreeSet<JobId>>>,
}

impl Signals {
    /// Signals of a coordinator on a store that others use too, or alone.
    pub(super) fn new(shared: bool) -> Self {
        Self { changed: shared.then(Mutex::default), ..Self::default() }
    }

    /// What others have not been told yet.
    pub(super) fn take_changed(&self) -> Vec<JobId> {
        let changed = self.changed.as_ref().map(|changed| std::mem::take(&mut *changed.lock().unwrap_or_else(PoisonError::into_inner)));
        changed.into_iter().flatten().collect()
    }

    /// Others did something to these jobs.
    pub(super) fn others_changed(&self, jobs: &[JobId]) {
        jobs.iter().for_each(|job| self.wake(*job));
        self.work.notify_waiters();
        self.tasks.notify_waiters();
        self.scenes.notify_waiters();
    }

    /// Anything may have happened: everybody looks.
    pub(super) fn everything(&self) {
        let watched: Vec<JobId> = self.jobs.lock().unwrap_or_else(PoisonError::into_inner).keys().copied().collect();
        self.others_changed(&watched);
    }

    /// Something happened to a job, and perhaps to everything that follows from it.
    pub(super) fn job_changed(&self, job: JobId) {
        self.touch(job);
        self.work.notify_waiters();
        self.tasks.notify_waiters();
    }

    /// Wakes only who watches the job.
    pub(super) fn touch(&self, job: JobId) {
        if let Some(changed) = &self.changed {
            changed.lock().unwrap_or_else(PoisonError::into_inner).insert(job);
        }
        self.wake(job);
    }

    fn wake(&self, job: JobId) {
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
