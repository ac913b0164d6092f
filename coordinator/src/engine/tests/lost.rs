//! Blobs that vanish although rows name them.

use super::*;

/// Bakes leases one after another as long as the job's record says so.
async fn bake_while(worker: &Worker, engine: &Engine, job: JobId, goes_on: impl Fn(&JobRecord) -> bool) {
    while goes_on(&engine.job(job).await.unwrap()) {
        if let Some(grant) = worker.lease_within(20).await {
            worker.bake(&grant).await;
        }
    }
}

async fn package(engine: &Engine, job: JobId) -> Vec<Vec<u8>> {
    let mut files = vec![];
    for path in ["manifest.json", "surfaces/floor.toy", "surfaces/lamp.toy"] {
        files.push(read_all(engine, job, path).await);
    }
    files
}

/// Deletes the blobs of all chunks of a phase so far; how many tiles they held.
async fn delete_chunks(engine: &Engine, job: JobId, phase: Phase) -> u64 {
    let every = kiln_proto::tile::TileRun { start: 0, end: 1 << 20 };
    let chunks = engine.core.store.chunks(job, phase, every).await.unwrap();
    for chunk in &chunks {
        engine.core.blobs.delete(chunk.blob).await.unwrap();
    }
    chunks.iter().map(|c| c.accepted.len()).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn tiles_whose_blobs_are_gone_are_baked_again_and_the_package_is_the_same() {
    let mut packages = vec![];
    for lost in [None, Some(Phase::Probe), Some(Phase::Bake)] {
        let rig = Rig::new();
        let engine = rig.open().await;
        let scene = ready_scene(&engine).await;
        let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
        let worker = Worker::join(&engine, "w").await;
        if let Some(phase) = lost {
            // Half of the phase, so that both the lost and the kept tiles matter.
            bake_while(&worker, &engine, job, |r| r.phase != Some(phase) || r.progress.tiles_done == 0).await;
            assert!(delete_chunks(&engine, job, phase).await > 0);
        }
        let done = worker.see_through(job).await;
        assert_eq!((done.state, done.progress.tiles_done), (JobState::Done, done.progress.tiles), "{:?}", done.problem);
        let events = engine.events(job, 0, 10_000).await.unwrap().events;
        let told =
            events.iter().any(|e| matches!(&e.kind, crate::records::EventKind::Problem { problem } if problem.message.contains("is gone")));
        assert_eq!(told, lost.is_some());
        packages.push(package(&engine, job).await);
    }
    assert!(packages[1] == packages[0] && packages[2] == packages[0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_chunk_takes_the_place_of_one_that_is_gone() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let (slow, quick) = (Worker::join(&engine, "slow").await, Worker::join(&engine, "quick").await);
    let late = slow.lease().await;
    rig.pass(&engine, 31_000).await;
    let taken = quick.lease().await;
    let tile = taken.tiles.start;
    quick.put(taken.token, 0, &chunk(taken.phase, &[tile])).await.unwrap();
    let before = engine.job(job).await.unwrap().progress;
    assert_eq!(delete_chunks(&engine, job, taken.phase).await, 1);
    let both = [(TileIndex(tile), Verdict::Accepted), (TileIndex(tile + 1), Verdict::Accepted)];
    let verdict = slow.put(late.token, 0, &chunk(late.phase, &[tile, tile + 1])).await.unwrap();
    assert_eq!(verdict.tiles, both);
    assert_eq!(engine.job(job).await.unwrap().progress.tiles_done, before.tiles_done + 1);
    // The same chunk again, gone meanwhile: recorded anew.
    assert_eq!(delete_chunks(&engine, job, taken.phase).await, 2);
    let verdict = slow.put(late.token, 0, &chunk(late.phase, &[tile, tile + 1])).await.unwrap();
    assert_eq!(verdict.tiles, both);
    engine.release(taken.token, &finish()).await.unwrap();
    assert_eq!(quick.see_through(job).await.state, JobState::Done);
}
