//! The end of a phase: late attempts get twins, and tiles that must be baked twice are.

use super::*;
use crate::{
    job::Job,
    lease::{Attempt, Event as LeaseEvent, Field},
    records::WorkerRecord,
    store::ChunkOutcome,
};
use kiln_proto::wire::message::Hello;
use std::collections::BTreeMap;

/// Workers that are connected.
async fn crew<const N: usize>(store: &dyn Store) -> [WorkerId; N] {
    let hello = |name: usize| Hello { name: format!("w{name}"), threads: 1, features: vec![], bake_version: 1 };
    let ids = [(); N].map(|()| WorkerId::random());
    for (n, id) in ids.iter().enumerate() {
        store.put_worker(&WorkerRecord::new(*id, &hello(n), NOW)).await.unwrap();
    }
    ids
}

/// A job all of whose tiles are baked twice.
async fn verified(store: &dyn Store, tiles: u64) -> JobId {
    let scene = ready_scene(store).await;
    open(store, JobSpec { verify: 1.0, ..spec(scene, 0) }, tiles).await
}

async fn deliver(store: &dyn Store, token: Token, tiles: &[u64], salt: &str) -> ChunkOutcome {
    store.record_chunk(&chunk(token, 0, tiles, salt), &BTreeMap::new(), NOW).await.unwrap()
}

/// A worker bakes the tiles 0 .. n.
async fn bake(store: &dyn Store, job: JobId, worker: WorkerId, tiles: u64, salt: &str) {
    let lease = Grant { worker, ..grant(job, 0, tiles, NOW) };
    assert!(granted(store, &lease, NOW).await);
    let all: Vec<u64> = (0..tiles).collect();
    assert!(matches!(deliver(store, lease.token, &all, salt).await, ChunkOutcome::Recorded(row) if row.accepted.len() == tiles));
    store.finish_attempt(lease.token, LeaseEvent::Complete, None, NOW).await.unwrap();
}

/// A worker is asked for its opinion, where it may have one, and says this.
async fn check(store: &dyn Store, job: JobId, worker: WorkerId, salt: &str) -> Option<u64> {
    let candidate = next(store).await?;
    assert_eq!((candidate.kind, candidate.job), (Kind::Check, job));
    let lease = Grant { worker, kind: Kind::Check, ..grant(job, 0, 0, NOW) };
    let run = store.grant(&[lease], NOW).await.unwrap()[0]?;
    assert!(matches!(deliver(store, lease.token, &[run.start], salt).await, ChunkOutcome::Recorded(row) if row.accepted.is_empty()));
    Some(run.start)
}

async fn row(store: &dyn Store, job: JobId) -> crate::store::JobRow {
    store.job(job).await.unwrap().unwrap()
}

pub(super) async fn a_tile_counts_when_another_worker_agrees(store: &dyn Store) {
    let (job, [a, b, c]) = (verified(store, 3).await, crew(store).await);
    bake(store, job, a, 3, "").await;
    let now = row(store, job).await;
    assert_eq!((now.tiles, now.unchecked, now.pending), ((3, 3), 3, 0));
    assert!(matches!(now.state, Job::Baking { left: 3, .. }), "{:?}", now.state);
    assert_eq!(check(store, job, a, "").await, None, "nobody checks itself");
    // Whoever is asked and leaves is no opinion.
    let lease = Grant { worker: b, kind: Kind::Check, ..grant(job, 0, 0, NOW) };
    assert_eq!(store.grant(&[lease], NOW).await.unwrap(), [Some(TileRun { start: 0, end: 1 })]);
    assert_eq!(store.claims(1).await.unwrap()[0].unasked, 2);
    store.finish_attempt(lease.token, LeaseEvent::Fail, None, NOW).await.unwrap();
    assert_eq!(store.claims(1).await.unwrap()[0].unasked, 3);
    // Who could not bake a tile is not asked about it again.
    for tile in [1, 2] {
        assert_eq!(check(store, job, b, "").await, Some(tile));
    }
    assert_eq!((check(store, job, b, "").await, check(store, job, c, "").await), (None, Some(0)));
    let now = row(store, job).await;
    assert!(matches!(now.state, Job::Baking { left: 0, .. }), "{:?}", now.state);
    assert_eq!((now.tiles, now.unchecked), ((3, 3), 0));
}

pub(super) async fn whoever_lied_is_barred_and_baked_again(store: &dyn Store) {
    let (job, [liar, b, c]) = (verified(store, 4).await, crew(store).await);
    bake(store, job, liar, 4, "lie").await;
    assert_eq!(check(store, job, b, "").await, Some(0));
    assert_eq!(row(store, job).await.tiles, (4, 4), "one word against another");
    assert_eq!(check(store, job, c, "").await, Some(0));
    let now = row(store, job).await;
    assert_eq!((now.tiles, now.pending, now.unchecked), ((4, 0), 4, 0), "all that it brought is taken back");
    assert!(store.worker(liar).await.unwrap().unwrap().barred.is_some());
    let events = store.events(job, 0, 100).await.unwrap().unwrap().events;
    let told = |text: &str| events.iter().any(|e| serde_json::to_string(&e.kind).unwrap().contains(text));
    assert!(told("is barred: two other workers agree") && told("are not to be trusted") && told("were wrong"), "{events:?}");
    let refused = Grant { worker: liar, ..grant(job, 0, 1, NOW) };
    assert_eq!(store.grant(&[refused], NOW).await.unwrap(), [None], "it gets nothing any more");
    bake(store, job, b, 4, "").await;
    for tile in 0..4 {
        assert_eq!(check(store, job, c, "").await, Some(tile));
    }
    assert!(matches!(row(store, job).await.state, Job::Baking { left: 0, .. }));
}

