//! One lease from grant to the end that is handed in. Nothing that goes wrong with one attempt ends the worker.

use super::{
    bake::{self, Lease},
    cache::Cache,
    leave::Leave,
    pack, thread, usage,
};
use crate::{
    client::{
        attempt::{Attempt, Heart},
        ledger::Ledger,
        outbox::Outbox,
        session::Session,
    },
    config::TileOrder,
};
use kiln_proto::{
    chain,
    wire::message::{Finish, LeaseGrant},
};
use std::sync::Arc;
use tokio::sync::mpsc;
use tracing::Instrument;

/// Finished segments that may wait to be packed before tracing pauses.
const SEGMENTS_IN_FLIGHT: usize = 8;

/// What it takes to work.
pub(super) struct Bench {
    pub(super) session: Arc<Session>,
    pub(super) pool: Arc<rayon::ThreadPool>,
    pub(super) outbox: Outbox,
    pub(super) ledger: Ledger,
    pub(super) leave: Leave,
    pub(super) order: TileOrder,
}

impl Bench {
    /// Bakes the tiles of a grant and hands in what comes of it. Delivery goes on after this returns.
    pub(super) async fn attempt(&self, cache: &mut Cache, grant: LeaseGrant) {
        let started = usage::core_seconds();
        let token = grant.token;
        let attempt = Arc::new(Attempt::new(token));
        self.ledger.open(token);
        let heart = Heart::start(self.session.clone(), attempt.clone(), self.ledger.clone());
        let span = tracing::info_span!("attempt", %token, job = %grant.job, phase = %grant.phase, tiles = grant.tiles.len());
        let result = self.bake(cache, grant, &attempt).instrument(span).await;
        if let Err(reason) = &result {
            tracing::error!(%token, reason, "the attempt failed");
        }
        let finish = Finish {
            core_seconds: usage::core_seconds() - started,
            rays: attempt.rays(),
            peak_rss_bytes: usage::peak_rss_bytes(),
            failure: result.as_ref().err().cloned(),
        };
        if let Err(closed) = self.outbox.end(attempt, finish, result.unwrap_or(false), heart) {
            tracing::debug!(%token, %closed, "nobody is told of the end of the attempt");
        }
    }

    /// Whether every tile was handed in; the error says why the attempt failed.
    async fn bake(&self, cache: &mut Cache, grant: LeaseGrant, attempt: &Arc<Attempt>) -> Result<bool, String> {
        let capture = tokio::select! {
            capture = cache.capture(&self.session, &grant) => capture.map_err(|e| chain(&e))?,
            () = self.leave.drain.cancelled() => return Ok(false),
        };
        let (ready, mut segments) = mpsc::channel(SEGMENTS_IN_FLIGHT);
        let lease = Lease { capture, grant, order: self.order, attempt: attempt.clone(), drain: self.leave.drain.clone() };
        let pool = self.pool.clone();
        let tracer = tokio::spawn(thread::off("tracer", move || pool.install(|| bake::bake(&lease, &ready))));
        let packed = pack::pack(&self.outbox, &self.session.welcome(), attempt, &mut segments, &self.leave.give_up).await;
        // Unblocks a tracer that waits for room.
        drop(segments);
        let traced = tokio::select! {
            traced = tracer => traced,
            () = self.leave.give_up.cancelled() => return Ok(false),
        };
        let whole = match traced {
            Ok(Ok(traced)) => traced?,
            Ok(Err(lost)) => return Err(format!("tracing stopped: {}", chain(&lost))),
            Err(interrupted) => return Err(format!("tracing stopped: {interrupted}")),
        };
        packed.map(|()| whole)
    }
}
