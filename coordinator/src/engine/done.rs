//! Which tiles of a job are done.

use super::{Engine, EngineError};
use crate::records::JobState;
use kiln_proto::{
    ids::JobId,
    tile::{TileRun, TileRuns},
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
            // All of them; once the package stands, the chunks that could say so are gone.
            JobState::Assembling | JobState::Done => return Ok((Some(Phase::Bake), TileRuns::all(row.tiles.0))),
            JobState::Baking | JobState::Paused | JobState::Failed | JobState::Cancelled => {}
        }
        let phase = row.state.phase().unwrap_or(Phase::Bake);
        let chunks = self.core.store.chunks(job, phase, EVERY).await?;
        Ok((Some(phase), chunks.iter().fold(TileRuns::new(), |done, chunk| done.union(&chunk.accepted))))
    }
}
