//! A job from upload to package, and what is said about it on the way.

use super::*;
use crate::records::EventKind;

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_becomes_a_package() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    assert_eq!(scene.statistics.as_ref().unwrap().surfaces, ["floor", "lamp"]);
    let hash = scene.scene.unwrap();
    assert_eq!(engine.scene(&hash.to_string(), Scope::All).await.unwrap().id, scene.id);
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap();
    let worker = Worker::join(&engine, "one").await;
    let done = worker.see_through(job.id).await;
    assert_eq!((done.state, done.scene), (JobState::Done, Some(hash)));
    assert!(done.progress.rays >= 2_000 && done.started_ms.is_some() && done.finished_ms.is_some());
    assert_eq!(done.progress.tiles, done.progress.tiles_done);

    let paths: Vec<String> = engine.package(job.id).await.unwrap().into_iter().map(|f| f.path).collect();
    assert_eq!(paths, ["manifest.json", "report.json", "surfaces/floor.toy", "surfaces/lamp.toy"]);
    let floor = read_all(&engine, job.id, "surfaces/floor.toy").await;
    let expected: Vec<u8> = (0..floor.len() as u64 / 16).flat_map(|t| segment(Phase::Bake, t, 0.5)).collect();
    assert_eq!(floor, expected);
    // 0.25 everywhere: two stops.
    assert!(String::from_utf8(engine.manifest(job.id).await.unwrap().to_vec()).unwrap().contains(r#""exposure":15"#));
    let part = engine.read_package_file(job.id, "surfaces/floor.toy", Some(0..3)).await.unwrap();
    assert_eq!(part.length, 3);

    let report: serde_json::Value = serde_json::from_slice(&read_all(&engine, job.id, "report.json").await).unwrap();
    assert!(report["core_seconds"].as_f64().unwrap() >= 3.0 && report["coordinator_peak_rss_bytes"].is_u64(), "{report}");
    assert_eq!(report["workers"][0]["worker"], "one");
}

#[tokio::test(flavor = "multi_thread")]
async fn events_have_no_gaps_and_end_with_the_state() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    Worker::join(&engine, "one").await.see_through(job).await;
    let page = engine.events(job, 0, 10_000).await.unwrap();
    assert!(!page.dropped && page.events.iter().map(|e| e.seq).eq(1..=page.events.len() as i64));
    let states: Vec<(JobState, Option<Phase>)> = page
        .events
        .iter()
        .filter_map(|e| if let EventKind::State { state, phase } = e.kind { Some((state, phase)) } else { None })
        .collect();
    use JobState::{Assembling, Baking, Done, Preparing, Queued};
    let expected =
        [(Queued, None), (Preparing, None), (Baking, Some(Phase::Probe)), (Baking, Some(Phase::Bake)), (Assembling, None), (Done, None)];
    assert_eq!(states, expected);
    let baked: u64 = page
        .events
        .iter()
        .filter_map(|e| {
            if let EventKind::Tiles { phase: Phase::Bake, runs, .. } = &e.kind {
                Some(runs.iter().map(|r| r.len()).sum::<u64>())
            } else {
                None
            }
        })
        .sum();
    assert_eq!(baked, engine.job(job).await.unwrap().progress.tiles);
    assert!(engine.events(job, 1_000, 10).await.unwrap().dropped, "a number from the future");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_waiting_worker_is_woken_by_work_and_by_the_end() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let worker = Worker::join(&engine, "early").await;
    assert_eq!(worker.lease_within(0).await, None);
    let waiting = tokio::spawn(async move { (worker.lease_within(25_000).await, worker) });
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let (grant, worker) = waiting.await.unwrap();
    assert_eq!(grant.unwrap().job, job);
    engine.cancel_job(job).await.unwrap();
    let waiting = tokio::spawn(async move { worker.lease_within(25_000).await });
    tokio::task::yield_now().await;
    engine.shut_down().await;
    assert_eq!(waiting.await.unwrap(), None);
    assert!(matches!(engine.ready().await, Err(EngineError::Unavailable(_))));
}

