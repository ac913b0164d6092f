//! Pictures of finished packages, rendered from their blobs.

use super::{Engine, EngineError};
use crate::{
    blob::{BlobFile, Blobs},
    preview::{BadCamera, Light, Origin, PackageFiles, RenderError, Stop, Stopped, View, draw},
    store::StoredPackageFile,
};
use image::ImageError;
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

/// Triangles of a scene that pictures are made of here, at most. Each takes some 200 bytes and a microsecond for every picture: at the
/// limit that is most of a gigabyte and four seconds, which is as much as other work should have to bear.
const TRIANGLES: usize = 4_000_000;

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

/// Why a package gives no picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// A view that this scene does not allow.
    #[error(transparent)]
    View(#[from] BadCamera),
    /// More than a coordinator draws beside its other work.
    #[error("the scene has {found} triangles, and pictures are made here of at most {TRIANGLES}; fetch the package and use `kiln render`")]
    SceneTooLarge {
        /// Triangles of the scene.
        found: usize,
    },
    /// It was given up.
    #[error(transparent)]
    Stopped(Stopped),
    /// Blobs that cannot be read or are damaged.
    #[error("the package cannot be read")]
    Package(#[source] ReadError),
    /// The encoder.
    #[error("the picture cannot be written as PNG")]
    Png(#[from] ImageError),
}

impl From<RenderError> for PictureError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Read(error) => Self::Package(error),
            RenderError::Stopped(stopped) => Self::Stopped(stopped),
        }
    }
}

fn check_size(triangles: usize) -> Result<(), PictureError> {
    if triangles > TRIANGLES { Err(PictureError::SceneTooLarge { found: triangles }) } else { Ok(()) }
}

impl StoredPackage {
    /// Draws a view as a PNG. Blocks for as long as it takes: a second or two, or until `stop` says so.
    ///
    /// # Errors
    /// Views that cannot be, scenes that are too large, blobs that cannot be read or are damaged, and pictures that were given up.
    pub fn picture(&self, view: &View, stop: &Stop) -> Result<Vec<u8>, PictureError> {
        check_size(self.scene.surfaces.iter().map(|surface| surface.triangles.len()).sum())?;
        let camera = view.camera(&self.scene)?;
        // Blobs were hashed when they came in.
        let mut light = Light::new(self, &self.scene, &self.plan, Origin::Codec, Trust::Hashed);
        Ok(draw(&self.scene, &self.plan, &mut light, &camera, view, stop)?.to_png()?)
    }
}

impl PackageFiles for StoredPackage {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        let missing = || ReadError::Io { name: path.to_owned(), source: "the package has no such file".into() };
        let stored = self.files.get(path).ok_or_else(missing)?;
        Ok(Box::new(BlobFile::new(path.to_owned(), stored.blob, stored.file.bytes, Arc::clone(&self.blobs), self.runtime.clone())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_above_the_limit_are_refused_with_both_numbers() {
        assert!(check_size(TRIANGLES).is_ok());
        let error = check_size(TRIANGLES + 1).unwrap_err().to_string();
        assert!(error.contains("4000001") && error.contains("4000000"), "{error}");
    }
}
