//! Request bodies: read to the end within a bound of bytes and of patience, into memory when small, into a spool file when not.
//!
//! A body that announces too much is refused before its first byte, one that lies about it as soon as it does; one that stalls for
//! [`PATIENCE`] is given up, so that a hundred silent connections do not hold a hundred spool files. What was spooled is removed with its
//! [`TempPath`], whichever way the handler ends, also when the client goes away and the handler is dropped.

use super::{
    catalogue::Kind,
    problem::{Answer, Failure},
};
use crate::engine::Engine;
use axum::{
    body::{Body, HttpBody},
    extract::multipart::MultipartError,
};
use bytes::Bytes;
use futures_util::{Stream, StreamExt};
use std::{error::Error, io, time::Duration};
use tempfile::TempPath;
use tokio::io::AsyncWriteExt;

/// How long a body may be silent.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

/// All of a small body.
///
/// # Errors
/// More than `max` bytes, an early end, a stall.
pub(super) async fn read(body: Body, max: u64) -> Answer<Vec<u8>> {
    within(&body, max)?;
    collect(&mut body.into_data_stream(), max).await
}

/// All of a small stream.
///
/// # Errors
/// As [`read`].
pub(super) async fn collect<S, E>(stream: &mut S, max: u64) -> Answer<Vec<u8>>
where
    S: Stream<Item = Result<Bytes, E>> + Unpin,
    E: Into<Interrupted>,
{
    let (mut out, mut budget) = (Vec::new(), Budget::new(max));
    while let Some(chunk) = next(stream).await? {
        budget.spend(chunk.len())?;
        out.extend_from_slice(&chunk);
    }
    Ok(out)
}

/// Refuses a body that announces more than `max` bytes.
///
/// # Errors
/// Such a body.
pub(super) fn within(body: &Body, max: u64) -> Answer<()> {
    if body.size_hint().lower() > max { Err(too_large(max)) } else { Ok(()) }
}

/// What may still come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    max: u64,
    left: u64,
}

impl Budget {
    /// At most `max` bytes.
    #[must_use]
    pub(super) fn new(max: u64) -> Self {
        Self { max, left: max }
    }

    /// Takes `bytes` from what is left.
    ///
    /// # Errors
    /// [`Kind::TooLarge`] where less is left.
    pub(super) fn spend(&mut self, bytes: usize) -> Answer<()> {
        self.left = self.left.checked_sub(bytes as u64).ok_or_else(|| too_large(self.max))?;
        Ok(())
    }
}

fn too_large(max: u64) -> Failure {
    Failure::new(Kind::TooLarge, format!("the body is larger than the {max} bytes that are allowed here"))
}

/// A body that has gone to disk.
pub(super) struct Spooled {
    /// The file; removed when dropped.
    pub path: TempPath,
    /// Its length in bytes.
    pub length: u64,
    /// Whether it begins as a ZIP archive does.
    pub zipped: bool,
}

/// A file on the data folder's disk with the bytes of `stream`.
///
/// # Errors
/// As [`read`], and a full disk.
pub(super) async fn spool<S, E>(engine: &Engine, stream: &mut S, budget: &mut Budget) -> Answer<Spooled>
where
    S: Stream<Item = Result<Bytes, E>> + Unpin,
    E: Into<Interrupted>,
{
    let (file, path) = engine.spool()?.into_parts();
    let mut file = tokio::fs::File::from_std(file);
    let (mut length, mut zipped) = (0, false);
    while let Some(chunk) = next(stream).await? {
        budget.spend(chunk.len())?;
        zipped |= length == 0 && chunk.starts_with(b"PK");
        length += chunk.len() as u64;
        file.write_all(&chunk).await.map_err(disk)?;
    }
    file.flush().await.map_err(disk)?;
    Ok(Spooled { path, length, zipped })
}

/// A failed write to the spool.
fn disk(error: io::Error) -> Failure {
    if error.kind() == io::ErrorKind::StorageFull {
        Failure::new(Kind::StorageFull, "the disk of the data folder is full").caused_by(error)
    } else {
        Failure::internal(error)
    }
}

/// The next bytes of a body.
async fn next<S, E>(stream: &mut S) -> Answer<Option<Bytes>>
where
    S: Stream<Item = Result<Bytes, E>> + Unpin,
    E: Into<Interrupted>,
{
    match tokio::time::timeout(PATIENCE, stream.next()).await {
        Ok(None) => Ok(None),
        Ok(Some(Ok(bytes))) => Ok(Some(bytes)),
        Ok(Some(Err(error))) => Err(error.into().0),
        Err(_) => Err(Failure::new(Kind::TooSlow, format!("no byte of the body arrived for {} s", PATIENCE.as_secs()))),
    }
}

/// Why a body stopped, as the problem it is.
pub(super) struct Interrupted(pub Failure);

impl From<axum::Error> for Interrupted {
    fn from(error: axum::Error) -> Self {
        Self(Failure::new(Kind::TruncatedUpload, "the connection ended before the body did").caused_by(error))
    }
}

impl From<MultipartError> for Interrupted {
    fn from(error: MultipartError) -> Self {
        let text = error.body_text();
        if error.status().as_u16() == 413 {
            return Self(Failure::new(Kind::TooLarge, "the multipart body is larger than allowed"));
        }
        let cut = ["incomplete", "failed to read stream"].iter().any(|word| text.contains(word)) || error.status().is_server_error();
        let failure = if cut {
            Failure::new(Kind::TruncatedUpload, format!("the multipart body ended early: {text}"))
        } else {
            Failure::new(Kind::InvalidRequest, format!("the multipart body cannot be read: {text}"))
        };
        Self(failure.caused_by(Box::<dyn Error + Send + Sync>::from(error)))
    }
}
