//! Requests with an Idempotency-Key.

use super::*;
use crate::{
    auth::TokenId,
    store::{Claimed, NewRequest},
};
use kiln_proto::ids::{Digest, Token};
use uuid::Uuid;

impl Bench {
    async fn with_key(&self, path: &str, key: &str, media: &str, body: impl Into<Body>) -> Reply {
        let request = Request::post(path).header(header::CONTENT_TYPE, media).header("idempotency-key", key);
        self.send(request.body(body.into()).unwrap()).await
    }

    async fn job_with_key(&self, key: &str, body: &str) -> Reply {
        self.with_key("/v1/jobs", key, "application/json", body.to_owned()).await
    }

    async fn scene(&self) -> String {
        let scene = self.post_parts("/v1/scenes", parts(&[("scene", Some("a.obj"), OBJ)])).await.json();
        scene["id"].as_str().unwrap().to_owned()
    }

    async fn count(&self, list: &str) -> usize {
        self.get("/v1/jobs").await.json()[list].as_array().unwrap().len()
    }

    /// What a request to create a job leaves behind that a coordinator died over, or works on.
    async fn claim(&self, key: &str, body: &str, deadline: i64) -> Uuid {
        let print = Digest::of(format!("POST /v1/jobs\n{}", Digest::of(body.as_bytes())).as_bytes());
        let (owner, subject, claim) = (None, Uuid::now_v7(), Token::random());
        let request = NewRequest { owner, key: key.into(), print, subject, claim, deadline };
        assert_eq!(self.engine.requests().claim_request(&request, self.engine.now()).await.unwrap(), Claimed::Granted(subject));
        subject
    }
}

fn is_replay(reply: &Reply) -> bool {
    reply.headers.get("idempotency-replayed").is_some_and(|value| value == "true")
}

