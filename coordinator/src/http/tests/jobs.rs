//! The life of a job over HTTP.

use super::*;

impl Bench {
    async fn patch(&self, id: &str, change: &'static str) -> Reply {
        let request = Request::patch(format!("/v1/jobs/{id}")).header(header::CONTENT_TYPE, "application/json");
        self.send(request.body(Body::from(change)).unwrap()).await
    }

    /// A job of the smallest scene; no worker ever takes its tiles.
    pub(super) async fn job(&self) -> String {
        let body = parts(&[("settings", None, r#"{"preset": "draft"}"#), ("scene", Some("room.obj"), OBJ)]);
        let reply = self.post_parts("/v1/bakes", body).await;
        assert_eq!(reply.status, StatusCode::CREATED, "{:?}", reply.body);
        let id = reply.json()["job"]["id"].as_str().unwrap().to_owned();
        assert_eq!(reply.headers[header::LOCATION], format!("/v1/jobs/{id}"));
        id
    }
}

#[tokio::test]
async fn unknown_jobs_are_not_found_whatever_is_asked_of_them() {
    let bench = Bench::new().await;
    for id in ["nonsense", "0198f2c4-1111-7222-8333-444455556666"] {
        for rest in [
            "",
            "/events",
            "/tiles",
            "/scene.kiln",
            "/segments?runs=0",
            "/assets",
            "/assets/manifest.json",
            "/bundle.zip",
            "/bundle.tar.zst",
        ] {
            assert_eq!(bench.get(&format!("/v1/jobs/{id}{rest}")).await.problem().1, "unknown-job", "{id}{rest}");
        }
        let cancel = Request::post(format!("/v1/jobs/{id}/cancel")).body(Body::empty()).unwrap();
        assert_eq!(bench.send(cancel).await.problem().1, "unknown-job");
        let retry = Request::post(format!("/v1/jobs/{id}/retry")).body(Body::empty()).unwrap();
        assert_eq!(bench.send(retry).await.problem().1, "unknown-job");
        assert_eq!(bench.patch(id, r#"{"priority": 3}"#).await.problem().1, "unknown-job");
        let delete = Request::delete(format!("/v1/jobs/{id}")).body(Body::empty()).unwrap();
        assert_eq!(bench.send(delete).await.problem().1, "unknown-job");
    }
    assert_eq!(bench.get("/v1/scenes/nonsense").await.problem().1, "unknown-scene");
    let unknown = format!(r#"{{"scene": "{}"}}"#, "0".repeat(64));
    assert_eq!(bench.post_json("/v1/jobs", &unknown).await.problem().1, "unknown-scene");
}

#[tokio::test]
async fn a_job_is_paused_resumed_and_moved_up() {
    let bench = Bench::new().await;
    let id = bench.job().await;
    while bench.get(&format!("/v1/jobs/{id}")).await.json()["state"] != "baking" {
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    }
    let paused = bench.patch(&id, r#"{"paused": true, "priority": 3}"#).await.json();
    assert_eq!((&paused["state"], &paused["priority"]), (&"paused".into(), &3.into()));
    assert!(paused["waiting"].as_str().unwrap().contains("kiln resume"), "{paused}");
    assert_eq!(bench.patch(&id, r#"{"paused": true}"#).await.json()["state"], "paused", "twice is once");
    assert_eq!(bench.get("/v1/jobs?state=paused").await.json()["jobs"][0]["id"], id.as_str());
    assert_eq!(bench.patch(&id, r#"{"paused": false}"#).await.json()["state"], "baking");
    let retry = Request::post(format!("/v1/jobs/{id}/retry")).body(Body::empty()).unwrap();
    let (status, kind, detail) = bench.send(retry).await.problem();
    assert_eq!((status, kind.as_str()), (409, "conflict"), "{detail}");
    assert!(detail.contains("given up"), "{detail}");
    let (status, kind, detail) = bench.patch(&id, r#"{"pauze": true}"#).await.problem();
    assert_eq!((status, kind.as_str()), (422, "wrong-shape"), "{detail}");
    bench.send(Request::post(format!("/v1/jobs/{id}/cancel")).body(Body::empty()).unwrap()).await;
    assert_eq!(bench.patch(&id, r#"{"paused": true}"#).await.problem().1, "conflict");
}

#[tokio::test]
async fn a_scene_is_uploaded_found_and_estimated() {
    let bench = Bench::new().await;
    let reply = bench.send(Request::post("/v1/scenes?name=room.obj").body(Body::from(OBJ)).unwrap()).await;
    assert_eq!(reply.status, StatusCode::CREATED, "{:?}", reply.body);
    let scene = reply.json();
    assert_eq!((&scene["state"], &scene["statistics"]["triangles"]), (&"ready".into(), &1.into()));
    for name in [&scene["id"], &scene["scene"]] {
        assert_eq!(bench.get(&format!("/v1/scenes/{}", name.as_str().unwrap())).await.json(), scene);
    }
    let dry = bench.post_json("/v1/jobs?dry_run=true", &format!(r#"{{"scene": {}}}"#, scene["scene"])).await;
    assert_eq!(dry.status, StatusCode::OK);
    assert!(dry.json()["texels"].as_u64().unwrap() > 0 && dry.json()["tiles"].as_u64().unwrap() > 0);
    assert_eq!(bench.get("/v1/jobs").await.json()["jobs"], serde_json::json!([]));
}

#[tokio::test]
async fn what_becomes_of_a_job_with_a_bad_tile_is_said_with_it() {
    let bench = Bench::new().await;
    let upload = |query: &str| {
        let request = Request::post(format!("/v1/bakes?name=room.obj{query}"));
        bench.send(request.body(Body::from(OBJ)).unwrap())
    };
    let plain = upload("").await.json();
    assert_eq!(plain["job"]["on_poison"], "fail");
    assert_eq!(plain["job"]["holes"], serde_json::Value::Null, "nothing is said of holes where there are none");
    assert_eq!(upload("&on_poison=skip").await.json()["job"]["on_poison"], "skip");
    let (status, _, detail) = upload("&on_poison=ignore").await.problem();
    assert_eq!(status, 400, "{detail}");
    let scene = &plain["scene"]["id"];
    let job = bench.post_json("/v1/jobs", &format!(r#"{{"scene": {scene}, "on_poison": "skip"}}"#)).await.json();
    assert_eq!(bench.get(&format!("/v1/jobs/{}", job["id"].as_str().unwrap())).await.json()["on_poison"], "skip");
    let (status, kind, detail) = bench.post_json("/v1/jobs", &format!(r#"{{"scene": {scene}, "on_poison": "ignore"}}"#)).await.problem();
    assert_eq!((status, kind.as_str()), (422, "wrong-shape"));
    assert!(detail.contains("`fail` or `skip`"), "{detail}");
}

#[tokio::test]
async fn a_scene_that_cannot_be_read_names_file_and_line() {
    let bench = Bench::new().await;
    let broken = parts(&[("scene", Some("room.obj"), &format!("{OBJ}f 1 2 99\n"))]);
    let reply = bench.post_parts("/v1/scenes", broken).await;
    assert_eq!(reply.problem().1, "scene-rejected");
    assert_eq!((&reply.json()["file"], &reply.json()["line"]), (&"room.obj".into(), &10.into()), "{:?}", reply.body);
}

#[tokio::test]
async fn a_job_is_followed_cancelled_and_deleted() {
    let bench = Bench::new().await;
    let id = bench.job().await;
    let path = format!("/v1/jobs/{id}");
    let job = bench.get(&path).await.json();
    assert_eq!((&job["settings"]["preset"], &job["settings"]["samples"]), (&"draft".into(), &64.into()));
    for rest in ["/assets", "/assets/a/b.mtsp", "/bundle.zip", "/bundle.tar.zst"] {
        let (status, kind, detail) = bench.get(&format!("{path}{rest}")).await.problem();
        assert_eq!((status, kind.as_str()), (409, "job-not-done"), "{rest}: {detail}");
        assert!(detail.contains(&id), "{detail}");
    }
    let cancelled = bench.send(Request::post(format!("{path}/cancel")).body(Body::empty()).unwrap()).await;
    assert_eq!(cancelled.json()["state"], "cancelled");
    assert_eq!(bench.get("/v1/jobs?state=cancelled").await.json()["jobs"][0]["id"], id.as_str());
    assert_eq!(bench.get("/v1/jobs?state=done").await.json()["jobs"], serde_json::json!([]));
    assert_eq!(bench.get(&format!("{path}/tiles?runs=0-9")).await.json()["tiles_done"], 0);
    let deleted = bench.send(Request::delete(&path).body(Body::empty()).unwrap()).await;
    assert_eq!((deleted.status, bench.get(&path).await.status), (StatusCode::NO_CONTENT, StatusCode::NOT_FOUND));
}

/// The ids and names of a whole stream.
fn events(reply: &Reply) -> Vec<(i64, String)> {
    let text = String::from_utf8(reply.body.to_vec()).unwrap();
    let field = |event: &str, name: &str| event.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": ").map(str::to_owned));
    text.split("\n\n").filter_map(|event| Some((field(event, "id")?.parse().unwrap(), field(event, "event")?))).collect()
}

#[tokio::test]
async fn a_finished_jobs_events_are_replayed_from_any_position() {
    let bench = Bench::new().await;
    let path = format!("/v1/jobs/{}/events", bench.job().await);
    bench.send(Request::post(path.replace("/events", "/cancel")).body(Body::empty()).unwrap()).await;
    let whole = bench.get(&path).await;
    assert_eq!(whole.headers[header::CONTENT_TYPE], "text/event-stream");
    let all = events(&whole);
    assert_eq!(all.iter().map(|(seq, _)| *seq).collect::<Vec<_>>(), (1..=all.len() as i64).collect::<Vec<_>>());
    assert!(String::from_utf8_lossy(&whole.body).contains("\"state\":\"cancelled\""));
    let last = all.last().unwrap().0;
    let resume = |seq: i64| Request::get(&path).header("last-event-id", seq.to_string()).body(Body::empty()).unwrap();
    assert_eq!(events(&bench.send(resume(last - 1)).await), all[all.len() - 1..]);
    assert_eq!(events(&bench.get(&format!("{path}?after={}", last - 1)).await), all[all.len() - 1..]);
    assert_eq!(bench.send(resume(last)).await.status, StatusCode::NO_CONTENT);
    assert_eq!(events(&bench.send(resume(last + 1_000)).await), all, "a position that the stream never had");
    let wrong = Request::get(&path).header("last-event-id", "first").body(Body::empty()).unwrap();
    assert_eq!(bench.send(wrong).await.problem().1, "invalid-request");
}
