//! Blobs as files in a local folder.
//!
//! Reading goes through `object_store`, whose interface S3 and its like share. Writing does not: an upload is already a file on this disk,
//! and renaming it costs nothing where `object_store` would copy it.

use super::{BlobError, BlobName, Blobs, ByteStream, stage};
use bytes::Bytes;
use futures_util::{StreamExt, TryStreamExt};
use object_store::{GetOptions, GetRange, ObjectStore, ObjectStoreExt, local::LocalFileSystem, path::Path as ObjectPath};
use std::{
    io::{self, Write},
    ops::Range,
    path::{Path, PathBuf},
    time::SystemTime,
};
use tempfile::{NamedTempFile, TempPath};

/// Blobs in a folder.
pub struct LocalBlobs {
    root: PathBuf,
    staging: PathBuf,
    store: LocalFileSystem,
}

impl LocalBlobs {
    /// Blobs under `root`, staged in `staging` on the same file system. Both are created when missing.
    ///
    /// # Errors
    /// Folders that cannot be created.
    pub fn open(root: &Path, staging: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(root)?;
        std::fs::create_dir_all(staging)?;
        let store = LocalFileSystem::new_with_prefix(root).map_err(io::Error::other)?;
        Ok(Self { root: root.to_owned(), staging: staging.to_owned(), store })
    }
}

fn object(name: BlobName) -> ObjectPath {
    ObjectPath::from(name.to_string())
}

fn read_error(name: BlobName, source: object_store::Error) -> BlobError {
    match source {
        object_store::Error::NotFound { .. } => BlobError::Missing(name),
        source => BlobError::Read { name: name.to_string(), source },
    }
}

/// Runs file-system work where blocking is allowed.
async fn blocking<T: Send + 'static>(what: String, work: impl FnOnce() -> io::Result<T> + Send + 'static) -> Result<T, BlobError> {
    let outcome = tokio::task::spawn_blocking(work).await.unwrap_or_else(|e| Err(io::Error::other(e)));
    outcome.map_err(|source| BlobError::write(what, source))
}

#[async_trait::async_trait]
impl Blobs for LocalBlobs {
    async fn put_file(&self, name: BlobName, file: TempPath) -> Result<(), BlobError> {
        let to = self.root.join(name.to_string());
        blocking(name.to_string(), move || stage::publish(file, &to)).await
    }

    async fn put(&self, bytes: Bytes) -> Result<BlobName, BlobError> {
        let (staging, root) = (self.staging.clone(), self.root.clone());
        blocking("a blob".into(), move || {
            let name = BlobName::of(&bytes);
            let mut file = NamedTempFile::new_in(staging)?;
            file.write_all(&bytes)?;
            stage::publish(file.into_temp_path(), &root.join(name.to_string()))?;
            Ok(name)
        })
        .await
    }

    async fn read(&self, name: BlobName, range: Option<Range<u64>>) -> Result<(u64, ByteStream), BlobError> {
        let path = object(name);
        let head = self.store.head(&path).await.map_err(|e| read_error(name, e))?;
        let range = range.map_or(0..head.size, |r| r.start.min(head.size)..r.end.min(head.size));
        if range.is_empty() {
            return Ok((0, futures_util::stream::empty().boxed()));
        }
        let length = range.end - range.start;
        let options = GetOptions { range: Some(GetRange::Bounded(range)), ..GetOptions::default() };
        let found = self.store.get_opts(&path, options).await.map_err(|e| read_error(name, e))?;
        Ok((length, found.into_stream().map_err(move |e| read_error(name, e)).boxed()))
    }

    async fn delete(&self, name: BlobName) -> Result<(), BlobError> {
        match self.store.delete(&object(name)).await {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(e) => Err(read_error(name, e)),
        }
    }

    async fn list(&self) -> Result<Vec<(BlobName, SystemTime)>, BlobError> {
        let all: Vec<_> = self.store.list(None).try_collect().await.map_err(|source| BlobError::Read { name: "(list)".into(), source })?;
        Ok(all.into_iter().filter_map(|m| Some((m.location.as_ref().parse().ok()?, m.last_modified.into()))).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blobs() -> (tempfile::TempDir, LocalBlobs) {
        let dir = tempfile::tempdir().unwrap();
        let blobs = LocalBlobs::open(&dir.path().join("blobs"), &dir.path().join("spool")).unwrap();
        (dir, blobs)
    }

    #[tokio::test]
    async fn blobs_are_named_by_content_and_read_by_range() {
        let (dir, blobs) = blobs();
        let name = blobs.put(Bytes::from_static(b"0123456789")).await.unwrap();
        assert_eq!(name, BlobName::of(b"0123456789"));
        assert_eq!(blobs.load(name, None, 100).await.unwrap(), b"0123456789");
        assert_eq!(blobs.load(name, Some(3..5), 100).await.unwrap(), b"34");
        assert_eq!(blobs.load(name, Some(8..50), 100).await.unwrap(), b"89");
        assert_eq!(blobs.load(name, Some(50..60), 100).await.unwrap(), b"");
        assert!(matches!(blobs.load(name, None, 9).await, Err(BlobError::TooLarge { found: 10, max: 9, .. })));
        assert_eq!(std::fs::read_dir(dir.path().join("spool")).unwrap().count(), 0, "nothing stays staged");
        assert_eq!(blobs.list().await.unwrap().iter().map(|b| b.0).collect::<Vec<_>>(), [name]);
    }

    #[tokio::test]
    async fn files_move_in_and_deleting_twice_is_no_error() {
        let (dir, blobs) = blobs();
        let mut file = NamedTempFile::new_in(dir.path()).unwrap();
        file.write_all(b"chunk").unwrap();
        let name = BlobName::of(b"chunk");
        blobs.put_file(name, file.into_temp_path()).await.unwrap();
        assert_eq!(blobs.load(name, None, 5).await.unwrap(), b"chunk");
        blobs.delete(name).await.unwrap();
        blobs.delete(name).await.unwrap();
        assert!(matches!(blobs.load(name, None, 5).await, Err(BlobError::Missing(n)) if n == name));
    }

    #[test]
    fn a_full_disk_is_told_apart() {
        assert!(BlobError::write("x", io::Error::from(io::ErrorKind::StorageFull)).is_full());
        assert!(!BlobError::write("x", io::Error::from(io::ErrorKind::NotFound)).is_full());
    }
}
