//! Bad input gets an error that says what, where and what to do; nothing is lost and the service keeps serving others.

use crate::harness::{Server, fail, kiln, room, runtime, succeed};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// Writes an OBJ (and an MTL beside it) and returns its path.
fn write(dir: &Path, obj: &str, mtl: &str) -> PathBuf {
    std::fs::write(dir.join("bad.mtl"), mtl).unwrap();
    let path = dir.join("bad.obj");
    std::fs::write(&path, obj).unwrap();
    path
}

fn bake_args(scene: &Path, out: &Path) -> Vec<String> {
    let out = out.display().to_string();
    ["bake", &scene.display().to_string(), "-o", &out, "--directions", "2x2", "--samples", "1", "--texels-per-metre", "4"]
        .map(str::to_owned)
        .to_vec()
}

#[test]
fn broken_scenes_are_refused_with_file_and_line() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("out");
    let with = |tail: &str| format!("{TRIANGLE}{tail}");
    for (obj, mtl, words) in [
        (String::new(), "", &["bad.obj"][..]),
        ("v 0 0 nan\n".to_owned() + TRIANGLE + "f 1 2 3\n", "", &["bad.obj:1", "finite"]),
        (with("f 1 2 9\n"), "", &["bad.obj:4", "9"]),
        (with("f 0 1 2\n"), "", &["bad.obj:4", "0"]),
        (with("f -4 -3 -2\n"), "", &["bad.obj:4"]),
        (with("f 1\n"), "", &["bad.obj:4"]),
        (with("f 1 2 x\n"), "", &["bad.obj:4"]),
        (with("v 5 5\nf 1 2 3\n"), "", &["bad.obj:4"]),
        (with("f 1 1 2\n"), "", &["area"]),
        (with("mtllib bad.mtl\nusemtl m\nf 1 2 3\n"), "newmtl m\nKd 0.5 x 0.5\n", &["bad.mtl:2"]),
        (with("mtllib bad.mtl\nusemtl m\nf 1 2 3\n"), "newmtl m\nKd 0.5 nan 0.5\n", &["bad.mtl:2"]),
        (with("mtllib bad.mtl\nusemtl m\nf 1 2 3\n"), "newmtl m\nmap_Kd gone.png\n", &["bad.mtl:2", "gone.png"]),
    ] {
        fail(1, words, bake_args(&write(dir.path(), &obj, mtl), &out));
        assert!(!out.exists(), "{obj}");
    }
}

#[test]
fn zero_area_and_duplicate_triangles_are_dropped_and_counted() {
    let dir = TempDir::new().unwrap();
    let obj = write(dir.path(), &format!("{TRIANGLE}v 2 0 0\nf 1 2 3\nf 2 3 1\nf 1 2 4\n"), "");
    let output = kiln(bake_args(&obj, &dir.path().join("out"))).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("repeat another") && said.contains("area"), "{said}");
}

#[test]
fn wrong_commands_are_usage_errors() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("out").display().to_string();
    let room = room().display().to_string();
    let settings = dir.path().join("settings.json");
    std::fs::write(&settings, r#"{"sampels": 4}"#).unwrap();
    let settings = settings.display().to_string();
    for (more, words) in [
        (&["--texture-size", "floor=0x0"][..], &["0x0"][..]),
        (&["--settings", &settings], &["sampels", "settings.json"]),
        (&["--samples", "-3"], &["-3"]),
        (&["--no-such-flag"], &["no-such-flag"]),
        (&["--threshold", "6"], &["threshold"]),
    ] {
        fail(2, words, ["bake", &room, "-o", &out].iter().chain(more));
    }
    fail(1, &["celing", "floor"], ["bake", &room, "-o", &out, "--texture-size", "celing=4x4"]);
    fail(1, &["nowhere.obj"], ["bake", "nowhere.obj", "-o", &out]);
    fail(2, &["not empty"], ["bake", &room, "-o", dir.path().to_str().unwrap()]);
    fail(1, &["kiln serve"], ["jobs", "--server", "http://127.0.0.1:1"]);
    fail(2, &["insecure-no-auth"], ["serve", "--listen", "0.0.0.0:0", "--data", &out]);
}

#[test]
fn configuration_is_checked_as_a_whole() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("kiln.toml");
    std::fs::write(&file, "lisen = \"x\"\n").unwrap();
    fail(2, &["kiln.toml", "lisen"], ["config", "check", "--config", file.to_str().unwrap()]);
    std::fs::write(&file, "[lease]\nttl_ms = 100\nheartbeat_ms = 200\n").unwrap();
    fail(2, &["heartbeat"], ["config", "check", "--config", file.to_str().unwrap()]);
    assert!(succeed(["config", "check"]).contains("ttl_ms"));
}

