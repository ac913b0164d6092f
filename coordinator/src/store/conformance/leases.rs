//! Leases and chunks.

use super::*;
use crate::{
    lease::{Attempt, Event as LeaseEvent, SHARD_TILES},
    store::{ChunkOutcome, FinishOutcome},
};
use kiln_proto::wire::message::Heartbeat;
use std::collections::BTreeMap;

const BEAT: Heartbeat = Heartbeat { texels_done: 0, rays: 5 };

pub(super) async fn a_run_is_granted_once(store: &dyn Store) {
    let scene = ready_scene(store).await;
    assert_eq!(next(store).await, None);
    let job = probing(store, scene, SHARD_TILES + 10, 0).await;
    assert_eq!(store.claims(2).await.unwrap(), [], "workers of another bake version get nothing");
    let first = next(store).await.unwrap();
    assert_eq!((first.job, first.run, first.pending), (job, TileRun { start: 0, end: SHARD_TILES }, SHARD_TILES + 10));
    let lease = grant(job, 0, 4, NOW);
    assert!(granted(store, &lease, NOW).await);
    assert_eq!(next(store).await.unwrap().run.start, 4);
    // Who comes for the same run gets what is left beside it, or nothing where the shard has no more.
    let run = |start, end| Some(TileRun { start, end });
    let late = [grant(job, 0, 4, NOW), grant(job, SHARD_TILES, SHARD_TILES + 11, NOW), grant(job, SHARD_TILES, SHARD_TILES + 1, NOW)];
    let got = store.grant(&late, NOW).await.unwrap();
    assert_eq!(got, [run(4, 8), run(SHARD_TILES, SHARD_TILES + 10), None]);
    assert_eq!(store.attempt(late[2].token).await.unwrap(), None);
    for lease in &late[..2] {
        store.finish_attempt(lease.token, LeaseEvent::Release, None, NOW).await.unwrap();
    }
    let row = store.attempt(lease.token).await.unwrap().unwrap();
    assert_eq!((row.run, row.worker, row.granted_ms), (lease.run, lease.worker, NOW));
    let figures = store.figures().await.unwrap();
    assert_eq!((figures.tiles_pending, figures.tiles_leased, figures.attempts_held), (SHARD_TILES + 6, 4, 1));
}

pub(super) async fn priority_then_age_decides(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let old = probing(store, scene, 1, 0).await;
    let young = probing(store, scene, 1, 0).await;
    let urgent = probing(store, scene, 1, 5).await;
    for expected in [urgent, old, young] {
        let next = next(store).await.unwrap();
        assert_eq!(next.job, expected);
        assert!(granted(store, &grant(next.job, 0, 1, NOW), NOW).await);
    }
    assert_eq!(next(store).await, None);
}

pub(super) async fn expiry_returns_what_is_owed_and_takes_late_chunks(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 6, 0).await;
    let lease = grant(job, 0, 6, NOW);
    assert!(granted(store, &lease, NOW).await);
    store.record_chunk(&chunk(lease.token, 0, &[1], ""), &BTreeMap::new(), NOW).await.unwrap();
    assert!(store.heartbeat(lease.token, &BEAT, 100, NOW + 50).await.unwrap().is_some());
    assert_eq!(store.expire(NOW + 149).await.unwrap().attempts, 0, "the heartbeat moved the deadline");
    assert_eq!(store.expire(NOW + 150).await.unwrap().attempts, 1);
    assert!(store.heartbeat(lease.token, &BEAT, 100, NOW + 151).await.unwrap().is_none());
    assert_eq!(next(store).await.unwrap().pending, 5);
    let late = store.record_chunk(&chunk(lease.token, 1, &[2, 3], ""), &BTreeMap::new(), NOW + 160).await.unwrap();
    assert!(matches!(late, ChunkOutcome::Recorded(row) if row.accepted.len() == 2));
    assert_eq!(next(store).await.unwrap().pending, 3);
    let finished = store.finish_attempt(lease.token, LeaseEvent::Complete, None, NOW + 170).await.unwrap();
    assert_eq!(finished, FinishOutcome::Gone("expired".into()));
    assert_eq!(store.job(job).await.unwrap().unwrap().rays, 5, "what the lost worker said of itself is kept");
}

