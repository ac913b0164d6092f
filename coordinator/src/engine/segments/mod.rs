//! Accepted segments for assembly: found through the chunks' trailers, read from their blobs ahead of who asks for them.
//!
//! The index holds one small entry per tile of one surface (at most 65,536 of them); the bytes stay in the blobs but for those that are
//! read ahead. That is what keeps assembly's memory constant however large the job.

mod readahead;

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
use futures_util::{StreamExt, TryStreamExt, stream};
use kiln_proto::{
    ids::JobId,
    limits,
    tile::{TileIndex, TileRun},
    wire::message::{ChunkEntry, Phase},
};
use readahead::Readahead;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};
use tokio::runtime::Handle;

/// Trailers that are read at the same time.
const TRAILERS: usize = 16;

/// The entries of a stored chunk; the inner error is the name of its blob, which is gone.
pub(super) async fn entries(blobs: &dyn Blobs, chunk: &ChunkRow) -> Result<Result<Vec<ChunkEntry>, BlobName>, EngineError> {
    let bytes = match blobs.load(chunk.blob, Some(chunk.trailer_at..chunk.length), limits::CHUNK_BYTES).await {
        Err(BlobError::Missing(gone)) => return Ok(Err(gone)),
        found => found?,
    };
    parse_trailer(&bytes).map(Ok).map_err(|reason| EngineError::Broken(format!("the chunk {}: {reason}", chunk.blob)))
}

/// Where each tile's segment lies.
type Index = BTreeMap<TileIndex, (BlobName, ChunkEntry)>;

/// The accepted segments of some tiles.
pub(super) struct StoredSegments {
    index: Index,
    ahead: Mutex<Readahead>,
}

impl StoredSegments {
    /// Indexes the tiles that will be asked for, in the order in which that is expected; another order costs time only. The inner error
    /// names a chunk's blob that is gone. Called within the runtime, used where blocking is allowed.
    pub(super) async fn open(core: &Core, job: JobId, phase: Phase, order: Vec<TileIndex>) -> Result<Result<Self, BlobName>, EngineError> {
        let (first, last) = (order.iter().min().map_or(0, |t| t.0), order.iter().max().map_or(0, |t| t.0));
        let run = TileRun { start: first, end: last + 1 };
        let mut index = BTreeMap::new();
        let chunks = core.store.chunks(job, phase, run).await?;
        let blobs = &*core.blobs;
        let read = stream::iter(chunks).map(move |chunk| async move {
            let found = entries(blobs, &chunk).await?;
            Ok::<_, EngineError>((chunk, found))
        });
        let mut read = read.buffered(TRAILERS).boxed();
        while let Some((chunk, found)) = read.try_next().await? {
            let entries = match found {
                Ok(entries) => entries,
                Err(gone) => return Ok(Err(gone)),
            };
            for entry in entries {
                if chunk.accepted.contains(entry.tile) && (run.start..run.end).contains(&entry.tile.0) {
                    index.insert(entry.tile, (chunk.blob, entry));
                }
            }
        }
        let ahead = Mutex::new(Readahead::new(Arc::clone(&core.blobs), Handle::current(), order));
        Ok(Ok(Self { index, ahead }))
    }
}

impl Segments for StoredSegments {
    fn segment(&self, tile: TileIndex) -> Result<Vec<u8>, PipelineError> {
        let lost = |reason: String| Problem::new(format!("the segment of tile {tile} is lost: {reason}"));
        let (_, entry) = self.index.get(&tile).ok_or_else(|| lost("no chunk holds it".into()))?;
        // A panic while it was held can at worst have lost what was read ahead.
        let packed = self.ahead.lock().unwrap_or_else(PoisonError::into_inner).packed(&self.index, tile)?;
        Ok(unpack(&packed, entry).map_err(lost)?)
    }
}
