//! Room on the disk: asked for before a bake begins, because a full disk after ten hours is ten hours lost.

use super::EngineError;
use crate::config::Config;
use kiln_proto::{
    plan::Plan,
    settings::{BakeSettings, RawFormat},
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

/// Bytes that a job is expected to write. Half of all samples are taken to be kept, at 4 bytes in the package and about 3 in a compressed
/// segment (the thesis's room at nominal sizes keeps a sixth with eps = 2, its noisiest surface a third); raw radiance hardly compresses.
pub(super) fn expected(plan: &Plan, settings: &BakeSettings) -> u64 {
    let texels: u64 = plan.surfaces.iter().map(|s| s.size.texels()).sum();
    let baked: u64 = plan.surfaces.iter().flat_map(|s| &s.tiles).map(|t| u64::from(t.covered) + u64::from(t.gutter)).sum();
    let samples = baked * u64::from(settings.directions.len());
    let raw = match settings.raw {
        None => 0,
        Some(RawFormat::U8) => 2 * 3,
        Some(RawFormat::F32) => 2 * 12,
    };
    samples * 7 / 2 + samples * raw + texels * 8
}

/// # Errors
/// [`EngineError::NoSpace`] where the plan and the reserve do not fit.
pub(super) fn require(config: &Config, plan: &Plan, settings: &BakeSettings) -> Result<(), EngineError> {
    let (needed, free) = (expected(plan, settings).saturating_add(config.reserve_bytes), free(&config.data_dir)?);
    if needed > free { Err(EngineError::NoSpace { needed, free, path: config.data_dir.clone() }) } else { Ok(()) }
}