/// The names in a TOML document, `[tables]` included, comments and values left out.
fn names(toml: &str) -> std::collections::BTreeSet<&str> {
    let lines = toml.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    lines.map(|l| l.split('=').next().unwrap().trim()).collect()
}

#[test]
fn the_example_configuration_holds_every_setting_at_its_default() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/kiln.example.toml");
    let defaults = succeed(["config", "check"]);
    assert_eq!(succeed(["config", "check", "--config", example.to_str().unwrap()]), defaults);
    // A setting that is left out would have its default, too.
    assert_eq!(names(&std::fs::read_to_string(&example).unwrap()), names(&defaults));
}

#[test]
fn a_port_in_use_a_bad_folder_and_a_second_coordinator_are_told_apart() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    let server = Server::start(&data, "127.0.0.1:0", &[]);
    let other = dir.path().join("other").display().to_string();
    fail(1, &["another program", "--listen"], ["serve", "--listen", &format!("127.0.0.1:{}", server.port), "--data", &other]);
    assert!(!Path::new(&other).exists(), "a coordinator that cannot listen touches no folder");
    fail(1, &[data.to_str().unwrap()], ["serve", "--listen", "127.0.0.1:0", "--data", data.to_str().unwrap()]);
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    let below = file.join("data").display().to_string();
    fail(1, &[&below], ["serve", "--listen", "127.0.0.1:0", "--data", &below]);
    // procfs refuses new folders whoever asks: read-only also for root.
    fail(1, &["/proc/kiln"], ["serve", "--listen", "127.0.0.1:0", "--data", "/proc/kiln"]);
}

#[test]
fn a_bad_upload_hurts_nobody_else() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let _worker = server.worker(&[]);
    let job = server.submit_room(&[]);
    runtime().block_on(async {
        let http = reqwest::Client::new();
        let scenes = format!("{}/v1/scenes", server.url);
        let truncated = "--b\r\nContent-Disposition: form-data; name=\"file\"; filename=\"a.obj\"\r\n\r\nv 0 0";
        let response = http.post(&scenes).header("content-type", "multipart/form-data; boundary=b").body(truncated).send().await.unwrap();
        assert_eq!(response.status(), 400);
        let part = reqwest::multipart::Part::bytes(b"v 0 0 nan\nf 1 1 1\n".to_vec()).file_name("a.obj");
        let response = http.post(&scenes).multipart(reqwest::multipart::Form::new().part("file", part)).send().await.unwrap();
        assert_eq!((response.status().as_u16(), &response.headers()["content-type"]), (422, &"application/problem+json".parse().unwrap()));
        let problem: serde_json::Value = response.json().await.unwrap();
        assert_eq!((&problem["problems"][0]["file"], &problem["problems"][0]["line"]), (&"a.obj".into(), &1.into()), "{problem}");
        let part = reqwest::multipart::Part::bytes(TRIANGLE.as_bytes()).file_name("../../a.obj");
        let response = http.post(&scenes).multipart(reqwest::multipart::Form::new().part("file", part)).send().await.unwrap();
        assert!(response.status().is_client_error());
        for (body, word) in [
            (r#"{"scene":"x","settings":{"sampels":1}}"#, "sampels"),
            (r#"{"scene":"x","settings":{"texture_sizes":{"floor":"0x0"}}}"#, "0x0"),
            (r#"{"scene":"#, "JSON"),
        ] {
            let request = http.post(format!("{}/v1/jobs", server.url)).header("content-type", "application/json").body(body);
            let response = request.send().await.unwrap();
            assert!(response.status().is_client_error());
            let text = response.text().await.unwrap();
            assert!(text.contains(word), "{text}");
        }
    });
    server.fetch_when_done(&job, &dir.path().join("package"));
}

/// Lengths inside a frame are claims, too: forty-odd bytes must not make the coordinator ask for four exabytes.
#[test]
fn a_frame_that_claims_the_moon_is_refused_and_the_service_lives() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    // Hello { bake_version: 1, name: a string of 2^62 bytes, … } as bincode writes it.
    let plain = [&[1u8, 0xfd][..], &(1u64 << 62).to_le_bytes()].concat();
    let payload = zstd::bulk::compress(&plain, 1).unwrap();
    let header: [&[u8]; 6] = [
        b"KLNF\x01\0\x01\0",
        &(payload.len() as u32).to_le_bytes(),
        &(plain.len() as u32).to_le_bytes(),
        &crc32c::crc32c(&payload).to_le_bytes(),
        &payload,
        &[],
    ];
    let frame = header.concat();
    runtime().block_on(async {
        let http = reqwest::Client::new();
        let answer = http.post(format!("{}/v1/worker/hello", server.url)).body(frame).send().await.unwrap();
        assert!(answer.status().is_client_error(), "{}", answer.status());
    });
    assert!(!server.text("/healthz").is_empty());
}
