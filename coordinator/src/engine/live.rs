//! What a live view of a job needs: its scene with the plan as it is now, and the light of tiles that are done.
//!
//! Both come from the store and the blobs as they are; nothing is written. An answer is put together in memory and stops at a number of
//! bytes and of tiles; chunks are looked up shard by shard until there is enough, so that a request costs what it is answered and not what
//! the job has. How many answers there are at a time is for who asks to limit. Streaming lost: the scene's header holds a checksum of what
//! follows, and the bytes of a segment are known only once its raw samples are left out.

use super::{
    Engine, EngineError,
    core::{Core, blocking},
    inspect::unpack,
    segments,
};
use crate::{
    auth::Scope,
    blob::{BlobError, BlobName},
    lease::SHARD_TILES,
    records::JobState,
    store::{ChunkRow, JobRow, PlanRef},
};
use kiln_proto::{
    format::container,
    ids::{Digest, JobId, SceneHash},
    limits,
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::{ChunkEntry, Phase},
};
use std::{collections::HashMap, sync::Arc};

/// Tiles of one answer, at most: their raw samples are read too, and left out.
const TILES: usize = 1_024;

/// A job's scene and its plan at one moment, before their bytes are loaded.
#[derive(Debug, Clone, Copy)]
pub struct LiveScene {
    scene: SceneHash,
    plan: PlanRef,
}

impl LiveScene {
    /// Names the bytes of the container: a hash of what they are made of, so that it is known before they are loaded.
    #[must_use]
    pub fn digest(&self) -> Digest {
        Digest::of(format!("{} {} {}", container::VERSION, self.scene, self.plan.digest).as_bytes())
    }
}

impl Engine {
    /// The scene of a job with its plan as it is now. The plan changes once, when Probe is merged.
    ///
    /// # Errors
    /// [`EngineError::NotFound`], and [`EngineError::Conflict`] while there is no plan.
    pub async fn live_scene(&self, job: JobId) -> Result<LiveScene, EngineError> {
        let row = row(&self.core, job).await?;
        match (row.scene_hash, row.plan) {
            (Some(scene), Some(plan)) => Ok(LiveScene { scene, plan }),
            _ => Err(EngineError::Conflict {
                what: format!("the job {job}"),
                state: row.state.name().into(),
                needed: "its plan exists when it is prepared".into(),
            }),
        }
    }

    /// The bytes of `scene.kiln` of a live scene.
    ///
    /// # Errors
    /// Blobs that are gone.
    pub async fn live_scene_bytes(&self, live: &LiveScene) -> Result<Vec<u8>, EngineError> {
        let core = &self.core;
        let missing = || EngineError::NotFound { what: "scene", id: live.scene.to_string() };
        let blob = core.store.scene_by_hash(live.scene, Scope::All).await?.and_then(|row| row.canonical).ok_or_else(missing)?;
        let (scene, plan) = (core.load_compressed(blob).await?, core.load_compressed(live.plan.blob).await?);
        blocking(move || [&container::header(&scene, &plan), &*scene, &*plan].concat()).await
    }

    /// Segments of tiles of the Bake phase that are in `asked` and done, in ascending order: of each the tile (u64), the length (u32), both
    /// little-endian, and the segment's bytes without raw samples. Ends before it would pass `most` bytes or 1,024 tiles, but not without a
    /// first tile. Nothing before the phase begins, and nothing of a job that is done: its chunks are collected.
    ///
    /// # Errors
    /// [`EngineError::NotFound`], and segments that are damaged.
    pub async fn live_segments(&self, job: JobId, asked: &TileRuns, most: usize) -> Result<Vec<u8>, EngineError> {
        let core = &self.core;
        let row = row(core, job).await?;
        let (Some(first), Some(last)) = (asked.runs().first(), asked.runs().last()) else { return Ok(Vec::new()) };
        if row.state.public() == JobState::Done {
            return Ok(Vec::new());
        }
        let (mut body, mut left) = (Vec::new(), TILES);
        let end = last.end.min(row.tiles.0);
        for shard in first.start / SHARD_TILES..end.div_ceil(SHARD_TILES) {
            let span = TileRun { start: shard * SHARD_TILES, end: (shard + 1) * SHARD_TILES };
            let wanted = asked.intersection(&TileRuns::from_run(span));
            if wanted.is_empty() {
                continue;
            }
            // A chunk lies within one shard.
            let chunks = core.store.chunks(job, Phase::Bake, span).await?;
            let (chunks, tiles) = blocking(move || {
                let tiles = schedule(&chunks, &wanted, left);
                (chunks, tiles)
            })
            .await?;
            left -= tiles.len();
            let mut reader = Reader { core, chunks: &chunks, entries: HashMap::new() };
            for (tile, chunk) in tiles {
                let Some(segment) = reader.segment(chunk, tile).await? else { continue };
                if !body.is_empty() && body.len() + segment.len() + 12 > most {
                    return Ok(body);
                }
                body.extend(tile.0.to_le_bytes());
                body.extend((segment.len() as u32).to_le_bytes()); // At most SEGMENT_BYTES, 128 MiB.
                body.extend(segment);
            }
            if left == 0 {
                break;
            }
        }
        Ok(body)
    }
}

