//! Jobs go when their time is over, with everything they hold.

use super::*;

const DAY: i64 = 24 * 3_600_000;

/// What the tidy task does, at the rig's present moment, and the collection as if all blobs were old.
async fn tidy(engine: &Engine) -> u64 {
    background::forget(&engine.core, engine.now()).await;
    background::collect(&engine.core, i64::MAX).await.unwrap()
}

#[tokio::test]
async fn a_job_goes_with_its_package_its_scene_and_its_blobs_and_others_stay() {
    let mut rig = Rig::new();
    rig.base.keep.jobs_ms = Some(30 * DAY as u64);
    let engine = rig.open().await;
    let worker = Worker::join(&engine, "w").await;
    let scene = ready_scene(&engine).await;
    let old = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    assert_eq!(worker.see_through(old).await.state, JobState::Done);
    rig.clock.fetch_add(20 * DAY, Ordering::SeqCst);
    let worker = Worker::join(&engine, "w").await;
    let young = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    worker.see_through(young).await;
    let waiting = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    // Nothing is collected while something is being prepared.
    until(&engine, waiting, JobState::Baking).await;
    rig.clock.fetch_add(10 * DAY - 1, Ordering::SeqCst);
    tidy(&engine).await;
    assert_eq!(engine.job(old).await.unwrap().state, JobState::Done, "not before its time");
    rig.clock.fetch_add(1, Ordering::SeqCst);
    tidy(&engine).await;
    assert!(matches!(engine.job(old).await, Err(EngineError::NotFound { .. })));
    assert!(matches!(engine.events(old, 0, 1).await, Err(EngineError::NotFound { .. })));
    assert!(!read_all(&engine, young, "manifest.json").await.is_empty(), "what is younger keeps its package");
    rig.clock.fetch_add(365 * DAY, Ordering::SeqCst);
    tidy(&engine).await;
    assert!(!engine.job(waiting).await.unwrap().state.is_final(), "what has not ended stays, however old");
    assert!(engine.job(young).await.is_err() && engine.scene(&scene.id.to_string(), Scope::All).await.is_ok());
    engine.cancel_job(waiting).await.unwrap();
    rig.clock.fetch_add(30 * DAY, Ordering::SeqCst);
    assert!(tidy(&engine).await > 0);
    assert!(engine.scene(&scene.id.to_string(), Scope::All).await.is_err(), "nobody uses it any more");
    assert_eq!(engine.core.blobs.list().try_collect::<Vec<_>>().await.unwrap().len(), 0, "nothing is left");
}

#[tokio::test]
async fn without_a_time_everything_is_kept_for_ever() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    engine.cancel_job(job).await.unwrap();
    rig.clock.fetch_add(10_000 * DAY, Ordering::SeqCst);
    tidy(&engine).await;
    assert!(engine.job(job).await.is_ok() && engine.scene(&scene.id.to_string(), Scope::All).await.is_ok());
}