pub(super) async fn a_repeated_chunk_changes_nothing(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 3, 0).await;
    let lease = grant(job, 0, 3, NOW);
    assert!(granted(store, &lease, NOW).await);
    let (one, none) = (chunk(lease.token, 0, &[0, 1], ""), BTreeMap::new());
    let first = store.record_chunk(&one, &none, NOW).await.unwrap();
    let before = store.events(job, 0, 100).await.unwrap();
    assert_eq!(store.record_chunk(&one, &none, NOW + 1).await.unwrap(), first);
    assert_eq!(store.events(job, 0, 100).await.unwrap(), before);
    // Other chunks with the same tiles need digests, which come from the chunk that was accepted.
    let (same, other) = (chunk(lease.token, 1, &[1], ""), chunk(lease.token, 2, &[0, 1], "x"));
    let ChunkOutcome::NeedDigests(found) = store.record_chunk(&same, &none, NOW).await.unwrap() else { panic!("digests are not kept") };
    assert_eq!(found[0].blob, one.blob);
    assert_eq!(store.chunk(lease.token, 1).await.unwrap(), None, "nothing was recorded");
    let known: BTreeMap<_, _> = one.tiles.iter().map(|t| (t.tile, t.digest)).collect();
    let sorted = async |c: &NewChunk| match store.record_chunk(c, &known, NOW).await.unwrap() {
        ChunkOutcome::Recorded(row) => (row.accepted.len(), row.conflicts.len()),
        other => panic!("{other:?}"),
    };
    assert_eq!((sorted(&same).await, sorted(&other).await), ((0, 0), (0, 2)));
    let finished = store.finish_attempt(lease.token, LeaseEvent::Complete, None, NOW).await.unwrap();
    assert!(matches!(finished, FinishOutcome::Finished(row) if row.state == Attempt::Released), "tile 2 is owed");
    assert_eq!(next(store).await.unwrap().run, TileRun { start: 2, end: 3 });
    let refused = store.record_chunk(&chunk(lease.token, 3, &[2], ""), &none, NOW).await.unwrap();
    assert_eq!(refused, ChunkOutcome::Gone("released".into()));
}

pub(super) async fn conflicts_blame_whoever_brought_the_tile(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 5, 0).await;
    let (outer, inner, late) = (grant(job, 0, 5, NOW - 100), grant(job, 0, 5, NOW), grant(job, 0, 5, NOW));
    let none = BTreeMap::new();
    // The outer chunk reaches across the tile that the inner one brings.
    assert!(granted(store, &outer, NOW - 100).await);
    store.expire(NOW).await.unwrap();
    store.record_chunk(&chunk(outer.token, 0, &[0, 4], ""), &none, NOW).await.unwrap();
    let inner = Grant { run: TileRun { start: 1, end: 4 }, ..inner };
    assert!(granted(store, &inner, NOW).await);
    let two = chunk(inner.token, 0, &[2], "");
    store.record_chunk(&two, &none, NOW).await.unwrap();
    store.finish_attempt(inner.token, LeaseEvent::Release, None, NOW).await.unwrap();
    let late = Grant { run: TileRun { start: 3, end: 4 }, ..late };
    assert!(granted(store, &late, NOW).await);
    let known = BTreeMap::from([(two.tiles[0].tile, two.tiles[0].digest)]);
    store.record_chunk(&chunk(late.token, 0, &[2], "x"), &known, NOW).await.unwrap();
    let events = store.events(job, 0, 100).await.unwrap().unwrap().events;
    let said = |e: &crate::records::JobEvent| format!("{:?}", e.kind);
    let blamed = events.iter().map(said).find(|text| text.contains("determinism")).expect("a conflict");
    assert!(blamed.contains(&inner.worker.to_string()) && !blamed.contains(&outer.worker.to_string()), "{blamed}");
}

pub(super) async fn the_end_of_a_job_ends_its_leases(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let job = probing(store, scene, 4, 0).await;
    let (held, expired) = (grant(job, 0, 2, NOW), grant(job, 2, 4, NOW - 50));
    assert!(granted(store, &held, NOW).await && granted(store, &expired, NOW).await);
    assert_eq!(store.expire(NOW + 60).await.unwrap().attempts, 1);
    store.job_event(job, &crate::job::Event::Cancel, NOW + 61).await.unwrap().unwrap().unwrap();
    assert_eq!(next(store).await, None);
    assert!(store.heartbeat(held.token, &BEAT, 100, NOW + 62).await.unwrap().is_none());
    for token in [held.token, expired.token] {
        let outcome = store.record_chunk(&chunk(token, 0, &[0], ""), &BTreeMap::new(), NOW + 63).await.unwrap();
        assert!(matches!(outcome, ChunkOutcome::Gone(_)), "{outcome:?}");
        assert_eq!(store.attempt(token).await.unwrap().unwrap().state, Attempt::Fenced);
    }
    store.forget(NOW + 1_000, NOW + 1_000).await.unwrap();
    assert_eq!(store.attempt(held.token).await.unwrap(), None);
}
