//! What becomes of tiles and workers when attempts fail.

use super::*;
use crate::{
    job::{Event as JobEvent, Job, OnPoison},
    lease::{Attempt, BAR_AFTER, Event as LeaseEvent, SHARD_TILES},
    records::WorkerRecord,
    store::{ChunkOutcome, FinishOutcome},
};
use kiln_proto::wire::message::{Finish, Heartbeat, Hello};
use std::collections::BTreeMap;

const BEAT: Heartbeat = Heartbeat { texels_done: 0, rays: 0 };

fn failed() -> Finish {
    Finish { core_seconds: 0.0, rays: 0, peak_rss_bytes: 0, failure: Some("it ran out of memory".into()) }
}

/// A lease of whatever comes next, at most `count` tiles.
async fn lease(store: &dyn Store, job: JobId, worker: WorkerId, count: u64) -> Option<Grant> {
    let next = next(store).await.filter(|next| next.job == job)?;
    let wanted = Grant { worker, ..grant(job, next.run.start, next.run.start + count, NOW) };
    let run = store.grant(&[wanted], NOW).await.unwrap()[0]?;
    Some(Grant { run, ..wanted })
}

async fn happened(store: &dyn Store, job: JobId, event: JobEvent) {
    store.job_event(job, &event, NOW).await.unwrap().unwrap().unwrap();
}

async fn deliver(store: &dyn Store, token: Token, n: u64, tiles: &[u64]) -> u64 {
    let outcome = store.record_chunk(&chunk(token, n, tiles, ""), &BTreeMap::new(), NOW).await.unwrap();
    let ChunkOutcome::Recorded(row) = outcome else { panic!("{outcome:?}") };
    row.accepted.len()
}

pub(super) async fn a_failing_tile_is_found_by_halves_and_can_be_tried_again(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 8, 0).await;
    let (worker, mut lengths) = (WorkerId::random(), vec![]);
    // Tile 5 fails whoever bakes it.
    let problem = loop {
        let Some(held) = lease(store, job, worker, 8).await else { panic!("nothing is pending after {lengths:?}") };
        let tiles: Vec<u64> = (held.run.start..held.run.end).collect();
        if !tiles.contains(&5) {
            assert_eq!(deliver(store, held.token, 0, &tiles).await, held.run.len());
            store.finish_attempt(held.token, LeaseEvent::Complete, None, NOW).await.unwrap();
            continue;
        }
        lengths.push(held.run.len());
        let bystander = lease(store, job, worker, 1).await;
        store.finish_attempt(held.token, LeaseEvent::Fail, Some(&failed()), NOW).await.unwrap();
        let state = store.job(job).await.unwrap().unwrap().state;
        if let Some(bystander) = &bystander {
            let now = store.attempt(bystander.token).await.unwrap().unwrap().state;
            assert_eq!(now == Attempt::Fenced, state.is_final(), "{now:?}");
            store.finish_attempt(bystander.token, LeaseEvent::Release, None, NOW).await.unwrap();
        }
        if let Job::Failed { problem, retry: Some(retry) } = state {
            assert!(retry.left >= 1);
            break problem;
        }
    };
    assert_eq!(lengths[..4], [8, 4, 2, 1], "{lengths:?}");
    assert!(problem.message.contains("tile 5 of probe") && problem.message.contains("ran out of memory"), "{problem}");
    assert_eq!(next(store).await, None, "a job that failed leases nothing");
    happened(store, job, JobEvent::Retry).await;
    while let Some(held) = lease(store, job, worker, 8).await {
        let tiles: Vec<u64> = (held.run.start..held.run.end).collect();
        deliver(store, held.token, 0, &tiles).await;
        store.finish_attempt(held.token, LeaseEvent::Complete, None, NOW).await.unwrap();
    }
    let row = store.job(job).await.unwrap().unwrap();
    assert_eq!(row.tiles, (8, 8));
    assert!(matches!(row.state, Job::Baking { left: 0, .. }), "{:?}", row.state);
}

