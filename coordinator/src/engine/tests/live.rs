//! What a live view is given, from before there is a plan until the job is done.

use super::*;
use crate::lease::SHARD_TILES;
use kiln_proto::tile::{TileRun, TileRuns};

/// The segments of a body: tile and bytes.
pub(super) fn split(mut body: &[u8]) -> Vec<(u64, &[u8])> {
    let mut found = Vec::new();
    while let Some((tile, rest)) = body.split_first_chunk::<8>() {
        let (length, rest) = rest.split_first_chunk::<4>().unwrap();
        let (segment, rest) = rest.split_at(u32::from_le_bytes(*length) as usize);
        found.push((u64::from_le_bytes(*tile), segment));
        body = rest;
    }
    found
}

fn tiles(runs: &[(u64, u64)]) -> TileRuns {
    let mut all = TileRuns::new();
    runs.iter().for_each(|(start, end)| all.insert(TileRun { start: *start, end: *end }));
    all
}

const PLENTY: usize = 1 << 20;

/// Grants of the Bake phase, one after another, the Probe phase being over.
async fn grants<const N: usize>(worker: &Worker) -> [LeaseGrant; N] {
    let mut held = Vec::new();
    while held.len() < N {
        let grant = worker.lease().await;
        if grant.phase == Phase::Probe { worker.bake(&grant).await } else { held.push(grant) }
    }
    held.try_into().unwrap()
}

/// Delivers the first tile of a lease.
async fn deliver(worker: &Worker, grant: &LeaseGrant) -> u64 {
    let tile = grant.tiles.start;
    worker.put(grant.token, 0, &chunk(Phase::Bake, &[tile])).await.unwrap();
    tile
}

#[tokio::test(flavor = "multi_thread")]
async fn segments_are_those_asked_for_and_done() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let everything = tiles(&[(0, u64::MAX)]);
    assert!(engine.live_segments(job, &everything, PLENTY).await.unwrap().is_empty());
    let worker = Worker::join(&engine, "one").await;
    let [one, two, three] = grants(&worker).await;
    assert!(engine.live_segments(job, &everything, PLENTY).await.unwrap().is_empty());
    let third = deliver(&worker, &three).await;
    let (first, second) = (deliver(&worker, &one).await, deliver(&worker, &two).await);

    let numbers = |body: &[u8]| split(body).iter().map(|(tile, _)| *tile).collect::<Vec<_>>();
    let body = engine.live_segments(job, &everything, PLENTY).await.unwrap();
    assert_eq!(numbers(&body), [first, second, third]);
    assert!(split(&body).iter().all(|(tile, bytes)| *bytes == segment(Phase::Bake, *tile, 0.5)));
    let some = engine.live_segments(job, &tiles(&[(second, second + 1), (third + 1, third + 9)]), PLENTY).await.unwrap();
    assert_eq!(numbers(&some), [second]);
    // A segment of 16 bytes takes 28 with tile and length.
    for (most, expected) in [(1, 1), (55, 1), (56, 2), (83, 2), (84, 3)] {
        let cut = engine.live_segments(job, &everything, most).await.unwrap();
        assert_eq!(numbers(&cut).len(), expected, "{most}");
    }
    assert!(engine.live_segments(job, &TileRuns::new(), PLENTY).await.unwrap().is_empty());
    assert!(matches!(engine.live_segments(JobId::random(), &everything, PLENTY).await, Err(EngineError::NotFound { .. })));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_chunk_whose_blob_is_gone_is_left_out() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "one").await;
    let [one, two] = grants(&worker).await;
    deliver(&worker, &one).await;
    let kept = deliver(&worker, &two).await;
    let lost = engine.core.store.chunk(one.token, 0).await.unwrap().unwrap();
    engine.core.blobs.delete(lost.blob).await.unwrap();
    let body = engine.live_segments(job, &tiles(&[(0, 100)]), PLENTY).await.unwrap();
    assert_eq!(split(&body).iter().map(|(tile, _)| *tile).collect::<Vec<_>>(), [kept]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_scene_can_be_had_from_the_plan_on_and_changes_its_name_once() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    rig.full.store(true, Ordering::SeqCst);
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    assert!(matches!(engine.live_scene(job).await, Err(EngineError::Conflict { .. })));
    rig.full.store(false, Ordering::SeqCst);
    rig.pass(&engine, 60_000).await;
    let worker = Worker::join(&engine, "one").await;
    let mut names = Vec::new();
    while !engine.job(job).await.unwrap().state.is_final() {
        if let Some(grant) = worker.lease_within(20).await {
            names.push(engine.live_scene(job).await.unwrap().digest());
            worker.bake(&grant).await;
        }
    }
    names.push(engine.live_scene(job).await.unwrap().digest());
    names.dedup();
    assert_eq!(names.len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_goes_on_from_one_shard_to_the_next() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    // A floor of 64 x 64 tiles and more, and the lamp.
    let settings = SettingsPatch { texels_per_metre: Some(540.0), ..SettingsPatch::default() };
    let job = engine.create_job(NewJob { settings, ..new_job(&scene) }, &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "one").await;
    let mut last = 0;
    while last < SHARD_TILES + 3 {
        let grant = worker.lease().await;
        last = if grant.phase == Phase::Bake { grant.tiles.end } else { 0 };
        worker.bake(&grant).await;
    }
    let asked = tiles(&[(1, 2), (SHARD_TILES - 2, SHARD_TILES + 2), (u64::MAX - 1, u64::MAX)]);
    let body = engine.live_segments(job, &asked, PLENTY).await.unwrap();
    let expected = [1, SHARD_TILES - 2, SHARD_TILES - 1, SHARD_TILES, SHARD_TILES + 1];
    assert_eq!(split(&body).iter().map(|(tile, _)| *tile).collect::<Vec<_>>(), expected);
    let all = engine.live_segments(job, &tiles(&[(SHARD_TILES - 5, u64::MAX)]), PLENTY).await.unwrap();
    assert!(split(&all).len() > 5 && split(&all).iter().zip(SHARD_TILES - 5..).all(|((tile, _), expected)| *tile == expected));
}
