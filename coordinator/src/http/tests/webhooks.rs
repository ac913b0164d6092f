//! Webhooks as clients ask for them.

use super::*;
use crate::webhook::WebhookConfig;

#[tokio::test]
async fn webhooks_that_are_not_allowed_are_refused_before_anything_is_kept() {
    let bench = Bench::new().await;
    let before = bench.files();
    let bake = parts(&[("scene", Some("a.obj"), OBJ)]);
    for reply in [
        bench.post_parts("/v1/bakes?webhook=https%3A%2F%2Fci.example%2F", bake.clone()).await,
        bench.post_parts("/v1/bakes?webhook=nonsense", bake).await,
    ] {
        let (status, kind, detail) = reply.problem();
        assert_eq!((status, kind.as_str(), &reply.json()["field"]), (422, "webhook-refused", &"webhook".into()), "{detail}");
        assert!(detail.contains("--webhook-allow"), "{detail}");
    }
    assert_eq!(bench.files(), before);
}

#[tokio::test]
async fn an_allowed_webhook_is_taken_and_not_told_to_others() {
    let folder = TempDir::new().unwrap();
    let secret = folder.path().join("secret");
    std::fs::write(&secret, "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw\n").unwrap();
    let webhooks = WebhookConfig { allow: vec!["ci.invalid".into()], secret_file: Some(secret) };
    let bench = Bench::over(Engine::open(Config { webhooks, ..config(&folder) }).await.unwrap(), folder);
    let bake = bench.post_parts("/v1/bakes?webhook=https%3A%2F%2Fci.invalid%2Fsecret", parts(&[("scene", Some("a.obj"), OBJ)])).await;
    assert_eq!(bake.status, StatusCode::CREATED, "{:?}", bake.body);
    let scene = bake.json()["scene"]["id"].as_str().unwrap().to_owned();
    let job = bench.post_json("/v1/jobs", &format!(r#"{{"scene": "{scene}", "webhook": "https://ci.invalid/secret"}}"#)).await;
    assert_eq!(job.status, StatusCode::CREATED, "{:?}", job.body);
    for reply in [bake, job] {
        assert!(!String::from_utf8_lossy(&reply.body).contains("ci.invalid"), "addresses may hold secrets");
    }
    let refused = bench.post_json("/v1/jobs", &format!(r#"{{"scene": "{scene}", "webhook": "https://ci.invalid:8443/"}}"#)).await;
    assert!(refused.problem().1 == "webhook-refused" && refused.problem().2.contains("ci.invalid:8443"), "{:?}", refused.body);
}
