//! Scenes, jobs, tasks, events, packages.

use super::*;
use crate::{
    job::{Event, Job},
    records::{EventKind, JobState, PackageFile, Problem},
    store::{ChunkOutcome, StoredPackageFile, TASK_TRIES},
};
use std::collections::BTreeMap;

fn file(path: &str) -> StoredPackageFile {
    let file = PackageFile { path: path.into(), media_type: "x/y".into(), bytes: 3, sha256: "0".repeat(64) };
    StoredPackageFile { file, blob: blob(path) }
}

async fn bake_all(store: &dyn Store, job: JobId, phase: Phase, tiles: u64) {
    let lease = Grant { phase, ..grant(job, 0, tiles, NOW) };
    assert!(granted(store, &lease, NOW).await);
    let all: Vec<u64> = (0..tiles).collect();
    let outcome = store.record_chunk(&chunk(lease.token, 0, &all, ""), &BTreeMap::new(), NOW).await.unwrap();
    assert!(matches!(outcome, ChunkOutcome::Recorded(row) if row.accepted.len() == tiles));
}

pub(super) async fn a_job_runs_through_its_tasks(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 3, 0).await;
    bake_all(store, job, Phase::Probe, 3).await;
    let row = store.job(job).await.unwrap().unwrap();
    assert_eq!((row.tiles, row.cost, row.texels), ((3, 3), (30, 30), 7));
    let merged = TaskResult::Merged { phase: Phase::Probe, plan: plan("two"), tiles: 2, cost: 20, places: vec![] };
    perform(store, Task::Job(job, JobTask::Merge(Phase::Probe)), &merged).await;
    let row = store.job(job).await.unwrap().unwrap();
    assert_eq!((row.tiles, row.cost, row.plan), ((2, 0), (20, 0), Some(plan("two"))));
    assert_eq!(store.plan(plan("one").digest).await.unwrap(), Some(plan("one").blob), "a slow worker may still ask for the first plan");
    bake_all(store, job, Phase::Bake, 2).await;
    let run = TileRun { start: 1, end: 2 };
    assert_eq!(store.chunks(job, Phase::Bake, run).await.unwrap().len(), 1);
    let report = serde_json::json!({ "k": 1 });
    let assembled = TaskResult::Assembled { surface: 0, report: report.clone(), files: vec![file("surfaces/s")] };
    perform(store, Task::Job(job, JobTask::Assemble(0)), &assembled).await;
    assert_eq!(store.surface_reports(job).await.unwrap(), [report]);
    perform(store, Task::Job(job, JobTask::Publish), &TaskResult::Published(vec![file("manifest.json")])).await;
    let row = store.job(job).await.unwrap().unwrap();
    assert_eq!((row.state, row.marks.len()), (Job::Done, 6));
    assert_eq!(store.package(job).await.unwrap(), [file("manifest.json"), file("surfaces/s")]);
    assert_eq!(store.chunks(job, Phase::Bake, run).await.unwrap(), [], "segments are retired");
    assert_eq!(store.take_task(Token::random(), NOW, NOW).await.unwrap(), None);
}

pub(super) async fn jobs_wait_for_their_scene_and_fail_with_it(store: &dyn Store) {
    let (good, bad) = (scene(store).await.record.id, scene(store).await.record.id);
    let first = store.add_job(&spec(good, 0), NOW).await.unwrap();
    let second = store.add_job(&spec(bad, 0), NOW).await.unwrap();
    assert_eq!((&first.state, first.scene_hash), (&Job::Queued, None));
    let hash = SceneHash::of(b"s");
    let imported = TaskResult::Imported { scene: hash, canonical: blob("c"), statistics: statistics(), warnings: vec![] };
    perform(store, Task::Import(good), &imported).await;
    let problem = Problem { message: "no".into(), file: Some("a.obj".into()), line: Some(3) };
    perform(store, Task::Import(bad), &TaskResult::Rejected(vec![problem.clone()])).await;
    let state = async |id| store.job(id).await.unwrap().unwrap().state;
    assert_eq!(store.job(first.spec.id).await.unwrap().unwrap().scene_hash, Some(hash));
    assert_eq!(
        (state(first.spec.id).await, state(second.spec.id).await),
        (Job::Preparing, Job::Failed { problem: problem.clone(), retry: None })
    );
    let late = store.add_job(&spec(bad, 0), NOW).await.unwrap();
    assert_eq!(late.state, Job::Failed { problem, retry: None });
    assert_eq!(store.scene_by_hash(hash, crate::auth::Scope::All).await.unwrap().unwrap().record.id, good);
}

