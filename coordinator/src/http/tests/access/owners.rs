//! What one token brings, another one does not see.

use super::*;

const OF_A_JOB: &[(&str, &str)] = &[
    ("GET", ""),
    ("DELETE", ""),
    ("POST", "/cancel"),
    ("GET", "/events"),
    ("GET", "/scene.kiln"),
    ("GET", "/segments?runs=0"),
    ("GET", "/tiles"),
    ("GET", "/assets"),
    ("GET", "/assets/manifest.json"),
    ("GET", "/bundle.zip"),
    ("GET", "/bundle.tar.zst"),
    ("GET", "/preview.png"),
    ("POST", "/links"),
];

fn ids(reply: &Reply) -> Vec<String> {
    reply.json()["jobs"].as_array().unwrap().iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test]
async fn jobs_of_others_do_not_exist() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let (one, two) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Submit]).await);
    let (job, ..) = bench.job_of(&one).await;
    let unknown = "0198f2c4-1111-7222-8333-444455556666";
    // The same job by another spelling of its id: what a router decodes must not lead past the gate.
    let digits: Vec<String> = job.bytes().map(|byte| format!("%{byte:02x}")).collect();
    for spelling in [job.clone(), job.to_uppercase(), job.replace('-', ""), digits.concat()] {
        for (method, rest) in OF_A_JOB {
            let reply = bench.by(&two, method, &format!("/v1/jobs/{spelling}{rest}")).await;
            let (status, kind, detail) = reply.problem();
            assert_eq!((status, kind.as_str()), (404, "unknown-job"), "{method} {spelling}{rest}");
            // Nothing tells a job of others from one that never was.
            let never = bench.by(&two, method, &format!("/v1/jobs/{unknown}{rest}")).await.problem();
            assert_eq!((status, kind, detail.replace(&job, unknown)), never, "{method} {rest}");
        }
        assert_eq!(bench.by(&one, "GET", &format!("/v1/jobs/{spelling}")).await.json()["id"], job.as_str());
    }
    let record = bench.by(&one, "GET", &format!("/v1/jobs/{job}")).await.json();
    assert_eq!((&record["owner"], &record["state"] == "cancelled"), (&Value::from(one.id.to_string()), false));
}

#[tokio::test]
async fn lists_hold_what_may_be_seen() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let (one, two) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Submit]).await);
    let (read, admin) = (bench.holder(&[Role::Read]).await, bench.holder(&[Role::Admin]).await);
    let (first, second, third) = (bench.job_of(&one).await.0, bench.job_of(&two).await.0, bench.job_of(&one).await.0);
    let list = async |who: &Holder, query: &str| bench.by(who, "GET", &format!("/v1/jobs{query}")).await;
    assert_eq!(ids(&list(&one, "").await), [third.clone(), first.clone()]);
    assert_eq!(ids(&list(&two, "").await), std::slice::from_ref(&second));
    for all in [&read, &admin] {
        assert_eq!(ids(&list(all, "").await), [third.clone(), second.clone(), first.clone()]);
    }
    // The cursor counts what is seen, not what is there.
    let page = list(&one, "?limit=1").await;
    assert_eq!((ids(&page), page.json()["next"].as_str()), (vec![third.clone()], Some(third.as_str())));
    let page = list(&one, &format!("?limit=1&cursor={third}")).await;
    assert_eq!((ids(&page), page.json()["next"].is_null()), (vec![first], true));
}

#[tokio::test]
async fn readers_change_nothing_and_admins_everything() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let (one, read, admin) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Read]).await, bench.holder(&[Role::Admin]).await);
    let both = bench.holder(&[Role::Read, Role::Submit]).await;
    let path = format!("/v1/jobs/{}", bench.job_of(&one).await.0);
    assert_eq!(bench.by(&read, "GET", &path).await.status, StatusCode::OK);
    assert_eq!(bench.by(&read, "DELETE", &path).await.problem().1, "forbidden");
    assert_eq!(bench.by(&both, "GET", &path).await.status, StatusCode::OK);
    assert_eq!(bench.by(&both, "DELETE", &path).await.problem().1, "unknown-job", "seen, but not theirs to change");
    assert_eq!(bench.by(&admin, "POST", &format!("{path}/cancel")).await.json()["state"], "cancelled");
    assert_eq!(bench.by(&one, "DELETE", &path).await.status, StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn a_scene_s_hash_gives_no_access() {
    let bench = Bench::closed(AccessConfig::default()).await;
    let (one, two) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Submit]).await);
    let (_, upload, hash) = bench.job_of(&one).await;
    for name in [&upload, &hash] {
        assert_eq!(bench.by(&one, "GET", &format!("/v1/scenes/{name}")).await.status, StatusCode::OK);
        assert_eq!(bench.by(&two, "GET", &format!("/v1/scenes/{name}")).await.problem().1, "unknown-scene");
        for query in ["", "?dry_run=true"] {
            let new = two.request("POST", &format!("/v1/jobs{query}"), format!(r#"{{"scene": "{name}"}}"#));
            assert_eq!(bench.send(new).await.problem().1, "unknown-scene", "{name}{query}");
        }
    }
    // Whoever brings the same scene has it, too, and the first one keeps the own upload.
    let (_, own, same) = bench.job_of(&two).await;
    assert_eq!(same, hash);
    assert_eq!(bench.by(&two, "GET", &format!("/v1/scenes/{hash}")).await.json()["id"], own.as_str());
    assert_eq!(bench.by(&one, "GET", &format!("/v1/scenes/{hash}")).await.json()["id"], upload.as_str());
}

#[tokio::test]
async fn what_came_before_the_first_token_is_for_readers_and_admins() {
    let bench = Bench::new().await;
    let before = bench.job().await;
    let (submit, read) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Read]).await);
    // Another service on the same store: this one has been told a moment ago that there are no tokens.
    let router = App::new(Arc::clone(&bench.engine), HostPolicy::Loopback, None, CancellationToken::new()).router();
    let path = format!("/v1/jobs/{before}");
    assert_eq!(send(&router, submit.request("GET", &path, Body::empty())).await.status, StatusCode::NOT_FOUND);
    assert_eq!(send(&router, read.request("GET", &path, Body::empty())).await.status, StatusCode::OK);
}
