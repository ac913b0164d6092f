//! Scenes: uploads come in, canonical bytes go out.

use super::{Download, Engine, EngineError, UploadedFile, core::blocking};
use crate::{
    auth::{Scope, TokenId},
    blob::{BlobError, BlobName},
    import::BundlePath,
    records::{Problem, SceneRecord, SceneState},
    store::{SceneRow, StoredFile},
};
use kiln_proto::{
    ids::{Digest, SceneHash},
    limits,
    options::ImportOptions,
};
use std::{path::PathBuf, time::Duration};
use tempfile::TempPath;
use uuid::Uuid;

impl Engine {
    /// Stores an uploaded scene of `owner` and queues its import with these options. The files are moved, also where this fails.
    ///
    /// # Errors
    /// Options out of range, no file at all, too many, names that leave the scene's folder, or a full disk.
    pub async fn add_scene(
        &self,
        files: Vec<UploadedFile>,
        options: ImportOptions,
        owner: Option<TokenId>,
    ) -> Result<SceneRecord, EngineError> {
        let mut problems = Vec::new();
        let mut staged = Vec::with_capacity(files.len());
        for file in files {
            if let Err(bad) = BundlePath::parse(&file.name) {
                problems.push(Problem { message: bad.to_string(), file: Some(file.name.clone()), line: None });
            }
            staged.push((file.name, adopt(file.path)?));
        }
        if let Err(bad) = options.check() {
            problems.push(Problem::new(bad.to_string()));
        }
        if staged.is_empty() {
            problems.push(Problem::new("the upload holds no file"));
        }
        if staged.len() > limits::BUNDLE_FILES {
            let message = format!("the upload holds {} files; at most {} are allowed", staged.len(), limits::BUNDLE_FILES);
            problems.push(Problem::new(message));
        }
        if !problems.is_empty() {
            return Err(EngineError::Invalid(problems));
        }
        let _naming = self.core.gate.read().await;
        let mut stored = Vec::with_capacity(staged.len());
        for (name, path) in staged {
            let (path, blob) = blocking(move || blob_name(&path).map(|blob| (path, blob))).await?.map_err(unreadable)?;
            self.core.blobs.put_file(blob, path).await?;
            stored.push(StoredFile { name, blob });
        }
        let row = self.core.store.add_scene(Uuid::now_v7(), &stored, &options, owner, self.now()).await?;
        self.core.signals.tasks.notify_waiters();
        Ok(row.record)
    }

    /// A scene by the id of its upload or by its hash, of those within `scope`: what a caller may not see is not there.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn scene(&self, name: &str, scope: Scope) -> Result<SceneRecord, EngineError> {
        Ok(self.find_scene(name, scope).await?.record)
    }

    pub(super) async fn find_scene(&self, name: &str, scope: Scope) -> Result<SceneRow, EngineError> {
        let found = if let Ok(hash) = name.parse::<SceneHash>() {
            self.core.store.scene_by_hash(hash, scope).await?
        } else if let Ok(id) = name.parse::<Uuid>() {
            self.core.store.scene(id).await?.filter(|row| scope.covers(row.owner))
        } else {
            None
        };
        found.ok_or_else(|| EngineError::NotFound { what: "scene", id: name.chars().take(80).collect() })
    }

    /// The scene of an upload once it is ready or rejected, or as it is after `wait`.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn wait_for_scene(&self, id: Uuid, wait: Duration) -> Result<SceneRecord, EngineError> {
        let until = tokio::time::Instant::now() + wait;
        loop {
            let woken = self.core.signals.scenes.notified();
            tokio::pin!(woken);
            woken.as_mut().enable();
            let record = self.scene(&id.to_string(), Scope::All).await?;
            let settled = matches!(record.state, SceneState::Ready | SceneState::Rejected);
            if settled || self.core.signals.is_stopping() || tokio::time::timeout_at(until, woken).await.is_err() {
                return Ok(record);
            }
        }
    }

    /// The canonical bytes of a scene, one zstd frame.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn scene_bytes(&self, scene: SceneHash) -> Result<Download, EngineError> {
        let found = self.core.store.scene_by_hash(scene, Scope::All).await?.and_then(|s| s.canonical);
        let blob = found.ok_or_else(|| EngineError::NotFound { what: "scene", id: scene.to_string() })?;
        let (length, stream) = self.core.blobs.read(blob, None).await?;
        Ok(Download { length, stream })
    }

    /// The bytes of a plan, one zstd frame.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn plan_bytes(&self, plan: Digest) -> Result<Download, EngineError> {
        let found = self.core.store.plan(plan).await?;
        let blob = found.ok_or_else(|| EngineError::NotFound { what: "plan", id: plan.to_string() })?;
        let (length, stream) = self.core.blobs.read(blob, None).await?;
        Ok(Download { length, stream })
    }
}

fn unreadable(source: std::io::Error) -> EngineError {
    EngineError::Blob(BlobError::write("an uploaded file", source))
}

fn adopt(path: PathBuf) -> Result<TempPath, EngineError> {
    TempPath::try_from_path(path).map_err(unreadable)
}

fn blob_name(path: &std::path::Path) -> std::io::Result<BlobName> {
    let mut hasher = blake3::Hasher::new();
    std::io::copy(&mut std::fs::File::open(path)?, &mut hasher)?;
    Ok(BlobName(Digest(*hasher.finalize().as_bytes())))
}