/// Sixty-four workers that will not wait at all meet on one shard: each gets a lease, since there is one for each.
#[tokio::test(flavor = "multi_thread")]
async fn no_worker_is_sent_away_while_work_is_pending() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let dense = SettingsPatch { texels_per_metre: Some(200.0), ..SettingsPatch::default() };
    let job = engine.create_job(NewJob { settings: dense, ..new_job(&scene) }, &Principal::Local).await.unwrap().id;
    let record = until(&engine, job, JobState::Baking).await;
    assert!(record.progress.tiles >= 64, "{:?}", record.progress);
    let mut workers = Vec::new();
    for k in 0..64 {
        workers.push(Worker::join(&engine, &format!("w{k}")).await);
    }
    let asked = workers.iter().map(|worker| worker.lease_within(0));
    let grants: Vec<LeaseGrant> = futures_util::future::join_all(asked).await.into_iter().flatten().collect();
    assert_eq!(grants.len(), 64);
    let tiles: std::collections::BTreeSet<u64> = grants.iter().flat_map(|grant| grant.tiles.start..grant.tiles.end).collect();
    assert_eq!(tiles.len() as u64, grants.iter().map(|grant| grant.tiles.len()).sum::<u64>(), "no tile twice");
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_cannot_work_are_refused_with_the_reason() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let says = |error: EngineError| error.to_string();
    let with = |settings: &str| NewJob { settings: serde_json::from_str(settings).unwrap(), ..new_job(&scene) };
    let refused = says(engine.create_job(with(r#"{"samples":0}"#), &Principal::Local).await.unwrap_err());
    assert!(refused.contains("samples"), "{refused}");
    let refused = says(engine.create_job(with(r#"{"texture_sizes":{"roof":"2x2"}}"#), &Principal::Local).await.unwrap_err());
    assert!(refused.contains("roof") && refused.contains("floor, lamp"), "{refused}");
    let unknown = NewJob { scene: "nothing".into(), ..new_job(&scene) };
    assert!(matches!(engine.create_job(unknown, &Principal::Local).await, Err(EngineError::NotFound { what: "scene", .. })));
    let escape = engine.spool().unwrap().into_temp_path().keep().unwrap();
    let files = vec![UploadedFile { name: "../../etc/passwd".into(), path: escape }];
    assert!(matches!(engine.add_scene(files, kiln_proto::options::ImportOptions::default(), None).await, Err(EngineError::Invalid(_))));
    assert!(matches!(engine.package(JobId::random()).await, Err(EngineError::NotFound { .. })));
    let old = Hello { bake_version: BAKE_VERSION + 1, name: "next".into(), threads: 1, features: vec![] };
    assert!(matches!(engine.hello(&old).await, Err(Refusal::Incompatible { bake_version: BAKE_VERSION, .. })));
    let stranger = LeaseRequest { worker: WorkerId::random(), wait_ms: 0 };
    assert_eq!(engine.lease(&stranger).await, Err(Refusal::UnknownWorker));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_calls_all_the_time_hears_what_became_of_it() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let worker = Worker::join(&engine, "busy").await;
    let request = LeaseRequest { worker: worker.id, wait_ms: 0 };
    assert_eq!(engine.lease(&request).await, Ok(None));
    engine.core.store.forget(0, i64::MAX).await.unwrap();
    assert_eq!(engine.lease(&request).await, Ok(None), "what was read a moment ago is believed");
    for _ in 0..2 {
        rig.clock.fetch_add(3_000, Ordering::SeqCst);
        engine.lease(&request).await.ok();
    }
    assert_eq!(engine.lease(&request).await, Err(Refusal::UnknownWorker));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rejected_scene_says_why_and_fails_its_jobs() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let record = upload(&engine, &[("bad.obj", "v 0 0 0\nf 1 2 9\n")]).await;
    let job = engine.create_job(new_job(&record), &Principal::Local).await;
    let record = engine.wait_for_scene(record.id, Duration::from_secs(30)).await.unwrap();
    assert_eq!(record.state, SceneState::Rejected);
    assert_eq!(record.problems[0].line, Some(2), "{:?}", record.problems);
    // The import may have been quicker than the job; then the job is refused with the same reason.
    match job {
        Ok(job) => assert_eq!(engine.job(job.id).await.unwrap().problem, Some(record.problems[0].clone())),
        Err(error) => assert!(matches!(error, EngineError::Invalid(_))),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn estimates_lists_and_deletion() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let estimate = engine.estimate(&new_job(&scene), &Principal::Local).await.unwrap();
    assert_eq!(estimate.surfaces["floor"], "160x160");
    assert!(estimate.tiles >= 25 && estimate.texels > 25_000 && estimate.disk_bytes > estimate.texels && estimate.seconds.is_none());
    let mut ids = vec![];
    for k in 0..3 {
        let labels = [("k".to_owned(), k.to_string())].into();
        ids.push(engine.create_job(NewJob { labels, ..new_job(&scene) }, &Principal::Local).await.unwrap().id);
    }
    ids.reverse();
    let first = engine.jobs(&JobFilter { limit: 2, ..JobFilter::default() }).await.unwrap();
    assert_eq!((first.jobs.iter().map(|j| j.id).collect::<Vec<_>>(), first.next), (ids[..2].to_vec(), Some(ids[1])));
    let rest = engine.jobs(&JobFilter { cursor: first.next, ..JobFilter::default() }).await.unwrap();
    assert_eq!((rest.jobs[0].id, rest.next), (ids[2], None));
    let labelled = engine.jobs(&JobFilter { label: Some(("k".into(), "1".into())), ..JobFilter::default() }).await.unwrap();
    assert_eq!(labelled.jobs.iter().map(|j| j.id).collect::<Vec<_>>(), [ids[1]]);
    engine.cancel_job(ids[0]).await.unwrap();
    let cancelled = engine.jobs(&JobFilter { state: Some(JobState::Cancelled), ..JobFilter::default() }).await.unwrap();
    assert_eq!(cancelled.jobs.len(), 1);
    engine.delete_job(ids[0]).await.unwrap();
    assert!(matches!(engine.job(ids[0]).await, Err(EngineError::NotFound { .. })));
    assert!(matches!(engine.delete_job(ids[0]).await, Err(EngineError::NotFound { .. })));
}
