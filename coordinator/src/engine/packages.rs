//! Packages of finished jobs.

use super::{Download, Engine, EngineError, PackageFile};
use crate::{job::Job, store::StoredPackageFile};
use bytes::Bytes;
use kiln_proto::ids::JobId;
use std::ops::Range;

/// Bytes of a manifest that are held in memory.
const MANIFEST: u64 = 64 << 20;

impl Engine {
    /// The files of a finished job's package, by path; `manifest.json` and `report.json` are among them.
    ///
    /// # Errors
    /// [`EngineError::NotFound`], and [`EngineError::Conflict`] before the job is done.
    pub async fn package(&self, job: JobId) -> Result<Vec<PackageFile>, EngineError> {
        Ok(self.published(job).await?.into_iter().map(|stored| stored.file).collect())
    }

    /// One file of a finished job's package: its description, to decide on ETag and Range.
    ///
    /// # Errors
    /// As [`Engine::package`], and a path that the package does not have.
    pub async fn package_file(&self, job: JobId, path: &str) -> Result<PackageFile, EngineError> {
        Ok(self.stored_file(job, path).await?.file)
    }

    /// Bytes of a package file; `range` is clipped to its length.
    ///
    /// # Errors
    /// As [`Engine::package_file`].
    pub async fn read_package_file(&self, job: JobId, path: &str, range: Option<Range<u64>>) -> Result<Download, EngineError> {
        let blob = self.stored_file(job, path).await?.blob;
        let (length, stream) = self.core.blobs.read(blob, range).await?;
        Ok(Download { length, stream })
    }

    /// The manifest of a finished job's package.
    ///
    /// # Errors
    /// As [`Engine::package`].
    pub async fn manifest(&self, job: JobId) -> Result<Bytes, EngineError> {
        let blob = self.stored_file(job, "manifest.json").await?.blob;
        Ok(Bytes::from(self.core.blobs.load(blob, None, MANIFEST).await?))
    }

    async fn stored_file(&self, job: JobId, path: &str) -> Result<StoredPackageFile, EngineError> {
        let found = self.published(job).await?.into_iter().find(|stored| stored.file.path == path);
        found.ok_or_else(|| EngineError::NotFound { what: "package file", id: path.chars().take(200).collect() })
    }

    /// The files of a finished job's package with their blobs.
    pub(super) async fn published(&self, job: JobId) -> Result<Vec<StoredPackageFile>, EngineError> {
        let row = self.core.store.job(job).await?.ok_or_else(|| EngineError::NotFound { what: "job", id: job.to_string() })?;
        if row.state != Job::Done {
            return Err(EngineError::Conflict {
                what: format!("the job {job}"),
                state: row.state.name().into(),
                needed: "its package exists when it is done".into(),
            });
        }
        Ok(self.core.store.package(job).await?)
    }
}
