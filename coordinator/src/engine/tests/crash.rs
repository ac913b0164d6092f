//! A coordinator that dies again and again.

use super::*;
use std::collections::BTreeSet;

/// Drops the engine as a crash does: whatever runs is lost wherever it is.
async fn crash(engine: Arc<Engine>) {
    let weak = Arc::downgrade(&engine.core);
    drop(engine);
    // Blocking work of the dead engine would be gone with its process; here it is waited for.
    while weak.upgrade().is_some() {
        tokio::task::yield_now().await;
    }
}

/// Bakes a job, crashing before every step whose number is in `crashes`; the package.
async fn bake(crashes: &BTreeSet<usize>) -> Vec<Vec<u8>> {
    let rig = Rig::new();
    let mut engine = rig.open().await;
    let scene = upload(&engine, &[("r.obj", OBJ), ("r.mtl", MTL)]).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let mut worker = Worker::join(&engine, "w").await.id;
    let mut accepted: BTreeSet<(Phase, u64)> = BTreeSet::new();
    let mut open: Option<(LeaseGrant, u64)> = None;
    for step in 0.. {
        if crashes.contains(&step) {
            crash(engine).await;
            engine = rig.open().await;
        }
        let record = engine.job(job).await.unwrap();
        if record.state.is_final() {
            assert_eq!(record.state, JobState::Done, "{:?}", record.problem);
            break;
        }
        let hand = Worker { engine: Arc::clone(&engine), id: worker };
        match open.take() {
            // Patient: what is granted in the moment in which a worker gives up waiting goes back at once, unless the coordinator dies just
            // then; such a lease only runs out, and in this test time stands still.
            None => open = hand.lease_within(1_000).await.map(|grant| (grant.clone(), grant.tiles.start)),
            Some((grant, next)) if next < grant.tiles.end => {
                let verdict = hand.put(grant.token, next, &chunk(grant.phase, &[next])).await.unwrap();
                assert_eq!(verdict.tiles[0].1, Verdict::Accepted, "a held lease survives its coordinator");
                assert!(accepted.insert((grant.phase, next)), "tile {next} was leased though it was accepted");
                open = Some((grant, next + 1));
            }
            Some((grant, _)) => engine.complete(grant.token, &finish()).await.unwrap(),
        }
        worker = hand.id;
    }
    let mut package = vec![];
    for path in ["manifest.json", "surfaces/floor.toy", "surfaces/lamp.toy"] {
        package.push(read_all(&engine, job, path).await);
    }
    package
}

#[tokio::test(flavor = "multi_thread")]
async fn whenever_the_coordinator_dies_the_package_is_the_same_and_nothing_is_baked_twice() {
    let calm = bake(&BTreeSet::new()).await;
    for seed in 0..4usize {
        let crashes: BTreeSet<usize> = (0..12).map(|k| (k * k * 3 + seed * 7 + k * 5 + 1) % 90).collect();
        assert_eq!(bake(&crashes).await, calm, "crashes before steps {crashes:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_that_outlives_its_worker_and_its_coordinator_expires() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let lost = Worker::join(&engine, "lost").await;
    let grant = lost.lease().await;
    drop(lost);
    crash(engine).await;
    let engine = rig.open().await;
    let next = Worker::join(&engine, "next").await;
    let other = next.lease_within(0).await;
    assert!(other.is_none_or(|g| g.tiles.start != grant.tiles.start), "held until its deadline");
    rig.pass(&engine, 31_000).await;
    assert_eq!(next.see_through(job).await.state, JobState::Done);
}
