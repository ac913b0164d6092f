//! A blob as a file that is read by position, from where blocking is allowed.
//!
//! A picture needs thousands of small pieces that lie close together; over a network each would cost what a megabyte costs. Small reads
//! therefore fetch the page around them, and the last few pages are kept.

use super::{BlobName, Blobs};
use kiln_proto::format::stream::{Fault, ReadAt};
use std::{
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::runtime::Handle;

/// Bytes of a page. Reads of as many or more go past the pages.
const PAGE: u64 = if cfg!(test) { 4 } else { 256 << 10 };
/// Pages that a file keeps.
const PAGES: usize = 16;

/// A page by its number.
type Page = (u64, Arc<Vec<u8>>);

/// A blob under the name that messages call it by.
pub struct BlobFile {
    name: String,
    blob: BlobName,
    length: u64,
    blobs: Arc<dyn Blobs>,
    runtime: Handle,
    /// The one used last is the last.
    pages: Mutex<Vec<Page>>,
}

impl BlobFile {
    /// The blob `blob` of `length` bytes. It must not be read on a thread of `runtime` that drives tasks, which would stop it.
    #[must_use]
    pub fn new(name: String, blob: BlobName, length: u64, blobs: Arc<dyn Blobs>, runtime: Handle) -> Self {
        Self { name, blob, length, blobs, runtime, pages: Mutex::default() }
    }

    fn load(&self, range: Range<u64>) -> Result<Vec<u8>, Fault> {
        let length = range.end - range.start;
        Ok(self.runtime.block_on(self.blobs.load(self.blob, Some(range), length))?)
    }

    fn pages(&self) -> MutexGuard<'_, Vec<Page>> {
        // Nothing in it can be left half done by a panic.
        self.pages.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A page; the last one is short. Two threads that miss it at the same time both fetch it.
    fn page(&self, number: u64) -> Result<Arc<Vec<u8>>, Fault> {
        let kept = {
            let mut pages = self.pages();
            pages.iter().position(|(n, _)| *n == number).map(|at| pages.remove(at))
        };
        let page = match kept {
            Some((_, page)) => page,
            None => Arc::new(self.load(number * PAGE..(number + 1) * PAGE)?),
        };
        let mut pages = self.pages();
        pages.push((number, Arc::clone(&page)));
        if pages.len() > PAGES {
            pages.remove(0);
        }
        Ok(page)
    }

    /// Bytes at a position; fewer where the blob ends.
    fn bytes(&self, at: u64, length: u64) -> Result<Vec<u8>, Fault> {
        if length >= PAGE {
            return self.load(at..at + length);
        }
        let mut found = Vec::with_capacity(length as usize);
        let (mut next, end) = (at, at + length);
        while next < end {
            let page = self.page(next / PAGE)?;
            let from = (next % PAGE) as usize;
            let to = page.len().min(from + (end - next) as usize);
            let Some(part) = page.get(from..to).filter(|part| !part.is_empty()) else { break };
            found.extend_from_slice(part);
            next += part.len() as u64;
        }
        Ok(found)
    }
}

impl ReadAt for BlobFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn length(&self) -> u64 {
        self.length
    }

    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault> {
        let length = out.len() as u64;
        let bytes = self.bytes(at, length)?;
        if bytes.len() != out.len() {
            return Err(format!("the blob {} ends before byte {}", self.blob, at + length).into());
        }
        out.copy_from_slice(&bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{super::LocalBlobs, *};
    use bytes::Bytes;

    #[tokio::test(flavor = "multi_thread")]
    async fn parts_are_read_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let blobs: Arc<dyn Blobs> = Arc::new(LocalBlobs::open(&dir.path().join("blobs"), &dir.path().join("spool")).unwrap());
        let blob = blobs.put(Bytes::from_static(b"0123456789")).await.unwrap();
        let file = BlobFile::new("a.mtsp".into(), blob, 10, blobs, Handle::current());
        let outcome = tokio::task::spawn_blocking(move || {
            let mut out = [0; 4];
            for (at, length) in (0..10).flat_map(|at| (0..=10 - at).map(move |length| (at, length))) {
                let mut part = vec![0; length];
                file.read_exact_at(at as u64, &mut part).unwrap();
                assert_eq!(part, b"0123456789"[at..at + length], "{length} bytes at {at}");
            }
            for k in 0..3 * PAGES as u64 {
                file.page(k % 3).unwrap();
            }
            assert_eq!(file.pages().len(), 3, "each page is kept once");
            file.read_exact_at(6, &mut out).unwrap();
            let beyond = file.read_exact_at(7, &mut [0; 4]).unwrap_err().to_string();
            (out, beyond, file.read_exact_at(10, &mut []).is_ok())
        });
        let (out, beyond, nothing) = outcome.await.unwrap();
        assert_eq!((&out, nothing), (b"6789", true));
        assert!(beyond.contains("before byte 11"), "{beyond}");
    }
}
