//! Workers as this process knows them, so that neither a lease nor a heartbeat asks the store who calls, nor writes that it was heard.
//!
//! What is cached is a few seconds old: a worker that was put off its work hears of it that late. When each was heard is written together,
//! every few seconds. Both may be lost.

use super::{EngineError, core::Core};
use crate::records::{UnixMillis, WorkerRecord};
use kiln_proto::ids::WorkerId;
use std::collections::HashMap;

/// How long a record is believed, milliseconds.
const BELIEVED: i64 = 5_000;
/// Records kept, at most; beyond, all are asked for again.
const KEPT: usize = 20_000;

/// Workers by id.
#[derive(Default)]
pub(super) struct Roster {
    known: HashMap<WorkerId, (UnixMillis, WorkerRecord)>,
    /// Heard and not yet written.
    heard: HashMap<WorkerId, UnixMillis>,
}

impl Roster {
    fn get(&self, id: WorkerId, now: UnixMillis) -> Option<WorkerRecord> {
        self.known.get(&id).filter(|(read, _)| (0..BELIEVED).contains(&(now - read))).map(|(_, worker)| worker.clone())
    }

    fn put(&mut self, worker: WorkerRecord, now: UnixMillis) {
        if self.known.len() >= KEPT {
            self.known.clear();
        }
        self.known.insert(worker.id, (now, worker));
    }

    /// Notes that a worker was heard.
    pub(super) fn heard(&mut self, id: WorkerId, now: UnixMillis) {
        self.heard.insert(id, now);
    }

    /// When a worker was heard that is not written yet.
    pub(super) fn last_heard(&self, id: WorkerId) -> Option<UnixMillis> {
        self.heard.get(&id).copied()
    }

    /// What is to be written now.
    pub(super) fn take_heard(&mut self) -> Vec<(WorkerId, UnixMillis)> {
        self.heard.drain().collect()
    }
}

/// A worker that calls; `None` where it is not known. It counts as heard.
pub(super) async fn caller(core: &Core, id: WorkerId) -> Result<Option<WorkerRecord>, EngineError> {
    let now = core.now();
    let known = core.roster().get(id, now);
    let worker = match known {
        Some(worker) => worker,
        None => {
            let Some(read) = core.store.worker(id).await? else { return Ok(None) };
            core.roster().put(read.clone(), now);
            read
        }
    };
    core.heard(id, now);
    Ok(Some(worker))
}

/// Writes when workers were heard.
pub(super) async fn write(core: &Core) {
    let heard = core.roster().take_heard();
    if heard.is_empty() {
        return;
    }
    if let Err(error) = core.store.heard_workers(&heard).await {
        tracing::error!(%error, "noting who was heard failed");
    }
}
