//! Every route for every kind of caller, against a table written by hand.

use super::*;
use crate::http::routes::Routes;
use kiln_proto::ids::Digest;

/// Who gets past the gate: Anonymous, Submit, Read, Worker, Admin.
const TABLE: &[(&str, &str, &str)] = &[
    ("get", "/", "ASRWX"),
    ("get", "/jobs/{id}", "ASRWX"),
    ("get", "/assets/{*path}", "ASRWX"),
    ("get", "/kiln-viewer.js", "ASRWX"),
    ("get", "/about", " SR X"),
    ("get", "/problems/{slug}", "ASRWX"),
    ("get", "/openapi.json", " SR X"),
    ("post", "/v1/scenes", " S  X"),
    ("get", "/v1/scenes/{scene}", " SR X"),
    ("post", "/v1/bakes", " S  X"),
    ("post", "/v1/jobs", " S  X"),
    ("get", "/v1/jobs", " SR X"),
    ("get", "/v1/jobs/{id}", " SR X"),
    ("patch", "/v1/jobs/{id}", " S  X"),
    ("post", "/v1/jobs/{id}/retry", " S  X"),
    ("delete", "/v1/jobs/{id}", " S  X"),
    ("post", "/v1/jobs/{id}/cancel", " S  X"),
    ("get", "/v1/jobs/{id}/events", " SR X"),
    ("get", "/v1/jobs/{id}/scene.kiln", " SR X"),
    ("get", "/v1/jobs/{id}/segments", " SR X"),
    ("get", "/v1/jobs/{id}/tiles", " SR X"),
    ("get", "/v1/jobs/{id}/assets", " SR X"),
    ("get", "/v1/jobs/{id}/assets/{*path}", " SR X"),
    ("get", "/v1/jobs/{id}/bundle.zip", " SR X"),
    ("get", "/v1/jobs/{id}/bundle.tar.zst", " SR X"),
    ("get", "/v1/jobs/{id}/preview.png", " SR X"),
    ("post", "/v1/jobs/{id}/links", " S  X"),
    ("post", "/v1/session", "ASRWX"),
    ("delete", "/v1/session", "ASRWX"),
    ("post", "/v1/worker/hello", "   W "),
    ("post", "/v1/worker/leases", "   W "),
    ("get", "/v1/worker/scenes/{hash}", "   W "),
    ("get", "/v1/worker/plans/{digest}", "   W "),
    ("put", "/v1/worker/attempts/{token}/chunks/{n}", "   W "),
    ("post", "/v1/worker/attempts/{token}/heartbeat", "   W "),
    ("post", "/v1/worker/attempts/{token}/complete", "   W "),
    ("post", "/v1/worker/attempts/{token}/release", "   W "),
    ("get", "/v1/workers", " SR X"),
    ("get", "/v1/throughput", " SR X"),
    ("get", "/healthz", "ASRWX"),
    ("get", "/readyz", "ASRWX"),
    ("get", "/metrics", "  R X"),
];

/// A path with something in the place of its parameters: nothing that exists.
fn filled(path: &str) -> String {
    let nothing = |part: &str| match part {
        "{id}" | "{token}" => "0198f2c4-1111-7222-8333-444455556666".to_owned(),
        "{n}" => "0".to_owned(),
        part if part.starts_with('{') => "nothing".to_owned(),
        part => part.to_owned(),
    };
    path.split('/').map(nothing).collect::<Vec<_>>().join("/")
}

#[tokio::test]
async fn every_route_lets_those_pass_that_the_table_names_and_no_others() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let routes: Vec<(&str, &str)> = Routes::all().list.iter().map(|route| (route.verb.name(), route.path)).collect();
    let mut written: Vec<(&str, &str)> = TABLE.iter().map(|(verb, path, _)| (*verb, *path)).collect();
    for route in &routes {
        assert!(written.contains(route), "{route:?} is not in the table of this test: who may use it?");
    }
    written.retain(|route| !routes.contains(route));
    assert_eq!(written, [], "routes that are not served");
    let mut callers = vec![('A', None)];
    for (letter, role) in ['S', 'R', 'W', 'X'].into_iter().zip(Role::ALL) {
        callers.push((letter, Some(bench.holder(&[role]).await)));
    }
    for (verb, path, passing) in TABLE {
        let upper = verb.to_uppercase();
        let methods = if *verb == "get" { vec!["GET", "HEAD"] } else { vec![upper.as_str()] };
        for (method, (letter, holder)) in methods.iter().flat_map(|m| callers.iter().map(move |c| (m, c))) {
            let mut request = Request::builder().method(*method).uri(filled(path));
            if let Some(holder) = holder {
                request = request.header(header::AUTHORIZATION, holder.bearer());
            }
            let reply = bench.send(request.body(Body::empty()).unwrap()).await;
            let refused = matches!(reply.status, StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN);
            let place = format!("{method} {path} as {letter}: {}", reply.status);
            assert_eq!(!refused, passing.contains(*letter), "{place}");
            if refused {
                let expected = if holder.is_none() { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
                assert_eq!(reply.status, expected, "{place}");
                assert_eq!(reply.headers.contains_key(header::WWW_AUTHENTICATE), holder.is_none(), "{place}");
            }
        }
    }
}

