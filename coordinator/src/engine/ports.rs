//! What the engine asks of import, split, codec and assembly: everything that burns processor time, and nothing that knows of jobs.
//!
//! One trait, so that tests of the farm run in milliseconds with a pipeline that bakes nothing. Every call blocks and is made where
//! blocking is allowed.

use crate::{
    assemble::{self, SourceError, SurfaceReport},
    import::{self, Bundle, Content, Imported, Part},
    records::Problem,
    split,
};
use kiln_proto::{
    ids::SceneHash,
    plan::Plan,
    probe::ProbeSums,
    scene::Scene,
    segment::{self, Segment},
    settings::BakeSettings,
    tile::TileIndex,
    wire::message::Phase,
};
use std::path::{Path, PathBuf};

/// Accepted segments, by tile.
pub trait Segments: Send + Sync {
    /// The bytes of a tile's segment, decompressed and of the digest that was accepted.
    ///
    /// # Errors
    /// A tile that has none, or whose blob is lost or damaged.
    fn segment(&self, tile: TileIndex) -> Result<Vec<u8>, Problem>;
}

/// The work of a coordinator.
pub trait Pipeline: Send + Sync + 'static {
    /// Imports an upload: the client's names with local files. `scratch` is a folder for what an archive unpacks to.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    fn import(&self, files: Vec<(String, PathBuf)>, scratch: &Path) -> Result<Imported, Vec<Problem>>;

    /// Lays surfaces out and cuts them into tiles.
    ///
    /// # Errors
    /// Settings that do not fit the scene.
    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem>;

    /// Whether bytes are an acceptable segment of a tile.
    ///
    /// # Errors
    /// What is wrong with them.
    fn check(&self, bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<(), Problem>;

    /// What a segment of the Probe phase found.
    ///
    /// # Errors
    /// Bytes that are no such segment.
    fn probe(&self, bytes: &[u8], plan: &Plan, tile: TileIndex) -> Result<ProbeSums, Problem>;

    /// Writes the files of one surface under `dir`, with paths as in the package, and answers with its entry of the manifest.
    ///
    /// # Errors
    /// Segments that are lost, a full disk.
    fn assemble(
        &self,
        plan: &Plan,
        scene: &Scene,
        surface: usize,
        segments: &dyn Segments,
        dir: &Path,
    ) -> Result<serde_json::Value, Problem>;

    /// Writes `manifest.json`, and whatever else belongs to the package as a whole, under `dir`, from what assembly said of each surface.
    ///
    /// # Errors
    /// A full disk.
    fn manifest(&self, plan: &Plan, scene: &Scene, surfaces: &[serde_json::Value], dir: &Path) -> Result<(), Problem>;
}

/// The real one.
pub struct Kiln;

impl Pipeline for Kiln {
    fn import(&self, files: Vec<(String, PathBuf)>, scratch: &Path) -> Result<Imported, Vec<Problem>> {
        let parts = files.into_iter().map(|(name, path)| Part { name, content: Content::File(path) }).collect();
        let bundle = Bundle::from_parts(parts, None, scratch).map_err(|problem| vec![problem])?;
        import::import_bundle(&bundle)
    }

    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
        split::make_plan(scene, hash, settings)
    }

    fn check(&self, bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<(), Problem> {
        segment::check(bytes, plan, phase, tile).map_err(|e| problem(&e))
    }

    fn probe(&self, bytes: &[u8], plan: &Plan, tile: TileIndex) -> Result<ProbeSums, Problem> {
        match segment::open(bytes, plan, Phase::Probe, tile).map_err(|e| problem(&e))? {
            Segment::Probe(probe) => Ok(probe.sums),
            Segment::Tile(_) => Err(said(format!("the segment of probe tile {tile} is one of the bake"))),
        }
    }

    fn assemble(
        &self,
        plan: &Plan,
        scene: &Scene,
        surface: usize,
        segments: &dyn Segments,
        dir: &Path,
    ) -> Result<serde_json::Value, Problem> {
        let first = plan.first_tile(surface).0;
        let stem = &scene.surfaces.get(surface).ok_or_else(|| said(format!("the scene has no surface {surface}")))?.file_stem;
        let mut source = |index: usize| segments.segment(TileIndex(first + index as u64)).map_err(|p| SourceError::from(p.message));
        let report = assemble::assemble_surface(plan, surface, stem, &mut source, dir).map_err(|e| problem(&e))?;
        serde_json::to_value(report).map_err(|e| problem(&e))
    }

    fn manifest(&self, plan: &Plan, scene: &Scene, surfaces: &[serde_json::Value], dir: &Path) -> Result<(), Problem> {
        let report = |value: &serde_json::Value| serde_json::from_value::<SurfaceReport>(value.clone()).map_err(|e| problem(&e));
        let reports = surfaces.iter().map(report).collect::<Result<Vec<_>, _>>()?;
        let bytes = scene.to_bytes().map_err(|e| problem(&e))?;
        assemble::write_manifest(dir, &bytes, plan, &reports).map(drop).map_err(|e| problem(&e))
    }
}

fn said(message: String) -> Problem {
    Problem { message, file: None, line: None }
}

/// An error with all its causes in one sentence.
pub(super) fn problem(error: &dyn std::error::Error) -> Problem {
    let mut message = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        message = format!("{message}: {cause}");
        source = cause.source();
    }
    said(message)
}
