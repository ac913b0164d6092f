//! Accepted segments for assembly: found through the chunks' trailers, read from their blobs one at a time.
//!
//! The index holds one small entry per tile of one surface (at most 65,536 of them); the bytes stay in the blobs. That is what keeps
//! assembly's memory constant however large the job.

use super::{
    EngineError,
    core::Core,
    inspect::{parse_trailer, unpack},
    ports::{PipelineError, Segments},
};
use crate::{
    blob::{BlobError, BlobName, Blobs},
    records::Problem,
    store::ChunkRow,
};
use kiln_proto::{
    ids::JobId,
    limits,
    tile::{TileIndex, TileRun},
    wire::message::{ChunkEntry, Phase},
};
use std::{collections::BTreeMap, sync::Arc};
use tokio::runtime::Handle;

/// The entries of a stored chunk; the inner error is the name of its blob, which is gone.
pub(super) async fn entries(blobs: &dyn Blobs, chunk: &ChunkRow) -> Result<Result<Vec<ChunkEntry>, BlobName>, EngineError> {
    let bytes = match blobs.load(chunk.blob, Some(chunk.trailer_at..chunk.length), limits::CHUNK_BYTES).await {
        Err(BlobError::Missing(gone)) => return Ok(Err(gone)),
        found => found?,
    };
    parse_trailer(&bytes).map(Ok).map_err(|reason| EngineError::Broken(format!("the chunk {}: {reason}", chunk.blob)))
}

/// The accepted segments of a run of tiles.
pub(super) struct StoredSegments {
    blobs: Arc<dyn Blobs>,
    index: BTreeMap<TileIndex, (BlobName, ChunkEntry)>,
    runtime: Handle,
}

impl StoredSegments {
    /// Indexes a run; the inner error names a chunk's blob that is gone. Called within the runtime, used where blocking is allowed.
    pub(super) async fn open(core: &Core, job: JobId, phase: Phase, run: TileRun) -> Result<Result<Self, BlobName>, EngineError> {
        let mut index = BTreeMap::new();
        for chunk in core.store.chunks(job, phase, run).await? {
            let entries = match entries(&*core.blobs, &chunk).await? {
                Ok(entries) => entries,
                Err(gone) => return Ok(Err(gone)),
            };
            for entry in entries {
                if chunk.accepted.contains(entry.tile) && (run.start..run.end).contains(&entry.tile.0) {
                    index.insert(entry.tile, (chunk.blob, entry));
                }
            }
        }
        Ok(Ok(Self { blobs: Arc::clone(&core.blobs), index, runtime: Handle::current() }))
    }
}

impl Segments for StoredSegments {
    fn segment(&self, tile: TileIndex) -> Result<Vec<u8>, PipelineError> {
        let lost = |reason: String| Problem { message: format!("the segment of tile {tile} is lost: {reason}"), file: None, line: None };
        let (blob, entry) = self.index.get(&tile).ok_or_else(|| lost("no chunk holds it".into()))?;
        let range = entry.offset..entry.offset + entry.length;
        let packed = self.runtime.block_on(self.blobs.load(*blob, Some(range), limits::CHUNK_BYTES));
        Ok(unpack(&packed?, entry).map_err(lost)?)
    }
}
