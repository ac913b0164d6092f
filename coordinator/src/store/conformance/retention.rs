//! What is long over is forgotten, and nothing else.

use super::*;
use crate::{job::Event, records::Problem};

pub(super) async fn what_is_long_over_is_forgotten(store: &dyn Store) {
    let scene = ready_scene(store).await;
    let (old, young, alive) = (spec(scene, 0), spec(scene, 0), spec(scene, 0));
    for spec in [&old, &young, &alive] {
        store.add_job(spec, NOW).await.unwrap();
    }
    let end = async |job, event: Event, at| store.job_event(job, &event, at).await.unwrap().unwrap().unwrap();
    end(old.id, Event::Cancel, NOW + 100).await;
    end(young.id, Event::Fail(Problem::new("no")), NOW + 101).await;
    assert_eq!(store.ended_jobs(NOW + 99).await.unwrap(), []);
    assert_eq!(store.ended_jobs(NOW + 100).await.unwrap(), [old.id]);
    assert!(!store.delete_ended_job(young.id, NOW + 100).await.unwrap(), "it ended later");
    assert!(!store.delete_ended_job(alive.id, NOW + 999).await.unwrap(), "it has not ended");
    assert!(store.delete_ended_job(old.id, NOW + 100).await.unwrap() && !store.delete_ended_job(old.id, NOW + 100).await.unwrap());
    assert!(store.job(old.id).await.unwrap().is_none() && store.events(old.id, 0, 10).await.unwrap().is_none());
    assert_eq!(store.ended_jobs(NOW + 999).await.unwrap(), [young.id]);
    // Its scene is in use as long as one of its jobs is there.
    assert_eq!(store.unused_scenes(NOW + 999).await.unwrap(), Vec::<Uuid>::new());
    assert!(!store.delete_unused_scene(scene, NOW + 999).await.unwrap());
    for job in [young.id, alive.id] {
        assert!(store.delete_job(job).await.unwrap());
    }
    assert_eq!(store.unused_scenes(NOW - 1).await.unwrap(), Vec::<Uuid>::new());
    assert_eq!(store.unused_scenes(NOW).await.unwrap(), [scene]);
    assert!(!store.delete_unused_scene(scene, NOW - 1).await.unwrap());
    assert!(store.delete_unused_scene(scene, NOW).await.unwrap() && !store.delete_unused_scene(scene, NOW).await.unwrap());
    assert!(store.scene(scene).await.unwrap().is_none() && !store.names(blob("canonical")).await.unwrap());
}

pub(super) async fn what_is_under_way_or_tried_again_is_kept(store: &dyn Store) {
    let scene = scene(store).await.record.id;
    assert_eq!(store.unused_scenes(NOW + 999).await.unwrap(), Vec::<Uuid>::new(), "it waits to be imported");
    assert!(!store.delete_unused_scene(scene, NOW + 999).await.unwrap());
    let imported =
        TaskResult::Imported { scene: SceneHash::of(b"s"), canonical: blob("canonical"), statistics: statistics(), warnings: vec![] };
    perform(store, Task::Import(scene), &imported).await;
    let job = probing(store, scene, 3, 0).await;
    let problem = Problem::new("given up");
    let lost = Event::Quarantined { phase: Phase::Probe, on_poison: crate::job::OnPoison::Fail, problem };
    store.job_event(job, &lost, NOW + 5).await.unwrap().unwrap().unwrap();
    assert_eq!(store.ended_jobs(NOW + 5).await.unwrap(), [job], "a failure counts, also where a retry is possible");
    store.job_event(job, &Event::Retry, NOW + 6).await.unwrap().unwrap().unwrap();
    assert!(store.ended_jobs(NOW + 999).await.unwrap().is_empty() && !store.delete_ended_job(job, NOW + 999).await.unwrap());
    store.job_event(job, &Event::Cancel, NOW + 50).await.unwrap().unwrap().unwrap();
    assert!(store.ended_jobs(NOW + 49).await.unwrap().is_empty(), "the last end counts");
    assert!(store.delete_ended_job(job, NOW + 50).await.unwrap());
}
