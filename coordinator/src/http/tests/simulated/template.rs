//! The folder that every schedule begins with: a scene that is imported and a job that waits for workers. Made once, copied for each.
//!
//! Importing and planning would take most of a schedule's time, and nothing of them depends on the network.

use super::store::InPlace;
use crate::{
    auth::Principal,
    blob::LocalBlobs,
    config::{Config, LeaseConfig},
    engine::{
        Engine, Parts,
        tests::{Toy, new_job, ready_scene, until},
    },
    records::JobState,
};
use kiln_proto::ids::JobId;
use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};
use tempfile::TempDir;

/// When simulated time begins, milliseconds.
pub(super) const EPOCH: i64 = 1_000_000;

/// Enough for some twenty tiles in each phase.
const TEXELS_PER_METRE: f32 = 30.0;

/// A data folder with a job in it.
pub(super) struct Template {
    folder: TempDir,
    pub(super) job: JobId,
}

/// A folder in memory where the system has such: how long a disk takes to flush is no part of a simulation, and took most of its time.
pub(super) fn folder() -> TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// Opens an engine, as any life of the coordinator does. Leases are short, so that they run out within the faults of a schedule.
pub(super) async fn engine(data: &Path, store: Arc<InPlace>, clock: Arc<AtomicI64>) -> Arc<Engine> {
    let times =
        LeaseConfig { ttl_ms: 5_000, heartbeat_ms: 2_500, target_ms: 3_000, hard_cap_ms: 60_000, poll_ms: 5_000, ..LeaseConfig::default() };
    let config = Config { data_dir: data.to_owned(), reserve_bytes: 0, lease: times, tasks: 1, ..Config::default() };
    let parts = Parts {
        store,
        blobs: Arc::new(LocalBlobs::open(&data.join("blobs"), &data.join("staging")).unwrap()),
        pipeline: Arc::new(Toy),
        clock: Arc::new(move || clock.load(Ordering::SeqCst)),
    };
    Engine::open_with(config, parts).await.unwrap()
}

impl Template {
    pub(super) fn new() -> Self {
        let folder = folder();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let store = Arc::new(InPlace::open(folder.path()));
        let job = runtime.block_on(async {
            let engine = engine(folder.path(), Arc::clone(&store), Arc::new(AtomicI64::new(EPOCH))).await;
            let scene = ready_scene(&engine).await;
            let mut new = new_job(&scene);
            new.settings.texels_per_metre = Some(TEXELS_PER_METRE);
            let job = engine.create_job(new, &Principal::Local).await.unwrap().id;
            until(&engine, job, JobState::Baking).await;
            engine.shut_down().await;
            job
        });
        store.close();
        Self { folder, job }
    }

    pub(super) fn folder(&self) -> &Path {
        self.folder.path()
    }
}

/// Makes `to` what `from` is.
pub(super) fn copy(from: &Path, to: &Path) {
    if to.exists() {
        fs::remove_dir_all(to).unwrap();
    }
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}
