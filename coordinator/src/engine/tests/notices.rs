//! Webhooks: who asked is told of the end of a job, and nothing else happens.

use super::*;
use crate::{
    records::{EventKind, WebhookEvent, WebhookMessage},
    webhook::WebhookConfig,
};
use axum::{
    Router,
    http::{HeaderMap, StatusCode, Uri, header},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use hmac::{Hmac, KeyInit, Mac};
use std::sync::Mutex;

const KEY: [u8; 32] = [7; 32];

/// What a receiver got.
#[derive(Debug, Clone)]
struct Call {
    path: String,
    headers: HeaderMap,
    body: Bytes,
}

impl Call {
    fn header(&self, name: &str) -> &str {
        self.headers[name].to_str().unwrap()
    }

    /// The message, if it is signed with the key.
    fn message(&self) -> WebhookMessage {
        let mut mac = Hmac::<sha2::Sha256>::new_from_slice(&KEY).unwrap();
        mac.update(format!("{}.{}.", self.header("webhook-id"), self.header("webhook-timestamp")).as_bytes());
        mac.update(&self.body);
        let expected = format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()));
        assert_eq!(self.header("webhook-signature"), expected);
        let message: WebhookMessage = serde_json::from_slice(&self.body).unwrap();
        assert_eq!(message.id, self.header("webhook-id"));
        message
    }
}

/// A receiver that answers as it is told, and a rig whose configuration allows it.
struct Receiver {
    address: String,
    calls: Arc<Mutex<Vec<Call>>>,
    answer: Arc<Mutex<StatusCode>>,
    _secret: tempfile::NamedTempFile,
}

impl Receiver {
    async fn start(rig: &mut Rig) -> Self {
        let (calls, answer) = (Arc::<Mutex<Vec<Call>>>::default(), Arc::new(Mutex::new(StatusCode::OK)));
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let place = listener.local_addr().unwrap().to_string();
        let router = Router::new().fallback({
            let (calls, answer) = (Arc::clone(&calls), Arc::clone(&answer));
            async move |uri: Uri, headers: HeaderMap, body: Bytes| {
                calls.lock().unwrap().push(Call { path: uri.path().to_owned(), headers, body });
                (*answer.lock().unwrap(), [(header::LOCATION, "/elsewhere")], "x".repeat(100_000))
            }
        });
        tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        let secret = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(secret.path(), format!("whsec_{}", STANDARD.encode(KEY))).unwrap();
        rig.base.webhooks = WebhookConfig { allow: vec![place.clone()], secret_file: Some(secret.path().to_owned()) };
        Self { address: format!("http://{place}/hook"), calls, answer, _secret: secret }
    }

    fn answers(&self, status: StatusCode) {
        *self.answer.lock().unwrap() = status;
    }

