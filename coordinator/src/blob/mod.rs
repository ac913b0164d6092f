//! Immutable blobs, named by their content: uploads, canonical scenes, plans, chunks, package files.
//!
//! A blob is written whole or not at all, never changed, and deleted only when no row of the store names it. Two writers of the same bytes
//! write the same name, so no coordination is needed. Correctness never leans on the blob store: what exists is what the store names.

mod local;
mod name;
mod positioned;
mod stage;

pub use local::LocalBlobs;
pub use name::BlobName;
pub use positioned::BlobFile;
pub use stage::publish;

use bytes::Bytes;
use futures_util::{StreamExt, stream::BoxStream};
use std::{ops::Range, time::SystemTime};
use tempfile::TempPath;

/// Bytes as they are read.
pub type ByteStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// Why the blob store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum BlobError {
    /// No such blob.
    #[error("the blob {0} does not exist")]
    Missing(BlobName),
    /// The disk is full.
    #[error("the disk is full: {0} could not be written")]
    Full(String),
    /// More bytes than the caller is ready to hold.
    #[error("the blob {name} has {found} bytes; at most {max} are expected")]
    TooLarge {
        /// The blob.
        name: BlobName,
        /// Its length.
        found: u64,
        /// What was allowed.
        max: u64,
    },
    /// A file could not be written or moved.
    #[error("{what} could not be written")]
    Write {
        /// Which.
        what: String,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The object store failed.
    #[error("the blob {name} could not be read")]
    Read {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: object_store::Error,
    },
}

impl BlobError {
    /// Whether room on the disk is what is missing.
    #[must_use]
    pub fn is_full(&self) -> bool {
        matches!(self, BlobError::Full(_))
    }

    /// A failed write; a full disk is told apart.
    #[must_use]
    pub fn write(what: impl Into<String>, source: std::io::Error) -> Self {
        let what = what.into();
        if Self::no_room(&source) { BlobError::Full(what) } else { BlobError::Write { what, source } }
    }

    /// Whether a file could not be written because the disk, or this user's part of it, is full.
    #[must_use]
    pub fn no_room(source: &std::io::Error) -> bool {
        matches!(source.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded | std::io::ErrorKind::FileTooLarge)
    }
}

/// A store of blobs.
#[async_trait::async_trait]
pub trait Blobs: Send + Sync + 'static {
    /// Stores a local file under the name of its content. Durable on return. Storing what is there already is a no-op that refreshes its
    /// age.
    async fn put_file(&self, name: BlobName, file: TempPath) -> Result<(), BlobError>;

    /// Stores bytes under their name; otherwise as [`Blobs::put_file`].
    async fn put(&self, bytes: Bytes) -> Result<BlobName, BlobError>;

    /// Reads a blob or a part of it, with the number of bytes to expect. `range` is clipped to the blob.
    async fn read(&self, name: BlobName, range: Option<Range<u64>>) -> Result<(u64, ByteStream), BlobError>;

    /// Removes a blob; one that is not there is no error.
    async fn delete(&self, name: BlobName) -> Result<(), BlobError>;

    /// Every blob with the time it was last written.
    async fn list(&self) -> Result<Vec<(BlobName, SystemTime)>, BlobError>;

    /// A whole blob, or a range of it, in memory.
    async fn load(&self, name: BlobName, range: Option<Range<u64>>, max: u64) -> Result<Vec<u8>, BlobError> {
        let (length, mut stream) = self.read(name, range).await?;
        if length > max {
            return Err(BlobError::TooLarge { name, found: length, max });
        }
        let mut bytes = Vec::with_capacity(length as usize);
        while let Some(part) = stream.next().await {
            bytes.extend_from_slice(&part?);
        }
        Ok(bytes)
    }
}
