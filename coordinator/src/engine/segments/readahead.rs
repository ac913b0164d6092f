//! Reads segments before they are asked for.
//!
//! Over a network a read takes tens of milliseconds however small it is: a surface of 65,536 tiles would wait half an hour, one read after
//! another. The order of the tiles is known, so that some reads are under way at any time, and tiles that lie side by side in one chunk
//! are read at once. Keeping whole chunks lost: a row of tiles crosses hundreds of them, which are gigabytes.

use super::Index;
use crate::blob::{BlobError, BlobName, Blobs};
use kiln_proto::{limits, tile::TileIndex};
use std::{collections::VecDeque, ops::Range, sync::Arc};
use tokio::{runtime::Handle, task::JoinHandle};

/// Reads under way at the same time, ...
const READS: usize = 8;
/// ... and the bytes that they may come to, unless a single one does.
const BYTES: u64 = 16 << 20;
/// Neighbours are joined up to this many bytes.
const JOINED: u64 = 1 << 20;

/// A read under way or done: part of a blob with some consecutive tiles of the order.
struct Fetch {
    range: Range<u64>,
    tiles: Range<usize>,
    bytes: Bytes,
}

enum Bytes {
    Coming(JoinHandle<Result<Vec<u8>, BlobError>>),
    Here(Vec<u8>),
}

/// Reads that are ahead of their reader.
pub(super) struct Readahead {
    blobs: Arc<dyn Blobs>,
    runtime: Handle,
    order: Vec<TileIndex>,
    /// The place in the order of the tile that is expected next.
    at: usize,
    /// The place from which on nothing is under way.
    begun: usize,
    under_way: VecDeque<Fetch>,
}

impl Readahead {
    pub(super) fn new(blobs: Arc<dyn Blobs>, runtime: Handle, order: Vec<TileIndex>) -> Self {
        Self { blobs, runtime, order, at: 0, begun: 0, under_way: VecDeque::new() }
    }

    /// The packed bytes of a tile that the index holds. Blocks.
    pub(super) fn packed(&mut self, index: &Index, tile: TileIndex) -> Result<Vec<u8>, BlobError> {
        let Some((blob, entry)) = index.get(&tile) else { return Ok(Vec::new()) };
        let wanted = entry.offset..entry.offset + entry.length;
        if self.order.get(self.at) != Some(&tile) {
            return self.runtime.block_on(self.blobs.load(*blob, Some(wanted), limits::CHUNK_BYTES));
        }
        self.top_up(index);
        let found = self.first(&wanted);
        self.at += 1;
        while self.under_way.front().is_some_and(|fetch| fetch.tiles.end <= self.at) {
            self.under_way.pop_front();
        }
        if found.is_err() {
            // What failed is not asked for twice: what follows begins anew.
            self.under_way.clear();
            self.begun = self.at;
        }
        found
    }

    /// The bytes of a range of the first read, which holds it.
    fn first(&mut self, wanted: &Range<u64>) -> Result<Vec<u8>, BlobError> {
        let Some(fetch) = self.under_way.front_mut() else { return Ok(Vec::new()) };
        if let Bytes::Coming(reading) = &mut fetch.bytes {
            let read = self.runtime.block_on(reading).unwrap_or_else(|e| Err(BlobError::write("what was read ahead", e.into())));
            fetch.bytes = Bytes::Here(read?);
        }
        let Bytes::Here(bytes) = &fetch.bytes else { return Ok(Vec::new()) };
        let (from, to) = ((wanted.start - fetch.range.start) as usize, (wanted.end - fetch.range.start) as usize);
        // A blob that is shorter than its trailer says gives less, which unpacking finds.
        Ok(bytes.get(from..to.min(bytes.len())).unwrap_or_default().to_vec())
    }

    /// Begins reads as far ahead as is allowed.
    fn top_up(&mut self, index: &Index) {
        self.begun = self.begun.max(self.at);
        let mut bytes: u64 = self.under_way.iter().map(|fetch| fetch.range.end - fetch.range.start).sum();
        while self.under_way.len() < READS {
            let Some((blob, range, tiles)) = self.next(index) else { return };
            bytes += range.end - range.start;
            if bytes > BYTES && !self.under_way.is_empty() {
                return;
            }
            self.begun = tiles.end;
            let (blobs, wanted) = (Arc::clone(&self.blobs), range.clone());
            let reading = self.runtime.spawn(async move { blobs.load(blob, Some(wanted), limits::CHUNK_BYTES).await });
            self.under_way.push_back(Fetch { range, tiles, bytes: Bytes::Coming(reading) });
        }
    }

