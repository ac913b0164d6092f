//! Which tiles of a job are done.

use super::{Engine, EngineError, ports::Listed, tasks};
use crate::{records::JobState, store::JobRow};
use kiln_proto::{
    ids::JobId,
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};

/// Every tile that a store can name.
const EVERY: TileRun = TileRun { start: 0, end: i64::MAX as u64 };

impl Engine {
    /// The tiles that are done in the phase that a job bakes or baked last; no phase before its first.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn done_tiles(&self, job: JobId) -> Result<(Option<Phase>, TileRuns), EngineError> {
        let found = self.core.store.job(job).await?;
        let row = found.ok_or_else(|| EngineError::NotFound { what: "job", id: job.to_string() })?;
        match row.state.public() {
            JobState::Queued | JobState::Preparing => return Ok((None, TileRuns::new())),
            // All of them but holes; once the package stands, the chunks that could say so are gone.
            JobState::Assembling | JobState::Done => {
                return Ok((Some(Phase::Bake), TileRuns::all(row.tiles.0).minus(&self.left_out(&row).await?)));
            }
            JobState::Baking | JobState::Paused | JobState::Failed | JobState::Cancelled => {}
        }
        let phase = row.state.phase().unwrap_or(Phase::Bake);
        let chunks = self.core.store.chunks(job, phase, EVERY).await?;
        Ok((Some(phase), chunks.iter().fold(TileRuns::new(), |done, chunk| done.union(&chunk.accepted))))
    }

    /// The tiles that a job ends without which is being assembled, or was.
    async fn left_out(&self, row: &JobRow) -> Result<TileRuns, EngineError> {
        let (job, (tiles, done)) = (row.spec.id, row.tiles);
        if tiles == done {
            return Ok(TileRuns::new());
        }
        if row.state.public() == JobState::Assembling {
            let holes = self.core.store.holes(job, Phase::Bake, EVERY).await?;
            return Ok(holes.into_keys().collect());
        }
        let (_, plan) = tasks::plan(&self.core, row).await?;
        let entries = self.core.store.surface_reports(job).await?;
        let of_surface = |(surface, entry): (usize, &serde_json::Value)| {
            let first = plan.surfaces.get(surface).map_or(0, |_| plan.first_tile(surface).0);
            Listed::of(entry).into_iter().map(move |hole| TileIndex(first + hole.tile as u64))
        };
        Ok(entries.iter().enumerate().flat_map(of_surface).collect())
    }
}
