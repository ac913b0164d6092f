//! Blobs as objects of a bucket: S3, Azure, Google Cloud, or anything that `object_store` speaks to.
//!
//! Reading goes block by block, each a request of its own that is repeated when it fails. One long answer per blob would need fewer
//! requests, but a client that reads slowly would hold it open until the store, a proxy or a time-out ends it, and a download of an hour
//! would have to survive on one connection. The cost is one request per [`BLOCK`], one block ahead of the reader.

use super::{BlobError, BlobList, BlobName, Blobs, ByteStream, error::is_denied, upload};
use bytes::Bytes;
use futures_util::{StreamExt, future::ready, stream};
use object_store::{Error, GetOptions, GetRange, ObjectMeta, ObjectStore, ObjectStoreExt, PutPayload, path::Path as ObjectPath};
use std::{ops::Range, sync::Arc, time::SystemTime};
use tempfile::TempPath;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Bytes of a request.
const BLOCK: u64 = 4 << 20;
/// Blocks of a download that are fetched at the same time.
const AHEAD: usize = 2;
/// How often a deletion is tried whose answer is lost: `object_store` repeats all other requests, but not this one.
const DELETIONS: u32 = 3;
/// What uploads may hold in memory together, MiB.
const BUDGET_MIB: u32 = 64;

/// Blobs in an object store.
pub struct RemoteBlobs {
    store: Arc<dyn ObjectStore>,
    budget: Arc<Semaphore>,
}

impl RemoteBlobs {
    /// Blobs in `store`, which repeats requests that fail and may be one's own alone: every `blake3/…` in it is taken for a blob.
    #[must_use]
    pub fn new(store: Arc<dyn ObjectStore>) -> Self {
        Self { store, budget: Arc::new(Semaphore::new(BUDGET_MIB as usize)) }
    }

    /// Waits until `bytes` may be held in memory; more than all of the budget counts as all of it.
    async fn afford(&self, bytes: u64) -> Option<OwnedSemaphorePermit> {
        let mib = bytes.div_ceil(1 << 20).clamp(1, u64::from(BUDGET_MIB)) as u32;
        // The semaphore is never closed.
        Arc::clone(&self.budget).acquire_many_owned(mib).await.ok()
    }

    /// The first block of a range with the blob's length; nothing where the range begins behind the blob's end.
    async fn first(&self, path: &ObjectPath, range: Range<u64>) -> Result<(u64, Bytes), Error> {
        let start = range.start;
        match block(&*self.store, path, range).await {
            Ok(found) => Ok(found),
            Err(error @ (Error::NotFound { .. } | Error::PermissionDenied { .. } | Error::Unauthenticated { .. })) => Err(error),
            // Stores answer a range without bytes, also the one of an empty blob, with an error that `object_store` does not tell apart.
            Err(error) => match self.store.head(path).await {
                Ok(meta) if meta.size <= start => Ok((meta.size, Bytes::new())),
                _ => Err(error),
            },
        }
    }
}

pub(super) fn object(name: BlobName) -> ObjectPath {
    ObjectPath::from(name.to_string())
}

/// An entry of a listing; nothing where it is no blob.
pub(super) fn listed(found: Result<ObjectMeta, Error>) -> Option<Result<(BlobName, SystemTime), BlobError>> {
    match found {
        Ok(meta) => Some(Ok((meta.location.as_ref().parse().ok()?, meta.last_modified.into()))),
        Err(e) => Some(Err(BlobError::list(e))),
    }
}

