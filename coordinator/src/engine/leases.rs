//! Workers: hello, lease, heartbeat, and the end of an attempt.
//!
//! A failing store or a full disk is told to a worker as busy: it keeps its work and comes back.

use super::{Engine, EngineError, core::Core, ports::problem, roster};
use crate::{
    lease::{self, Attempt},
    records::{Problem, WorkerRecord},
    store::FinishOutcome,
};
use kiln_proto::{
    BAKE_VERSION,
    ids::{JobId, Token, WorkerId},
    limits,
    tile::TileRun,
    wire::{
        frame::PROTOCOL_VERSION,
        message::{Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Refusal, Welcome},
    },
};
use std::time::Duration;

/// When a worker should come back after the coordinator failed, milliseconds.
const RETRY: u64 = 1_000;

/// Our failure, as a worker hears it.
pub(super) fn busy(error: impl Into<EngineError>) -> Refusal {
    tracing::error!(error = %problem(&error.into()), "a worker was put off");
    Refusal::Busy { retry_after_ms: RETRY }
}

impl Engine {
    /// A worker introduces itself.
    ///
    /// # Errors
    /// [`Refusal::Incompatible`]; [`Refusal::Busy`] while store or disk fail, here and in every call below.
    pub async fn hello(&self, hello: &Hello) -> Result<Welcome, Refusal> {
        if hello.bake_version != BAKE_VERSION {
            return Err(Refusal::Incompatible { protocol: PROTOCOL_VERSION, bake_version: BAKE_VERSION });
        }
        if hello.name.len() > limits::NAME_BYTES || hello.features.iter().map(String::len).sum::<usize>() > limits::NAME_BYTES {
            return Err(Refusal::Invalid { reason: format!("name or features above {} bytes", limits::NAME_BYTES) });
        }
        let now = self.now();
        let worker = WorkerRecord::new(WorkerId::random(), hello, now);
        self.core.store.put_worker(&worker).await.map_err(busy)?;
        self.core.meter().heard(worker.id, now);
        tracing::info!(worker = %worker.id, name = worker.name, threads = worker.threads, "a worker joined");
        let (lease, chunks) = (&self.core.config.lease, &self.core.config.chunks);
        Ok(Welcome { worker: worker.id, heartbeat_ms: lease.heartbeat_ms, chunk_bytes: chunks.bytes, chunk_ms: chunks.age_ms })
    }

    /// Work for a worker, as soon as there is some; `None` when the time it is willing to wait has passed.
    ///
    /// # Errors
    /// [`Refusal::UnknownWorker`].
    pub async fn lease(&self, request: &LeaseRequest) -> Result<Option<LeaseGrant>, Refusal> {
        let core = &*self.core;
        let stop = core.signals.stop.notified();
        tokio::pin!(stop);
        stop.as_mut().enable();
        if core.signals.is_stopping() {
            return Ok(None);
        }
        let worker = roster::caller(core, request.worker).await.map_err(busy)?.ok_or(Refusal::UnknownWorker)?;
        if let Some(reason) = &worker.barred {
            return Err(Refusal::Invalid { reason: format!("this worker is barred: {reason}") });
        }
        let until = tokio::time::Instant::now() + Duration::from_millis(request.wait_ms.min(core.config.lease.poll_ms));
        tokio::select! {
            answer = core.dispatch.queue_up(worker).wait(until) => answer.transpose(),
            () = stop => Ok(None),
        }
    }

    /// A sign of life of an attempt.
    ///
    /// # Errors
    /// Only [`Refusal::Busy`]: an attempt that is gone is answered with [`HeartbeatReply::Cancel`].
    pub async fn heartbeat(&self, token: Token, heartbeat: &Heartbeat) -> Result<HeartbeatReply, Refusal> {
        let (core, now) = (&*self.core, self.now());
        let ttl = core.config.lease.ttl_ms as i64;
        let Some(row) = core.store.heartbeat(token, heartbeat, ttl, now).await.map_err(busy)? else {
            return Ok(HeartbeatReply::Cancel);
        };
        core.heard(row.worker, now);
        let mut meter = core.meter();
        meter.rays(token, row.worker, row.job, heartbeat.rays, now);
        meter.measured(row.worker, row.job, row.phase, heartbeat.texels_done, now - row.granted_ms);
        Ok(HeartbeatReply::Continue)
    }

    /// The worker is done with an attempt: every tile has been delivered.
    ///
    /// # Errors
    /// [`Refusal::Gone`]; [`Refusal::Invalid`] where tiles are missing, which go back to work.
    pub async fn complete(&self, token: Token, finish: &Finish) -> Result<(), Refusal> {
        match self.finish(token, lease::Event::Complete, finish).await? {
            Attempt::Completed => Ok(()),
            _ => Err(Refusal::Invalid { reason: "tiles of the lease were never delivered; they go to another worker".into() }),
        }
    }

    /// The worker gives the rest of an attempt back. A failure that it names is recorded in the job's events.
    ///
    /// # Errors
    /// [`Refusal::Gone`].
    pub async fn release(&self, token: Token, finish: &Finish) -> Result<(), Refusal> {
        let event = if finish.failure.is_some() { lease::Event::Fail } else { lease::Event::Release };
        self.finish(token, event, finish).await.map(drop)
    }

    async fn finish(&self, token: Token, event: lease::Event, finish: &Finish) -> Result<Attempt, Refusal> {
        let (core, now) = (&*self.core, self.now());
        let row = match core.store.finish_attempt(token, event, Some(finish), now).await.map_err(busy)? {
            FinishOutcome::Finished(row) => row,
            FinishOutcome::Gone(state) => return Err(Refusal::Gone { state }),
        };
        core.heard(row.worker, now);
        {
            let mut meter = core.meter();
            meter.rays(token, row.worker, row.job, finish.rays, now);
            meter.measured(row.worker, row.job, row.phase, row.texels, now - row.granted_ms);
            meter.ended(token);
        }
        if let Some(failure) = &finish.failure {
            let reason: String = failure.chars().take(limits::NAME_BYTES).collect();
            let TileRun { start, end } = row.run;
            let text = format!("worker {} gave up on tiles {start} to {} of {}: {reason}", row.worker, end.saturating_sub(1), row.phase);
            note_failure(core, row.job, text).await.map_err(busy)?;
        }
        core.signals.job_changed(row.job);
        Ok(row.state)
    }
}

/// An attempt of a job failed: its followers are told. What becomes of its tiles is decided where the attempt ends.
pub(super) async fn note_failure(core: &Core, job: JobId, message: String) -> Result<(), EngineError> {
    tracing::warn!(%job, message, "an attempt failed");
    core.store.add_problem(job, &Problem::new(message), core.now()).await?;
    core.signals.job_changed(job);
    Ok(())
}
