//! The tasks before and between phases: import, prepare, merge.

use super::{
    EngineError,
    core::{Core, blocking},
    ports::{PipelineError, Segments},
    segments::StoredSegments,
    space,
};
use crate::{
    blob::{BlobError, BlobName},
    records::Problem,
    store::{JobRow, PlanRef, TaskResult},
};
use futures_util::StreamExt;
use kiln_proto::{
    ids::{JobId, SceneHash},
    plan::Plan,
    probe::ProbeSums,
    scene::Scene,
    tile::{TileIndex, TileRun},
    wire::message::Phase,
};
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};
use tempfile::TempDir;
use tokio::io::AsyncWriteExt;
use uuid::Uuid;

/// A folder for a task's files, removed with the value and at start-up.
pub(super) fn scratch(core: &Core) -> Result<TempDir, EngineError> {
    tempfile::tempdir_in(&core.spool).map_err(|source| EngineError::DataFolder {
        path: core.spool.clone(),
        doing: "creating a scratch folder",
        source,
    })
}

/// The job of a task, which exists as long as its task does.
pub(super) async fn job(core: &Core, id: JobId) -> Result<JobRow, EngineError> {
    core.store.job(id).await?.ok_or_else(|| EngineError::NotFound { what: "job", id: id.to_string() })
}

/// A job's plan and its name.
pub(super) async fn plan(core: &Core, row: &JobRow) -> Result<(PlanRef, Arc<Plan>), EngineError> {
    let plan = row.plan.ok_or_else(|| EngineError::Broken(format!("the job {} has no plan", row.spec.id)))?;
    Ok((plan, core.plan(&plan).await?))
}

pub(super) async fn scene_of(core: &Core, row: &JobRow) -> Result<(SceneHash, Arc<Scene>), EngineError> {
    let hash = row.scene_hash.ok_or_else(|| EngineError::Broken(format!("the job {} has no scene", row.spec.id)))?;
    Ok((hash, core.scene(hash).await?))
}

pub(super) async fn import(core: &Arc<Core>, id: Uuid) -> Result<TaskResult, EngineError> {
    let row = core.store.scene(id).await?.ok_or_else(|| EngineError::NotFound { what: "scene", id: id.to_string() })?;
    let scratch = scratch(core)?;
    let mut files = Vec::with_capacity(row.files.len());
    for (index, file) in row.files.iter().enumerate() {
        let local = scratch.path().join(format!("part-{index}"));
        copy(core, file.blob, &local).await?;
        files.push((file.name.clone(), local));
    }
    let (pipeline, options) = (Arc::clone(&core.pipeline), row.record.options);
    let imported = blocking(move || pipeline.import(files, &options, scratch.path())).await?;
    let imported = match imported {
        Ok(imported) => imported,
        Err(problems) => return Ok(TaskResult::Rejected(problems)),
    };
    let bytes = imported.scene.to_bytes().map_err(|e| EngineError::invalid(format!("the scene is too large: {e}")))?;
    let scene = Scene::hash_of(&bytes);
    let canonical = core.put_compressed(bytes).await?;
    Ok(TaskResult::Imported { scene, canonical, statistics: imported.statistics, warnings: imported.warnings })
}

/// Copies a blob into a local file.
async fn copy(core: &Core, blob: BlobName, to: &Path) -> Result<(), EngineError> {
    let failed = |source| EngineError::Blob(BlobError::write("a scratch file", source));
    let mut file = tokio::fs::File::create(to).await.map_err(failed)?;
    let (_, mut stream) = core.blobs.read(blob, None).await?;
    while let Some(part) = stream.next().await {
        file.write_all(&part?).await.map_err(failed)?;
    }
    file.flush().await.map_err(failed)
}

pub(super) async fn prepare(core: &Arc<Core>, id: JobId) -> Result<TaskResult, EngineError> {
    let row = job(core, id).await?;
    let (hash, scene) = scene_of(core, &row).await?;
    let (pipeline, settings) = (Arc::clone(&core.pipeline), row.spec.settings.clone());
    let planned = blocking(move || pipeline.plan(&scene, hash, &settings)).await?;
    let (plan, warnings) = match planned {
        Ok(planned) => planned,
        Err(problem) => return Ok(TaskResult::Failed(problem)),
    };
    space::require(&core.config, &plan, &row.spec.settings)?;
    let (tiles, texels, surfaces) = (plan.tile_count(Phase::Probe), plan.covered(), plan.surfaces.len());
    if tiles == 0 || plan.tile_count(Phase::Bake) == 0 {
        let message = "no texel of any surface is covered; raise texels_per_metre or give texture_sizes";
        return Ok(TaskResult::Failed(Problem::new(message)));
    }
    let cost = (0..tiles).map(|t| plan.tile_cost(Phase::Probe, TileIndex(t))).sum();
    let plan = core.put_plan(plan).await?;
    Ok(TaskResult::Prepared { plan, tiles, cost, surfaces: surfaces as u32, texels, warnings })
}

