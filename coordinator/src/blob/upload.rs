//! Sending a staged file to an object store with bounded memory.
//!
//! Small files go in one request, which an object store takes whole or not at all. Larger ones go in parts, few at a time; they exist when
//! the last request has put them together, and are given up otherwise, since parts that nobody ever puts together are paid for and seen
//! by no listing. A process that is killed on the way leaves its parts all the same; docs/storage.md says how buckets clear them away.

use bytes::Bytes;
use object_store::{Error, MultipartUpload, ObjectStore, ObjectStoreExt, PutPayload, path::Path as ObjectPath};
use std::{io, path::Path};
use tokio::{fs::File, io::AsyncReadExt, task::JoinSet};

/// Bytes of the largest file that goes in one request: a chunk does.
const SINGLE: u64 = 16 << 20;
/// Bytes of a part. Some stores want all but the last to have the same length, and none below 5 MiB.
const PART: u64 = 8 << 20;
/// S3's limit; others allow more.
const PARTS: u64 = 10_000;
/// Parts under way at the same time.
const AT_ONCE: usize = 3;

/// Bytes that sending a file of `length` holds in memory.
pub(super) fn memory(length: u64) -> u64 {
    if length <= SINGLE { length } else { part_length(length) * AT_ONCE as u64 }
}

fn part_length(length: u64) -> u64 {
    PART.max(length.div_ceil(PARTS))
}

/// Stores `file`, which has `length` bytes, at `to`. When this returns it is there with all of its bytes.
///
/// # Errors
/// What the store says, and files that cannot be read.
pub(super) async fn send(store: &dyn ObjectStore, to: &ObjectPath, file: &Path, length: u64) -> Result<(), Error> {
    let mut source = File::open(file).await.map_err(|e| unreadable(&e))?;
    if length <= SINGLE {
        let bytes = read(&mut source, length).await?;
        store.put(to, PutPayload::from(bytes)).await?;
        return Ok(());
    }
    let mut upload = store.put_multipart(to).await?;
    let sent = match parts(&mut *upload, &mut source, length).await {
        Ok(()) => upload.complete().await.map(drop),
        Err(error) => Err(error),
    };
    let Err(error) = sent else { return verify(store, to, length).await };
    // The answer to the last request may have been lost, and the repeated request met an upload that is over. Names are hashes of
    // contents: what has the name and the length is what was sent.
    if verify(store, to, length).await.is_ok() {
        return Ok(());
    }
    if let Err(left) = upload.abort().await {
        tracing::warn!(object = %to, error = %left, "parts of an upload that failed could not be removed");
    }
    Err(error)
}

async fn parts(upload: &mut dyn MultipartUpload, source: &mut File, length: u64) -> Result<(), Error> {
    let (part, mut left) = (part_length(length), length);
    // Dropping the set on the way out ends what is still under way.
    let mut sending = JoinSet::new();
    while left > 0 {
        if sending.len() == AT_ONCE {
            joined(sending.join_next().await)?;
        }
        let bytes = read(source, part.min(left)).await?;
        left -= bytes.len() as u64;
        sending.spawn(upload.put_part(PutPayload::from(bytes)));
    }
    while !sending.is_empty() {
        joined(sending.join_next().await)?;
    }
    Ok(())
}

fn joined(outcome: Option<Result<Result<(), Error>, tokio::task::JoinError>>) -> Result<(), Error> {
    outcome.unwrap_or(Ok(Ok(()))).map_err(Error::from)?
}

async fn read(source: &mut File, length: u64) -> Result<Bytes, Error> {
    let mut bytes = vec![0; length as usize]; // A part: PART bytes, or more for files above 80 GB.
    source.read_exact(&mut bytes).await.map_err(|e| unreadable(&e))?;
    Ok(Bytes::from(bytes))
}

async fn verify(store: &dyn ObjectStore, at: &ObjectPath, length: u64) -> Result<(), Error> {
    let found = store.head(at).await?.size;
    if found == length {
        return Ok(());
    }
    Err(Error::Generic { store: "upload", source: format!("{length} bytes were sent, but {found} are stored").into() })
}

fn unreadable(source: &io::Error) -> Error {
    Error::Generic { store: "upload", source: Box::new(io::Error::new(source.kind(), format!("the staged file cannot be read: {source}"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_parts_suffice() {
        assert_eq!(memory(1_000), 1_000);
        assert_eq!(memory(SINGLE), SINGLE);
        assert_eq!(memory(SINGLE + 1), PART * AT_ONCE as u64);
        for length in [SINGLE + 1, 80 << 30, 5 << 40] {
            assert!(length.div_ceil(part_length(length)) <= PARTS, "{length}");
        }
    }
}
