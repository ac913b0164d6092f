//! Notices of the ends of jobs.

use super::*;
use crate::{
    job::Event,
    records::{EventKind, JobState, Problem},
    store::{Notice, TASK_TRIES},
};

async fn hooked(store: &dyn Store) -> JobId {
    let scene = ready_scene(store).await;
    let spec = JobSpec { webhook: Some("https://ci.example/".into()), ..spec(scene, 0) };
    let row = store.add_job(&spec, NOW).await.unwrap();
    assert_eq!(row.spec.webhook, spec.webhook);
    row.spec.id
}

async fn end(store: &dyn Store, job: JobId) {
    store.job_event(job, &Event::Cancel, NOW + 5).await.unwrap().unwrap().unwrap();
}

pub(super) async fn every_end_of_a_job_with_a_webhook_is_told(store: &dyn Store) {
    let job = hooked(store).await;
    assert_eq!(store.take_notice(Token::random(), NOW + 10, NOW).await.unwrap(), None, "it has not ended");
    end(store, job).await;
    let seq = store.job(job).await.unwrap().unwrap().seq;
    assert_eq!(store.take_task(Token::random(), NOW + 10, NOW).await.unwrap(), None, "notices have a lane of their own");
    assert_eq!(store.figures().await.unwrap().tasks, 0);
    let (first, second) = (Token::random(), Token::random());
    let notice = Task::Notify(Notice { job, state: JobState::Cancelled, at_ms: NOW + 5, seq });
    assert_eq!(store.take_notice(first, NOW + 10, NOW).await.unwrap().unwrap().task, notice);
    assert_eq!(store.take_notice(second, NOW + 10, NOW).await.unwrap(), None, "it is held");
    assert_eq!(store.expire(NOW + 10).await.unwrap().tasks, 1, "its coordinator died");
    assert_eq!(store.take_notice(second, NOW + 50, NOW).await.unwrap().unwrap().task, notice);
    assert!(!store.finish_task(first, &TaskResult::Notified, NOW).await.unwrap(), "the token fences");
    assert!(store.put_off_task(second, "no answer", NOW + 70).await.unwrap());
    assert_eq!(store.job(job).await.unwrap().unwrap().put_off, None, "the job waits for nothing");
    assert_eq!(store.take_notice(first, NOW + 90, NOW + 69).await.unwrap(), None, "it is not due");
    assert_eq!(store.take_notice(first, NOW + 90, NOW + 70).await.unwrap().unwrap().put_off, 1);
    assert!(store.finish_task(first, &TaskResult::Notified, NOW).await.unwrap());
    assert_eq!(store.take_notice(first, NOW + 90, NOW + 70).await.unwrap(), None);
    let quiet = store.add_job(&spec(store.job(job).await.unwrap().unwrap().spec.scene, 0), NOW).await.unwrap().spec.id;
    end(store, quiet).await;
    assert_eq!(store.take_notice(first, NOW + 90, NOW + 70).await.unwrap(), None, "nobody asked");
}

pub(super) async fn a_notice_that_is_given_up_changes_nothing_but_the_stream(store: &dyn Store) {
    let last = async |job| store.events(job, 0, 100).await.unwrap().unwrap().events.pop().unwrap().kind;
    let job = hooked(store).await;
    end(store, job).await;
    let before = store.job(job).await.unwrap().unwrap();
    let token = Token::random();
    store.take_notice(token, NOW + 10, NOW).await.unwrap().unwrap();
    let problem = Problem::new("no answer");
    assert!(store.finish_task(token, &TaskResult::Failed(problem.clone()), NOW).await.unwrap());
    let after = store.job(job).await.unwrap().unwrap();
    assert_eq!((&after.state, &after.marks), (&before.state, &before.marks));
    assert_eq!(last(job).await, EventKind::Problem { problem });
    // One that coordinators die of, likewise.
    let job = hooked(store).await;
    end(store, job).await;
    for _ in 0..TASK_TRIES {
        assert!(store.take_notice(Token::random(), NOW + 1, NOW).await.unwrap().is_some());
        store.expire(NOW + 1).await.unwrap();
    }
    assert_eq!(store.take_notice(Token::random(), NOW + 1, NOW).await.unwrap(), None);
    assert!(matches!(last(job).await, EventKind::Problem { problem } if problem.message.contains("webhook")));
    // One of a job that is gone ends quietly.
    let job = hooked(store).await;
    end(store, job).await;
    store.take_notice(token, NOW + 10, NOW).await.unwrap().unwrap();
    assert!(store.delete_job(job).await.unwrap());
    assert!(store.finish_task(token, &TaskResult::Failed(Problem::new("no answer")), NOW).await.unwrap());
}
