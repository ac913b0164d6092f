//! Disks that fill up, folders that cannot be used, workers that give up.

use super::*;
use crate::store::StoreError;

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_puts_workers_off_and_loses_nothing() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "w").await;
    let grant = worker.lease().await;
    let bytes = chunk(grant.phase, &(grant.tiles.start..grant.tiles.end).collect::<Vec<_>>());
    rig.full.store(true, Ordering::SeqCst);
    assert!(matches!(worker.put(grant.token, 0, &bytes).await, Err(Refusal::Busy { .. })));
    rig.full.store(false, Ordering::SeqCst);
    worker.put(grant.token, 0, &bytes).await.unwrap();
    engine.complete(grant.token, &finish()).await.unwrap();
    assert_eq!(worker.see_through(job).await.state, JobState::Done);
}

/// Bakes until the last tile of a phase is in, with a disk that fills up behind it: what follows finds no room. How many tiles were baked.
async fn bake_until_full(rig: &Rig, engine: &Engine, worker: &Worker, job: JobId, last: Phase) -> u64 {
    let mut baked = 0;
    while !rig.full.load(Ordering::SeqCst) {
        let Some(grant) = worker.lease_within(20).await else { continue };
        let progress = engine.job(job).await.unwrap().progress;
        let tiles: Vec<u64> = (grant.tiles.start..grant.tiles.end).collect();
        let is_last = grant.phase == last && progress.tiles - progress.tiles_done == tiles.len() as u64;
        rig.full_after_next.store(is_last, Ordering::SeqCst);
        worker.put(grant.token, 0, &chunk(grant.phase, &tiles)).await.unwrap();
        baked += tiles.len() as u64;
        engine.complete(grant.token, &finish()).await.unwrap();
    }
    baked
}

/// The record of a job as soon as it says what it waits for on the disk.
async fn until_it_waits(engine: &Engine, job: JobId) -> JobRecord {
    loop {
        let record = engine.job(job).await.unwrap();
        assert!(!record.state.is_final(), "ended: {:?}", record.problem);
        if record.waiting.as_ref().is_some_and(|w| w.contains("the disk is full") && w.contains("bytes free")) {
            return record;
        }
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_waits_while_the_disk_is_full_at_the_barrier_or_at_assembly_and_bakes_nothing_twice() {
    for (phase, state) in [(Phase::Probe, JobState::Baking), (Phase::Bake, JobState::Assembling)] {
        let rig = Rig::new();
        let engine = rig.open().await;
        let scene = ready_scene(&engine).await;
        let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
        let worker = Worker::join(&engine, "w").await;
        let mut baked = bake_until_full(&rig, &engine, &worker, job, phase).await;
        assert_eq!(until_it_waits(&engine, job).await.state, state);
        // Still full when it is tried again: it waits longer, and goes on waiting.
        rig.pass(&engine, 2_000).await;
        assert_eq!(until_it_waits(&engine, job).await.state, state);
        rig.full_after_next.store(false, Ordering::SeqCst);
        rig.full.store(false, Ordering::SeqCst);
        // Time enough for what is tried again more and more seldom, and not without end: on a busy machine a merge that is under way would
        // lose its lease to this clock as often as one that kills its coordinator.
        let mut minutes = 0..10;
        while !engine.job(job).await.unwrap().state.is_final() {
            if minutes.next().is_some() {
                rig.pass(&engine, 60_000).await;
                engine.core.signals.tasks.notify_waiters();
            }
            let Some(grant) = worker.lease_within(20).await else { continue };
            baked += grant.tiles.len();
            worker.bake(&grant).await;
        }
        let done = engine.job(job).await.unwrap();
        assert_eq!((done.state, done.waiting), (JobState::Done, None), "{:?}", done.problem);
        let plan = engine.core.store.job(job).await.unwrap().unwrap().plan.unwrap();
        let plan = engine.core.plan(&plan).await.unwrap();
        assert_eq!(baked, plan.tile_count(Phase::Probe) + plan.tile_count(Phase::Bake), "nothing is baked twice");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bake_that_does_not_fit_the_disk_never_begins() {
    let rig = Rig::new();
    std::fs::create_dir_all(rig.config().data_dir).unwrap();
    let parts = Parts { pipeline: Arc::new(Toy), ..Parts::of(&rig.config()).await.unwrap() };
    let engine = Engine::open_with(Config { reserve_bytes: u64::MAX / 2, ..rig.config() }, parts).await.unwrap();
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let failed = until(&engine, job, JobState::Failed).await;
    let message = failed.problem.unwrap().message;
    assert!(message.contains("bytes are needed") && message.contains("free"), "{message}");
    assert!(matches!(engine.ready().await, Err(EngineError::NoSpace { .. })));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_attempts_keep_failing_fails_with_their_reason() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "w").await;
    let broken = Finish { failure: Some("no memory for the tree".into()), ..finish() };
    while let Some(grant) = worker.lease_within(if engine.job(job).await.unwrap().state.is_final() { 0 } else { 5_000 }).await {
        engine.release(grant.token, &broken).await.unwrap();
    }
    let record = engine.job(job).await.unwrap();
    assert_eq!(record.state, JobState::Failed);
    assert!(record.problem.unwrap().message.contains("no memory for the tree"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_in_use_is_refused_and_free_again_when_its_engine_is_gone() {
    let rig = Rig::new();
    let first = Engine::open(rig.config()).await.unwrap();
    let error = Engine::open(rig.config()).await.err().unwrap();
    assert!(matches!(&error, EngineError::Locked { .. }) && error.to_string().contains("another coordinator"), "{error}");
    drop(first);
    Engine::open(rig.config()).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_that_cannot_be_used_are_named() {
    let rig = Rig::new();
    std::fs::write(rig.dir.path().join("file"), "x").unwrap();
    let config = Config { data_dir: rig.dir.path().join("file/data"), ..rig.config() };
    let error = Engine::open(config).await.err().unwrap();
    assert!(matches!(&error, EngineError::DataFolder { .. }) && error.to_string().contains("file/data"), "{error}");

    let data = rig.config().data_dir;
    std::fs::create_dir_all(&data).unwrap();
    std::fs::write(data.join("kiln.db"), "this is no database, however long it may be ".repeat(100)).unwrap();
    let error = Engine::open(rig.config()).await.err().unwrap();
    assert!(matches!(&error, EngineError::Store(StoreError::Damaged { .. })), "{error:?}");
    let error = Engine::open(Config { tasks: 0, ..rig.config() }).await.err().unwrap();
    assert!(error.to_string().contains("tasks"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn only_blobs_that_nothing_names_are_collected() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    Worker::join(&engine, "w").await.see_through(job).await;
    let stray = engine.core.blobs.put(Bytes::from_static(b"stray")).await.unwrap();
    assert_eq!(background::collect(&engine.core, 0).await.unwrap(), 0, "young blobs stay");
    assert!(background::collect(&engine.core, i64::MAX).await.unwrap() > 1, "the stray and the chunks of the finished job go");
    assert!(engine.core.blobs.load(stray, None, 100).await.is_err());
    assert_eq!(read_all(&engine, job, "surfaces/lamp.toy").await.len() % 16, 0);
    engine.plan_bytes(engine.core.store.job(job).await.unwrap().unwrap().plan.unwrap().digest).await.unwrap();
    engine.scene_bytes(scene.scene.unwrap()).await.unwrap();
}
