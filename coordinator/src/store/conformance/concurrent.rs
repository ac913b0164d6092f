//! Many callers at once, through two stores where the database is shared: every tile is accepted once, nobody who asks while tiles are pending
//! goes away without, and nothing waits in a circle.

use super::*;
use crate::{
    lease::{Event as LeaseEvent, SHARD_TILES},
    store::{ChunkOutcome, FinishOutcome},
};
use futures_util::future::join_all;
use kiln_proto::wire::message::Heartbeat;
use std::collections::BTreeMap;

/// Two shards.
const TILES: u64 = SHARD_TILES + 900;
const CALLERS: usize = 64;
/// Tiles of a lease.
const LEASE: u64 = 20;

/// Runs it on two stores over one database, or twice the same store.
pub(crate) async fn concurrent(one: Arc<dyn Store>, other: Arc<dyn Store>) {
    let scene = ready_scene(&*one).await;
    let job = probing(&*one, scene, TILES, 0).await;
    let doomed = probing(&*one, scene, TILES, -1).await;
    let callers = (0..CALLERS).map(|k| {
        let store = Arc::clone(if k % 2 == 0 { &one } else { &other });
        tokio::spawn(async move { work(&*store, job).await })
    });
    let meddler = tokio::spawn({
        let store = Arc::clone(&other);
        async move {
            for _ in 0..50 {
                store.expire(NOW).await.unwrap();
                store.add_problem(job, &crate::records::Problem::new("x"), NOW).await.unwrap();
            }
            store.job_event(doomed, &crate::job::Event::Cancel, NOW).await.unwrap().unwrap().unwrap();
        }
    });
    let accepted: u64 = join_all(callers).await.into_iter().map(|done| done.expect("a caller")).sum();
    meddler.await.expect("the meddler");
    assert_eq!(accepted, TILES, "each tile once");
    let row = other.job(job).await.unwrap().unwrap();
    assert_eq!((row.tiles, row.cost.1, row.workers), ((TILES, TILES), TILES * 10, 0));
    let events = one.events(job, row.seq - 1, 10).await.unwrap().unwrap().events;
    assert_eq!(events.last().map(|e| e.seq), Some(row.seq), "numbers without gaps");
}

/// Leases, bakes and delivers until nothing of the job is pending; how many tiles were accepted from it.
async fn work(store: &dyn Store, job: JobId) -> u64 {
    let mut accepted = 0;
    loop {
        let Some(next) = next(store).await.filter(|next| next.job == job) else { return accepted };
        let lease = grant(job, next.run.start, next.run.end.min(next.run.start + LEASE), NOW);
        let Some(run) = store.grant(&[lease], NOW).await.unwrap()[0] else { continue };
        let held = store.heartbeat(lease.token, &Heartbeat { texels_done: 0, rays: 1 }, 100, NOW).await.unwrap();
        assert_eq!(held.map(|row| row.run), Some(run));
        let tiles: Vec<u64> = (run.start..run.end).collect();
        for (n, part) in tiles.chunks(7).enumerate() {
            let outcome = store.record_chunk(&chunk(lease.token, n as u64, part, ""), &BTreeMap::new(), NOW).await.unwrap();
            let ChunkOutcome::Recorded(row) = outcome else { panic!("{outcome:?}") };
            accepted += row.accepted.len();
        }
        let ended = store.finish_attempt(lease.token, LeaseEvent::Complete, None, NOW).await.unwrap();
        assert!(matches!(ended, FinishOutcome::Finished(row) if row.state == crate::lease::Attempt::Completed));
    }
}
