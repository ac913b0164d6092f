//! Browsers' sessions and signed links.

use super::*;
use axum::http::request::Builder;

async fn log_in(bench: &Bench, token: &str) -> Reply {
    bench.post_json("/v1/session", &serde_json::json!({ "token": token }).to_string()).await
}

/// The cookie of an answer, as a browser sends it back.
fn cookie(reply: &Reply) -> String {
    reply.headers[header::SET_COOKIE].to_str().unwrap().split(';').next().unwrap().to_owned()
}

#[tokio::test]
async fn a_token_is_traded_for_a_cookie_that_scripts_cannot_read() {
    let bench = Bench::closed(AccessConfig { session_s: 600, ..AccessConfig::default() }).await;
    let holder = bench.holder(&[Role::Submit]).await;
    let reply = log_in(&bench, holder.token.expose()).await;
    assert_eq!(reply.status, StatusCode::OK, "{:?}", reply.body);
    let set = reply.headers[header::SET_COOKIE].to_str().unwrap();
    for attribute in ["kiln_session=", "; HttpOnly", "; SameSite=Strict", "; Path=/", "; Max-Age=600"] {
        assert!(set.contains(attribute), "{set}");
    }
    assert!(!set.contains("Secure"), "a browser over plain HTTP would not send it back");
    let secret = holder.token.expose().rsplit('_').next().unwrap();
    assert!(!set.contains(secret) && !String::from_utf8_lossy(&reply.body).contains(secret));
    assert_eq!((&reply.json()["token"], &reply.json()["roles"]), (&holder.id.to_string().into(), &serde_json::json!(["submit"])));
    let asked = Request::get("/v1/jobs").header(header::COOKIE, cookie(&reply)).body(Body::empty()).unwrap();
    assert_eq!(bench.send(asked).await.status, StatusCode::OK);
    let closed = bench.send(Request::delete("/v1/session").body(Body::empty()).unwrap()).await;
    assert_eq!(closed.status, StatusCode::NO_CONTENT);
    assert!(closed.headers[header::SET_COOKIE].to_str().unwrap().starts_with("kiln_session=; Path=/; Max-Age=0"));
    let proxied = Request::post("/v1/session").header("x-forwarded-proto", "https").header(header::CONTENT_TYPE, "application/json");
    let body = format!(r#"{{"token": "{}"}}"#, holder.token.expose());
    let reply = bench.send(proxied.body(body.into()).unwrap()).await;
    assert!(reply.headers[header::SET_COOKIE].to_str().unwrap().ends_with("; Secure"));
}

#[tokio::test]
async fn bad_tokens_and_bad_cookies_open_nothing() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let holder = bench.holder(&[Role::Submit]).await;
    for bad in ["", "kiln_x", &holder.token.expose()[..20]] {
        assert_eq!(log_in(&bench, bad).await.problem().1, "unauthenticated");
    }
    let good = cookie(&log_in(&bench, holder.token.expose()).await);
    let asked = |cookie: String| bench_get(&bench, cookie);
    assert_eq!(asked(good.clone()).await.status, StatusCode::OK);
    let last = good.chars().last().unwrap();
    let flipped = format!("{}{}", &good[..good.len() - 1], if last == '0' { '1' } else { '0' });
    for bad in [flipped, good[..good.len() - 1].to_owned(), "kiln_session=".to_owned()] {
        assert_eq!(asked(bad).await.problem().1, "unauthenticated");
    }
    Desk::new(bench.engine.tokens()).revoke(holder.id, 1).await.unwrap();
    // A service that has not looked a moment ago.
    let router = App::new(Arc::clone(&bench.engine), HostPolicy::Any, None, CancellationToken::new()).router();
    let request = Request::get("/v1/jobs").header(header::COOKIE, good).body(Body::empty()).unwrap();
    assert_eq!(send(&router, request).await.problem().1, "unauthenticated", "the token was revoked");
}

async fn bench_get(bench: &Bench, cookie: String) -> Reply {
    bench.send(Request::get("/v1/jobs").header(header::COOKIE, cookie).body(Body::empty()).unwrap()).await
}

