//! A blob as a file that is read by position, from where blocking is allowed.

use super::{BlobName, Blobs};
use kiln_proto::format::stream::{Fault, ReadAt};
use std::sync::Arc;
use tokio::runtime::Handle;

/// A blob under the name that messages call it by.
pub struct BlobFile {
    name: String,
    blob: BlobName,
    length: u64,
    blobs: Arc<dyn Blobs>,
    runtime: Handle,
}

impl BlobFile {
    /// The blob `blob` of `length` bytes. It must not be read on a thread of `runtime` that drives tasks, which would stop it.
    #[must_use]
    pub fn new(name: String, blob: BlobName, length: u64, blobs: Arc<dyn Blobs>, runtime: Handle) -> Self {
        Self { name, blob, length, blobs, runtime }
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
        let bytes = self.runtime.block_on(self.blobs.load(self.blob, Some(at..at + length), length))?;
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
            file.read_exact_at(6, &mut out).unwrap();
            let beyond = file.read_exact_at(7, &mut [0; 4]).unwrap_err().to_string();
            (out, beyond, file.read_exact_at(10, &mut []).is_ok())
        });
        let (out, beyond, nothing) = outcome.await.unwrap();
        assert_eq!((&out, nothing), (b"6789", true));
        assert!(beyond.contains("before byte 11"), "{beyond}");
    }
}
