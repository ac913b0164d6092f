//! What the engine's methods and its background work share.

use super::{EngineError, dispatch::Dispatch, meter::Meter, ports::Pipeline, roster::Roster, signals::Signals};
use crate::{
    auth::Scope,
    blob::{BlobName, Blobs},
    config::Config,
    records::UnixMillis,
    store::{PlanRef, Store},
    webhook::Webhooks,
};
use bytes::Bytes;
use kiln_proto::{
    ids::{Digest, SceneHash, WorkerId},
    limits,
    plan::Plan,
    scene::Scene,
};
use std::{
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::AtomicU64},
};
use tokio::sync::{RwLock, Semaphore};

/// A clock: milliseconds since 1970. Real, or a test's own.
pub type Clock = Arc<dyn Fn() -> UnixMillis + Send + Sync>;

/// Plans kept decoded.
const PLANS: usize = 8;
/// Scenes kept decoded.
const SCENES: usize = 2;
/// zstd's level for scenes and plans: written once, sent to every worker.
const LEVEL: i32 = 3;

/// Things that happened since this process began.
#[derive(Default)]
pub(super) struct Counters {
    pub(super) leases_granted: AtomicU64,
    pub(super) attempts_expired: AtomicU64,
    pub(super) chunks_accepted: AtomicU64,
    pub(super) chunks_refused: AtomicU64,
    pub(super) chunk_bytes: AtomicU64,
    pub(super) tiles_accepted: AtomicU64,
    pub(super) tiles_duplicate: AtomicU64,
    pub(super) tiles_conflicting: AtomicU64,
}

/// What the engine's methods and its background work share.
pub(super) struct Core {
    pub(super) config: Config,
    pub(super) store: Arc<dyn Store>,
    pub(super) blobs: Arc<dyn Blobs>,
    pub(super) pipeline: Arc<dyn Pipeline>,
    pub(super) clock: Clock,
    pub(super) spool: PathBuf,
    pub(super) signals: Signals,
    pub(super) webhooks: Webhooks,
    pub(super) counters: Counters,
    /// Chunks that are checked at the same time.
    pub(super) slots: Semaphore,
    /// Held shared from writing a blob until a row names it, and alone while an unnamed blob is deleted.
    pub(super) gate: RwLock<()>,
    /// Workers that wait for work.
    pub(super) dispatch: Dispatch,
    meter: Mutex<Meter>,
    roster: Mutex<Roster>,
    plans: Mutex<Vec<(Digest, Arc<Plan>)>>,
    scenes: Mutex<Vec<(SceneHash, Arc<Scene>)>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing behind these locks can be left half done by a panic.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs processor work where it may block; a panic in it is an error here, not the end of the service.
pub(super) async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, EngineError> {
    tokio::task::spawn_blocking(work).await.map_err(|e| EngineError::Broken(format!("a part of the coordinator panicked: {e}")))
}

impl Core {
    pub(super) fn new(
        config: Config,
        spool: PathBuf,
        store: Arc<dyn Store>,
        blobs: Arc<dyn Blobs>,
        pipeline: Arc<dyn Pipeline>,
        clock: Clock,
        webhooks: Webhooks,
    ) -> Self {
        let (slots, shared) = (Semaphore::new(config.chunks.concurrent as usize), store.is_shared());
        Self {
            config,
            store,
            blobs,
            pipeline,
            clock,
            spool,
            signals: Signals::new(shared),
            webhooks,
            counters: Counters::default(),
            slots,
            gate: RwLock::default(),
            dispatch: Dispatch::default(),
            meter: Mutex::default(),
            roster: Mutex::default(),
            plans: Mutex::default(),
            scenes: Mutex::default(),
        }
    }

    pub(super) fn now(&self) -> UnixMillis {
        (self.clock)()
    }

    pub(super) fn meter(&self) -> MutexGuard<'_, Meter> {
        lock(&self.meter)
    }

