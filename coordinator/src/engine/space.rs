//! Room on the disk: asked for before a bake begins, because a full disk after ten hours is ten hours lost.

use super::EngineError;
use crate::config::Config;
use kiln_proto::{
    plan::{Plan, SurfacePlan},
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
    plan.surfaces.iter().map(|surface| of_surface(surface, settings)).sum()
}

fn of_surface(surface: &SurfacePlan, settings: &BakeSettings) -> u64 {
    let baked: u64 = surface.tiles.iter().map(|t| u64::from(t.covered) + u64::from(t.gutter)).sum();
    let samples = baked * u64::from(settings.directions.len());
    let raw = match settings.raw {
        None => 0,
        Some(RawFormat::U8) => 2 * 3,
        Some(RawFormat::F32) => 2 * 12,
    };
    samples * 7 / 2 + samples * raw + surface.size.texels() * 8
}

/// Of those, the bytes that the data folder's disk must have room for: all of them, or where blobs live elsewhere, the files of the surfaces
/// that are assembled at the same time.
fn expected_here(config: &Config, plan: &Plan, settings: &BakeSettings) -> u64 {
    let all = expected(plan, settings);
    if config.blobs.is_none() {
        return all;
    }
    let largest = plan.surfaces.iter().map(|surface| of_surface(surface, settings)).max().unwrap_or(0);
    all.min(largest.saturating_mul(u64::from(config.tasks)))
}

/// # Errors
/// [`EngineError::NoSpace`] where the plan and the reserve do not fit.
pub(super) fn require(config: &Config, plan: &Plan, settings: &BakeSettings) -> Result<(), EngineError> {
    let (needed, free) = (expected_here(config, plan, settings).saturating_add(config.reserve_bytes), free(&config.data_dir)?);
    if needed > free { Err(EngineError::NoSpace { needed, free, path: config.data_dir.clone() }) } else { Ok(()) }
}
