//! What the log tells: who did what, and never a secret.

use super::*;
use std::{
    io::{self, Write},
    sync::Mutex,
};
use tracing_subscriber::{filter::LevelFilter, fmt::MakeWriter};

/// A log in memory.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for Log {
    type Writer = Log;
    fn make_writer(&'a self) -> Log {
        self.clone()
    }
}

#[tokio::test]
async fn the_log_names_who_did_what_and_never_holds_a_token() {
    let log = Log::default();
    let subscriber = tracing_subscriber::fmt().with_max_level(LevelFilter::TRACE).with_writer(log.clone()).with_ansi(false).finish();
    let _guard = tracing::subscriber::set_default(subscriber);
    let bench = Bench::closed(AccessConfig::default()).await;
    let (holder, other, lost) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Read]).await, bench.holder(&[Role::Read]).await);
    let desk = Desk::new(bench.engine.tokens());
    desk.revoke(lost.id, bench.engine.now()).await.unwrap();
    let rotated = desk.rotate(other.id).await.unwrap();
    let (job, ..) = bench.job_of(&holder).await;
    bench.by(&lost, "GET", "/v1/jobs").await;
    bench.by(&holder, "GET", "/metrics").await;
    let body = |who: &Holder| format!(r#"{{"token": "{}"}}"#, who.token.expose());
    let opened = bench.post_json("/v1/session", &body(&holder)).await;
    bench.post_json("/v1/session", &body(&lost)).await;
    bench.send(Request::delete("/v1/session").body(Body::empty()).unwrap()).await;
    let made = bench.send(holder.request("POST", &format!("/v1/jobs/{job}/links"), "{}")).await.json();
    bench.get(made["url"].as_str().unwrap()).await;
    bench.by(&holder, "POST", &format!("/v1/jobs/{job}/cancel")).await;
    bench.by(&holder, "DELETE", &format!("/v1/jobs/{job}")).await;
    let text = String::from_utf8(log.0.lock().unwrap().clone()).unwrap();
    let audit: Vec<&str> = text.lines().filter(|line| line.contains("kiln::audit")).collect();
    let audit_of = |action: &str, words: &[&str]| {
        let found = audit.iter().any(|line| line.contains(&format!("action=\"{action}\"")) && words.iter().all(|word| line.contains(word)));
        assert!(found, "{action} {words:?} is missing in\n{}", audit.join("\n"));
    };
    let who = format!("principal=token:{}", holder.id);
    audit_of("token-created", &["principal=local", &holder.id.to_string()]);
    audit_of("token-revoked", &[&lost.id.to_string()]);
    audit_of("token-rotated", &[&other.id.to_string()]);
    audit_of("denied", &["principal=anonymous", &lost.id.to_string(), "revoked"]);
    audit_of("forbidden", &[&who, "/metrics"]);
    audit_of("logged-in", &[&who]);
    audit_of("logged-out", &[]);
    for action in ["job-created", "job-cancelled", "job-deleted", "link-signed"] {
        audit_of(action, &[&who, &job]);
    }
    let secret = |text: &str| text.rsplit('_').next().unwrap().to_owned();
    let cookie = opened.headers[header::SET_COOKIE].to_str().unwrap().split('.').nth(2).unwrap()[..64].to_owned();
    let signature = made["url"].as_str().unwrap().split("signature=").nth(1).unwrap().to_owned();
    let tokens = [&holder.token, &other.token, &lost.token, &rotated.text].map(|token| secret(token.expose()));
    for hidden in tokens.iter().chain([&cookie, &signature]) {
        assert!(hidden.len() >= 52 && !text.contains(hidden.as_str()), "the log holds {hidden}");
    }
}