    pub(super) fn roster(&self) -> MutexGuard<'_, Roster> {
        lock(&self.roster)
    }

    /// A worker was heard.
    pub(super) fn heard(&self, worker: WorkerId, now: UnixMillis) {
        self.meter().heard(worker, now);
        self.roster().heard(worker, now);
    }

    /// Workers that were heard lately; a waiting worker is silent for as long as it polls.
    pub(super) fn present_workers(&self) -> u64 {
        let now = self.now();
        self.meter().present(now - self.silence(), now)
    }

    /// After so long without a word a worker is not connected any more, milliseconds.
    pub(super) fn silence(&self) -> i64 {
        (self.config.lease.ttl_ms + self.config.lease.poll_ms) as i64
    }

    /// Stores bytes as one zstd frame.
    pub(super) async fn put_compressed(&self, bytes: Vec<u8>) -> Result<BlobName, EngineError> {
        let packed = blocking(move || zstd::bulk::compress(&bytes, LEVEL)).await?;
        let packed = packed.map_err(|e| EngineError::Broken(format!("bytes could not be compressed: {e}")))?;
        Ok(self.blobs.put(Bytes::from(packed)).await?)
    }

    pub(super) async fn load_compressed(&self, blob: BlobName) -> Result<Vec<u8>, EngineError> {
        let packed = self.blobs.load(blob, None, limits::SCENE_BYTES as u64).await?;
        let plain = blocking(move || zstd::stream::decode_all(packed.as_slice())).await?;
        plain.map_err(|e| EngineError::Broken(format!("the blob {blob} cannot be decompressed: {e}")))
    }

    /// Stores a plan.
    pub(super) async fn put_plan(&self, plan: Plan) -> Result<PlanRef, EngineError> {
        let bytes = plan.to_bytes().map_err(|e| EngineError::invalid(format!("the plan is too large: {e}")))?;
        let digest = Plan::digest_of(&bytes);
        let blob = self.put_compressed(bytes).await?;
        remember(&mut lock(&self.plans), PLANS, digest, Arc::new(plan));
        Ok(PlanRef { digest, blob })
    }

    /// A plan, decoded.
    pub(super) async fn plan(&self, plan: &PlanRef) -> Result<Arc<Plan>, EngineError> {
        if let Some(found) = recall(&mut lock(&self.plans), &plan.digest) {
            return Ok(found);
        }
        let bytes = self.load_compressed(plan.blob).await?;
        let decoded = blocking(move || Plan::from_bytes(&bytes)).await?;
        let decoded = Arc::new(decoded.map_err(|e| EngineError::Broken(format!("plan {}: {e}", plan.digest)))?);
        remember(&mut lock(&self.plans), PLANS, plan.digest, Arc::clone(&decoded));
        Ok(decoded)
    }

    /// A scene, decoded and validated.
    pub(super) async fn scene(&self, hash: SceneHash) -> Result<Arc<Scene>, EngineError> {
        if let Some(found) = recall(&mut lock(&self.scenes), &hash) {
            return Ok(found);
        }
        let missing = || EngineError::NotFound { what: "scene", id: hash.to_string() };
        let blob = self.store.scene_by_hash(hash, Scope::All).await?.and_then(|s| s.canonical).ok_or_else(missing)?;
        let bytes = self.load_compressed(blob).await?;
        let decoded = blocking(move || Scene::from_bytes(&bytes)).await?;
        let decoded = Arc::new(decoded.map_err(|e| EngineError::Broken(format!("scene {hash}: {e}")))?);
        remember(&mut lock(&self.scenes), SCENES, hash, Arc::clone(&decoded));
        Ok(decoded)
    }
}

/// The last entry is the one used last.
fn recall<K: PartialEq, V: Clone>(cache: &mut Vec<(K, V)>, key: &K) -> Option<V> {
    let at = cache.iter().position(|(k, _)| k == key)?;
    let entry = cache.remove(at);
    let value = entry.1.clone();
    cache.push(entry);
    Some(value)
}

fn remember<K: PartialEq, V>(cache: &mut Vec<(K, V)>, most: usize, key: K, value: V) {
    cache.retain(|(k, _)| *k != key);
    cache.push((key, value));
    if cache.len() > most {
        cache.remove(0);
    }
}
