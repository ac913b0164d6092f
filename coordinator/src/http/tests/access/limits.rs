//! How often tokens and addresses may ask.

use super::*;

#[tokio::test]
async fn a_token_that_asks_too_often_is_told_when_to_come_back_and_others_are_not() {
    let bench = Bench::frozen(AccessConfig { requests_per_s: 1, burst: 3, ..AccessConfig::default() }).await;
    let (busy, calm) = (bench.holder(&[Role::Read]).await, bench.holder(&[Role::Read]).await);
    let worker = bench.holder(&[Role::Worker]).await;
    for _ in 0..3 {
        assert_eq!(bench.by(&busy, "GET", "/v1/jobs").await.status, StatusCode::OK);
    }
    let refused = bench.by(&busy, "GET", "/v1/jobs").await;
    assert_eq!(refused.problem().1, "too-many-requests");
    assert_eq!(refused.headers[header::RETRY_AFTER], "1");
    assert_eq!(bench.by(&calm, "GET", "/v1/jobs").await.status, StatusCode::OK);
    for _ in 0..20 {
        assert_eq!(bench.by(&worker, "POST", "/v1/worker/hello").await.status, StatusCode::BAD_REQUEST, "workers are not counted");
    }
}

#[tokio::test]
async fn what_is_forbidden_is_counted_too() {
    let bench = Bench::frozen(AccessConfig { requests_per_s: 1, burst: 2, ..AccessConfig::default() }).await;
    let (reader, submitter) = (bench.holder(&[Role::Read]).await, bench.holder(&[Role::Submit]).await);
    for (holder, method, path) in [(&reader, "POST", "/v1/jobs"), (&submitter, "POST", "/v1/worker/hello")] {
        for _ in 0..2 {
            assert_eq!(bench.by(holder, method, path).await.problem().1, "forbidden");
        }
        assert_eq!(bench.by(holder, method, path).await.problem().1, "too-many-requests", "{path}");
    }
}

#[tokio::test]
async fn an_address_that_guesses_is_refused_before_it_is_asked_who_it_is() {
    let bench = Bench::frozen(AccessConfig::default()).await;
    let (known, fresh) = (bench.holder(&[Role::Read]).await, bench.holder(&[Role::Read]).await);
    assert_eq!(bench.by(&known, "GET", "/v1/jobs").await.status, StatusCode::OK);
    let guess = || Request::get("/v1/jobs").header(header::AUTHORIZATION, known.bearer().replace('_', "-"));
    let mut kinds = BTreeSet::new();
    for _ in 0..40 {
        kinds.insert(bench.send(guess().body(Body::empty()).unwrap()).await.problem().1);
    }
    assert_eq!(kinds, ["too-many-requests", "unauthenticated"].map(str::to_owned).into());
    assert_eq!(bench.by(&known, "GET", "/v1/jobs").await.status, StatusCode::OK, "who is known already is not locked out");
    let refused = bench.by(&fresh, "GET", "/v1/jobs").await;
    assert_eq!(refused.problem().1, "too-many-requests");
    assert!(refused.headers.contains_key(header::RETRY_AFTER));
    let log_in = bench.post_json("/v1/session", &format!(r#"{{"token": "{}"}}"#, fresh.token.expose())).await;
    assert_eq!(log_in.problem().1, "too-many-requests", "the other way in has the same lock");
    assert_eq!(bench.get("/healthz").await.status, StatusCode::OK);
}
