//! Immutable blobs, named by their content: uploads, canonical scenes, plans, chunks, package files.
//!
//! A blob is written whole or not at all, never changed, and deleted only when no row of the store names it. Two writers of the same bytes
//! write the same name, so no coordination is needed. Correctness never leans on the blob store: what exists is what the store names.
//! That is also why no conditional writes are used, in which the object stores of the world differ.

#[cfg(test)]
mod conformance;
mod error;
mod local;
mod location;
mod name;
mod positioned;
mod remote;
mod setup;
mod stage;
mod upload;

pub use error::BlobError;
pub use local::LocalBlobs;
pub use location::{BadLocation, Cloud, Location};
pub use name::BlobName;
pub use positioned::BlobFile;
pub use remote::RemoteBlobs;
pub use setup::{SetupError, connect};
pub use stage::publish;

use bytes::Bytes;
use futures_util::{StreamExt, stream::BoxStream};
use std::{ops::Range, time::SystemTime};
use tempfile::TempPath;

/// Bytes as they are read.
pub type ByteStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// Blobs as they are found, each with the time it was last written.
pub type BlobList = BoxStream<'static, Result<(BlobName, SystemTime), BlobError>>;

/// A store of blobs.
#[async_trait::async_trait]
pub trait Blobs: Send + Sync + 'static {
    /// Stores a local file under the name of its content. Durable on return. Storing what is there already changes nothing but its age,
    /// which begins anew.
    async fn put_file(&self, name: BlobName, file: TempPath) -> Result<(), BlobError>;

    /// Stores bytes under their name; otherwise as [`Blobs::put_file`].
    async fn put(&self, bytes: Bytes) -> Result<BlobName, BlobError>;

    /// Reads a blob or a part of it, with the number of bytes to expect. `range` is clipped to the blob.
    async fn read(&self, name: BlobName, range: Option<Range<u64>>) -> Result<(u64, ByteStream), BlobError>;

    /// Removes a blob; one that is not there is no error.
    async fn delete(&self, name: BlobName) -> Result<(), BlobError>;

    /// Every blob, page by page: never all of them in memory. Blobs that come or go meanwhile may be among them or not.
    fn list(&self) -> BlobList;

    /// When a blob was last written; nothing where there is none.
    async fn written(&self, name: BlobName) -> Result<Option<SystemTime>, BlobError>;

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