async fn row(core: &Core, job: JobId) -> Result<JobRow, EngineError> {
    core.store.job(job).await?.ok_or_else(|| EngineError::NotFound { what: "job", id: job.to_string() })
}

/// The first tiles that are asked for and done, in order and at most `most`, each with the position of its chunk.
fn schedule(chunks: &[ChunkRow], asked: &TileRuns, most: usize) -> Vec<(TileIndex, usize)> {
    let mut runs = Vec::new();
    for (chunk, row) in chunks.iter().enumerate() {
        let wanted = row.accepted.intersection(asked);
        runs.extend(wanted.runs().iter().map(|run| (run.start, run.end, chunk)));
    }
    // A tile is accepted from one chunk only: the runs do not overlap.
    runs.sort_unstable();
    let tiles = runs.into_iter().flat_map(|(start, end, chunk)| (start..end).map(move |tile| (TileIndex(tile), chunk)));
    tiles.take(most).collect()
}

/// Reads segments of chunks whose trailers it has looked up.
struct Reader<'a> {
    core: &'a Core,
    chunks: &'a [ChunkRow],
    entries: HashMap<usize, HashMap<TileIndex, ChunkEntry>>,
}

impl Reader<'_> {
    /// A tile's segment without raw samples; nothing where its blob is gone, which assembly finds out and puts right.
    async fn segment(&mut self, chunk: usize, tile: TileIndex) -> Result<Option<Vec<u8>>, EngineError> {
        let row = &self.chunks[chunk];
        if !self.entries.contains_key(&chunk) {
            let found = segments::entries(&*self.core.blobs, row).await?.unwrap_or_default();
            self.entries.insert(chunk, found.into_iter().map(|entry| (entry.tile, entry)).collect());
        }
        let Some(entry) = self.entries.get(&chunk).and_then(|entries| entries.get(&tile)).cloned() else { return Ok(None) };
        let Some(packed) = load(self.core, row.blob, &entry).await? else { return Ok(None) };
        let pipeline = Arc::clone(&self.core.pipeline);
        let lean = blocking(move || pipeline.lean(unpack(&packed, &entry)?).map_err(|problem| problem.to_string())).await?;
        lean.map(Some).map_err(|reason| EngineError::Broken(format!("the chunk {}: {reason}", row.blob)))
    }
}

async fn load(core: &Core, blob: BlobName, entry: &ChunkEntry) -> Result<Option<Vec<u8>>, EngineError> {
    match core.blobs.load(blob, Some(entry.offset..entry.offset + entry.length), limits::CHUNK_BYTES).await {
        Ok(packed) => Ok(Some(packed)),
        Err(BlobError::Missing(_)) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(runs: &[(u64, u64)]) -> ChunkRow {
        let mut accepted = TileRuns::new();
        runs.iter().for_each(|(start, end)| accepted.insert(TileRun { start: *start, end: *end }));
        ChunkRow { blob: BlobName(Digest::of(b"chunk")), trailer_at: 0, length: 0, accepted, conflicts: TileRuns::new() }
    }

    #[test]
    fn tiles_come_in_order_wherever_they_lie() {
        let chunks = [chunk(&[(10, 12), (3, 4)]), chunk(&[(0, 3), (7, 9)])];
        let mut asked = TileRuns::new();
        asked.insert(TileRun { start: 2, end: 8 });
        asked.insert(TileRun { start: 11, end: 99 });
        let found: Vec<(u64, usize)> = schedule(&chunks, &asked, 100).into_iter().map(|(tile, chunk)| (tile.0, chunk)).collect();
        assert_eq!(found, [(2, 1), (3, 0), (7, 1), (11, 0)]);
    }

    #[test]
    fn one_answer_has_a_bounded_number_of_tiles() {
        let all = TileRuns::all(1_000_000);
        assert_eq!(schedule(&[chunk(&[(0, 1_000_000)])], &all, TILES).len(), TILES);
    }
}
