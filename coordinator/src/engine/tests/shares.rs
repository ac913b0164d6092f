//! Whose tiles go next, who bakes along, and whose word is checked.

use super::*;

/// A job of 400 tiles on the floor and 100 on the lamp.
fn large_job(scene: &SceneRecord, priority: i32) -> NewJob {
    let settings = SettingsPatch { texels_per_metre: Some(160.0), ..SettingsPatch::default() };
    NewJob { settings, priority, ..new_job(scene) }
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_share_the_farm_by_priority_and_say_who_goes_first() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let high = engine.create_job(large_job(&scene, 1), &Principal::Local).await.unwrap().id;
    let low = engine.create_job(large_job(&scene, 0), &Principal::Local).await.unwrap().id;
    for job in [high, low] {
        until(&engine, job, JobState::Baking).await;
    }
    let waiting = async |job| engine.job(job).await.unwrap().waiting.unwrap_or_default();
    assert!(waiting(low).await.contains("no worker is connected"), "{}", waiting(low).await);
    let worker = Worker::join(&engine, "one").await;
    let first = worker.lease().await;
    assert_eq!(first.job, high);
    let says = waiting(low).await;
    assert!(says.contains(&format!("job {high} goes first")), "{says}");
    worker.bake(&first).await;
    let baking = async |job| engine.job(job).await.unwrap().phase == Some(Phase::Bake);
    while !(baking(high).await && baking(low).await) {
        if let Some(grant) = worker.lease_within(20).await {
            worker.bake(&grant).await;
        }
    }
    let mut leases = std::collections::HashMap::<JobId, u32>::new();
    for _ in 0..60 {
        let grant = worker.lease().await;
        *leases.entry(grant.job).or_default() += 1;
        worker.bake(&grant).await;
    }
    // Tiles at the edges of a chart cost less than the others, and work is what is shared.
    assert!((37..=43).contains(&leases[&high]), "{leases:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn one_job_is_bounded_in_what_it_holds() {
    let rig = Rig::new();
    let mut config = rig.config();
    config.lease.per_token = Some(2);
    let engine = rig.open_as(config).await;
    let scene = ready_scene(&engine).await;
    engine.create_job(large_job(&scene, 0), &Principal::Local).await.unwrap();
    let worker = Worker::join(&engine, "one").await;
    let first = worker.lease().await;
    worker.lease().await;
    assert_eq!(worker.lease_within(50).await, None);
    worker.bake(&first).await;
    assert!(worker.lease_within(20_000).await.is_some());
}

#[tokio::test(flavor = "multi_thread")]
async fn an_idle_worker_bakes_along_with_a_late_one() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let job = engine.create_job(new_job(&scene), &Principal::Local).await.unwrap().id;
    let [slow, fast] = [Worker::join(&engine, "slow").await, Worker::join(&engine, "fast").await];
    let late = loop {
        let grant = slow.lease().await;
        if grant.phase == Phase::Bake {
            break grant;
        }
        slow.bake(&grant).await;
    };
    let tiles = late.tiles.len();
    while let Some(grant) = fast.lease_within(50).await {
        assert!(grant.tiles.end <= late.tiles.start || late.tiles.end <= grant.tiles.start, "not late yet");
        rig.clock.fetch_add(10, Ordering::SeqCst);
        fast.bake(&grant).await;
    }
    rig.clock.fetch_add(5_000, Ordering::SeqCst);
    let twin = fast.lease_within(20_000).await.expect("a twin");
    assert_eq!((twin.tiles, twin.job), (late.tiles, job));
    fast.bake(&twin).await;
    let beat = Heartbeat { texels_done: 0, rays: 0 };
    assert_eq!(engine.heartbeat(late.token, &beat).await.unwrap(), HeartbeatReply::Cancel, "the loser is told");
    let done = until(&engine, job, JobState::Done).await;
    assert!(done.progress.tiles >= 8 + tiles && done.progress.tiles == done.progress.tiles_done);
}

/// Takes what there is and delivers this light; nothing where there is nothing, or where the worker is barred.
async fn bake_some(worker: &Worker, light: f32) {
    let asked = worker.engine.lease(&LeaseRequest { worker: worker.id, wait_ms: 20 }).await;
    let Ok(Some(grant)) = asked else { return };
    let tiles: Vec<(u64, Vec<u8>)> = (grant.tiles.start..grant.tiles.end).map(|t| (t, segment(grant.phase, t, light))).collect();
    if worker.put(grant.token, 0, &pack(&tiles)).await.is_ok() {
        let _ = worker.engine.complete(grant.token, &finish()).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_liar_is_found_and_leaves_nothing_behind() {
    let rig = Rig::new();
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let wrong = NewJob { verify: Some(1.5), ..new_job(&scene) };
    let error = engine.create_job(wrong, &Principal::Local).await.unwrap_err();
    assert!(error.to_string().contains("between 0 and 1"), "{error}");
    let job = engine.create_job(NewJob { verify: Some(1.0), ..new_job(&scene) }, &Principal::Local).await.unwrap().id;
    let [liar, a, b] = [Worker::join(&engine, "liar").await, Worker::join(&engine, "a").await, Worker::join(&engine, "b").await];
    let mut unverified = 0;
    let done = loop {
        for (worker, light) in [(&liar, 0.75), (&a, 0.5), (&b, 0.5)] {
            bake_some(worker, light).await;
        }
        let record = engine.job(job).await.unwrap();
        unverified = unverified.max(record.progress.tiles_unverified);
        if record.state.is_final() {
            break record;
        }
    };
    assert_eq!((done.state, done.progress.tiles_unverified), (JobState::Done, 0), "{:?}", done.problem);
    assert!(unverified > 0);
    let mut package = read_all(&engine, job, "surfaces/floor.toy").await;
    package.extend(read_all(&engine, job, "surfaces/lamp.toy").await);
    let expected: Vec<u8> = (0..done.progress.tiles).flat_map(|t| segment(Phase::Bake, t, 0.5)).collect();
    assert!(package == expected, "light of the liar is in it");
    let workers = engine.workers().await.unwrap();
    let is_barred = |id: WorkerId| workers.iter().find(|w| w.id == id).unwrap().barred.is_some();
    assert_eq!([liar.id, a.id, b.id].map(is_barred), [true, false, false]);
}
