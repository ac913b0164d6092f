//! What every store of blobs must do, whatever it is made of. Also run by the system tests, on servers.

use super::{BlobError, BlobName, Blobs};
use bytes::Bytes;
use futures_util::TryStreamExt;
use std::{collections::BTreeSet, io::Write, path::Path, time::SystemTime};
use tempfile::{NamedTempFile, TempPath};

/// More than goes in one request, with a last part that is short.
const LARGE: usize = (17 << 20) + 12_345;

/// Runs the suite on an empty store; files are staged in `dir`.
pub(crate) async fn all(blobs: &dyn Blobs, dir: &Path) {
    blobs_are_named_by_content_and_read_by_range(blobs).await;
    an_empty_blob_is_a_blob(blobs).await;
    what_is_not_there_is_missing(blobs).await;
    files_are_stored_and_deleted(blobs, dir).await;
    large_files_come_back_whole(blobs, dir).await;
    storing_again_begins_a_new_age(blobs, dir).await;
    everything_is_listed(blobs).await;
}

fn staged(dir: &Path, bytes: &[u8]) -> TempPath {
    let mut file = NamedTempFile::new_in(dir).unwrap();
    file.write_all(bytes).unwrap();
    file.into_temp_path()
}

/// Bytes that differ at every place, so that a shifted or repeated part does not look right.
fn pattern(length: usize) -> Vec<u8> {
    (0..length as u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

async fn blobs_are_named_by_content_and_read_by_range(blobs: &dyn Blobs) {
    let name = blobs.put(Bytes::from_static(b"0123456789")).await.unwrap();
    assert_eq!(name, BlobName::of(b"0123456789"));
    let ranges = [(None, "0123456789"), (Some(3..5), "34"), (Some(8..50), "89"), (Some(4..4), ""), (Some(10..20), ""), (Some(50..60), "")];
    for (range, expected) in ranges {
        let (length, _) = blobs.read(name, range.clone()).await.unwrap();
        assert_eq!(length, expected.len() as u64, "{range:?}");
        assert_eq!(blobs.load(name, range.clone(), 100).await.unwrap(), expected.as_bytes(), "{range:?}");
    }
    assert!(matches!(blobs.load(name, None, 9).await, Err(BlobError::TooLarge { found: 10, max: 9, .. })));
}

async fn an_empty_blob_is_a_blob(blobs: &dyn Blobs) {
    let name = blobs.put(Bytes::new()).await.unwrap();
    assert_eq!(blobs.load(name, None, 0).await.unwrap(), b"");
    assert_eq!(blobs.load(name, Some(0..5), 0).await.unwrap(), b"");
    assert!(blobs.written(name).await.unwrap().is_some());
}

async fn what_is_not_there_is_missing(blobs: &dyn Blobs) {
    let name = BlobName::of(b"never stored");
    for range in [None, Some(0..5), Some(3..3)] {
        assert!(matches!(blobs.load(name, range.clone(), 5).await, Err(BlobError::Missing(n)) if n == name), "{range:?}");
    }
    assert_eq!(blobs.written(name).await.unwrap(), None);
    blobs.delete(name).await.unwrap();
}

async fn files_are_stored_and_deleted(blobs: &dyn Blobs, dir: &Path) {
    let (name, file) = (BlobName::of(b"chunk"), staged(dir, b"chunk"));
    let path = file.to_path_buf();
    blobs.put_file(name, file).await.unwrap();
    assert!(!path.exists(), "the staged file is gone");
    assert_eq!(blobs.load(name, None, 5).await.unwrap(), b"chunk");
    blobs.delete(name).await.unwrap();
    blobs.delete(name).await.unwrap();
    assert!(matches!(blobs.load(name, None, 5).await, Err(BlobError::Missing(n)) if n == name));
}

async fn large_files_come_back_whole(blobs: &dyn Blobs, dir: &Path) {
    let bytes = pattern(LARGE);
    let name = BlobName::of(&bytes);
    blobs.put_file(name, staged(dir, &bytes)).await.unwrap();
    let (length, stream) = blobs.read(name, None).await.unwrap();
    assert_eq!(length, LARGE as u64);
    let parts: Vec<Bytes> = stream.try_collect().await.unwrap();
    assert!(parts.len() > 1 && parts.iter().all(|part| part.len() <= 8 << 20), "it is never in memory as a whole");
    assert!(parts.concat() == bytes, "the bytes are those that were stored");
    let range = 4_194_300..9_000_001;
    assert!(blobs.load(name, Some(range.clone()), u64::MAX).await.unwrap() == bytes[range.start as usize..range.end as usize]);
}

async fn storing_again_begins_a_new_age(blobs: &dyn Blobs, dir: &Path) {
    let name = blobs.put(Bytes::from_static(b"aging")).await.unwrap();
    let first = blobs.written(name).await.unwrap().unwrap();
    let mut again = first;
    // Some stores keep whole seconds.
    while again == first {
        tokio::time::sleep(std::time::Duration::from_millis(200)).await;
        blobs.put_file(name, staged(dir, b"aging")).await.unwrap();
        again = blobs.written(name).await.unwrap().unwrap();
    }
    assert!(again > first);
}

async fn everything_is_listed(blobs: &dyn Blobs) {
    let before: BTreeSet<BlobName> = listed(blobs).await;
    let mut added = BTreeSet::new();
    // More than one page of the common object stores would take too long; the smallest test of order and completeness does not.
    for k in 0..20_u8 {
        added.insert(blobs.put(Bytes::from(vec![k; 3])).await.unwrap());
    }
    let expected: BTreeSet<BlobName> = before.union(&added).copied().collect();
    assert_eq!(listed(blobs).await, expected);
    for name in &added {
        blobs.delete(*name).await.unwrap();
    }
    assert_eq!(listed(blobs).await, before);
}

async fn listed(blobs: &dyn Blobs) -> BTreeSet<BlobName> {
    let all: Vec<(BlobName, SystemTime)> = blobs.list().try_collect().await.unwrap();
    let names: BTreeSet<BlobName> = all.iter().map(|(name, _)| *name).collect();
    assert_eq!(names.len(), all.len(), "each once");
    assert!(all.iter().all(|(_, written)| *written > SystemTime::UNIX_EPOCH));
    names
}
