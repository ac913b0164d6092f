//! The worker's life: say hello, lease, bake, stream, repeat; drain when told to stop.
//!
//! Light is computed on a pool of its own, tile after tile, all threads on one tile: the newest finished tile streams while the next is
//! being traced, and memory stays at a few tiles whatever the thread count. The alternative, a tile per thread, needs memory in proportion
//! to cores and finishes nothing for the first seconds of a lease.

mod bake;
mod cache;
mod usage;

use crate::{
    client::{
        session::{CallError, Session},
        stream::Chunk,
    },
    config::WorkerConfig,
};
use bake::{Baked, Lease};
use cache::Cache;
use kiln_proto::{
    BAKE_VERSION,
    ids::Token,
    wire::message::{Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, Refusal},
};
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

/// Finished segments that may wait for the upload before tracing pauses.
const SEGMENTS_IN_FLIGHT: usize = 8;

/// Why a worker ended.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The conversation failed for good.
    #[error("the worker cannot work for {server}")]
    Call {
        /// The coordinator's address.
        server: String,
        /// What happened.
        #[source]
        source: CallError,
    },
    /// Threads cannot be started.
    #[error("cannot start {threads} threads")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What happened.
        #[source]
        source: rayon::ThreadPoolBuildError,
    },
}

/// What an attempt has done so far; shared between the threads that trace, the heartbeat and the final report.
#[derive(Debug, Default)]
struct Tally {
    texels: AtomicU64,
    rays: AtomicU64,
    /// Set when the attempt should not go on: drain, cancel, or a failure.
    stop: AtomicBool,
}

/// Works until `stop`, then drains.
///
/// # Errors
/// A coordinator that refuses this worker for good, or a machine without threads.
pub async fn run(config: WorkerConfig, stop: CancellationToken) -> Result<(), RunError> {
    let fail = |source| RunError::Call { server: config.server.clone(), source };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(config.threads).thread_name(|k| format!("trace-{k}")).build();
    let pool = Arc::new(pool.map_err(|source| RunError::Threads { threads: config.threads, source })?);
    // The session outlives the order to stop by the drain timeout, so that the rest can be handed back.
    let cut = CancellationToken::new();
    let hello =
        Hello { bake_version: BAKE_VERSION, name: config.name.clone(), threads: config.threads as u32, features: config.simd.features() };
    let opening = Session::open(&config.server, hello, cut.clone());
    let session = tokio::select! {
        session = opening => Arc::new(session.map_err(fail)?),
        () = stop.cancelled() => return Ok(()),
    };
    tracing::info!(server = config.server, worker = %session.welcome().worker, threads = config.threads, "connected");
    let drained = cut_after_drain(stop.clone(), cut, config.drain_timeout);
    let mut cache = Cache::new(config.simd);
    let outcome = loop {
        let grant = tokio::select! {
            grant = session.lease() => grant,
            () = stop.cancelled() => break Ok(()),
        };
        match grant {
            Ok(Some(grant)) => attempt(&session, &mut cache, &pool, &config, grant, &stop).await,
            Ok(None) => {}
            Err(CallError::Stopped) => break Ok(()),
            Err(error) => break Err(fail(error)),
        }
    };
    drained.abort();
    outcome
}

fn cut_after_drain(stop: CancellationToken, cut: CancellationToken, after: Duration) -> tokio::task::JoinHandle<()> {
    tokio::spawn(async move {
        stop.cancelled().await;
        tokio::time::sleep(after).await;
        cut.cancel();
    })
}

/// One lease from grant to complete or release. Nothing that goes wrong with one attempt ends the worker.
async fn attempt(
    session: &Arc<Session>,
    cache: &mut Cache,
    pool: &Arc<rayon::ThreadPool>,
    config: &WorkerConfig,
    grant: LeaseGrant,
    stop: &CancellationToken,
) {
    let started = usage::core_seconds();
    let token = grant.token;
    let tally = Arc::new(Tally::default());
    let heart = tokio::spawn(beat(session.clone(), token, tally.clone(), Duration::from_millis(session.welcome().heartbeat_ms.max(10))));
    let drain = tokio::spawn(stop_on(stop.clone(), tally.clone()));
    let result = match cache.capture(session, &grant).await {
        Ok(capture) => {
            let lease = Lease { capture, grant, order: config.order };
            bake_and_stream(session, pool.clone(), lease, tally.clone()).await
        }
        Err(error) => Err(Failure::Own(chain(&error))),
    };
    heart.abort();
    drain.abort();
    let finish = Finish {
        core_seconds: usage::core_seconds() - started,
        rays: tally.rays.load(Ordering::Relaxed),
        peak_rss_bytes: usage::peak_rss_bytes(),
        failure: None,
    };
    let told = match result {
        Ok(()) if tally.stop.load(Ordering::Relaxed) => session.release(token, finish).await,
        Ok(()) => session.complete(token, finish).await,
        Err(Failure::Gone(state)) => {
            tracing::info!(%token, state, "the attempt is not ours any more");
            return;
        }
        Err(Failure::Own(reason)) => {
            tracing::error!(%token, reason, "the attempt failed");
            session.release(token, Finish { failure: Some(reason), ..finish }).await
        }
    };
    if let Err(error) = told {
        tracing::info!(%token, reason = chain(&error), "the end of the attempt was not taken");
    }
}

