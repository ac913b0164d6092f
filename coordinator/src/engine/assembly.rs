//! The last tasks of a job: each surface's files, then manifest and report.
//!
//! Files are written into a scratch folder and become blobs; the store names them when the task ends, and the package exists when the
//! last of them, the manifest, is named in the transaction that makes the job done. A coordinator that dies on the way leaves scratch
//! that the next start removes, and blobs that nobody names.

use super::{
    EngineError,
    core::{Core, blocking},
    ports::Listed,
    report,
    segments::StoredSegments,
    tasks::{failed, files_below, job, plan, scene_of, scratch},
};
use crate::{
    assemble::reading_order,
    blob::{BlobError, BlobName},
    records::{PackageFile, Problem},
    store::{StoredPackageFile, TaskResult},
};
use kiln_proto::{
    ids::{Digest, JobId},
    tile::{TileIndex, TileRun},
    wire::message::Phase,
};
use sha2::Digest as _;
use std::{
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::Arc,
};
use tempfile::TempPath;

/// Bytes read at once.
const BLOCK: usize = 1 << 20;

pub(super) async fn assemble(core: &Arc<Core>, id: JobId, surface: u32) -> Result<TaskResult, EngineError> {
    let row = job(core, id).await?;
    let (_, plan) = plan(core, &row).await?;
    let (_, scene) = scene_of(core, &row).await?;
    let index = surface as usize;
    let layout = plan.surfaces.get(index).ok_or_else(|| EngineError::Broken(format!("the plan has no surface {surface}")))?;
    let (start, tiles) = (plan.first_tile(index).0, layout.tiles.len());
    // Before the chunks: what is delivered in between is listed as a hole and treated as one.
    let holes = core.store.holes(id, Phase::Bake, TileRun { start, end: start + tiles as u64 }).await?;
    let order = reading_order(layout).into_iter().map(|index| TileIndex(start + index as u64));
    let order = order.filter(|tile| !holes.contains_key(tile)).collect();
    let segments = match StoredSegments::open(core, id, Phase::Bake, order).await? {
        Ok(segments) => segments,
        Err(gone) => return Ok(TaskResult::Lost(Phase::Bake, gone)),
    };
    let (scratch, pipeline) = (scratch(core)?, Arc::clone(&core.pipeline));
    let dir = scratch.path().to_owned();
    let bare = (holes.len() == tiles && tiles > 0).then(|| scene.surfaces.get(index).map(|s| s.name.clone())).flatten();
    let report = match blocking(move || pipeline.assemble(&plan, &scene, index, &holes, &segments, &dir)).await? {
        Ok(report) => report,
        Err(error) => return failed(error, Phase::Bake),
    };
    if let Some(name) = bare {
        let message = format!("none of the {tiles} tiles of surface `{name}` could be baked; it is black in the package");
        core.store.add_problem(id, &Problem::new(message), core.now()).await?;
    }
    let files = take_in(core, scratch.path()).await?;
    Ok(TaskResult::Assembled { surface, report, files })
}

pub(super) async fn publish(core: &Arc<Core>, id: JobId) -> Result<TaskResult, EngineError> {
    let row = job(core, id).await?;
    let (_, plan) = plan(core, &row).await?;
    let (_, scene) = scene_of(core, &row).await?;
    let surfaces = core.store.surface_reports(id).await?;
    let holes = surfaces.iter().map(|entry| Listed::of(entry).len() as u64).sum();
    let (scratch, pipeline) = (scratch(core)?, Arc::clone(&core.pipeline));
    let dir = scratch.path().to_owned();
    if let Err(error) = blocking(move || pipeline.manifest(&plan, &scene, &surfaces, &dir)).await? {
        return failed(error, Phase::Bake);
    }
    let report = report::report(core, &row, holes).await?;
    let unwritten = |source| EngineError::Blob(BlobError::write("report.json", source));
    tokio::fs::write(scratch.path().join("report.json"), report).await.map_err(unwritten)?;
    Ok(TaskResult::Published(take_in(core, scratch.path()).await?))
}

/// Makes every file below a folder a blob.
async fn take_in(core: &Arc<Core>, root: &Path) -> Result<Vec<StoredPackageFile>, EngineError> {
    let unreadable = |source| EngineError::Blob(BlobError::write("a package file", source));
    let mut stored = Vec::new();
    for (path, local) in files_below(root).map_err(unreadable)? {
        let measured = blocking({
            let local = local.clone();
            move || measure(&local)
        });
        let (bytes, sha256, blob) = measured.await?.map_err(unreadable)?;
        core.blobs.put_file(blob, adopt(local).map_err(unreadable)?).await?;
        let media_type = media_type(&path).to_owned();
        stored.push(StoredPackageFile { file: PackageFile { path, media_type, bytes, sha256 }, blob });
    }
    Ok(stored)
}

fn adopt(path: PathBuf) -> io::Result<TempPath> {
    TempPath::try_from_path(path)
}

/// Length, SHA-256 and BLAKE3 in one pass.
fn measure(path: &Path) -> io::Result<(u64, String, BlobName)> {
    let (mut file, mut block) = (File::open(path)?, vec![0; BLOCK]);
    let (mut length, mut sha, mut blake) = (0, sha2::Sha256::new(), blake3::Hasher::new());
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            break;
        }
        length += n as u64;
        sha.update(&block[..n]);
        blake.update(&block[..n]);
    }
    let sha256 = sha.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok((length, sha256, BlobName(Digest(*blake.finalize().as_bytes()))))
}

/// The media type of a package file.
fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "json" => "application/json",
        "glb" => "model/gltf-binary",
        "png" => "image/png",
        "ktx2" => "image/ktx2",
        _ => "application/octet-stream",
    }
}
