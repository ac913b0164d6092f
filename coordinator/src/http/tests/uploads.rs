//! Uploads that cannot be used are refused by name and leave nothing behind.

use super::*;

#[tokio::test]
async fn bad_uploads_are_refused_and_leave_nothing_behind() {
    let bench = Bench::new().await;
    let before = bench.files();
    let obj = ("scene", Some("a.obj"), OBJ);
    let whole = parts(&[obj]);
    for (case, body, status, kind) in [
        ("cut in the middle", whole[..whole.len() / 2].to_owned(), 400, "truncated-upload"),
        ("without the last boundary", whole[..whole.len() - 8].to_owned(), 400, "truncated-upload"),
        ("no part at all", parts(&[]), 422, "empty-upload"),
        ("an empty file", parts(&[("scene", Some("a.obj"), "")]), 422, "empty-upload"),
        ("only settings", parts(&[("settings", None, "{}")]), 422, "empty-upload"),
        ("a name that climbs", parts(&[obj, ("x", Some("../../etc/cron.d/x"), "x")]), 422, "bad-file-name"),
        ("an absolute name", parts(&[("x", Some("/etc/passwd"), "x")]), 422, "bad-file-name"),
        ("the same name twice", parts(&[obj, obj]), 422, "bad-file-name"),
        ("an unknown field", parts(&[obj, ("setings", None, "{}")]), 400, "invalid-request"),
        ("not multipart at all", "hello".to_owned(), 400, "truncated-upload"),
    ] {
        for path in ["/v1/scenes", "/v1/bakes"] {
            let (found, name, detail) = bench.post_parts(path, body.clone()).await.problem();
            assert_eq!((found, name.as_str()), (status, kind), "{path}, {case}: {detail}");
        }
        assert_eq!(bench.files(), before, "{case}");
    }
}

