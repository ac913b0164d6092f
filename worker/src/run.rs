//! The worker's life: say hello, lease, bake, hand in, repeat; drain when told to stop.
//!
//! Light is computed on a pool of its own, tile after tile, all threads on one tile: the newest finished tile travels while the next is
//! being traced, and memory stays at a few tiles whatever the thread count. The alternative, a tile per thread, needs memory in proportion
//! to cores and finishes nothing for the first seconds of a lease.
//!
//! Delivery is a life of its own ([`courier`](crate::client::courier)): a coordinator that is away stops neither the tracing of what is
//! leased nor, once it is back, anything from arriving.

mod attempt;
mod bake;
mod cache;
mod leave;
mod pack;
mod thread;
mod usage;

use crate::{
    client::{
        address::{AddressError, farm_key},
        courier::Courier,
        ledger::Ledger,
        session::{CallError, Session},
        spool::{Spool, SpoolError, Spooled},
    },
    config::WorkerConfig,
};
use attempt::Bench;
use cache::Cache;
use kiln_proto::{BAKE_VERSION, wire::message::Hello};
use leave::Leave;
use std::{sync::Arc, time::SystemTime};
use tokio_util::sync::CancellationToken;

/// Why a worker ended.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// There can be no coordinator there.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Finished work has no place to wait in.
    #[error(
        "finished work has no place to wait for the coordinator in; name another folder with --spool, or do without by --spool-bytes 0"
    )]
    Spool(#[from] SpoolError),
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
    /// A fault of this program.
    #[error("the delivery of finished work broke off")]
    Broken(#[from] tokio::task::JoinError),
}

impl RunError {
    /// What a person can do about it, as a clause; empty where the error says all there is.
    #[must_use]
    pub fn advice(&self) -> String {
        match self {
            RunError::Call { source, .. } => source.advice(),
            _ => String::new(),
        }
    }
}

/// Works until `stop`, then drains: the tile in hand is finished and delivered, the rest goes back, all within the drain timeout. What
/// cannot be delivered by then stays in the spool for the next worker.
///
/// # Errors
/// A coordinator that refuses this worker for good, a spool that cannot be used, or a machine without threads.
pub async fn run(config: WorkerConfig, stop: CancellationToken) -> Result<(), RunError> {
    let farm = farm_key(&config.server)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(config.threads).thread_name(|k| format!("trace-{k}")).build();
    let pool = Arc::new(pool.map_err(|source| RunError::Threads { threads: config.threads, source })?);
    let (spool, inherited) = open_spool(&config, &farm)?;
    let fail = |source| RunError::Call { server: config.server.clone(), source };
    let leave = Leave::new();
    let hello =
        Hello { bake_version: BAKE_VERSION, name: config.name.clone(), threads: config.threads as u32, features: config.simd.features() };
    let opening = Session::open(&config.server, &config.access, hello, leave.cut.clone());
    let session = tokio::select! {
        session = opening => Arc::new(session.map_err(fail)?),
        () = stop.cancelled() => return Ok(()),
    };
    tracing::info!(server = config.server, worker = %session.welcome().worker, threads = config.threads, "connected");
    let _timetable = leave.follow(stop, config.drain_timeout);
    let (courier, outbox, ledger) = Courier::new(session.clone(), spool, inherited);
    let ended = leave.cut.clone().drop_guard();
    let courier = tokio::spawn(async move {
        // However it ends: without it nothing that is baked would ever arrive.
        let _ended = ended;
        courier.run().await
    });
    let bench = Bench { session, pool, outbox, ledger, leave, order: config.order };
    let worked = work(&bench, Cache::new(config.simd)).await;
    if worked.is_err() {
        bench.leave.cut.cancel();
    }
    // The courier ends when its outbox is gone and everything in it is told, or when the time to leave has come.
    drop(bench);
    let ends = [worked.err(), courier.await?.err()];
    match ends.into_iter().flatten().find(|error| !matches!(error, CallError::Stopped)) {
        Some(error) => Err(fail(error)),
        None => Ok(()),
    }
}

fn open_spool(config: &WorkerConfig, farm: &str) -> Result<(Option<Spool>, Vec<Spooled>), SpoolError> {
    let Some(place) = config.spool.as_ref().filter(|place| place.bytes > 0) else { return Ok((None, vec![])) };
    let (spool, inherited) = Spool::open(&place.folder, farm, place.bytes, SystemTime::now())?;
    tracing::debug!(folder = %spool.folder().display(), limit = place.bytes, "spooling");
    if !inherited.is_empty() {
        tracing::info!(chunks = inherited.len(), bytes = spool.used(), "an earlier worker left finished chunks; they are delivered first");
    }
    Ok((Some(spool), inherited))
}

/// Leases and bakes until it is time to drain.
async fn work(bench: &Bench, mut cache: Cache) -> Result<(), CallError> {
    let (session, drain) = (&bench.session, &bench.leave.drain);
    let mut retry = session.retry();
    loop {
        let grant = tokio::select! {
            grant = lease(session, &bench.ledger) => grant,
            () = drain.cancelled() => return Ok(()),
        };
        let error = match grant {
            Ok(grant) => {
                retry.succeeded(session.server());
                if let Some(grant) = grant {
                    bench.attempt(&mut cache, grant).await;
                }
                continue;
            }
            Err(error) if error.passes() => error,
            Err(error) => return Err(error),
        };
        tokio::select! {
            () = tokio::time::sleep(retry.after(session.server(), &error)) => {}
            () = drain.cancelled() => return Ok(()),
        }
    }
}

/// One try, when what lies here finished allows it: see [`Ledger`].
async fn lease(session: &Session, ledger: &Ledger) -> Result<Option<kiln_proto::wire::message::LeaseGrant>, CallError> {
    ledger.may_lease().await;
    session.lease().await
}