pub(super) async fn a_lie_about_others_is_found_too(store: &dyn Store) {
    let (job, [a, liar, c]) = (verified(store, 1).await, crew(store).await);
    bake(store, job, a, 1, "").await;
    assert_eq!(check(store, job, liar, "lie").await, Some(0));
    assert_eq!(check(store, job, c, "").await, Some(0));
    assert!(matches!(row(store, job).await.state, Job::Baking { left: 0, .. }), "the first segment was right");
    assert!(store.worker(liar).await.unwrap().unwrap().barred.is_some());
    assert!(store.worker(a).await.unwrap().unwrap().barred.is_none());
}

pub(super) async fn checks_that_nobody_can_make_are_waived(store: &dyn Store) {
    let (job, [a, b]) = (verified(store, 2).await, crew(store).await);
    bake(store, job, a, 2, "").await;
    let soon = NOW + 1_000_000;
    store.heard_workers(&[(a, soon), (b, soon)]).await.unwrap();
    assert_eq!(store.waive_checks(soon).await.unwrap(), 0, "another worker is there");
    let later = soon + 1_000_000;
    assert_eq!(store.waive_checks(later).await.unwrap(), 0, "nobody is there, and somebody may come");
    store.heard_workers(&[(a, later)]).await.unwrap();
    assert_eq!(store.waive_checks(later).await.unwrap(), 2, "only whoever baked them is left");
    assert!(matches!(row(store, job).await.state, Job::Baking { left: 0, .. }));
    assert_eq!(store.waive_checks(later).await.unwrap(), 0);
}

/// Leases of one tile that took this long, and one that is still held.
async fn one_is_late(store: &dyn Store, worker: WorkerId, ms: i64) -> (JobId, Grant) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 12, 0).await;
    for tile in 0..8 {
        let lease = Grant { worker, ..grant(job, tile, tile + 1, NOW) };
        assert!(granted(store, &lease, NOW).await);
        deliver(store, lease.token, &[tile], "").await;
        store.finish_attempt(lease.token, LeaseEvent::Complete, None, NOW + ms).await.unwrap();
    }
    let late = Grant { worker, cap: NOW + 1_000_000, deadline: NOW + 1_000_000, ..grant(job, 8, 12, NOW) };
    assert_eq!(store.late(1, NOW).await.unwrap(), [], "tiles wait");
    assert!(granted(store, &late, NOW).await);
    (job, late)
}

pub(super) async fn a_late_attempt_gets_a_twin_and_the_first_wins(store: &dyn Store) {
    let [slow, idle] = crew(store).await;
    let (job, late) = one_is_late(store, slow, 50).await;
    let found = store.late(1, NOW).await.unwrap();
    let [phase] = found.as_slice() else { panic!("{found:?}") };
    let field = Field { pending: 0, running: &phase.running, finished: &phase.finished, workers: phase.workers };
    assert_eq!((phase.finished.len(), phase.workers), (8, 2));
    // Eight took 50 ms a tile: with four tiles, an attempt is late after twice 200 ms.
    assert_eq!((field.twin(idle, NOW + 400), field.twin(slow, NOW + 401)), (None, None));
    let twin = field.twin(idle, NOW + 401).unwrap();
    assert_eq!((twin.of, twin.run), (late.token, late.run));
    let along = Grant { worker: idle, kind: Kind::Twin(twin.of), ..grant(job, 8, 12, NOW) };
    let itself = Grant { worker: slow, token: Token::random(), ..along };
    assert_eq!(store.grant(&[itself, along, Grant { token: Token::random(), ..along }], NOW).await.unwrap(), [None, Some(late.run), None]);
    assert!(matches!(deliver(store, late.token, &[8, 9], "").await, ChunkOutcome::Recorded(row) if row.accepted.len() == 2));
    assert!(matches!(deliver(store, along.token, &[10, 11], "").await, ChunkOutcome::Recorded(row) if row.accepted.len() == 2));
    for token in [late.token, along.token] {
        let state = store.attempt(token).await.unwrap().unwrap().state;
        assert!(matches!(&state, Attempt::Held { remaining, .. } if remaining.is_empty()) || state == Attempt::Fenced, "{state:?}");
    }
    assert!(matches!(row(store, job).await.state, Job::Baking { left: 0, .. }));
}

pub(super) async fn what_a_lost_twin_owed_is_still_held(store: &dyn Store) {
    let [slow, idle] = crew(store).await;
    let (job, late) = one_is_late(store, slow, 50).await;
    let along = Grant { worker: idle, kind: Kind::Twin(late.token), ..grant(job, 8, 12, NOW) };
    assert_eq!(store.grant(&[along], NOW).await.unwrap(), [Some(late.run)]);
    assert_eq!(store.expire(along.deadline).await.unwrap().attempts, 1);
    assert_eq!(row(store, job).await.pending, 0, "the late attempt has them");
    store.finish_attempt(late.token, LeaseEvent::Release, None, NOW).await.unwrap();
    assert_eq!(row(store, job).await.pending, 4);
}