#[tokio::test]
async fn a_cookie_changes_things_only_from_a_page_of_this_service() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let holder = bench.holder(&[Role::Submit]).await;
    let (job, ..) = bench.job_of(&holder).await;
    let cookie = cookie(&log_in(&bench, holder.token.expose()).await);
    let post = || Request::post(format!("/v1/jobs/{job}/cancel")).header(header::COOKIE, &cookie).header(header::HOST, "bake.example");
    let from = |request: Builder| bench.send(request.body(Body::empty()).unwrap());
    assert_eq!(from(post()).await.problem().1, "foreign-origin", "no word of the browser");
    for site in ["cross-site", "same-site", "none"] {
        assert_eq!(from(post().header("sec-fetch-site", site)).await.problem().1, "foreign-origin", "{site}");
    }
    assert_eq!(from(post().header(header::ORIGIN, "https://evil.example")).await.problem().1, "foreign-origin");
    assert_eq!(from(post().header(header::ORIGIN, "https://bake.example")).await.status, StatusCode::OK);
    assert_eq!(from(post().header("sec-fetch-site", "same-origin")).await.status, StatusCode::OK);
    let foreign = Request::post("/v1/session").header("sec-fetch-site", "cross-site").header(header::CONTENT_TYPE, "application/json");
    let body = format!(r#"{{"token": "{}"}}"#, holder.token.expose());
    assert_eq!(bench.send(foreign.body(body.into()).unwrap()).await.problem().1, "foreign-origin", "nobody is logged in by a foreign page");
}

/// What stands for a finished package here: a job that is not done answers 409 to those who get past the gate.
const PAST_THE_GATE: u16 = 409;

async fn link(bench: &Bench, who: &Holder, job: &str, json: &str) -> Reply {
    bench.send(who.request("POST", &format!("/v1/jobs/{job}/links"), json.to_owned())).await
}

#[tokio::test]
async fn a_signed_link_reads_its_file_and_nothing_else() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let holder = bench.holder(&[Role::Submit]).await;
    let ((job, ..), (other, ..)) = (bench.job_of(&holder).await, bench.job_of(&holder).await);
    for path in ["bundle.zip", "bundle.tar.zst", "assets", "assets/surfaces/the floor.mtsp", "preview.png"] {
        let made = link(&bench, &holder, &job, &serde_json::json!({ "path": path, "expires_s": 60 }).to_string()).await.json();
        let url = made["url"].as_str().unwrap().to_owned();
        assert_eq!(bench.get(&url).await.status.as_u16(), PAST_THE_GATE, "{url}");
        if path == "preview.png" {
            assert_eq!(bench.get(&format!("{url}&w=64&h=48")).await.status.as_u16(), PAST_THE_GATE, "any view");
        }
        let elsewhere = url.replace(&job, &other);
        let longer = url.replace("expires=", "expires=9");
        let unsigned = url.split("&signature").next().unwrap().to_owned();
        let events = url.replace(path, "events").replace("surfaces/the%20floor.mtsp", "");
        for forged in [elsewhere, longer, unsigned, events] {
            assert!(matches!(bench.get(&forged).await.status, StatusCode::UNAUTHORIZED), "{forged}");
        }
        let delete = Request::delete(&url).body(Body::empty()).unwrap();
        assert_eq!(bench.send(delete).await.status, StatusCode::UNAUTHORIZED, "{url}");
        // Whoever has a token of one's own may follow the link, too.
        assert_eq!(bench.by(&holder, "GET", &url).await.status.as_u16(), PAST_THE_GATE);
    }
    let usual = link(&bench, &holder, &job, "{}").await.json();
    assert!(usual["url"].as_str().unwrap().contains("/bundle.zip?expires="));
    for bad in [r#"{"path": "events"}"#, r#"{"path": "assets/../events"}"#, r#"{"expires_s": 0}"#, r#"{"expires_s": 99999999}"#] {
        assert_eq!(link(&bench, &holder, &job, bad).await.problem().1, "wrong-shape", "{bad}");
    }
}

#[tokio::test]
async fn links_work_on_an_open_service_too() {
    let bench = Bench::new().await;
    let job = bench.job().await;
    let made = bench.post_json(&format!("/v1/jobs/{job}/links"), r#"{"path": "preview.png"}"#).await.json();
    assert_eq!(bench.get(made["url"].as_str().unwrap()).await.status.as_u16(), PAST_THE_GATE);
}
