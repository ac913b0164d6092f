//! Pictures of finished packages, rendered from their blobs.

use super::{Engine, EngineError};
use crate::{
    blob::{BlobFile, Blobs},
    preview::{BadCamera, Light, Origin, PackageFiles, View, render},
    store::StoredPackageFile,
};
use kiln_proto::{
    format::{
        PackageHash, Sha256Hex, package_hash,
        stream::{ReadAt, ReadError, Trust},
    },
    ids::JobId,
    plan::Plan,
    scene::Scene,
};
use std::{collections::HashMap, sync::Arc};
use tokio::runtime::Handle;

/// A finished package where the coordinator keeps it.
pub struct StoredPackage {
    /// By path.
    files: HashMap<String, StoredPackageFile>,
    scene: Arc<Scene>,
    plan: Arc<Plan>,
    blobs: Arc<dyn Blobs>,
    runtime: Handle,
}

impl Engine {
    /// The hash of a finished job's package.
    ///
    /// # Errors
    /// As [`Engine::package`].
    pub async fn package_hash(&self, job: JobId) -> Result<PackageHash, EngineError> {
        let files = self.package(job).await?;
        let hashed = files.iter().map(|f| Some((f.path.as_str(), f.sha256.parse::<Sha256Hex>().ok()?)));
        let hashed: Option<Vec<_>> = hashed.collect();
        hashed.map(package_hash).ok_or_else(|| EngineError::Broken(format!("the store names a file of job {job} without its hash")))
    }

    /// A finished job's package, to be looked at.
    ///
    /// # Errors
    /// As [`Engine::package`], and a scene or plan that is gone.
    pub async fn stored_package(&self, job: JobId) -> Result<StoredPackage, EngineError> {
        let files = self.published(job).await?.into_iter().map(|stored| (stored.file.path.clone(), stored)).collect();
        let row = self.core.store.job(job).await?.ok_or_else(|| EngineError::NotFound { what: "job", id: job.to_string() })?;
        let (Some(hash), Some(plan)) = (row.scene_hash, row.plan) else {
            return Err(EngineError::Broken(format!("job {job} is done without scene or plan")));
        };
        let (scene, plan) = (self.core.scene(hash).await?, self.core.plan(&plan).await?);
        Ok(StoredPackage { files, scene, plan, blobs: Arc::clone(&self.core.blobs), runtime: Handle::current() })
    }
}

impl StoredPackage {
    /// Renders a view as a PNG; the inner error is a view that this scene does not allow. Blocks for as long as it takes: a second or two.
    ///
    /// # Errors
    /// Blobs that cannot be read or are damaged.
    pub fn picture(&self, view: &View) -> Result<Result<Vec<u8>, BadCamera>, EngineError> {
        let camera = match view.camera(&self.scene) {
            Ok(camera) => camera,
            Err(refused) => return Ok(Err(refused)),
        };
        // Blobs were hashed when they came in.
        let mut light = Light::new(self, &self.scene, &self.plan, Origin::Codec, Trust::Hashed);
        let frame = render(&self.scene, &self.plan, &mut light, &camera, view.mode)?;
        let png = frame.to_png(view.exposure);
        png.map(Ok).map_err(|e| EngineError::Broken(format!("the picture cannot be written as PNG: {e}")))
    }
}

impl PackageFiles for StoredPackage {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        let missing = || ReadError::Io { name: path.to_owned(), source: "the package has no such file".into() };
        let stored = self.files.get(path).ok_or_else(missing)?;
        Ok(Box::new(BlobFile::new(path.to_owned(), stored.blob, stored.file.bytes, Arc::clone(&self.blobs), self.runtime.clone())))
    }
}
