//! Blobs as files in a local folder.
//!
//! Reading goes through `object_store`, whose interface S3 and its like share. Writing does not: an upload is already a file on this disk,
//! and renaming it costs nothing where `object_store` would copy it.

use super::{
    BlobError, BlobList, BlobName, Blobs, ByteStream,
    remote::{self, listed, object},
    stage,
};
use bytes::Bytes;
use futures_util::{StreamExt, TryStreamExt, future::ready};
use object_store::{GetOptions, GetRange, ObjectStore, ObjectStoreExt, local::LocalFileSystem};
use std::{
    fs::File,
    io::{self, Write},
    ops::Range,
    os::unix::fs::MetadataExt,
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
    /// Blobs under `root`, staged in `staging` on the same file system. Both are created when missing. Files that come from another file
    /// system are copied.
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

/// Moves a file to `to`, by way of `staging` where it lies on another file system, from which nothing can be renamed.
fn take_in(file: TempPath, to: &Path, staging: &Path) -> io::Result<()> {
    if std::fs::metadata(&file)?.dev() == std::fs::metadata(staging)?.dev() {
        return stage::publish(file, to);
    }
    copy_in(&file, to, staging)
}

fn copy_in(file: &Path, to: &Path, staging: &Path) -> io::Result<()> {
    let mut copy = NamedTempFile::new_in(staging)?;
    io::copy(&mut File::open(file)?, &mut copy)?;
    stage::publish(copy.into_temp_path(), to)
}

/// Runs file-system work where blocking is allowed.
async fn blocking<T: Send + 'static>(what: String, work: impl FnOnce() -> io::Result<T> + Send + 'static) -> Result<T, BlobError> {
    let outcome = tokio::task::spawn_blocking(work).await.unwrap_or_else(|e| Err(io::Error::other(e)));
    outcome.map_err(|source| BlobError::write(what, source))
}

#[async_trait::async_trait]
impl Blobs for LocalBlobs {
    async fn put_file(&self, name: BlobName, file: TempPath) -> Result<(), BlobError> {
        let (to, staging) = (self.root.join(name.to_string()), self.staging.clone());
        blocking(name.to_string(), move || take_in(file, &to, &staging)).await
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
        let head = self.store.head(&path).await.map_err(|e| BlobError::read(name, e))?;
        let range = range.map_or(0..head.size, |r| r.start.min(head.size)..r.end.min(head.size));
        if range.is_empty() {
            return Ok((0, futures_util::stream::empty().boxed()));
        }
        let length = range.end - range.start;
        let options = GetOptions { range: Some(GetRange::Bounded(range)), ..GetOptions::default() };
        let found = self.store.get_opts(&path, options).await.map_err(|e| BlobError::read(name, e))?;
        Ok((length, found.into_stream().map_err(move |e| BlobError::read(name, e)).boxed()))
    }

    async fn delete(&self, name: BlobName) -> Result<(), BlobError> {
        match self.store.delete(&object(name)).await {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(e) => Err(BlobError::store(name, e)),
        }
    }

    fn list(&self) -> BlobList {
        self.store.list(None).filter_map(|found| ready(listed(found))).boxed()
    }

    async fn written(&self, name: BlobName) -> Result<Option<SystemTime>, BlobError> {
        remote::written(&self.store, name).await
    }
}

#[cfg(test)]
mod tests {
    use super::{super::conformance, *};

    fn blobs() -> (tempfile::TempDir, LocalBlobs) {
        let dir = tempfile::tempdir().unwrap();
        let blobs = LocalBlobs::open(&dir.path().join("blobs"), &dir.path().join("spool")).unwrap();
        (dir, blobs)
    }

    #[tokio::test]
    async fn a_folder_does_what_every_store_of_blobs_must() {
        let (dir, blobs) = blobs();
        conformance::all(&blobs, dir.path()).await;
        assert_eq!(std::fs::read_dir(dir.path().join("spool")).unwrap().count(), 0, "nothing stays staged");
    }

    #[tokio::test]
    async fn a_file_of_another_file_system_is_copied() {
        let (dir, blobs) = blobs();
        let (name, from) = (BlobName::of(b"far"), dir.path().join("far"));
        std::fs::write(&from, b"far").unwrap();
        copy_in(&from, &blobs.root.join(name.to_string()), &blobs.staging).unwrap();
        assert_eq!(blobs.load(name, None, 3).await.unwrap(), b"far");
        assert_eq!(std::fs::read_dir(&blobs.staging).unwrap().count(), 0);
    }
}
