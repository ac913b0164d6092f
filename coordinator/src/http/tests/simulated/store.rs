//! The real store, each call of which is over before simulated time goes on.
//!
//! The simulation's clocks stand still while a host works, and jump to the next timer once all its tasks wait. SQLite is asked on a thread of
//! its own, which tokio's clock knows nothing of: to the clock a coordinator that waits for its database has nothing to do, and seconds pass
//! within a query, as many as the machine happens to be slow. Here the thread that runs the simulation waits for every call instead. Calls of
//! one coordinator never overlap then; what may happen between them is a matter of the store's own tests. (`spawn_blocking` needs nothing of
//! the kind: tokio stops the clock for it.) A store of plain maps was the alternative: fast, and not what runs in production.

use crate::{
    auth::{Scope, TokenId, TokenRow},
    blob::BlobName,
    job, lease,
    records::{Problem, UnixMillis, WorkerRecord},
    store::*,
};
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    options::ImportOptions,
    tile::{TileIndex, TileRun},
    wire::message::{Finish, Heartbeat, Phase},
};
use std::{
    collections::BTreeMap,
    path::Path,
    pin::pin,
    sync::Arc,
    task::{Context, Poll, Wake},
    thread::{self, Thread},
};
use tokio::runtime::Runtime;
use uuid::Uuid;

/// A [`SqlStore`] with a runtime of its own.
pub(super) struct InPlace {
    store: SqlStore,
    /// Always there, until the end.
    runtime: Option<Runtime>,
}

impl InPlace {
    pub(super) fn open(data: &Path) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let store = wait(&runtime, SqlStore::open(None, data)).unwrap();
        Self { store, runtime: Some(runtime) }
    }

    /// Waits until nothing of the database is open any more.
    pub(super) fn close(&self) {
        self.wait(self.store.close());
    }

    fn wait<T>(&self, call: impl Future<Output = T>) -> T {
        wait(self.runtime.as_ref().unwrap(), call)
    }
}

/// Wakes a thread.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// Polls a call until it is done, with the timers and tasks of `runtime`. A runtime's own `block_on` is forbidden to a thread that drives
/// another one, which may have used up the turns that it grants a task.
fn wait<T>(runtime: &Runtime, call: impl Future<Output = T>) -> T {
    let _entered = runtime.enter();
    let waker = Arc::new(Unpark(thread::current())).into();
    let mut call = pin!(tokio::task::unconstrained(call));
    loop {
        match call.as_mut().poll(&mut Context::from_waker(&waker)) {
            Poll::Ready(answer) => return answer,
            Poll::Pending => thread::park(),
        }
    }
}

impl Drop for InPlace {
    fn drop(&mut self) {
        // Its host's runtime drops it, and must not wait meanwhile.
        self.runtime.take().unwrap().shutdown_background();
    }
}

macro_rules! in_place {
    ($of:ident { $($own:tt)* } $($name:ident($($argument:ident: $kind:ty),*) -> $answer:ty;)*) => {
        #[async_trait::async_trait]
        impl $of for InPlace {
            $($own)*
            $(async fn $name(&self, $($argument: $kind),*) -> Result<$answer, StoreError> {
                self.wait(self.store.$name($($argument),*))
            })*
        }
    };
}

in_place! { TokenStore {}
    add_token(token: &TokenRow) -> ();
    token(id: TokenId) -> Option<TokenRow>;
    tokens() -> Vec<TokenRow>;
    has_tokens() -> bool;
    rotate_token(id: TokenId, hash: Digest) -> bool;
    revoke_token(id: TokenId, now: UnixMillis) -> bool;
    touch_token(id: TokenId, now: UnixMillis) -> ();
    service_secret(fresh: [u8; 32]) -> [u8; 32];
    job_owner(id: JobId) -> Option<Option<TokenId>>;
}

in_place! { RequestStore {}
    claim_request(request: &NewRequest, now: UnixMillis) -> Claimed;
    renew_request(claim: Token, deadline: UnixMillis) -> bool;
    answer_request(claim: Token, answer: &KeptAnswer) -> bool;
    release_request(claim: Token) -> bool;
    forget_requests(before: UnixMillis) -> u64;
}

