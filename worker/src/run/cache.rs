//! Scenes and plans that the worker holds: one of each, the ones in use. A farm bakes one job after another, and the next lease nearly
//! always names the same scene; a larger cache would hold memory that tracing needs.

use super::thread;
use crate::{
    capture::Capture,
    client::session::{CallError, Session},
    scene::BakeScene,
    simd::Simd,
};
use kiln_proto::{
    BAKE_VERSION,
    ids::{Digest, SceneHash},
    plan::{Plan, PlanError},
    scene::{Scene, SceneError},
    wire::message::LeaseGrant,
};
use std::sync::Arc;

/// Why what a lease names cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum CacheError {
    #[error("what the lease needs cannot be fetched")]
    Fetch(#[from] CallError),
    #[error("the scene cannot be used")]
    Scene(#[from] SceneError),
    #[error("the plan cannot be used")]
    Plan(#[from] PlanError),
    #[error("the scene cannot be prepared")]
    Prepare(#[source] Box<dyn std::error::Error + Send + Sync>),
    #[error("the plan belongs to scene {scene} and bake version {bake_version}, not to this lease")]
    Foreign { scene: SceneHash, bake_version: u32 },
    #[error("preparing the scene was interrupted")]
    Interrupted(#[from] thread::Lost),
}

/// The scene and the plan in use.
pub(super) struct Cache {
    simd: Simd,
    scene: Option<(SceneHash, Arc<BakeScene>)>,
    capture: Option<(Digest, Arc<Capture>)>,
}

impl Cache {
    pub(super) fn new(simd: Simd) -> Self {
        Self { simd, scene: None, capture: None }
    }

    /// What it takes to bake the tiles of `grant`.
    pub(super) async fn capture(&mut self, session: &Session, grant: &LeaseGrant) -> Result<Arc<Capture>, CacheError> {
        if let Some((digest, capture)) = &self.capture
            && *digest == grant.plan
        {
            return Ok(capture.clone());
        }
        let scene = self.scene(session, grant.scene).await?;
        let plan = session.plan(grant.plan).await?;
        let hash = grant.scene;
        let capture = thread::off("scene", move || -> Result<_, CacheError> {
            let plan = Arc::new(Plan::from_bytes(&plan)?);
            if plan.scene != hash || plan.bake_version != BAKE_VERSION {
                return Err(CacheError::Foreign { scene: plan.scene, bake_version: plan.bake_version });
            }
            Ok(Arc::new(Capture::new(scene, plan).map_err(|e| CacheError::Prepare(Box::new(e)))?))
        })
        .await??;
        self.capture = Some((grant.plan, capture.clone()));
        Ok(capture)
    }

    async fn scene(&mut self, session: &Session, hash: SceneHash) -> Result<Arc<BakeScene>, CacheError> {
        if let Some((held, scene)) = &self.scene
            && *held == hash
        {
            return Ok(scene.clone());
        }
        // The old scene goes before the new one comes: both may be large.
        (self.scene, self.capture) = (None, None);
        let bytes = session.scene(hash).await?;
        let simd = self.simd;
        let scene = thread::off("scene", move || -> Result<_, CacheError> {
            let scene = Scene::from_bytes(&bytes)?;
            Ok(Arc::new(BakeScene::new(scene, simd).map_err(|e| CacheError::Prepare(Box::new(e)))?))
        })
        .await??;
        self.scene = Some((hash, scene.clone()));
        Ok(scene)
    }
}
