//! Tiles that nobody can bake, in jobs that end without them.

use super::*;
use crate::records::EventKind;
use kiln_proto::tile::TileRuns;

/// Bakes until the job has ended, and fails every lease with a tile of `bad`.
async fn bake_but(engine: &Engine, worker: &Worker, job: JobId, bad: impl Fn(Phase, u64) -> bool) -> JobRecord {
    let broken = Finish { failure: Some("the ray never\nends".into()), ..finish() };
    loop {
        let record = engine.job(job).await.unwrap();
        if record.state.is_final() {
            return record;
        }
        let Some(grant) = worker.lease_within(20).await else { continue };
        if (grant.tiles.start..grant.tiles.end).any(|tile| bad(grant.phase, tile)) {
            engine.release(grant.token, &broken).await.unwrap();
        } else {
            worker.bake(&grant).await;
        }
    }
}

async fn problems(engine: &Engine, job: JobId) -> Vec<String> {
    let events = engine.events(job, 0, 10_000).await.unwrap().events;
    let message = |kind| if let EventKind::Problem { problem } = kind { Some(problem.message) } else { None };
    events.into_iter().filter_map(|event| message(event.kind)).collect()
}

async fn submit(engine: &Engine, on_poison: OnPoison) -> JobId {
    let scene = ready_scene(engine).await;
    let record = engine.create_job(NewJob { on_poison, ..new_job(&scene) }, &Principal::Local).await.unwrap();
    assert_eq!(record.on_poison, on_poison);
    record.id
}