/// Why an attempt ended early.
enum Failure {
    /// The coordinator gave it up; there is nobody to tell.
    Gone(String),
    /// It failed here.
    Own(String),
}

impl From<CallError> for Failure {
    fn from(error: CallError) -> Self {
        match error {
            CallError::Refused(Refusal::Gone { state }) => Failure::Gone(state),
            CallError::Stopped => Failure::Gone("abandoned: draining took too long".into()),
            other => Failure::Own(chain(&other)),
        }
    }
}

async fn bake_and_stream(session: &Session, pool: Arc<rayon::ThreadPool>, lease: Lease, tally: Arc<Tally>) -> Result<(), Failure> {
    let (ready, mut segments) = mpsc::channel(SEGMENTS_IN_FLIGHT);
    let token = lease.grant.token;
    let tracing_stop = tally.clone();
    let tracer = tokio::task::spawn_blocking(move || pool.install(|| bake::bake(&lease, &tally, &ready)));
    let streamed = stream(session, token, &mut segments).await;
    if streamed.is_err() {
        tracing_stop.stop.store(true, Ordering::Relaxed);
    }
    // Unblocks a tracer that waits for room.
    drop(segments);
    let traced = match tracer.await {
        Ok(outcome) => outcome.map_err(Failure::Own),
        Err(panic) => Err(Failure::Own(format!("tracing stopped: {panic}"))),
    };
    streamed.and(traced)
}

/// Uploads segments in chunks as they come, until the tracer is done.
async fn stream(session: &Session, token: Token, segments: &mut mpsc::Receiver<Baked>) -> Result<(), Failure> {
    let (limit, age) = (session.welcome().chunk_bytes, Duration::from_millis(session.welcome().chunk_ms));
    let mut chunk = Chunk::default();
    let mut number = 0;
    loop {
        let due = chunk.since().map(|since| tokio::time::Instant::from_std(since + age));
        let next = tokio::select! {
            next = segments.recv() => next,
            () = async { tokio::time::sleep_until(due.unwrap_or_else(tokio::time::Instant::now)).await }, if due.is_some() => {
                flush(session, token, &mut number, &mut chunk).await?;
                continue;
            }
        };
        match next {
            Some(baked) => chunk.push(&baked, Instant::now()),
            None => break,
        }
        if chunk.is_full(limit) {
            flush(session, token, &mut number, &mut chunk).await?;
        }
    }
    flush(session, token, &mut number, &mut chunk).await
}

async fn flush(session: &Session, token: Token, number: &mut u32, chunk: &mut Chunk) -> Result<(), Failure> {
    if chunk.is_empty() {
        return Ok(());
    }
    let (bytes, tiles) = chunk.close().map_err(|e| Failure::Own(chain(&e)))?;
    let size = bytes.len();
    session.chunk(token, *number, bytes).await?;
    tracing::debug!(%token, number, tiles, size, "chunk taken");
    *number += 1;
    Ok(())
}

/// Heartbeats until aborted; raises `stop` when the coordinator says that the attempt is over.
async fn beat(session: Arc<Session>, token: Token, tally: Arc<Tally>, every: Duration) {
    loop {
        tokio::time::sleep(every).await;
        let beat = Heartbeat { texels_done: tally.texels.load(Ordering::Relaxed), rays: tally.rays.load(Ordering::Relaxed) };
        match session.heartbeat(token, beat).await {
            Ok(HeartbeatReply::Continue) => {}
            Ok(HeartbeatReply::Cancel) | Err(CallError::Refused(Refusal::Gone { .. })) => tally.stop.store(true, Ordering::Relaxed),
            Err(error) => tracing::debug!(%token, reason = chain(&error), "a heartbeat was lost"),
        }
    }
}

async fn stop_on(stop: CancellationToken, tally: Arc<Tally>) {
    stop.cancelled().await;
    tally.stop.store(true, Ordering::Relaxed);
}

/// An error with its causes, in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text.push_str(": ");
        text.push_str(&inner.to_string());
        cause = inner.source();
    }
    text
}
