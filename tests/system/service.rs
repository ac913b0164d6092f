//! The HTTP service as its users meet it: the tour of the README, step by step.

use crate::harness::{Server, room, runtime, succeed};
use serde_json::Value;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// The block of the README under "Five minutes with the service" that needs nothing but curl.
fn readme_block() -> String {
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let (_, tour) = readme.split_once("## Five minutes with the service").expect("the README has its tour");
    let (_, block) =
        tour.split_once("```sh\ncd tests/scenes/thesis-room\n").expect("the tour has a block that begins in the room's folder");
    block.split_once("\n```").unwrap().0.to_owned()
}

#[test]
fn the_readme_s_curl_commands_work_as_they_are_printed() {
    let curl = Command::new("curl").arg("--version").stdout(Stdio::null()).status();
    assert!(curl.is_ok_and(|s| s.success()), "this test runs the README's commands and needs curl: apt-get install curl");
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("thesis-room");
    std::fs::create_dir(&folder).unwrap();
    for file in std::fs::read_dir(room().parent().unwrap()).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
    }
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let _worker = server.worker(&[]);
    let reply = dir.path().join("bake.json");
    let script = readme_block().replace("http://127.0.0.1:8080", &server.url).replace("/tmp/bake.json", reply.to_str().unwrap());
    assert!(script.contains(&server.url) && script.contains(reply.to_str().unwrap()), "{script}");
    let output = Command::new("bash").args(["-eu", "-o", "pipefail", "-c", &script]).current_dir(&folder).output().unwrap();
    let (said, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{errors}\n{said}");
    assert!(said.contains("event: ") && said.contains("\"done\""), "{said}");
    let codes = std::fs::read(folder.join("floor.mtnc")).unwrap();
    assert_eq!(&codes[..4], b"MTNC");
    let mut zip = zip::ZipArchive::new(std::fs::File::open(folder.join("package.zip")).unwrap()).unwrap();
    let mut packed = Vec::new();
    std::io::copy(&mut zip.by_name("surfaces/floor.mtnc").unwrap(), &mut packed).unwrap();
    assert!(packed == codes, "the archive holds the same file");
}

#[test]
fn the_tour_of_the_readme_works() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let _worker = server.worker(&[]);
    runtime().block_on(async {
        let http = reqwest::Client::new();
        let at = |path: &str| format!("{}{path}", server.url);
        let folder = room().parent().unwrap().to_owned();
        let mut form = reqwest::multipart::Form::new();
        for name in ["thesis.obj", "thesis.mtl"] {
            form = form.part("file", reqwest::multipart::Part::bytes(std::fs::read(folder.join(name)).unwrap()).file_name(name));
        }
        let settings = r#"{"samples": 8, "directions": "4x6", "texels_per_metre": 4}"#;
        let bake = http.post(at("/v1/bakes")).multipart(form.text("settings", settings)).send().await.unwrap();
        assert_eq!(bake.status(), 201);
        let bake: Value = bake.json().await.unwrap();
        let job = bake["job"]["id"].as_str().unwrap().to_owned();
        // The stream ends by itself when the job has ended.
        let events = http.get(at(&format!("/v1/jobs/{job}/events"))).send().await.unwrap().text().await.unwrap();
        assert!(events.contains("\"tiles\"") && events.contains("\"done\""), "{events}");

        let asset = at(&format!("/v1/jobs/{job}/assets/surfaces/floor.mtsp"));
        let whole = http.get(&asset).send().await.unwrap();
        let tag = whole.headers()["etag"].clone();
        let bytes = whole.bytes().await.unwrap();
        let same = http.get(&asset).header("if-none-match", tag).send().await.unwrap();
        assert_eq!(same.status(), 304);
        let part = http.get(&asset).header("range", "bytes=4-7").send().await.unwrap();
        assert_eq!((part.status().as_u16(), part.bytes().await.unwrap()), (206, bytes.slice(4..8)));
        let zip = http.get(at(&format!("/v1/jobs/{job}/bundle.zip"))).send().await.unwrap().bytes().await.unwrap();
        let mut zip = zip::ZipArchive::new(std::io::Cursor::new(zip)).unwrap();
        assert!(zip.by_name("manifest.json").is_ok() && zip.by_name("surfaces/floor.mtsp").is_ok());

        let api: Value = http.get(at("/openapi.json")).send().await.unwrap().json().await.unwrap();
        assert!(api["openapi"].as_str().unwrap().starts_with("3.1"));
        let metrics = http.get(at("/metrics")).send().await.unwrap().text().await.unwrap();
        assert!(metrics.contains("kiln_tiles_pending"), "{metrics}");
        let workers: Value = http.get(at("/v1/workers")).send().await.unwrap().json().await.unwrap();
        assert_eq!(workers["workers"].as_array().unwrap().len(), 1);
        for health in ["/healthz", "/readyz"] {
            assert_eq!(http.get(at(health)).send().await.unwrap().status(), 200);
        }
    });
}

#[test]
fn watch_follows_a_job_and_jobs_lists_it() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let _worker = server.worker(&[]);
    let job = server.submit_room(&[]);
    let events = succeed(["--json", "watch", &job, "--server", &server.url]);
    let seqs: Vec<i64> = events.lines().map(|l| serde_json::from_str::<Value>(l).unwrap()["seq"].as_i64().unwrap()).collect();
    assert!(seqs.iter().copied().eq(1..=seqs.len() as i64), "{seqs:?}");
    let listed = succeed(["jobs", "--server", &server.url, "--state", "done"]);
    assert!(listed.contains(&job), "{listed}");
}

#[test]
fn a_job_without_workers_says_why_it_waits() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let job = server.submit_room(&[]);
    // Before it bakes it waits for its scene and its plan, and says so.
    server.wait_for(&job, "a reason", |r| r["waiting"].as_str().is_some_and(|why| why.contains("no worker is connected")));
}