/// The tiles of the lamp, which follow those of the floor.
async fn lamp(engine: &Engine, job: JobId) -> Range<u64> {
    until(engine, job, JobState::Baking).await;
    let plan = engine.core.store.job(job).await.unwrap().unwrap().plan.unwrap();
    let plan = engine.core.plan(&plan).await.unwrap();
    plan.first_tile(1).0..plan.tile_count(Phase::Bake)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_ends_with_its_holes_listed() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let job = submit(&engine, OnPoison::Skip).await;
    let worker = Worker::join(&engine, "w").await;
    let bad = lamp(&engine, job).await.start + 2;
    let done =
        bake_but(&engine, &worker, job, |phase, tile| (phase, tile) == (Phase::Bake, bad) || (phase, tile) == (Phase::Probe, 1)).await;
    assert_eq!((done.state, done.holes, done.progress.tiles_done), (JobState::Done, 1, done.progress.tiles - 1), "{:?}", done.problem);
    let manifest: serde_json::Value = serde_json::from_slice(&engine.manifest(job).await.unwrap()).unwrap();
    let reason = "failed 3 times on the only worker, the last time with: the ray never ends";
    assert_eq!(manifest["surfaces"][1]["holes"], serde_json::json!([{ "tile": 2, "reason": reason }]));
    assert_eq!(manifest["surfaces"][0]["holes"], serde_json::json!([]));
    let report: serde_json::Value = serde_json::from_slice(&read_all(&engine, job, "report.json").await).unwrap();
    assert_eq!(report["holes"], 1);
    let told = problems(&engine, job).await;
    let says = |what: &str| told.iter().any(|message| message.contains(what) && message.ends_with("the job goes on without it"));
    assert!(says("tile 1 of probe") && says(&format!("tile {bad} of bake (tile 2 of surface `lamp`)")), "{told:?}");
    // What is not there is not done, and is not answered with.
    let (phase, tiles) = engine.done_tiles(job).await.unwrap();
    assert_eq!((phase, TileRuns::all(done.progress.tiles).minus(&tiles)), (Some(Phase::Bake), [TileIndex(bad)].into_iter().collect()));
    let retry = engine.retry_job(job).await;
    assert!(matches!(&retry, Err(EngineError::Conflict { .. })), "{retry:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_leave_to_skip_the_job_fails_and_can_be_tried_again() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let job = submit(&engine, OnPoison::Fail).await;
    let worker = Worker::join(&engine, "w").await;
    let bad = lamp(&engine, job).await.start + 2;
    let failed = bake_but(&engine, &worker, job, |phase, tile| (phase, tile) == (Phase::Bake, bad)).await;
    assert_eq!((failed.state, failed.holes), (JobState::Failed, 0));
    let message = failed.problem.unwrap().message;
    assert!(message.contains("tile 2 of surface `lamp`") && message.contains("never ends; mend the cause and retry"), "{message}");
    engine.retry_job(job).await.unwrap();
    let done = worker.see_through(job).await;
    assert_eq!((done.state, done.holes), (JobState::Done, 0), "{:?}", done.problem);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_probe_without_any_tile_fails_whatever_may_be_skipped() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let job = submit(&engine, OnPoison::Skip).await;
    let worker = Worker::join(&engine, "w").await;
    let failed = bake_but(&engine, &worker, job, |phase, _| phase == Phase::Probe).await;
    let message = failed.problem.unwrap().message;
    assert_eq!(failed.state, JobState::Failed);
    assert!(message.contains("tiles of probe were given up") && message.contains("never ends"), "{message}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_surface_without_any_tile_is_named() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let job = submit(&engine, OnPoison::Skip).await;
    let worker = Worker::join(&engine, "w").await;
    let lamp = lamp(&engine, job).await;
    let tiles = lamp.end - lamp.start;
    let done = bake_but(&engine, &worker, job, |phase, tile| phase == Phase::Bake && lamp.contains(&tile)).await;
    assert_eq!((done.state, done.holes), (JobState::Done, tiles), "{:?}", done.problem);
    let told = problems(&engine, job).await;
    assert!(told.iter().any(|message| message.contains(&format!("none of the {tiles} tiles of surface `lamp`"))), "{told:?}");
    assert!(read_all(&engine, job, "surfaces/lamp.toy").await.is_empty());
}

/// A worker is silent with a tile until others have given it up, and delivers it after all.
#[tokio::test(flavor = "multi_thread")]
async fn a_hole_that_is_filled_late_is_none() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let job = submit(&engine, OnPoison::Skip).await;
    let slow = Worker::join(&engine, "slow").await;
    let late = loop {
        let grant = slow.lease().await;
        if grant.phase == Phase::Bake {
            break grant;
        }
        slow.bake(&grant).await;
    };
    // Past its deadline: its tiles wait for others, and it may still deliver. Too long to be counted among the workers.
    rig.pass(&engine, 95_000).await;
    let (quick, mut held) = (Worker::join(&engine, "quick").await, vec![]);
    let (bad, run) = (late.tiles.start, kiln_proto::tile::TileRun { start: 0, end: 1_000 });
    while engine.core.store.holes(job, Phase::Bake, run).await.unwrap().is_empty() {
        let grant = quick.lease().await;
        if (grant.tiles.start..grant.tiles.end).contains(&bad) {
            engine.release(grant.token, &Finish { failure: Some("no luck".into()), ..finish() }).await.unwrap();
        } else {
            held.push(grant);
        }
    }
    assert_eq!(engine.core.store.holes(job, Phase::Bake, run).await.unwrap().into_keys().collect::<Vec<_>>(), [TileIndex(bad)]);
    let verdict = slow.put(late.token, 0, &chunk(Phase::Bake, &[bad])).await.unwrap();
    assert_eq!(verdict.tiles, [(TileIndex(bad), Verdict::Accepted)]);
    assert!(engine.core.store.holes(job, Phase::Bake, run).await.unwrap().is_empty());
    for grant in &held {
        quick.bake(grant).await;
    }
    let done = quick.see_through(job).await;
    assert_eq!((done.state, done.holes, done.progress.tiles_done), (JobState::Done, 0, done.progress.tiles), "{:?}", done.problem);
    let manifest = String::from_utf8(engine.manifest(job).await.unwrap().to_vec()).unwrap();
    assert!(!manifest.contains("no luck"), "{manifest}");
}