#[tokio::test]
async fn bad_settings_of_a_bake_are_refused_before_anything_is_kept() {
    let bench = Bench::new().await;
    let before = bench.files();
    for (settings, status, kind) in [
        (r#"{"sampels": 1}"#, 422, "invalid-settings"),
        (r#"{"texture_sizes": {"floor": "0x0"}}"#, 422, "invalid-settings"),
        (r#"{"samples": -1}"#, 422, "invalid-settings"),
        ("{", 400, "invalid-json"),
    ] {
        let body = parts(&[("settings", None, settings), ("scene", Some("a.obj"), OBJ)]);
        let (found, name, detail) = bench.post_parts("/v1/bakes", body).await.problem();
        assert_eq!((found, name.as_str()), (status, kind), "{settings}: {detail}");
    }
    let query = "/v1/bakes?settings=%7B%22preset%22%3A%22draught%22%7D";
    assert_eq!(bench.post_parts(query, parts(&[("scene", Some("a.obj"), OBJ)])).await.problem().1, "invalid-settings");
    let both = parts(&[("settings", None, "{}"), ("scene", Some("a.obj"), OBJ)]);
    assert_eq!(bench.post_parts("/v1/bakes?settings=%7B%7D", both).await.problem().1, "invalid-request");
    assert_eq!(bench.files(), before);
}

#[tokio::test]
async fn single_bodies_are_judged_by_type_name_and_size() {
    let bench = Bench::new().await;
    let before = bench.files();
    let post = |path: &str, media: &str, body: &str| {
        Request::post(path).header(header::CONTENT_TYPE, media).body(Body::from(body.to_owned())).unwrap()
    };
    assert_eq!(bench.send(post("/v1/scenes", "application/json", "{}")).await.problem().0, 415);
    assert_eq!(bench.send(post("/v1/scenes?name=..%2Fx.obj", "model/obj", OBJ)).await.problem().1, "bad-file-name");
    assert_eq!(bench.send(post("/v1/scenes", "model/obj", "")).await.problem().1, "empty-upload");
    let boundless = Request::post("/v1/scenes").header(header::CONTENT_TYPE, "multipart/form-data").body(Body::from("x")).unwrap();
    assert_eq!(bench.send(boundless).await.problem().1, "invalid-request");
    assert_eq!(bench.files(), before);
}

#[tokio::test]
async fn a_client_that_goes_away_leaves_nothing_behind() {
    let bench = Bench::new().await;
    let before = bench.files();
    let (sender, receiver) = tokio::sync::mpsc::channel::<Result<Bytes, std::io::Error>>(1);
    let body = Body::from_stream(tokio_stream::wrappers::ReceiverStream::new(receiver));
    let upload = tokio::spawn({
        let router = bench.router.clone();
        async move { router.oneshot(Request::post("/v1/scenes?name=a.obj").body(body).unwrap()).await }
    });
    sender.send(Ok(Bytes::from_static(b"v 0 0 0\n"))).await.unwrap();
    sender.send(Ok(Bytes::from_static(b"v 0 0 1\n"))).await.unwrap(); // Room for it means that the first was taken.
    upload.abort();
    assert!(upload.await.unwrap_err().is_cancelled());
    assert_eq!(bench.files(), before);
}

/// Two pixels of 0.125 as Radiance has them.
const HDR: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n@@@\x7f@@@\x7f";

#[tokio::test]
async fn import_options_come_by_query_and_are_recorded_with_the_scene() {
    let bench = Bench::new().await;
    let body = || parts(&[("scene", Some("a.obj"), OBJ), ("sky", Some("sky.hdr"), HDR)]);
    let query = "environment=sky.hdr&environment_rotation=-90&environment_intensity=2&x3d_shadows=strict&up=z";
    let scene = bench.post_parts(&format!("/v1/scenes?{query}"), body()).await.json();
    let expected = serde_json::json!({
        "environment": "sky.hdr", "environment_rotation": -90.0, "environment_intensity": 2.0, "up": "z",
        "light_units": "x3d", "x3d_shadows": "strict", "x3d_projectors": "surface", "x3d_outside_map": "lit",
    });
    assert_eq!(scene["options"], expected, "{scene}");
    assert_eq!(scene["state"], "ready");
    assert_eq!(bench.get(&format!("/v1/scenes/{}", scene["id"].as_str().unwrap())).await.json()["options"], expected);
    let plain = bench.post_parts("/v1/scenes", body()).await.json();
    assert_ne!(plain["scene"], scene["scene"], "read otherwise, it is another scene");
    let two = parts(&[("scene", Some("a.obj"), OBJ), ("another", Some("b.obj"), OBJ)]);
    assert_eq!(bench.post_parts("/v1/scenes", two.clone()).await.problem().1, "scene-rejected");
    assert_eq!(bench.post_parts("/v1/scenes?main=b.obj", two).await.json()["options"]["main"], "b.obj");
    let baked = bench.post_parts(&format!("/v1/bakes?{query}&priority=3"), body()).await.json();
    assert_eq!((&baked["scene"]["scene"], &baked["job"]["priority"]), (&scene["scene"], &serde_json::json!(3)));
}

#[tokio::test]
async fn bad_import_options_are_refused_by_name() {
    let bench = Bench::new().await;
    let before = bench.files();
    for (query, word) in [
        ("enviroment=sky.hdr", "enviroment"),
        ("x3d_shadows=strickt", "strickt"),
        ("up=w", "w"),
        ("time=-1", "time"),
        ("time=soon", "time"),
        ("environment_intensity=2", "environment_intensity"),
    ] {
        for path in ["/v1/scenes", "/v1/bakes"] {
            let (status, _, detail) = bench.post_parts(&format!("{path}?{query}"), parts(&[("s", Some("a.obj"), OBJ)])).await.problem();
            assert!(status == 400 && detail.contains(word), "{path}?{query}: {status} {detail}");
        }
    }
    assert_eq!(bench.files(), before);
    let missing = bench.post_parts("/v1/scenes?environment=sky.hdr", parts(&[("s", Some("a.obj"), OBJ)])).await.problem();
    assert!(missing.1 == "scene-rejected" && missing.2.contains("`sky.hdr` is not among the files"), "{missing:?}");
}