pub(super) async fn a_task_belongs_to_its_token(store: &dyn Store) {
    let id = scene(store).await.record.id;
    let (old, new) = (Token::random(), Token::random());
    assert!(store.take_task(old, NOW + 10, NOW).await.unwrap().is_some());
    assert!(store.take_task(new, NOW + 10, NOW).await.unwrap().is_none(), "it is held");
    assert!(store.renew_task(old, NOW + 20).await.unwrap());
    assert_eq!(store.expire(NOW + 19).await.unwrap().tasks, 0);
    assert_eq!(store.expire(NOW + 20).await.unwrap().tasks, 1);
    assert_eq!(store.take_task(new, NOW + 50, NOW).await.unwrap().unwrap().task, Task::Import(id));
    let failed = TaskResult::Failed(Problem::new("late"));
    assert!(!store.renew_task(old, NOW + 99).await.unwrap() && !store.finish_task(old, &failed, NOW).await.unwrap(), "the token fences");
    assert_eq!(store.scene(id).await.unwrap().unwrap().record.state, SceneState::Importing);
    assert_eq!(store.take_over_tasks(NOW).await.unwrap(), 1, "whoever knows itself alone need not wait for deadlines");
    assert!(store.take_task(old, NOW + 50, NOW).await.unwrap().is_some());
    assert!(store.put_off_task(old, "no room", NOW + 70).await.unwrap() && !store.put_off_task(old, "no room", NOW).await.unwrap());
    assert_eq!(store.take_task(new, NOW + 90, NOW + 69).await.unwrap(), None, "it is not due");
    assert_eq!(store.take_task(new, NOW + 90, NOW + 70).await.unwrap().unwrap().put_off, 1);
}

pub(super) async fn a_task_that_never_ends_fails_its_job(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = store.add_job(&spec(scene, 0), NOW).await.unwrap().spec.id;
    for _ in 0..TASK_TRIES {
        assert!(store.take_task(Token::random(), NOW + 1, NOW).await.unwrap().is_some());
        store.expire(NOW + 1).await.unwrap();
    }
    assert!(store.take_task(Token::random(), NOW + 1, NOW).await.unwrap().is_none());
    assert_eq!(store.job(job).await.unwrap().unwrap().state.public(), JobState::Failed);
}

pub(super) async fn events_are_kept_up_to_a_bound(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = store.add_job(&spec(scene, 0), NOW).await.unwrap().spec.id;
    let problem = Problem::new("p");
    store.add_problem(job, &problem, NOW + 5).await.unwrap();
    let page = store.events(job, 0, 100).await.unwrap().unwrap();
    assert!(!page.dropped && page.events.iter().map(|e| e.seq).eq([1, 2, 3]));
    assert_eq!((page.events[2].at_ms, &page.events[2].kind), (NOW + 5, &EventKind::Problem { problem }));
    assert_eq!(store.events(job, 2, 100).await.unwrap().unwrap().events.len(), 1);
    assert_eq!(store.events(job, 0, 2).await.unwrap().unwrap().events.len(), 2);
    assert!(store.events(job, 4, 100).await.unwrap().unwrap().dropped, "a number that was never given");
    assert!(store.events(JobId::random(), 0, 1).await.unwrap().is_none());
}

pub(super) async fn blobs_are_named_as_long_as_rows_name_them(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 2, 0).await;
    bake_all(store, job, Phase::Probe, 2).await;
    let chunk = store.chunks(job, Phase::Probe, TileRun { start: 0, end: 2 }).await.unwrap()[0].blob;
    for named in [blob("obj"), blob("canonical"), plan("one").blob, chunk] {
        assert!(store.names(named).await.unwrap(), "{named}");
    }
    assert!(!store.names(blob("stray")).await.unwrap());
    assert!(store.job_event(job, &Event::Cancel, NOW).await.unwrap().unwrap().is_ok());
    assert!(store.job_event(job, &Event::Cancel, NOW).await.unwrap().unwrap().is_err(), "it has ended");
    assert!(!store.names(chunk).await.unwrap() && store.names(plan("one").blob).await.unwrap());
    assert!(store.delete_job(job).await.unwrap() && !store.delete_job(job).await.unwrap());
    assert!(!store.names(plan("one").blob).await.unwrap());
    assert!(store.job_event(job, &Event::Cancel, NOW).await.unwrap().is_none());
}