/// When a blob was written last; nothing where there is none.
pub(super) async fn written(store: &dyn ObjectStore, name: BlobName) -> Result<Option<SystemTime>, BlobError> {
    match store.head(&object(name)).await.map_err(|e| BlobError::read(name, e)) {
        Ok(meta) => Ok(Some(meta.last_modified.into())),
        Err(BlobError::Missing(_)) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Bytes of a range, which is clipped to the object's end, with the length of the object.
async fn block(store: &dyn ObjectStore, path: &ObjectPath, range: Range<u64>) -> Result<(u64, Bytes), Error> {
    let options = GetOptions { range: Some(GetRange::Bounded(range)), ..GetOptions::default() };
    let found = store.get_opts(path, options).await?;
    let (size, length) = (found.meta.size, found.range.end - found.range.start);
    let bytes = found.bytes().await?;
    if bytes.len() as u64 == length {
        return Ok((size, bytes));
    }
    Err(Error::Generic { store: "blobs", source: format!("{length} bytes were promised, but {} came", bytes.len()).into() })
}

/// What is left of a range after its first block. Each block is fetched in a task of its own, whose time-out does not run while a slow
/// reader leaves this stream alone.
fn rest(store: Arc<dyn ObjectStore>, name: BlobName, range: Range<u64>) -> impl futures_util::Stream<Item = Result<Bytes, BlobError>> {
    let starts = stream::iter(range.clone().step_by(BLOCK as usize));
    let fetch = move |start: u64| {
        let (store, end) = (Arc::clone(&store), range.end.min(start + BLOCK));
        let fetched = tokio::spawn(async move { block(&*store, &object(name), start..end).await });
        async move {
            let (_, bytes) = fetched.await.map_err(Error::from).flatten().map_err(|e| BlobError::read(name, e))?;
            Ok(bytes)
        }
    };
    starts.map(fetch).buffered(AHEAD)
}

#[async_trait::async_trait]
impl Blobs for RemoteBlobs {
    async fn put_file(&self, name: BlobName, file: TempPath) -> Result<(), BlobError> {
        let length = tokio::fs::metadata(&file).await.map_err(|e| BlobError::write(name.to_string(), e))?.len();
        let afforded = self.afford(upload::memory(length)).await;
        let store = Arc::clone(&self.store);
        // A task of its own: who gives this up half way must not leave parts behind.
        let sent = tokio::spawn(async move {
            let sent = upload::send(&*store, &object(name), &file, length).await;
            drop((file, afforded));
            sent
        });
        sent.await.map_err(Error::from).flatten().map_err(|e| BlobError::store(name, e))
    }

    async fn put(&self, bytes: Bytes) -> Result<BlobName, BlobError> {
        let name = BlobName::of(&bytes);
        let stored = self.store.put(&object(name), PutPayload::from(bytes)).await;
        stored.map(|_| name).map_err(|e| BlobError::store(name, e))
    }

    async fn read(&self, name: BlobName, range: Option<Range<u64>>) -> Result<(u64, ByteStream), BlobError> {
        let (path, asked) = (object(name), range.unwrap_or(0..u64::MAX));
        if asked.is_empty() {
            self.store.head(&path).await.map_err(|e| BlobError::read(name, e))?;
            return Ok((0, stream::empty().boxed()));
        }
        let front = asked.start..asked.end.min(asked.start.saturating_add(BLOCK));
        let (size, bytes) = self.first(&path, front).await.map_err(|e| BlobError::read(name, e))?;
        let end = asked.end.min(size);
        let begun = asked.start + bytes.len() as u64;
        let rest = rest(Arc::clone(&self.store), name, begun..end.max(begun));
        Ok((end.saturating_sub(asked.start), stream::iter([Ok(bytes)]).chain(rest).boxed()))
    }

    async fn delete(&self, name: BlobName) -> Result<(), BlobError> {
        let mut tries = 1..=DELETIONS;
        loop {
            tries.next();
            match self.store.delete(&object(name)).await {
                Ok(()) | Err(Error::NotFound { .. }) => return Ok(()),
                Err(e) if tries.is_empty() || is_denied(&e) => return Err(BlobError::store(name, e)),
                Err(_) => {}
            }
        }
    }

    fn list(&self) -> BlobList {
        let all = self.store.list(Some(&ObjectPath::from(BlobName::FOLDER)));
        all.filter_map(|found| ready(listed(found))).boxed()
    }

    async fn written(&self, name: BlobName) -> Result<Option<SystemTime>, BlobError> {
        written(&*self.store, name).await
    }
}

#[cfg(test)]
mod tests {
    use super::{super::conformance, *};
    use futures_util::TryStreamExt;
    use object_store::{memory::InMemory, prefix::PrefixStore};

    #[tokio::test]
    async fn an_object_store_does_what_every_store_of_blobs_must() {
        let dir = tempfile::tempdir().unwrap();
        let store = PrefixStore::new(InMemory::new(), "some/prefix");
        conformance::all(&RemoteBlobs::new(Arc::new(store)), dir.path()).await;
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing stays staged");
    }

    #[tokio::test]
    async fn what_others_keep_in_the_bucket_is_not_listed() {
        let store = Arc::new(InMemory::new());
        let blobs = RemoteBlobs::new(Arc::clone(&store) as Arc<dyn ObjectStore>);
        let name = blobs.put(Bytes::from_static(b"x")).await.unwrap();
        for other in ["probe/x", "blake3/short", "other"] {
            store.put(&ObjectPath::from(other), PutPayload::from_static(b"y")).await.unwrap();
        }
        let all: Vec<_> = blobs.list().try_collect().await.unwrap();
        assert_eq!(all.iter().map(|(found, _)| *found).collect::<Vec<_>>(), [name]);
    }

    #[tokio::test]
    async fn uploads_wait_for_memory_and_the_largest_still_goes() {
        let blobs = RemoteBlobs::new(Arc::new(InMemory::new()));
        let all = blobs.afford(u64::MAX).await.unwrap();
        assert_eq!(blobs.budget.available_permits(), 0);
        drop(all);
        let _some = blobs.afford(1).await.unwrap();
        assert_eq!(blobs.budget.available_permits(), BUDGET_MIB as usize - 1);
    }
}
