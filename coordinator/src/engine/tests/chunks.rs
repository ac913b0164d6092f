//! Chunks that come late, twice, wrong or from somebody else.

use super::*;
use crate::records::EventKind;

/// An engine with a job whose Probe phase is done, and a worker.
async fn baking(rig: &Rig) -> (Arc<Engine>, JobId, Worker) {
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "first").await;
    loop {
        let grant = worker.lease().await;
        if grant.phase == Phase::Bake {
            engine.release(grant.token, &finish()).await.unwrap();
            return (engine, job, worker);
        }
        worker.bake(&grant).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_chunks_are_refused_and_cost_the_attempt() {
    let rig = Rig::new();
    let (engine, job, worker) = baking(&rig).await;
    let whole = |g: &LeaseGrant| chunk(g.phase, &(g.tiles.start..g.tiles.end).collect::<Vec<_>>());
    type Spoil = fn(Vec<u8>, &LeaseGrant) -> Vec<u8>;
    let spoiled: [(&str, Spoil); 9] = [
        ("too short", |_, _| vec![1, 2]),
        ("trailer", |good, _| good[..good.len() - 7].to_vec()),
        ("not of this lease", |_, g| chunk(g.phase, &[g.tiles.end])),
        ("twice", |_, g| chunk(g.phase, &[g.tiles.start, g.tiles.start])),
        ("not finite", |_, g| pack(&[(g.tiles.start, segment(g.phase, g.tiles.start, f32::NAN))])),
        ("another tile", |_, g| pack(&[(g.tiles.start, segment(g.phase, g.tiles.start + 1, 0.5))])),
        ("digest", |_, g| forged(g, |e| e.digest = Digest::of(b"x"))),
        ("expected 0", |_, g| forged(g, |e| e.offset = 1)),
        ("claims", |_, g| forged(g, |e| e.plain_length = u64::MAX)),
    ];
    for (reason, spoil) in spoiled {
        let grant = worker.lease().await;
        let Err(Refusal::Invalid { reason: said }) = worker.put(grant.token, 0, &spoil(whole(&grant), &grant)).await else {
            panic!("accepted: {reason}")
        };
        assert!(said.contains(reason), "expected `{reason}`, found `{said}`");
        assert_eq!(worker.put(grant.token, 1, &whole(&grant)).await, Err(Refusal::Gone { state: "fenced".into() }));
        assert_eq!(engine.heartbeat(grant.token, &Heartbeat { texels_done: 0, rays: 0 }).await, Ok(HeartbeatReply::Cancel));
        // The tile is suspected now; a good delivery clears it, before three failures give it up.
        let again = worker.lease().await;
        assert_eq!(again.tiles.start, grant.tiles.start);
        worker.bake(&again).await;
    }
    assert_eq!(engine.statistics().await.unwrap().chunks_refused, 9);
    // Nothing was lost: an honest worker finishes.
    assert_eq!(worker.see_through(job).await.state, JobState::Done);
}

fn forged(grant: &LeaseGrant, change: fn(&mut ChunkEntry)) -> Vec<u8> {
    let plain = segment(grant.phase, grant.tiles.start, 0.5);
    let packed = zstd::bulk::compress(&plain, 1).unwrap();
    let mut entry = ChunkEntry {
        tile: TileIndex(grant.tiles.start),
        offset: 0,
        length: packed.len() as u64,
        plain_length: plain.len() as u64,
        digest: Digest::of(&plain),
    };
    change(&mut entry);
    with_trailer(packed, vec![entry])
}

#[tokio::test(flavor = "multi_thread")]
async fn no_flipped_bit_gets_through() {
    let rig = Rig::new();
    let (engine, _, worker) = baking(&rig).await;
    let grant = worker.lease().await;
    let good = chunk(grant.phase, &[grant.tiles.start]);
    let row = super::super::tasks::job(&engine.core, grant.job).await.unwrap();
    let (_, plan) = super::super::tasks::plan(&engine.core, &row).await.unwrap();
    let asked = super::super::inspect::Asked { plan: &plan, phase: grant.phase, run: grant.tiles };
    let check = |bytes: &[u8]| {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        super::super::inspect::check(&mut file, &asked, &Toy)
    };
    let checked = check(&good).unwrap();
    assert_eq!(checked.blob, BlobName::of(&good));
    // Only a segment's zstd frame may hold bits that mean nothing; what it decompresses to has a digest.
    for bit in 0..good.len() * 8 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert!(check(&bad).is_err() || (bit / 8) < checked.trailer_at as usize, "bit {bit}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_chunk_again_has_the_same_verdicts() {
    let rig = Rig::new();
    let (engine, _, worker) = baking(&rig).await;
    let grant = worker.lease().await;
    let tiles: Vec<u64> = (grant.tiles.start..grant.tiles.end).rev().collect();
    let bytes = chunk(grant.phase, &tiles);
    let first = worker.put(grant.token, 0, &bytes).await.unwrap();
    assert!(first.tiles.iter().map(|(t, _)| t.0).eq(tiles.iter().copied()), "verdicts come in the chunk's order");
    assert_eq!(worker.put(grant.token, 0, &bytes).await.unwrap(), first);
    let again = worker.put(grant.token, 1, &bytes).await.unwrap();
    assert!(again.tiles.iter().all(|(_, v)| *v == Verdict::Duplicate));
    engine.complete(grant.token, &finish()).await.unwrap();
    engine.complete(grant.token, &finish()).await.unwrap();
    assert_eq!(worker.put(grant.token, 0, &bytes).await.unwrap(), first, "even after its attempt has ended");
    assert_eq!(engine.statistics().await.unwrap().tiles_duplicate, tiles.len() as u64);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_expired_attempt_may_deliver_what_nobody_has_done() {
    let rig = Rig::new();
    let (engine, job, slow) = baking(&rig).await;
    let late = slow.lease().await;
    assert!(late.tiles.len() >= 2);
    rig.pass(&engine, 31_000).await;
    let quick = Worker::join(&engine, "second").await;
    let taken = quick.lease().await;
    assert_eq!(taken.tiles.start, late.tiles.start, "what expired is leased again");
    assert_eq!(taken.tiles.len(), late.tiles.len().div_ceil(2), "in halves");
    let (a, b) = (taken.tiles.start, taken.tiles.start + 1);
    quick.put(taken.token, 0, &chunk(taken.phase, &[a])).await.unwrap();
    // The first worker wakes up: one tile is done with the same bytes, the other is still undone.
    let verdict = slow.put(late.token, 0, &chunk(late.phase, &[a, b])).await.unwrap();
    assert_eq!(verdict.tiles, [(TileIndex(a), Verdict::Duplicate), (TileIndex(b), Verdict::Accepted)]);
    assert!(matches!(engine.complete(late.token, &finish()).await, Err(Refusal::Gone { state }) if state == "expired"));
    let rest: Vec<u64> = (b..taken.tiles.end).collect();
    if !rest.is_empty() {
        quick.put(taken.token, 1, &chunk(taken.phase, &rest)).await.unwrap();
    }
    engine.complete(taken.token, &finish()).await.unwrap();
    assert_eq!(engine.statistics().await.unwrap().attempts_expired, 1);
    assert_eq!(quick.see_through(job).await.state, JobState::Done);
}

#[tokio::test(flavor = "multi_thread")]
async fn other_bytes_for_a_done_tile_are_a_recorded_conflict() {
    let rig = Rig::new();
    let (engine, job, liar) = baking(&rig).await;
    let late = liar.lease().await;
    rig.pass(&engine, 31_000).await;
    let honest = Worker::join(&engine, "second").await;
    let taken = honest.lease().await;
    honest.bake(&taken).await;
    let tile = late.tiles.start;
    let verdict = liar.put(late.token, 0, &pack(&[(tile, segment(late.phase, tile, 0.75))])).await.unwrap();
    assert_eq!(verdict.tiles, [(TileIndex(tile), Verdict::Conflict)]);
    let events = engine.events(job, 0, 10_000).await.unwrap().events;
    let blamed = |e: &&crate::records::JobEvent| {
        matches!(&e.kind, EventKind::Problem { problem } if problem.message.starts_with("determinism")
            && problem.message.contains(&liar.id.to_string()) && problem.message.contains(&honest.id.to_string()))
    };
    assert_eq!(events.iter().filter(blamed).count(), 1);
    honest.see_through(job).await;
    let floor = read_all(&engine, job, "surfaces/floor.toy").await;
    assert_eq!(floor[..16], segment(Phase::Bake, 0, 0.5), "the first bytes were kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_job_takes_nothing_more() {
    let rig = Rig::new();
    let (engine, job, worker) = baking(&rig).await;
    let held = worker.lease().await;
    assert_eq!(engine.cancel_job(job).await.unwrap().state, JobState::Cancelled);
    assert_eq!(engine.heartbeat(held.token, &Heartbeat { texels_done: 0, rays: 0 }).await, Ok(HeartbeatReply::Cancel));
    let refused = worker.put(held.token, 0, &chunk(held.phase, &[held.tiles.start])).await;
    assert_eq!(refused, Err(Refusal::Gone { state: "fenced".into() }));
    assert_eq!(worker.lease_within(0).await, None);
    assert_eq!(engine.cancel_job(job).await.unwrap().state, JobState::Cancelled, "twice is once");
}

#[tokio::test(flavor = "multi_thread")]
async fn completing_without_the_tiles_gives_them_back() {
    let rig = Rig::new();
    let (engine, _, worker) = baking(&rig).await;
    let grant = worker.lease().await;
    assert!(matches!(engine.complete(grant.token, &finish()).await, Err(Refusal::Invalid { .. })));
    assert_eq!(worker.lease().await.tiles.start, grant.tiles.start);
}