pub(super) async fn a_job_that_skips_goes_on_and_lists_its_holes(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let spec = JobSpec { on_poison: OnPoison::Skip, ..spec(scene, 0) };
    let job = store.add_job(&spec, NOW).await.unwrap().spec.id;
    // The second shard's tiles are named by their numbers in the phase.
    let tiles = SHARD_TILES + 3;
    let prepared = TaskResult::Prepared { plan: plan("one"), tiles, cost: tiles, surfaces: 1, texels: 7, warnings: vec![] };
    perform(store, Task::Job(job, JobTask::Prepare), &prepared).await;
    let (worker, bad) = (WorkerId::random(), [2, SHARD_TILES + 1]);
    let every = TileRun { start: 0, end: i64::MAX as u64 };
    let silent = Grant { run: TileRun { start: 2, end: 3 }, ..grant(job, 2, 3, NOW) };
    assert!(granted(store, &silent, NOW).await);
    assert_eq!(store.expire(NOW + 100).await.unwrap().attempts, 1);
    for tile in [2, 2, SHARD_TILES + 1, SHARD_TILES + 1, SHARD_TILES + 1] {
        assert!(!store.holes(job, Phase::Probe, every).await.unwrap().contains_key(&TileIndex(tile)));
        let single = Grant { worker, ..grant(job, tile, tile + 1, NOW) };
        assert!(granted(store, &single, NOW).await);
        store.finish_attempt(single.token, LeaseEvent::Fail, Some(&failed()), NOW).await.unwrap();
    }
    let holes = store.holes(job, Phase::Probe, every).await.unwrap();
    let expected = bad.map(|tile| {
        let workers = if tile == 2 { "2 workers" } else { "the only worker" };
        (TileIndex(tile), format!("failed 3 times on {workers}, the last time with: it ran out of memory"))
    });
    assert_eq!(holes, BTreeMap::from(expected));
    let part = |start, end| store.holes(job, Phase::Probe, TileRun { start, end });
    assert_eq!(part(2, 3).await.unwrap().len() + part(3, SHARD_TILES + 1).await.unwrap().len(), 1);
    assert_eq!(store.holes(job, Phase::Bake, every).await.unwrap().len(), 0);
    let Job::Baking { left, .. } = store.job(job).await.unwrap().unwrap().state else { panic!("a hole ended the job") };
    assert_eq!(left, tiles - 2);
    // The silent worker delivers after all: the hole is filled, and counted once.
    assert_eq!(deliver(store, silent.token, 0, &[2]).await, 1);
    assert_eq!(store.holes(job, Phase::Probe, every).await.unwrap().into_keys().collect::<Vec<_>>(), [TileIndex(bad[1])]);
    assert!(matches!(store.job(job).await.unwrap().unwrap().state, Job::Baking { left, .. } if left == tiles - 2));
    happened(store, job, JobEvent::Cancel).await;
    assert!(store.holes(job, Phase::Probe, every).await.unwrap().is_empty());
}

pub(super) async fn a_paused_job_leases_nothing_and_counts_what_comes(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 3, 0).await;
    let held = lease(store, job, WorkerId::random(), 2).await.unwrap();
    happened(store, job, JobEvent::Pause).await;
    assert_eq!(next(store).await, None);
    assert!(store.heartbeat(held.token, &BEAT, 100, NOW).await.unwrap().is_some());
    assert_eq!(deliver(store, held.token, 0, &[0, 1]).await, 2);
    assert_eq!(store.job(job).await.unwrap().unwrap().state, Job::Paused { phase: Phase::Probe, left: 1, surfaces: 1 });
    happened(store, job, JobEvent::Resume).await;
    assert_eq!(next(store).await.unwrap().run, TileRun { start: 2, end: 3 });
}

pub(super) async fn what_an_expired_attempt_delivers_is_no_debt_of_the_next(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 2, 0).await;
    let first = lease(store, job, WorkerId::random(), 2).await.unwrap();
    assert_eq!(store.expire(NOW + 100).await.unwrap().attempts, 1);
    let second = lease(store, job, WorkerId::random(), 1).await.unwrap();
    let third = lease(store, job, WorkerId::random(), 1).await.unwrap();
    assert_eq!((second.run.len(), third.run.len()), (1, 1), "halves");
    assert_eq!(deliver(store, first.token, 0, &[second.run.start]).await, 1, "late, and welcome");
    assert!(store.heartbeat(second.token, &BEAT, 100, NOW).await.unwrap().is_none(), "it owes nothing any more");
    assert_eq!(store.attempt(second.token).await.unwrap().unwrap().state, Attempt::Fenced);
    assert!(store.heartbeat(third.token, &BEAT, 100, NOW).await.unwrap().is_some());
    let ended = store.finish_attempt(second.token, LeaseEvent::Complete, None, NOW).await.unwrap();
    assert_eq!(ended, FinishOutcome::Gone("fenced".into()));
}

pub(super) async fn a_worker_that_fails_what_others_manage_is_barred(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let (weak, strong) = (WorkerId::random(), WorkerId::random());
    for id in [weak, strong] {
        let hello = Hello { name: "w".into(), threads: 1, features: vec![], bake_version: 1 };
        let worker = WorkerRecord::new(id, &hello, NOW);
        store.put_worker(&worker).await.unwrap();
    }
    for _ in 0..BAR_AFTER {
        assert_eq!(store.worker(weak).await.unwrap().unwrap().barred, None);
        let job = probing(store, scene, 1, 0).await;
        let held = lease(store, job, weak, 1).await.unwrap();
        store.finish_attempt(held.token, LeaseEvent::Fail, Some(&failed()), NOW).await.unwrap();
        assert_eq!(lease(store, job, weak, 1).await, None, "another must try it first");
        let held = lease(store, job, strong, 1).await.unwrap();
        deliver(store, held.token, 0, &[0]).await;
        store.finish_attempt(held.token, LeaseEvent::Complete, None, NOW).await.unwrap();
        happened(store, job, JobEvent::Cancel).await;
    }
    assert!(store.worker(weak).await.unwrap().unwrap().barred.is_some());
    assert_eq!(store.worker(strong).await.unwrap().unwrap().barred, None);
}