#[tokio::test]
async fn what_does_not_exist_is_told_only_to_those_who_are_known() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let worker = bench.holder(&[Role::Worker]).await;
    for (method, path, status) in [("GET", "/nowhere", 404), ("PATCH", "/v1/jobs", 405), ("OPTIONS", "/v1/jobs", 405)] {
        let nobody = bench.send(Request::builder().method(method).uri(path).body(Body::empty()).unwrap()).await;
        assert_eq!(nobody.problem().1, "unauthenticated", "{method} {path}");
        assert_eq!(bench.by(&worker, method, path).await.status.as_u16(), status, "{method} {path}");
    }
}

#[tokio::test]
async fn tokens_that_are_none_wrong_or_revoked_are_told_apart_from_each_other() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let (good, revoked) = (bench.holder(&[Role::Read]).await, bench.holder(&[Role::Read]).await);
    Desk::new(bench.engine.tokens()).revoke(revoked.id, bench.engine.now()).await.unwrap();
    let altered = format!("{}0", &good.bearer()[..good.bearer().len() - 1]);
    let altered = if altered == good.bearer() { altered.replace('0', "g") } else { altered };
    for (value, words) in [
        ("Basic eDp5".to_owned(), "not a Kiln token"),
        ("Bearer kiln_what".to_owned(), "not a Kiln token"),
        (altered, "unknown here"),
        (revoked.bearer(), "revoked"),
    ] {
        let reply = bench.send(Request::get("/v1/jobs").header(header::AUTHORIZATION, value).body(Body::empty()).unwrap()).await;
        let (status, kind, detail) = reply.problem();
        assert_eq!((status, kind.as_str()), (401, "unauthenticated"));
        assert!(detail.contains(words), "{detail}");
        assert!(reply.headers[header::WWW_AUTHENTICATE].to_str().unwrap().contains("invalid_token"));
    }
    assert_eq!(bench.by(&good, "GET", "/v1/jobs").await.status, StatusCode::OK);
}

#[tokio::test]
async fn roles_add_up() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let both = bench.holder(&[Role::Read, Role::Worker]).await;
    assert_eq!(bench.by(&both, "GET", "/metrics").await.status, StatusCode::OK);
    assert_eq!(bench.by(&both, "POST", "/v1/worker/hello").await.status, StatusCode::BAD_REQUEST, "an empty frame");
    let (status, _, detail) = bench.by(&both, "POST", "/v1/jobs").await.problem();
    assert!(status == 403 && detail.contains("submit or admin"), "{detail}");
}

#[tokio::test]
async fn the_service_s_own_workers_work_and_do_nothing_else() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let own = Secret::new("known to this process alone");
    let hash = Digest::of(own.expose().as_bytes());
    let router = App::new(Arc::clone(&bench.engine), HostPolicy::Any, Some(hash), CancellationToken::new()).router();
    let ask = |secret: &str, path: &str| {
        let request = Request::post(path).header(header::AUTHORIZATION, format!("Bearer {secret}"));
        send(&router, request.body(Body::empty()).unwrap())
    };
    assert_eq!(ask(own.expose(), "/v1/worker/hello").await.status, StatusCode::BAD_REQUEST, "an empty frame");
    assert_eq!(ask(own.expose(), "/v1/jobs").await.status, StatusCode::FORBIDDEN);
    assert_eq!(ask("known to this process alon", "/v1/worker/hello").await.status, StatusCode::UNAUTHORIZED);
}

#[tokio::test]
async fn without_tokens_everyone_on_loopback_may_do_everything_and_a_token_changes_nothing() {
    let bench = Bench::new().await;
    let stale = Request::get("/v1/jobs").header(header::AUTHORIZATION, "Bearer of another farm").body(Body::empty()).unwrap();
    assert_eq!(bench.send(stale).await.status, StatusCode::OK);
    assert_eq!(bench.get("/metrics").await.status, StatusCode::OK);
    assert_eq!(bench.send(Request::post("/v1/worker/hello").body(Body::empty()).unwrap()).await.status, StatusCode::BAD_REQUEST);
}

#[tokio::test]
async fn the_first_token_closes_a_service_that_needs_no_host_any_more() {
    let bench = Bench::new().await;
    let holder = bench.holder(&[Role::Read]).await;
    assert_eq!(bench.get("/v1/jobs").await.problem().1, "unauthenticated");
    let named = Request::get("/v1/jobs").header(header::HOST, "bake.example").header(header::AUTHORIZATION, holder.bearer());
    assert_eq!(bench.send(named.body(Body::empty()).unwrap()).await.status, StatusCode::OK, "behind a proxy, under a name of its own");
}
