//! Immutable blobs, named by their content.

use bytes::Bytes;
use futures_util::stream::BoxStream;

/// Bytes as they are read.
pub type ByteStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// Why the blob store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum BlobError {
    /// No such blob.
    #[error("the blob {0} does not exist")]
    Missing(String),
}