in_place! { RetentionStore {}
    ended_jobs(before: UnixMillis) -> Vec<JobId>;
    delete_ended_job(id: JobId, before: UnixMillis) -> bool;
    unused_scenes(before: UnixMillis) -> Vec<Uuid>;
    delete_unused_scene(id: Uuid, before: UnixMillis) -> bool;
}

in_place! { Store { fn is_shared(&self) -> bool { self.store.is_shared() } }
    clock() -> UnixMillis;
    hint(jobs: &[JobId]) -> ();
    hints() -> Hints;
    add_scene(id: Uuid, files: &[StoredFile], options: &ImportOptions, owner: Option<TokenId>, now: UnixMillis) -> SceneRow;
    scene(id: Uuid) -> Option<SceneRow>;
    scene_by_hash(scene: SceneHash, scope: Scope) -> Option<SceneRow>;
    add_job(spec: &JobSpec, now: UnixMillis) -> JobRow;
    job(id: JobId) -> Option<JobRow>;
    jobs(filter: &JobFilter) -> Vec<JobRow>;
    job_event(id: JobId, event: &job::Event, now: UnixMillis) -> Option<Result<(), job::Illegal>>;
    set_priority(id: JobId, priority: i32) -> bool;
    delete_job(id: JobId) -> bool;
    add_problem(id: JobId, problem: &Problem, now: UnixMillis) -> ();
    events(id: JobId, after: i64, limit: u32) -> Option<EventPage>;
    plan(digest: Digest) -> Option<BlobName>;
    take_task(token: Token, deadline: UnixMillis, now: UnixMillis) -> Option<TaskLease>;
    take_notice(token: Token, deadline: UnixMillis, now: UnixMillis) -> Option<TaskLease>;
    renew_task(token: Token, deadline: UnixMillis) -> bool;
    finish_task(token: Token, result: &TaskResult, now: UnixMillis) -> bool;
    put_off_task(token: Token, why: &str, due: UnixMillis) -> bool;
    take_over_tasks(now: UnixMillis) -> u64;
    put_worker(worker: &WorkerRecord) -> ();
    worker(id: WorkerId) -> Option<WorkerRecord>;
    heard_workers(workers: &[(WorkerId, UnixMillis)]) -> ();
    workers(since: UnixMillis) -> Vec<WorkerRecord>;
    claims(bake_version: u32) -> Vec<ClaimRow>;
    next_work(job: JobId, most: usize) -> Vec<Candidate>;
    late(bake_version: u32, now: UnixMillis) -> Vec<Late>;
    waive_checks(now: UnixMillis) -> u64;
    grant(grants: &[Grant], now: UnixMillis) -> Vec<Option<TileRun>>;
    attempt(token: Token) -> Option<AttemptRow>;
    heartbeat(token: Token, beat: &Heartbeat, ttl: i64, now: UnixMillis) -> Option<AttemptRow>;
    chunk(token: Token, n: u64) -> Option<ChunkRow>;
    record_chunk(chunk: &NewChunk, known: &BTreeMap<TileIndex, Digest>, now: UnixMillis) -> ChunkOutcome;
    lose_chunk(job: JobId, phase: Phase, blob: BlobName, now: UnixMillis) -> bool;
    finish_attempt(token: Token, event: lease::Event, finish: Option<&Finish>, now: UnixMillis) -> FinishOutcome;
    chunks(job: JobId, phase: Phase, run: TileRun) -> Vec<ChunkRow>;
    holes(job: JobId, phase: Phase, run: TileRun) -> BTreeMap<TileIndex, String>;
    contributions(job: JobId) -> Vec<Contribution>;
    surface_reports(job: JobId) -> Vec<serde_json::Value>;
    package(job: JobId) -> Vec<StoredPackageFile>;
    expire(now: UnixMillis) -> Expiry;
    forget(attempts_before: UnixMillis, workers_before: UnixMillis) -> ();
    names(blob: BlobName) -> bool;
    figures() -> Figures;
}