/// The barrier behind Probe: integer sums of all segments that there are become exposure and walks, and so a new plan.
pub(super) async fn merge(core: &Arc<Core>, id: JobId, phase: Phase) -> Result<TaskResult, EngineError> {
    let row = job(core, id).await?;
    let (_, plan) = plan(core, &row).await?;
    let tiles = plan.tile_count(phase);
    let holes = core.store.holes(id, phase, TileRun { start: 0, end: tiles }).await?;
    let there: Vec<TileIndex> = (0..tiles).map(TileIndex).filter(|tile| !holes.contains_key(tile)).collect();
    if let (true, Some(reason)) = (there.is_empty(), holes.values().next_back()) {
        let message = format!("all {tiles} tiles of {phase} were given up, so that there is nothing to go by; the last one {reason}");
        return Ok(TaskResult::Failed(Problem::new(message)));
    }
    let segments = match StoredSegments::open(core, id, phase, there.clone()).await? {
        Ok(segments) => segments,
        Err(gone) => return Ok(TaskResult::Lost(phase, gone)),
    };
    let pipeline = Arc::clone(&core.pipeline);
    let merged = blocking(move || {
        let mut sums = ProbeSums::new(plan.surfaces.len());
        for tile in there {
            sums.add(&pipeline.probe(&segments.segment(tile)?, &plan, tile)?);
        }
        let probe = sums.results(plan.settings.exposure, plan.settings.walk);
        Ok::<Plan, PipelineError>(Plan { probe: Some(probe), ..(*plan).clone() })
    });
    let plan = match merged.await? {
        Ok(plan) => plan,
        Err(error) => return failed(error, phase),
    };
    let tiles = plan.tile_count(Phase::Bake);
    let cost = plan.surfaces.iter().flat_map(|s| &s.tiles).map(|t| u64::from(t.covered) + u64::from(t.gutter)).sum();
    let places = places(&plan, &scene_of(core, &row).await?.1);
    let plan = core.put_plan(plan).await?;
    Ok(TaskResult::Merged { phase, plan, tiles, cost, places })
}

/// Where surfaces begin among the tiles of Bake: what messages call a tile by. Tiles of Probe lie all over the scene.
fn places(plan: &Plan, scene: &Scene) -> Vec<(u64, String)> {
    scene.surfaces.iter().enumerate().map(|(index, s)| (plan.first_tile(index).0, s.name.clone())).collect()
}

/// What becomes of a task whose pipeline failed over the segments of a phase: content that cannot be used fails the job; storage that
/// failed does not, and segments that are gone are baked again.
pub(super) fn failed(error: PipelineError, phase: Phase) -> Result<TaskResult, EngineError> {
    match error {
        PipelineError::Invalid(problem) => Ok(TaskResult::Failed(problem)),
        PipelineError::Blob(BlobError::Missing(blob)) => Ok(TaskResult::Lost(phase, blob)),
        PipelineError::Blob(error) => Err(EngineError::Blob(error)),
        PipelineError::Io { path, source } => Err(EngineError::Blob(BlobError::write(path.display().to_string(), source))),
    }
}

/// Every file below a folder, with its path relative to it, `/` between parts, in order.
pub(super) fn files_below(root: &Path) -> std::io::Result<Vec<(String, PathBuf)>> {
    let (mut found, mut open) = (Vec::new(), vec![(String::new(), root.to_owned())]);
    while let Some((prefix, folder)) = open.pop() {
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().into_string().map_err(|n| std::io::Error::other(format!("{} is not text", n.display())))?;
            let path = if prefix.is_empty() { name } else { format!("{prefix}/{name}") };
            if entry.file_type()?.is_dir() { open.push((path, entry.path())) } else { found.push((path, entry.path())) }
        }
    }
    found.sort();
    Ok(found)
}
