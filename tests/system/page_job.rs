//! The pages of the service in a browser, end to end: a job watched while it bakes, and everything that may go wrong while somebody
//! watches.

use crate::{
    browser::{GPUS, Script},
    harness::{Server, runtime},
};
use std::path::Path;
use tempfile::TempDir;

/// Enough to trace that tiles come one after another, in a few seconds.
const WATCHED: &[&str] = &["--samples", "48", "--texel-scale", "0.35"];

fn start(dir: &TempDir, more: &[&str]) -> Server {
    Server::start(&dir.path().join("data"), "127.0.0.1:0", more)
}

fn story(name: &str, server: &Server, gpu: &str, job: &str) -> Script {
    Script::start("job.mjs", [name, &server.url, gpu, job])
}

#[test]
fn page_shows_tiles_as_they_come_and_then_the_package() {
    let dir = TempDir::new().unwrap();
    let server = Server::impatient(dir.path(), "127.0.0.1:0");
    let job = server.submit_room(WATCHED);
    let mut script = story("live", &server, GPUS[1], &job);
    script.wait_for("watching");
    let _worker = server.worker(&[]);
    let said = script.finish();
    println!("{said:?}");
    assert!(said.iter().any(|s| s["at"] == "arrived"), "{said:?}");
}

/// Flips a byte in every stored chunk: what is left when a disk lies. Scenes and plans, which are one zstd frame and no more, stay whole.
fn damage_chunks(data: &Path) {
    let mut damaged = 0;
    let mut folders = vec![data.join("blobs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let mut bytes = std::fs::read(&path).unwrap();
            if zstd::stream::decode_all(bytes.as_slice()).is_err() {
                // Near the beginning: in a segment, not in the chunk's table at its end.
                bytes[20] ^= 1;
                std::fs::write(&path, bytes).unwrap();
                damaged += 1;
            }
        }
    }
    assert!(damaged > 0, "no chunk was found");
}

#[test]
fn page_says_why_a_job_failed() {
    let dir = TempDir::new().unwrap();
    let server = Server::impatient(dir.path(), "127.0.0.1:0");
    let job = server.submit_room(WATCHED);
    let mut worker = server.worker(&[]);
    server.wait_until_halfway(&job);
    worker.kill();
    damage_chunks(&dir.path().join("data"));
    let mut script = story("failed", &server, GPUS[1], &job);
    script.wait_for("watching");
    let _worker = server.worker(&[]);
    script.finish();
}

#[test]
fn page_says_that_its_job_was_deleted() {
    let dir = TempDir::new().unwrap();
    let server = start(&dir, &[]);
    let job = server.submit_room(&[]);
    let mut script = story("deleted", &server, GPUS[1], &job);
    script.wait_for("watching");
    let gone = runtime().block_on(async { reqwest::Client::new().delete(format!("{}/v1/jobs/{job}", server.url)).send().await.unwrap() });
    assert_eq!(gone.status(), 204);
    script.finish();
}

#[test]
fn page_says_that_there_is_no_such_job() {
    let dir = TempDir::new().unwrap();
    let server = start(&dir, &[]);
    story("unknown", &server, GPUS[1], "019ab0c2-0000-7000-8000-000000000000").finish();
}

#[test]
fn page_waits_for_a_coordinator_that_was_killed() {
    let dir = TempDir::new().unwrap();
    let mut server = start(&dir, &[]);
    let job = server.submit_room(&[]);
    let mut script = story("away", &server, GPUS[1], &job);
    script.wait_for("watching");
    server.process.kill();
    script.wait_for("missed");
    let server = Server::start(&dir.path().join("data"), &format!("127.0.0.1:{}", server.port), &[]);
    let _worker = server.worker(&[]);
    script.finish();
}

/// A server with a finished job.
fn finished(dir: &TempDir) -> (Server, String, crate::harness::Process) {
    let server = start(dir, &[]);
    let worker = server.worker(&[]);
    let job = server.submit_room(&[]);
    server.wait_for(&job, "the end", |r| r["state"] == "done");
    (server, job, worker)
}

#[test]
fn page_without_webgl_says_so_and_shows_a_picture() {
    let dir = TempDir::new().unwrap();
    let (server, job, _worker) = finished(&dir);
    story("without_webgl", &server, "none", &job).finish();
}

#[test]
fn page_needs_no_mouse() {
    let dir = TempDir::new().unwrap();
    let (server, job, _worker) = finished(&dir);
    story("keyboard", &server, GPUS[1], &job).finish();
}

#[test]
fn page_of_the_farm_lists_jobs_and_workers() {
    let dir = TempDir::new().unwrap();
    let (mut server, done, mut worker) = finished(&dir);
    worker.kill();
    let waiting = server.submit_room(&[]);
    let mut script = Script::start("dashboard.mjs", [&server.url, GPUS[1], &done, &waiting]);
    script.wait_for("ready for the end");
    server.process.kill();
    script.finish();
}
