//! Room on the disk: asked for before a bake begins, because a full disk after ten hours is ten hours lost.

use super::{EngineError, JobFilter, core::Core, tasks};
use crate::records::JobState;
use kiln_proto::{
    plan::Plan,
    settings::{BakeSettings, RawFormat, Rule},
    wire::message::Phase,
};
use std::path::Path;

/// Bytes free for this process on the disk of `path`.
pub(super) fn free(path: &Path) -> Result<u64, EngineError> {
    let found = rustix::fs::statvfs(path).map_err(|e| EngineError::DataFolder {
        path: path.to_owned(),
        doing: "asking for free space",
        source: e.into(),
    })?;
    Ok(found.f_bavail.saturating_mul(found.f_frsize))
}

/// Bytes that a job is likely to take, segments and package together. On the thesis's room at nominal size and 1,024 samples both take 0.21 of
/// the raw 8-bit bytes, 0.55 on its noisiest surface, and noisier bakes reach 1.2; 3 bytes a sample, 1.0 of raw, is on the safe side of all
/// but those. Where every sample is kept (a threshold of 0), it takes 4 bytes in the package and up to 3 in a segment: the worst case.
/// Raw radiance hardly compresses and comes on top, once in segments and once in the package.
pub(super) fn expected(plan: &Plan, settings: &BakeSettings) -> u64 {
    let texels: u64 = plan.surfaces.iter().map(|s| s.size.texels()).sum();
    let baked: u64 = plan.surfaces.iter().flat_map(|s| &s.tiles).map(|t| u64::from(t.covered) + u64::from(t.gutter)).sum();
    let samples = baked * u64::from(settings.directions.len());
    let keeps_all = matches!(settings.rule, Rule::Thesis { threshold: 0 } | Rule::Cumulative { threshold: 0 } | Rule::Bounded { eps: 0 });
    let kept = if keeps_all || settings.raw.is_some() { 7 } else { 3 };
    let raw = match settings.raw {
        None => 0,
        Some(RawFormat::U8) => 2 * 3,
        Some(RawFormat::F32) => 2 * 12,
    };
    samples * kept + samples * raw + texels * 8
}

/// # Errors
/// [`EngineError::NoSpace`] where the plan and the reserve do not fit beside what running jobs still need.
pub(super) async fn require(core: &Core, plan: &Plan, settings: &BakeSettings) -> Result<(), EngineError> {
    let (needed, path) = (expected(plan, settings).saturating_add(core.config.reserve_bytes), &core.config.data_dir);
    let free = free(path)?.saturating_sub(promised(core).await?);
    if needed > free { Err(EngineError::NoSpace { needed, free, path: path.clone() }) } else { Ok(()) }
}

/// Bytes that running jobs are still expected to take: segments, half of it, as far as they are not baked; and the package, the other half.
async fn promised(core: &Core) -> Result<u64, EngineError> {
    let mut total = 0u64;
    for state in [JobState::Baking, JobState::Assembling] {
        for row in core.store.jobs(&JobFilter { state: Some(state), limit: 1_000, ..JobFilter::default() }).await? {
            let (_, plan) = tasks::plan(core, &row).await?;
            let half = expected(&plan, &row.spec.settings) / 2;
            let (cost, done) = row.cost;
            let segments = match row.state.phase() {
                None => 0,
                Some(Phase::Probe) => half,
                Some(Phase::Bake) => (half as f64 * (1.0 - done as f64 / cost.max(1) as f64)) as u64,
            };
            total = total.saturating_add(half + segments);
        }
    }
    Ok(total)
}
