//! What holds for every answer, whatever the engine knows.

use super::*;
use crate::http::catalogue::Kind;
use axum::{http::Method, routing::get};

#[tokio::test]
async fn every_answer_carries_the_security_headers_and_an_id() {
    let bench = Bench::new().await;
    for path in ["/", "/about", "/healthz", "/nowhere", "/v1/jobs?limt=3", "/openapi.json"] {
        let reply = bench.get(path).await;
        assert_eq!(reply.headers[header::X_CONTENT_TYPE_OPTIONS], "nosniff", "{path}");
        assert!(reply.headers[header::CONTENT_SECURITY_POLICY].to_str().unwrap().starts_with("default-src 'none'"), "{path}");
        assert!(reply.headers.contains_key("x-request-id") && reply.headers.contains_key(header::REFERRER_POLICY), "{path}");
    }
}

#[tokio::test]
async fn unknown_paths_methods_and_parameters_are_problems() {
    let bench = Bench::new().await;
    assert_eq!(bench.get("/nowhere").await.problem().1, "not-found");
    let reply = bench.send(Request::delete("/v1/jobs").body(Body::empty()).unwrap()).await;
    assert_eq!(reply.problem().0, 405);
    let allowed = reply.headers[header::ALLOW].to_str().unwrap();
    assert!(allowed.contains("GET") && allowed.contains("POST"), "{allowed}");
    let (status, kind, detail) = bench.get("/v1/jobs?limt=3").await.problem();
    assert_eq!((status, kind.as_str()), (400, "invalid-request"));
    assert!(detail.contains("limt"), "{detail}");
    assert_eq!(bench.get("/v1/jobs?state=burning").await.problem().0, 400);
    assert_eq!(bench.get("/v1/jobs?label=nameless").await.problem().0, 400);
}

#[tokio::test]
async fn foreign_hosts_and_pages_are_refused() {
    let bench = Bench::new().await;
    let ask = |name: header::HeaderName, text: &str| Request::get("/healthz").header(name, text).body(Body::empty()).unwrap();
    assert_eq!(bench.send(ask(header::HOST, "kiln.evil.example")).await.problem().1, "foreign-host");
    assert_eq!(bench.send(ask(header::ORIGIN, "https://evil.example")).await.problem().1, "foreign-origin");
    assert_eq!(bench.send(ask(header::HOST, "localhost:8080")).await.status, StatusCode::OK);
}

#[tokio::test]
async fn json_is_judged_with_field_and_position() {
    let bench = Bench::new().await;
    for (json, status, kind, word) in [
        ("{\"scene\": ", 400, "invalid-json", "EOF"),
        ("{}", 422, "wrong-shape", "scene"),
        (r#"{"scene": 7}"#, 422, "wrong-shape", "string"),
        (r#"{"scene": "x", "prority": 1}"#, 422, "wrong-shape", "prority"),
        (r#"{"scene": "x", "settings": {"sampels": 1}}"#, 422, "wrong-shape", "sampels"),
        (r#"{"scene": "x", "settings": {"samples": "many"}}"#, 422, "wrong-shape", "many"),
        (r#"{"scene": "x", "settings": {"samples": 0}}"#, 422, "invalid-settings", "samples"),
        (r#"{"scene": "x", "settings": {"texture_sizes": {"floor": "0x0"}}}"#, 422, "wrong-shape", "0x0"),
        (r#"{"scene": "x", "settings": {"eps": 2, "rule": "thesis"}}"#, 422, "invalid-settings", "eps"),
    ] {
        let (found, name, detail) = bench.post_json("/v1/jobs", json).await.problem();
        assert_eq!((found, name.as_str()), (status, kind), "{json}: {detail}");
        assert!(detail.contains(word), "{json}: {detail}");
    }
    let untyped = Request::post("/v1/jobs").body(Body::from("{}")).unwrap();
    assert_eq!(bench.send(untyped).await.problem().0, 415);
    let vast = format!("{{\"scene\": \"{}\"}}", "x".repeat(5 << 20));
    assert_eq!(bench.post_json("/v1/jobs", &vast).await.problem().0, 413);
}

#[tokio::test]
async fn a_panic_is_an_internal_problem_and_the_service_goes_on() {
    let bench = Bench::new().await;
    let app = App::new(Arc::clone(&bench.engine), HostPolicy::Loopback, None, CancellationToken::new());
    let routes =
        Router::new().route("/panic", get(async || -> &'static str { panic!("the secret reason") })).route("/fine", get(async || "fine"));
    let router = app.surround(routes);
    let request = |path: &str| Request::get(path).body(Body::empty()).unwrap();
    let reply = send(&router, request("/panic")).await;
    assert_eq!(reply.problem().1, "internal");
    assert!(!String::from_utf8_lossy(&reply.body).contains("secret"));
    assert!(reply.headers.contains_key("x-request-id"));
    assert_eq!(send(&router, request("/fine")).await.body, "fine");
}

#[tokio::test]
async fn every_kind_of_problem_has_its_page() {
    let bench = Bench::new().await;
    for kind in Kind::ALL {
        let reply = bench.get(&kind.uri()).await;
        assert_eq!(reply.status, StatusCode::OK, "{kind:?}");
        assert!(reply.headers[header::CONTENT_TYPE].to_str().unwrap().starts_with("text/html"));
    }
    assert_eq!(bench.get("/problems/none-such").await.problem().0, 404);
}

#[tokio::test]
async fn requests_are_counted_by_their_route() {
    let bench = Bench::new().await;
    bench.get("/problems/busy").await;
    bench.send(Request::builder().method(Method::HEAD).uri("/healthz").body(Body::empty()).unwrap()).await;
    let reply = bench.get("/metrics").await;
    let text = String::from_utf8(reply.body.to_vec()).unwrap();
    for line in [
        "kiln_http_requests_total{route=\"/problems/{slug}\",method=\"GET\",status=\"200\"} 1",
        "kiln_http_requests_total{route=\"/healthz\",method=\"HEAD\",status=\"200\"} 1",
        "# TYPE kiln_tiles_pending gauge",
    ] {
        assert!(text.contains(line), "{line} is missing in\n{text}");
    }
}

#[tokio::test]
async fn a_working_service_is_ready() {
    let bench = Bench::new().await;
    assert_eq!((bench.get("/healthz").await.status, bench.get("/readyz").await.status), (StatusCode::OK, StatusCode::OK));
    bench.engine.shut_down().await;
    assert_eq!(bench.get("/readyz").await.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(bench.get("/healthz").await.status, StatusCode::OK);
}
