//! What happens without being asked for: tasks, expiry, forgetting, collecting garbage.

use super::{core::Core, dispatch, hints, retention, roster, runner};
use crate::{
    records::UnixMillis,
    store::{Lane, REQUEST_KEPT},
};
use futures_util::TryStreamExt;
use std::{
    sync::{Arc, atomic::Ordering},
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::task::JoinSet;

/// How often the clock is looked at, milliseconds: a fraction of a heartbeat, so that expiry is prompt.
const SWEEP_PART: u64 = 4;
/// How often old rows and unnamed blobs are looked for.
const TIDY: Duration = Duration::from_secs(600);
/// Attempts that ended are remembered for repeated calls this long, milliseconds.
const ATTEMPTS_KEPT: i64 = 600_000;

/// Webhooks that are told at the same time.
const NOTICES: usize = 4;

/// Starts all of it.
pub(super) fn start(core: &Arc<Core>, set: &mut JoinSet<()>) {
    for _ in 0..core.config.tasks {
        set.spawn(runner::run(Arc::clone(core), Lane::Work));
    }
    // A coordinator that may tell nobody leaves notices to those that may.
    let notices = if core.webhooks.are_on() { NOTICES } else { 0 };
    for _ in 0..notices {
        set.spawn(runner::run(Arc::clone(core), Lane::Notices));
    }
    set.spawn(dispatch::run(Arc::clone(core)));
    set.spawn(sweep(Arc::clone(core)));
    set.spawn(tidy(Arc::clone(core)));
    if core.store.is_shared() {
        set.spawn(dispatch::look_around(Arc::clone(core)));
        set.spawn(hints::tell(Arc::clone(core)));
        set.spawn(hints::hear(Arc::clone(core)));
    }
}

async fn sweep(core: Arc<Core>) {
    let every = Duration::from_millis((core.config.lease.heartbeat_ms / SWEEP_PART).max(1));
    while !core.signals.is_stopping() {
        tokio::time::sleep(every).await;
        expire(&core).await;
    }
}

/// Lets everything expire whose time has come, notes who is here, and gives up waiting for checks that nobody can make.
pub(super) async fn expire(core: &Core) {
    core.present_workers();
    roster::write(core).await;
    match core.store.expire(core.now()).await {
        Ok(expiry) if expiry.attempts + expiry.tasks > 0 => {
            tracing::warn!(attempts = expiry.attempts, tasks = expiry.tasks, "expired; the work goes back");
            core.counters.attempts_expired.fetch_add(expiry.attempts, Ordering::Relaxed);
            core.signals.work.notify_waiters();
            core.signals.tasks.notify_waiters();
        }
        Ok(_) => {}
        Err(error) => tracing::error!(%error, "looking for expired leases failed"),
    }
    match core.store.waive_checks(core.now()).await {
        Ok(0) => {}
        Ok(tiles) => {
            tracing::warn!(tiles, "nobody could check these tiles; they count as they are");
            core.signals.everything();
        }
        Err(error) => tracing::error!(%error, "looking for checks that nobody can make failed"),
    }
}

async fn tidy(core: Arc<Core>) {
    while !core.signals.is_stopping() {
        tokio::time::sleep(TIDY).await;
        let now = core.now();
        forget(&core, now).await;
        match collect(&core, now - core.config.keep.unnamed_blobs_ms as i64).await {
            Ok(0) => {}
            Ok(blobs) => tracing::info!(blobs, "removed blobs that nothing names"),
            Err(error) => tracing::error!(%error, "collecting unnamed blobs failed"),
        }
    }
}

/// Removes rows whose time is over.
pub(super) async fn forget(core: &Core, now: UnixMillis) {
    let workers_before = now - core.config.keep.dead_workers_ms as i64;
    if let Err(error) = core.store.forget(now - ATTEMPTS_KEPT, workers_before).await {
        tracing::error!(%error, "forgetting old attempts failed");
    }
    if let Err(error) = core.store.forget_requests(now - REQUEST_KEPT).await {
        tracing::error!(%error, "forgetting answers to repeated requests failed");
    }
    match retention::run(core, now).await {
        Ok((0, 0)) => {}
        Ok((jobs, scenes)) => tracing::info!(jobs, scenes, "deleted jobs and uploads that were kept long enough"),
        Err(error) => tracing::error!(%error, "deleting old jobs failed"),
    }
}

/// Removes blobs that no row names and that were last written before a moment. How many.
pub(super) async fn collect(core: &Core, before: UnixMillis) -> Result<u64, super::EngineError> {
    let is_old = |written: SystemTime| written.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64) < before;
    let (mut removed, mut all) = (0, core.blobs.list());
    while let Some((name, written)) = all.try_next().await? {
        if !is_old(written) {
            continue;
        }
        // Alone: nobody is between writing this blob again and naming it. Never waited for, since a waiting writer would hold up every
        // chunk behind a long assembly; what is busy now is looked at again next time.
        let Ok(_alone) = core.gate.try_write() else { continue };
        if core.store.names(name).await? {
            continue;
        }
        // The list may be hours old, and another coordinator may have written the blob again since, to name it next. What remains is the
        // moment between this look and the deletion; a chunk that is lost to it is baked again.
        if core.blobs.written(name).await?.is_some_and(is_old) {
            core.blobs.delete(name).await?;
            removed += 1;
        }
    }
    Ok(removed)
}