    /// The next read: a tile, and those behind it in the order that also lie behind it in its chunk. Nothing where a tile is in no chunk,
    /// which who asks for it is told.
    fn next(&self, index: &Index) -> Option<(BlobName, Range<u64>, Range<usize>)> {
        let place = |k: usize| self.order.get(k).and_then(|tile| index.get(tile));
        let (blob, entry) = place(self.begun)?;
        let (mut range, mut end) = (entry.offset..entry.offset + entry.length, self.begun + 1);
        while let Some((next, entry)) = place(end) {
            if next != blob || entry.offset != range.end || range.end - range.start + entry.length > JOINED {
                break;
            }
            range.end += entry.length;
            end += 1;
        }
        Some((*blob, range, self.begun..end))
    }
}

impl Drop for Readahead {
    fn drop(&mut self) {
        for fetch in &self.under_way {
            if let Bytes::Coming(reading) = &fetch.bytes {
                reading.abort();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blob::LocalBlobs;
    use kiln_proto::{ids::Digest, wire::message::ChunkEntry};

    /// Two chunks of 40 tiles each, tile k being k % 7 + 1 times the byte k; the second chunk has its tiles backwards.
    async fn chunks(blobs: &LocalBlobs) -> Index {
        let mut index = Index::new();
        for tiles in [(0..40).collect::<Vec<u64>>(), (40..80).rev().collect()] {
            let (mut bytes, mut places) = (Vec::new(), Vec::new());
            for k in tiles {
                let length = k % 7 + 1;
                places.push((k, bytes.len() as u64, length));
                bytes.extend(vec![k as u8; length as usize]);
            }
            let blob = blobs.put(bytes.into()).await.unwrap();
            for (k, offset, length) in places {
                let entry = ChunkEntry { tile: TileIndex(k), offset, length, plain_length: length, digest: Digest::of(b"") };
                index.insert(TileIndex(k), (blob, entry));
            }
        }
        index
    }

    fn expected(k: u64) -> Vec<u8> {
        vec![k as u8; (k % 7 + 1) as usize]
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn tiles_come_right_in_the_expected_order_and_in_any_other() {
        let dir = tempfile::tempdir().unwrap();
        let blobs = LocalBlobs::open(&dir.path().join("blobs"), &dir.path().join("spool")).unwrap();
        let index = chunks(&blobs).await;
        let blobs: Arc<dyn Blobs> = Arc::new(blobs);
        // Rows of a surface: now in one chunk, now in the other.
        let order: Vec<u64> = (0..10).flat_map(|row| (row * 4..row * 4 + 4).chain(40 + row * 4..44 + row * 4)).collect();
        let asked: [Vec<u64>; 3] = [order.clone(), order.iter().rev().copied().collect(), order.iter().step_by(3).copied().collect()];
        for asked in asked {
            let order = order.iter().map(|k| TileIndex(*k)).collect();
            let (mut ahead, index) = (Readahead::new(Arc::clone(&blobs), Handle::current(), order), index.clone());
            let check = move || {
                for k in asked {
                    assert_eq!(ahead.packed(&index, TileIndex(k)).unwrap(), expected(k), "tile {k}");
                    assert!(ahead.under_way.len() <= READS);
                }
            };
            tokio::task::spawn_blocking(check).await.unwrap();
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn neighbours_are_read_at_once_and_a_lost_blob_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let blobs = LocalBlobs::open(&dir.path().join("blobs"), &dir.path().join("spool")).unwrap();
        let index = chunks(&blobs).await;
        let lost = index[&TileIndex(40)].0;
        blobs.delete(lost).await.unwrap();
        let order = (0..80).map(TileIndex).collect();
        let mut ahead = Readahead::new(Arc::new(blobs), Handle::current(), order);
        assert_eq!(ahead.next(&index).unwrap().2, 0..40, "all of a chunk whose tiles lie in order");
        let check = move || {
            for k in 0..40 {
                assert_eq!(ahead.packed(&index, TileIndex(k)).unwrap(), expected(k));
            }
            for k in 40..42 {
                assert!(matches!(ahead.packed(&index, TileIndex(k)), Err(BlobError::Missing(blob)) if blob == lost));
            }
        };
        tokio::task::spawn_blocking(check).await.unwrap();
    }
}
