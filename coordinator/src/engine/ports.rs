//! What the engine asks of import, split, codec and assembly: everything that burns processor time, and nothing that knows of jobs.
//!
//! One trait, so that tests of the farm run in milliseconds with a pipeline that bakes nothing. Every call blocks and is made where
//! blocking is allowed.

use crate::{
    assemble::{self, AssembleError, Hole, Holes, SourceError, SurfaceReport},
    blob::BlobError,
    import::{self, Bundle, Content, Imported, Part},
    records::Problem,
    split,
};
use kiln_proto::{
    chain,
    ids::SceneHash,
    options::ImportOptions,
    plan::Plan,
    probe::ProbeSums,
    scene::Scene,
    segment::{self, Segment},
    settings::BakeSettings,
    tile::TileIndex,
    wire::message::Phase,
};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    io,
    path::{Path, PathBuf},
};

/// Why the pipeline could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// What it was given cannot be used; trying again would end the same.
    #[error("{0}")]
    Invalid(Problem),
    /// A segment's blob cannot be had: the disk fails, or the blob is gone.
    #[error("a segment cannot be read")]
    Blob(#[from] BlobError),
    /// A file could not be written: the disk is full or fails.
    #[error("{} cannot be written", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
}

impl From<Problem> for PipelineError {
    fn from(problem: Problem) -> Self {
        Self::Invalid(problem)
    }
}

impl From<AssembleError> for PipelineError {
    fn from(error: AssembleError) -> Self {
        match error {
            AssembleError::Io { path, source } => Self::Io { path, source },
            // What `Segments` answered has passed through assembly as it was.
            AssembleError::Source { tile, source } => match source.downcast::<PipelineError>() {
                Ok(own) => *own,
                Err(source) => problem(&AssembleError::Source { tile, source }).into(),
            },
            other => problem(&other).into(),
        }
    }
}

/// Accepted segments, by tile.
pub trait Segments: Send + Sync {
    /// The bytes of a tile's segment, decompressed and of the digest that was accepted.
    ///
    /// # Errors
    /// A tile that has none, or whose blob is lost or damaged.
    fn segment(&self, tile: TileIndex) -> Result<Vec<u8>, PipelineError>;
}

/// The work of a coordinator. What is done to segments has one real way, which is given here; what is done to what strangers send may be done
/// elsewhere.
pub trait Pipeline: Send + Sync + 'static {
    /// Imports an upload: the client's names with local files. `scratch` is a folder for what an archive unpacks to.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    fn import(&self, files: Vec<(String, PathBuf)>, options: &ImportOptions, scratch: &Path) -> Result<Imported, Vec<Problem>>;

    /// Lays surfaces out and cuts them into tiles.
    ///
    /// # Errors
    /// Settings that do not fit the scene.
    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem>;

    /// Whether bytes are an acceptable segment of a tile.
    ///
    /// # Errors
    /// What is wrong with them.
    fn check(&self, bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<(), Problem> {
        segment::check(bytes, plan, phase, tile).map_err(|e| problem(&e))
    }

    /// A segment of the Bake phase without what the live preview has no use for.
    ///
    /// # Errors
    /// Bytes that are no such segment.
    fn lean(&self, bytes: Vec<u8>) -> Result<Vec<u8>, Problem> {
        segment::without_raw(bytes).map_err(|e| problem(&e))
    }

    /// What a segment of the Probe phase found.
    ///
    /// # Errors
    /// Bytes that are no such segment.
    fn probe(&self, bytes: &[u8], plan: &Plan, tile: TileIndex) -> Result<ProbeSums, Problem> {
        match segment::open(bytes, plan, Phase::Probe, tile).map_err(|e| problem(&e))? {
            Segment::Probe(probe) => Ok(probe.sums),
            Segment::Tile(_) => Err(Problem::new(format!("the segment of probe tile {tile} is one of the bake"))),
        }
    }

    /// Writes the files of one surface under `dir`, with paths as in the package, and answers with its entry of the manifest. `holes` are its
    /// tiles that nobody could bake, each with how it failed: they have no segments, and the entry has them as `holes` (see [`Listed`]).
    ///
    /// # Errors
    /// Segments that are lost or cannot be used, a disk that is full or fails.
    fn assemble(
        &self,
        plan: &Plan,
        scene: &Scene,
        surface: usize,
        holes: &BTreeMap<TileIndex, String>,
        segments: &dyn Segments,
        dir: &Path,
    ) -> Result<serde_json::Value, PipelineError> {
        let first = plan.first_tile(surface).0;
        let stem = &scene.surfaces.get(surface).ok_or_else(|| Problem::new(format!("the scene has no surface {surface}")))?.file_stem;
        let mut source = |index: usize| segments.segment(TileIndex(first + index as u64)).map_err(SourceError::from);
        let report = if holes.is_empty() {
            assemble::assemble_surface(plan, surface, stem, &mut source, dir)?
        } else {
            let hole = |(tile, reason): (&TileIndex, &String)| Hole { tile: tile.0.saturating_sub(first) as usize, reason: reason.clone() };
            let holes = Holes::new(scene, plan, surface, holes.iter().map(hole).collect())?;
            assemble::assemble_around(&holes, stem, &mut source, dir)?
        };
        Ok(serde_json::to_value(report).map_err(|e| problem(&e))?)
    }

    /// Writes `manifest.json`, and whatever else belongs to the package as a whole, under `dir`, from what assembly said of each surface.
    ///
    /// # Errors
    /// Reports that do not belong to the plan, a disk that is full or fails.
    fn manifest(&self, plan: &Plan, scene: &Scene, surfaces: &[serde_json::Value], dir: &Path) -> Result<(), PipelineError> {
        let report = |value: &serde_json::Value| serde_json::from_value::<SurfaceReport>(value.clone()).map_err(|e| problem(&e));
        let reports = surfaces.iter().map(report).collect::<Result<Vec<_>, _>>()?;
        let bytes = scene.to_bytes().map_err(|e| problem(&e))?;
        assemble::write_manifest(dir, &bytes, plan, &reports)?;
        Ok(())
    }
}

/// What every entry of the manifest says that [`Pipeline::assemble`] answers with, whatever else is in it.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Listed {
    /// The surface's holes, in order.
    #[serde(default)]
    pub(super) holes: Vec<Hole>,
}

impl Listed {
    /// The holes that an entry lists.
    pub(super) fn of(entry: &serde_json::Value) -> Vec<Hole> {
        Self::deserialize(entry).unwrap_or_default().holes
    }
}

/// The real one, all of it in this process.
pub struct Kiln;

impl Pipeline for Kiln {
    fn import(&self, files: Vec<(String, PathBuf)>, options: &ImportOptions, scratch: &Path) -> Result<Imported, Vec<Problem>> {
        let parts = files.into_iter().map(|(name, path)| Part { name, content: Content::File(path) }).collect();
        let bundle = Bundle::from_parts(parts, options.main.as_deref(), scratch).map_err(|problem| vec![problem])?;
        import::import_bundle(&bundle, options)
    }

    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
        split::make_plan(scene, hash, settings)
    }
}

/// An error with all its causes in one sentence.
pub(super) fn problem(error: &dyn std::error::Error) -> Problem {
    Problem::new(chain(error))
}
