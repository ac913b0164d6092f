//! Takes tasks and sees them through: renews the lease while the work runs, and reports what came of it.

use super::{EngineError, assembly, core::Core, notices, ports::problem, space, tasks};
use crate::{
    job::JobTask,
    store::{Lane, Task, TaskLease, TaskResult},
};
use kiln_proto::ids::{JobId, Token};
use std::{future::Future, sync::Arc, time::Duration};
use tracing::Instrument;

/// A task expires this long after it was renewed last, milliseconds.
const TTL: i64 = 60_000;
/// It is renewed this often.
const RENEW: Duration = Duration::from_secs(15);
/// What storage failed under is tried again after this long, milliseconds, ...
const PUT_OFF: i64 = 2_000;
/// ... twice as long each time, up to this.
const PUT_OFF_MOST: i64 = 60_000;
/// A runner that was told of nothing looks this often.
const IDLE: Duration = Duration::from_secs(1);

/// One runner: one task after another until the engine stops.
pub(super) async fn run(core: Arc<Core>, lane: Lane) {
    while !core.signals.is_stopping() {
        let woken = core.signals.tasks.notified();
        tokio::pin!(woken);
        woken.as_mut().enable();
        let (token, now) = (Token::random(), core.now());
        let taken = match lane {
            Lane::Work => core.store.take_task(token, now + TTL, now).await,
            Lane::Notices => core.store.take_notice(token, now + TTL, now).await,
        };
        match taken {
            Ok(Some(lease)) => {
                let span = tracing::info_span!("task", task = ?lease.task);
                take_up(&core, lease).instrument(span).await;
            }
            Ok(None) => drop(tokio::time::timeout(IDLE, woken).await),
            Err(error) => {
                tracing::error!(%error, "taking a task failed");
                tokio::time::sleep(IDLE).await;
            }
        }
    }
}

async fn take_up(core: &Arc<Core>, lease: TaskLease) {
    match lease.task {
        Task::Import(scene) => see_through(core, lease, tasks::import(core, scene)).await,
        Task::Job(job, task) => see_through(core, lease, perform(core, job, task)).await,
        Task::Notify(notice) => notices::see_through(core, &lease, &notice).await,
    }
}

async fn see_through(core: &Arc<Core>, lease: TaskLease, work: impl Future<Output = Result<TaskResult, EngineError>>) {
    tracing::debug!(task = ?lease.task, "begin");
    // The gate is held until the result names what the task wrote.
    let gate = core.gate.read().await;
    let Some(outcome) = renewed(core, lease.token, work).await else {
        tracing::warn!(task = ?lease.task, "lost to another coordinator");
        return;
    };
    let result = match outcome {
        Ok(TaskResult::Lost(phase, blob)) => {
            tracing::warn!(task = ?lease.task, %phase, %blob, "a blob is gone; its tiles are baked again");
            TaskResult::Lost(phase, blob)
        }
        Ok(result) => result,
        // Nothing is wrong with the work: it waits, and everything that was accepted stays.
        Err(error) if error.is_storage() => return put_off(core, &lease, &error).await,
        // Not the job's fault, and nothing could be recorded now: the lease runs out and the task is done again.
        Err(EngineError::Store(error)) => {
            tracing::error!(task = ?lease.task, error = %problem(&error), "the store failed under a task");
            return;
        }
        Err(error) => {
            tracing::warn!(task = ?lease.task, error = %problem(&error), "failed");
            TaskResult::Failed(problem(&error))
        }
    };
    match core.store.finish_task(lease.token, &result, core.now()).await {
        Ok(true) => {}
        Ok(false) => tracing::warn!(task = ?lease.task, "its result came too late"),
        // The lease runs out and the task is done again, when the store may be better.
        Err(error) => tracing::error!(task = ?lease.task, %error, "its result could not be stored"),
    }
    drop(gate);
    match lease.task {
        Task::Import(_) => {
            core.signals.scenes.notify_waiters();
            core.signals.tasks.notify_waiters();
        }
        Task::Job(job, task) => {
            if task == JobTask::Publish {
                core.meter().forget(job);
            }
            core.signals.job_changed(job);
        }
        Task::Notify(_) => {}
    }
}

/// Puts a task back until storage may be better, and tells why.
async fn put_off(core: &Core, lease: &TaskLease, error: &EngineError) {
    let reason = problem(error).message;
    tracing::warn!(task = ?lease.task, reason, "put off");
    let why = if error.is_full() {
        let free = space::free(&core.config.data_dir).map_or_else(|_| "an unknown number of".into(), |free| free.to_string());
        format!(
            "the disk is full: {free} bytes free on the disk of {}; the job continues when there is room",
            core.config.data_dir.display()
        )
    } else {
        format!("storage fails: {reason}; the job continues when it works again")
    };
    let delay = PUT_OFF.saturating_mul(1 << lease.put_off.min(10)).min(PUT_OFF_MOST);
    match core.store.put_off_task(lease.token, &why, core.now() + delay).await {
        Ok(true) => {}
        Ok(false) => tracing::warn!(task = ?lease.task, "lost to another coordinator"),
        // The lease runs out and the task is done again.
        Err(error) => tracing::error!(task = ?lease.task, %error, "it could not be put off"),
    }
    if let Task::Job(job, _) = lease.task {
        core.signals.touch(job);
    }
}

/// Runs work while renewing its lease; `None` when the lease is lost.
pub(super) async fn renewed<T>(core: &Core, token: Token, work: impl Future<Output = T>) -> Option<T> {
    tokio::pin!(work);
    let mut tick = tokio::time::interval(RENEW);
    tick.tick().await;
    loop {
        tokio::select! {
            done = &mut work => return Some(done),
            _ = tick.tick() => match core.store.renew_task(token, core.now() + TTL).await {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => tracing::error!(%error, "renewing a task failed"),
            },
        }
    }
}

async fn perform(core: &Arc<Core>, job: JobId, task: JobTask) -> Result<TaskResult, EngineError> {
    match task {
        JobTask::Prepare => tasks::prepare(core, job).await,
        JobTask::Merge(phase) => tasks::merge(core, job, phase).await,
        JobTask::Assemble(surface) => assembly::assemble(core, job, surface).await,
        JobTask::Publish => assembly::publish(core, job).await,
    }
}