    /// Waits for the n-th call.
    async fn call(&self, engine: &Engine, n: usize) -> Call {
        for _ in 0..2_000 {
            if let Some(call) = self.calls.lock().unwrap().get(n - 1) {
                return call.clone();
            }
            engine.core.signals.tasks.notify_waiters();
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        panic!("no call {n}: {:?}", self.calls.lock().unwrap());
    }

    fn count(&self) -> usize {
        self.calls.lock().unwrap().len()
    }

    async fn job(&self, engine: &Engine) -> JobId {
        let new = NewJob { webhook: Some(self.address.clone()), ..new_job(&ready_scene(engine).await) };
        engine.create_job(new, &Principal::Local).await.unwrap().id
    }
}

/// The problems in a job's stream.
async fn problems(engine: &Engine, job: JobId) -> Vec<String> {
    let events = engine.events(job, 0, 10_000).await.unwrap().events;
    let problem = |kind| if let EventKind::Problem { problem } = kind { Some(problem.message) } else { None };
    events.into_iter().filter_map(|event| problem(event.kind)).collect()
}

/// Waits until nobody holds a notice and one waits for its time.
async fn put_off(engine: &Engine, n: u32) {
    for _ in 0..2_000 {
        let later = engine.now() + 48 * 3_600_000;
        let token = Token::random();
        if let Some(lease) = engine.core.store.take_notice(token, later + 1, later).await.unwrap() {
            // Only looked at: the store puts it back as it was.
            engine.core.store.take_over_tasks(later + 1).await.unwrap();
            if lease.put_off == n {
                return;
            }
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    panic!("no notice was put off {n} times");
}

#[tokio::test]
async fn whoever_asked_is_told_of_the_end_with_a_signature() {
    let mut rig = Rig::new();
    let receiver = Receiver::start(&mut rig).await;
    let engine = rig.open().await;
    let worker = Worker::join(&engine, "w").await;
    let job = receiver.job(&engine).await;
    worker.see_through(job).await;
    let call = receiver.call(&engine, 1).await;
    let message = call.message();
    assert_eq!((call.path.as_str(), message.kind, message.job.id), ("/hook", WebhookEvent::Done, job));
    assert_eq!((message.job.state, message.at_ms), (JobState::Done, rig.clock.load(Ordering::SeqCst)));
    assert_eq!((call.header("webhook-timestamp"), call.header("content-type")), ("1000", "application/json"));
    assert!(!String::from_utf8_lossy(&call.body).contains(&receiver.address), "addresses may hold secrets");
    let cancelled = receiver.job(&engine).await;
    engine.cancel_job(cancelled).await.unwrap();
    let second = receiver.call(&engine, 2).await.message();
    assert_eq!((second.kind, second.job.id), (WebhookEvent::Cancelled, cancelled));
    assert_ne!(second.id, message.id);
    assert_eq!(problems(&engine, job).await, Vec::<String>::new());
}

#[tokio::test]
async fn a_receiver_that_fails_is_told_again_under_the_same_id_and_is_not_followed() {
    let mut rig = Rig::new();
    let receiver = Receiver::start(&mut rig).await;
    let engine = rig.open().await;
    receiver.answers(StatusCode::INTERNAL_SERVER_ERROR);
    let job = receiver.job(&engine).await;
    engine.cancel_job(job).await.unwrap();
    let first = receiver.call(&engine, 1).await.message();
    put_off(&engine, 1).await;
    receiver.answers(StatusCode::TEMPORARY_REDIRECT);
    rig.pass(&engine, 5_000).await;
    let second = receiver.call(&engine, 2).await;
    put_off(&engine, 2).await;
    // Another coordinator goes on where this one ended.
    engine.shut_down().await;
    drop(engine);
    let engine = rig.open().await;
    receiver.answers(StatusCode::NO_CONTENT);
    rig.pass(&engine, 60_000).await;
    let third = receiver.call(&engine, 3).await;
    assert_eq!((second.message().id, third.message().id), (first.id.clone(), first.id));
    assert_eq!((second.path.as_str(), third.path.as_str()), ("/hook", "/hook"), "a redirect leads nowhere");
    assert_eq!(third.header("webhook-timestamp"), "1065");
    rig.pass(&engine, 48 * 3_600_000).await;
    tokio::time::sleep(Duration::from_millis(50)).await;
    assert_eq!((receiver.count(), problems(&engine, job).await), (3, vec![]));
}

#[tokio::test]
async fn a_receiver_that_never_answers_is_given_up_after_a_day_and_the_job_stays_done() {
    let mut rig = Rig::new();
    let receiver = Receiver::start(&mut rig).await;
    let engine = rig.open().await;
    receiver.answers(StatusCode::BAD_GATEWAY);
    let worker = Worker::join(&engine, "w").await;
    let job = receiver.job(&engine).await;
    worker.see_through(job).await;
    let began = rig.clock.load(Ordering::SeqCst);
    for n in 1..=8 {
        receiver.call(&engine, n).await;
        put_off(&engine, n as u32).await;
        rig.pass(&engine, 8 * 3_600_000).await;
    }
    receiver.call(&engine, 9).await;
    while problems(&engine, job).await.is_empty() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let said = problems(&engine, job).await;
    assert!(said.len() == 1 && said[0].contains("tried 9 times") && said[0].contains("502"), "{said:?}");
    let record = engine.job(job).await.unwrap();
    assert_eq!((record.state, record.problem, record.waiting, record.finished_ms), (JobState::Done, None, None, Some(began)));
    rig.pass(&engine, 48 * 3_600_000).await;
    assert_eq!(receiver.count(), 9);
    // One that wants no more is not asked again.
    receiver.answers(StatusCode::GONE);
    let unwanted = receiver.job(&engine).await;
    engine.cancel_job(unwanted).await.unwrap();
    receiver.call(&engine, 10).await;
    while problems(&engine, unwanted).await.is_empty() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn a_deleted_job_is_told_of_no_more() {
    let mut rig = Rig::new();
    let receiver = Receiver::start(&mut rig).await;
    let engine = rig.open().await;
    receiver.answers(StatusCode::INTERNAL_SERVER_ERROR);
    let job = receiver.job(&engine).await;
    engine.cancel_job(job).await.unwrap();
    receiver.call(&engine, 1).await;
    put_off(&engine, 1).await;
    engine.delete_job(job).await.unwrap();
    rig.pass(&engine, 3_600_000).await;
    // The notice ends: nobody is left to be put off.
    while engine.core.store.take_notice(Token::random(), i64::MAX, engine.now() + 48 * 3_600_000).await.unwrap().is_some() {
        engine.core.store.take_over_tasks(i64::MAX).await.unwrap();
        engine.core.signals.tasks.notify_waiters();
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(receiver.count(), 1);
}

#[tokio::test]
async fn what_is_not_allowed_is_refused_when_it_is_asked_for() {
    let mut rig = Rig::new();
    let receiver = Receiver::start(&mut rig).await;
    let engine = rig.open().await;
    let scene = ready_scene(&engine).await;
    let refusal = async |engine: &Engine, address: &str| {
        let new = NewJob { webhook: Some(address.to_owned()), ..new_job(&scene) };
        match engine.create_job(new, &Principal::Local).await {
            Err(EngineError::Webhook(bad)) => bad.to_string(),
            other => panic!("{other:?}"),
        }
    };
    assert!(refusal(&engine, "http://127.0.0.1:1/").await.contains("--webhook-allow 127.0.0.1:1"));
    engine.shut_down().await;
    drop(engine);
    rig.base.webhooks = WebhookConfig::default();
    let engine = rig.open().await;
    assert!(refusal(&engine, &receiver.address).await.contains("--webhook-secret-file"));
    assert_eq!(engine.jobs(&JobFilter::default()).await.unwrap().jobs.len(), 0);
}
