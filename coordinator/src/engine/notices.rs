//! Tells webhooks of the end of jobs: at least once, by any coordinator, and without any consequence for the job.

use super::{core::Core, progress, runner};
use crate::{
    records::{JobState, Problem, WebhookEvent, WebhookMessage},
    store::{Notice, StoreError, TaskLease, TaskResult},
    webhook::Undelivered,
};

const SECOND: i64 = 1_000;
const MINUTE: i64 = 60 * SECOND;
const HOUR: i64 = 60 * MINUTE;

/// The pauses between tries, milliseconds: a receiver that restarts is told soon, one that is mended over night the next morning.
const PAUSES: [i64; 8] = [5 * SECOND, MINUTE, 5 * MINUTE, 30 * MINUTE, 2 * HOUR, 5 * HOUR, 8 * HOUR, 8 * HOUR];

/// One try, and what follows from it.
pub(super) async fn see_through(core: &Core, lease: &TaskLease, notice: &Notice) {
    let Some(tried) = runner::renewed(core, lease.token, tell(core, notice)).await else { return };
    let recorded = match tried {
        Ok(Ok(())) => core.store.finish_task(lease.token, &TaskResult::Notified, core.now()).await,
        Ok(Err(undelivered)) => again(core, lease, notice, &undelivered).await,
        Err(error) => Err(error),
    };
    match recorded {
        Ok(true) => core.signals.touch(notice.job),
        Ok(false) => tracing::warn!(job = %notice.job, "its notice was lost to another coordinator"),
        // The lease runs out, and the receiver is told once more.
        Err(error) => tracing::error!(job = %notice.job, %error, "the store failed under a notice"),
    }
}

/// Puts a notice off, or gives it up and says so in the job's stream.
async fn again(core: &Core, lease: &TaskLease, notice: &Notice, undelivered: &Undelivered) -> Result<bool, StoreError> {
    let (job, why) = (notice.job, &undelivered.why);
    if let Some(pause) = PAUSES.get(lease.put_off as usize).filter(|_| !undelivered.for_good) {
        tracing::info!(%job, why, pause, "a webhook was not told; it is tried again");
        return core.store.put_off_task(lease.token, why, core.now() + pause).await;
    }
    let tries = lease.put_off + 1;
    tracing::warn!(%job, why, tries, "a webhook was not told, and is given up");
    let problem = Problem::new(format!("the webhook could not be told that the job ended, tried {tries} times: {why}"));
    core.store.finish_task(lease.token, &TaskResult::Failed(problem), core.now()).await
}

/// Sends the notice of a job that is still there.
async fn tell(core: &Core, notice: &Notice) -> Result<Result<(), Undelivered>, StoreError> {
    let Some(row) = core.store.job(notice.job).await? else { return Ok(Ok(())) };
    let (Some(kind), Some(address)) = (event(notice.state), row.spec.webhook.clone()) else { return Ok(Ok(())) };
    let id = format!("{}_{}", notice.job, notice.seq);
    let message = WebhookMessage { id, kind, at_ms: notice.at_ms, job: progress::one(core, row).await? };
    let body = match serde_json::to_vec(&message) {
        Ok(body) => body,
        Err(error) => return Ok(Err(Undelivered::for_now(format!("the message cannot be written: {error}")))),
    };
    Ok(core.webhooks.send(&address, &message.id, core.now() / SECOND, body).await)
}

/// What a receiver is told; nothing of states that are no end.
fn event(state: JobState) -> Option<WebhookEvent> {
    match state {
        JobState::Done => Some(WebhookEvent::Done),
        JobState::Failed => Some(WebhookEvent::Failed),
        JobState::Cancelled => Some(WebhookEvent::Cancelled),
        JobState::Queued | JobState::Preparing | JobState::Baking | JobState::Paused | JobState::Assembling => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receiver_has_about_a_day() {
        assert!((23 * HOUR..25 * HOUR).contains(&PAUSES.iter().sum()));
        assert!(PAUSES.is_sorted());
    }
}
