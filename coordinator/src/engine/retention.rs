//! Forgets jobs that ended long ago, with everything they hold, and uploads that no job uses.

use super::{EngineError, core::Core};
use crate::records::UnixMillis;

/// Deletes what was over before the moment that the configuration says; without one, nothing. How many jobs and uploads. Blobs follow when
/// they are collected.
pub(super) async fn run(core: &Core, now: UnixMillis) -> Result<(u64, u64), EngineError> {
    let Some(kept) = core.config.keep.jobs_ms else { return Ok((0, 0)) };
    let before = now - kept as i64;
    let (mut jobs, mut scenes) = (0, 0);
    for job in core.store.ended_jobs(before).await? {
        // Asked again in the deletion's own transaction: someone may be trying it again at this moment.
        if core.store.delete_ended_job(job, before).await? {
            core.meter().forget(job);
            core.signals.job_changed(job);
            jobs += 1;
        }
    }
    for scene in core.store.unused_scenes(before).await? {
        scenes += u64::from(core.store.delete_unused_scene(scene, before).await?);
    }
    Ok((jobs, scenes))
}