#[tokio::test]
async fn a_repeated_request_creates_one_job_and_has_one_answer() {
    let bench = Bench::new().await;
    let body = format!(r#"{{"scene": "{}", "settings": {{"preset": "draft"}}}}"#, bench.scene().await);
    let first = bench.job_with_key("one", &body).await;
    assert!(first.status == StatusCode::CREATED && !is_replay(&first), "{:?}", first.body);
    let id = first.json()["id"].as_str().unwrap().to_owned();
    bench.send(Request::post(format!("/v1/jobs/{id}/cancel")).body(Body::empty()).unwrap()).await;
    let again = bench.job_with_key("one", &body).await;
    assert!(is_replay(&again));
    assert_eq!((again.status, &again.body), (first.status, &first.body), "as it was then");
    for name in [header::LOCATION, header::CONTENT_TYPE] {
        assert_eq!(again.headers[&name], first.headers[&name]);
    }
    assert_eq!(bench.count("jobs").await, 1);
    let (status, kind, detail) = bench.job_with_key("one", &body.replace("draft", "preview")).await.problem();
    assert_eq!((status, kind.as_str()), (422, "idempotency-key-reused"), "{detail}");
    assert_eq!(bench.job_with_key("two", &body).await.status, StatusCode::CREATED);
    assert_eq!(bench.post_json("/v1/jobs", &body).await.status, StatusCode::CREATED);
    assert_eq!(bench.count("jobs").await, 3, "another key, and none, are other requests");
    // What creates nothing takes no key.
    let estimate = bench.with_key("/v1/jobs?dry_run=true", "one", "application/json", body.clone()).await;
    assert_eq!((estimate.status, is_replay(&estimate)), (StatusCode::OK, false));
}

#[tokio::test]
async fn refusals_are_remembered_and_what_never_arrived_is_not() {
    let bench = Bench::new().await;
    let unknown = format!(r#"{{"scene": "{}"}}"#, "0".repeat(64));
    let first = bench.job_with_key("k", &unknown).await;
    assert_eq!(first.problem().1, "unknown-scene");
    let again = bench.job_with_key("k", &unknown).await;
    assert_eq!((is_replay(&again), again.problem(), &again.body), (true, first.problem(), &first.body));
    let whole = parts(&[("scene", Some("a.obj"), OBJ)]);
    let cut = bench.with_key("/v1/scenes", "up", MULTIPART, whole[..whole.len() / 2].to_owned()).await;
    assert_eq!(cut.problem().1, "truncated-upload");
    assert_eq!(bench.with_key("/v1/scenes", "up", MULTIPART, whole).await.status, StatusCode::CREATED);
}

#[tokio::test]
async fn uploads_are_told_apart_by_names_and_contents_and_not_by_boundaries() {
    let bench = Bench::new().await;
    for path in ["/v1/scenes", "/v1/bakes"] {
        let body = parts(&[("settings", None, r#"{"preset": "draft"}"#), ("scene", Some("a.obj"), OBJ)]);
        let first = bench.with_key(path, path, MULTIPART, body.clone()).await;
        assert_eq!(first.status, StatusCode::CREATED, "{:?}", first.body);
        let again = bench.with_key(path, path, &MULTIPART.replace("frontier", "border"), body.replace("frontier", "border")).await;
        assert_eq!((is_replay(&again), &again.body), (true, &first.body), "{path}");
        for other in [
            body.replace("a.obj", "b.obj"),
            body.replace("f 1/1", "f  1/1"),
            body.replace("draft", "preview"),
            parts(&[("scene", Some("a.obj"), OBJ)]),
        ] {
            assert_eq!(bench.with_key(path, path, MULTIPART, other).await.problem().1, "idempotency-key-reused", "{path}");
        }
        let query = bench.with_key(&format!("{path}?up=z"), path, MULTIPART, body).await;
        assert_eq!(query.problem().1, "idempotency-key-reused", "{path}");
    }
    assert_eq!(bench.count("jobs").await, 1);
    let single = bench.with_key("/v1/scenes?name=a.obj", "single", "model/obj", OBJ).await;
    let again = bench.with_key("/v1/scenes?name=a.obj", "single", "model/obj", OBJ).await;
    assert_eq!((single.status, is_replay(&again), &again.body), (StatusCode::CREATED, true, &single.body));
}

#[tokio::test]
async fn while_the_first_is_under_way_the_second_is_told_to_wait() {
    let bench = Bench::new().await;
    let body = format!(r#"{{"scene": "{}"}}"#, bench.scene().await);
    bench.claim("k", &body, bench.engine.now() + 60_000).await;
    let reply = bench.job_with_key("k", &body).await;
    assert_eq!(reply.problem().1, "idempotency-key-in-use");
    assert_eq!((reply.status, &reply.headers[header::RETRY_AFTER]), (StatusCode::CONFLICT, &"1".parse().unwrap()));
    assert_eq!(bench.count("jobs").await, 0);
    // Whatever the order, several at once create one.
    let all = futures_util::future::join_all((0..6).map(|_| bench.job_with_key("race", &body))).await;
    for reply in &all {
        let fits = reply.status == StatusCode::CREATED || reply.problem().1 == "idempotency-key-in-use";
        assert!(fits, "{:?}", reply.body);
    }
    assert_eq!(all.iter().filter(|r| r.status == StatusCode::CREATED && !is_replay(r)).count(), 1);
    assert_eq!(bench.count("jobs").await, 1);
}

#[tokio::test]
async fn what_a_crash_cut_off_is_done_by_the_next_and_only_once() {
    let bench = Bench::new().await;
    let body = format!(r#"{{"scene": "{}"}}"#, bench.scene().await);
    let subject = bench.claim("k", &body, bench.engine.now()).await;
    let first = bench.job_with_key("k", &body).await;
    assert_eq!((first.status, first.json()["id"].as_str().unwrap().to_owned()), (StatusCode::CREATED, subject.to_string()));
    // The job was created, and the coordinator died before it could say so.
    let id = kiln_proto::ids::JobId(bench.claim("late", &body, bench.engine.now()).await);
    let new = serde_json::from_str(&body).unwrap();
    bench.engine.create_job_as(id, new, &crate::auth::Principal::Local).await.unwrap();
    assert_eq!(bench.job_with_key("late", &body).await.json()["id"], id.to_string());
    assert_eq!(bench.count("jobs").await, 2);
}

#[tokio::test]
async fn a_client_that_goes_away_finds_its_answer_when_it_comes_back() {
    let bench = Bench::new().await;
    let body = parts(&[("scene", Some("a.obj"), OBJ)]);
    let send = || bench.with_key("/v1/bakes", "k", MULTIPART, body.clone());
    let mut gone = Box::pin(send());
    // Both go on: the one may hold what the other waits for.
    let mut reply = loop {
        tokio::select! {
            _ = gone.as_mut() => break send().await,
            reply = send() => if reply.status == StatusCode::CONFLICT || is_replay(&reply) {
                break reply;
            },
        }
    };
    drop(gone);
    while reply.status == StatusCode::CONFLICT {
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
        reply = send().await;
    }
    assert!(reply.status == StatusCode::CREATED && is_replay(&reply), "{:?}", reply.body);
    assert_eq!(bench.count("jobs").await, 1);
}

#[tokio::test]
async fn keys_that_cannot_be_kept_are_refused() {
    let bench = Bench::new().await;
    let body = format!(r#"{{"scene": "{}"}}"#, bench.scene().await);
    for (key, word) in [("", "empty"), (&*"k".repeat(256), "255"), ("schlüssel", "ASCII")] {
        let (status, kind, detail) = bench.job_with_key(key, &body).await.problem();
        assert!(status == 400 && kind == "invalid-request" && detail.contains(word), "{status} {kind} {detail}");
    }
    let twice = Request::post("/v1/jobs").header("idempotency-key", "a").header("idempotency-key", "b");
    assert!(bench.send(twice.body(Body::empty()).unwrap()).await.problem().2.contains("more than once"));
    assert_eq!(bench.count("jobs").await, 0);
    for key in ["k".repeat(255), "\"8e03978e-40d5-43e8-bc93-6894a57f9324\"".to_owned()] {
        assert_eq!(bench.job_with_key(&key, &body).await.status, StatusCode::CREATED);
    }
}

#[tokio::test]
async fn answers_survive_a_restart_and_are_the_owners_own() {
    let bench = Bench::new().await;
    let body = format!(r#"{{"scene": "{}"}}"#, bench.scene().await);
    let first = bench.job_with_key("k", &body).await;
    let Bench { engine, router, folder } = bench;
    engine.shut_down().await;
    drop((engine, router));
    let bench = Bench::over(Engine::open(config(&folder)).await.unwrap(), folder);
    let again = bench.job_with_key("k", &body).await;
    assert_eq!((is_replay(&again), &again.body), (true, &first.body));
    let request = NewRequest {
        owner: Some(TokenId::from_random([1; 8])),
        key: "k".into(),
        print: Digest::of(b"other"),
        subject: Uuid::now_v7(),
        claim: Token::random(),
        deadline: i64::MAX,
    };
    let claimed = bench.engine.requests().claim_request(&request, bench.engine.now()).await.unwrap();
    assert_eq!(claimed, Claimed::Granted(request.subject));
}

#[tokio::test(flavor = "multi_thread")]
async fn any_coordinator_knows_the_answer_of_another() {
    let server = kiln_test_servers::Postgres::start();
    let url = server.database();
    let open = async || {
        let folder = TempDir::new().unwrap();
        let config = Config { store: Some(url.clone()), ..config(&folder) };
        Bench::over(Engine::open(config).await.unwrap(), folder)
    };
    let (one, other) = (open().await, open().await);
    let body = format!(r#"{{"scene": "{}"}}"#, one.scene().await);
    let first = one.job_with_key("k", &body).await;
    let again = other.job_with_key("k", &body).await;
    assert_eq!((first.status, is_replay(&again), &again.body), (StatusCode::CREATED, true, &first.body));
    assert_eq!(other.count("jobs").await, 1);
}
