//! Processes are killed in the middle of their work; nothing is lost and the package is the same.

use crate::harness::{LARGE, Server, assert_same_package, bake_room};
use serde_json::Value;
use tempfile::TempDir;

/// Enough work that half-way lasts long enough to be caught.
const LONGER: &[&str] = &["--samples", "96"];

/// Texels of the room at the scale of these tests, gutters included.
const BAKED_TEXELS: u64 = 16_328;

fn undisturbed(dir: &TempDir) -> std::path::PathBuf {
    let path = dir.path().join("undisturbed");
    bake_room(&path, LONGER);
    path
}

#[test]
fn a_worker_killed_mid_tile_costs_its_lease_and_no_byte() {
    let dir = TempDir::new().unwrap();
    let expected = undisturbed(&dir);
    let server = Server::impatient(dir.path(), "127.0.0.1:0");
    let mut victim = server.worker(&[]);
    let job = server.submit_room(LONGER);
    server.wait_until_halfway(&job);
    victim.kill();
    let _heir = server.worker(&[]);
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_same_package(&expected, &package);
}

#[test]
fn a_coordinator_killed_mid_bake_continues_without_baking_accepted_tiles_again() {
    let dir = TempDir::new().unwrap();
    let expected = undisturbed(&dir);
    let mut server = Server::impatient(dir.path(), "127.0.0.1:0");
    let _worker = server.worker(&[]);
    let job = server.submit_room(LONGER);
    let before = server.wait_until_halfway(&job);
    server.process.kill();
    let server = Server::impatient(dir.path(), &format!("127.0.0.1:{}", server.port));
    let after = server.get(&format!("/v1/jobs/{job}"));
    let done = |r: &Value| r["progress"]["tiles_done"].as_u64().unwrap();
    assert!(done(&after) >= done(&before), "accepted tiles were forgotten: {} of {}", done(&after), done(&before));
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_same_package(&expected, &package);
    let metrics = server.text("/metrics");
    assert!(metrics.lines().any(|l| l == "kiln_tiles_duplicate_total 0"), "{metrics}");
    let report: Value = serde_json::from_slice(&std::fs::read(package.join("report.json")).unwrap()).unwrap();
    let delivered: u64 =
        report["workers"].as_array().unwrap().iter().filter(|w| w["phase"] == "bake").map(|w| w["texels"].as_u64().unwrap()).sum();
    assert_eq!(delivered, BAKED_TEXELS, "every texel was delivered once: {report}");
}

#[test]
fn a_coordinator_killed_while_it_assembles_assembles_the_same_package() {
    let dir = TempDir::new().unwrap();
    let expected = dir.path().join("undisturbed");
    bake_room(&expected, LARGE);
    let mut server = Server::impatient(dir.path(), "127.0.0.1:0");
    let _worker = server.worker(&[]);
    let job = server.submit_room(LARGE);
    server.wait_for(&job, "assembly", |r| {
        assert!(r["state"] != "done", "the job was too quick to be disturbed");
        r["state"] == "assembling"
    });
    server.process.kill();
    let server = Server::impatient(dir.path(), &format!("127.0.0.1:{}", server.port));
    let after = server.get(&format!("/v1/jobs/{job}"));
    assert_eq!(after["progress"]["tiles_done"], after["progress"]["tiles"], "assembly begins with every tile accepted");
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_same_package(&expected, &package);
}

#[test]
fn a_worker_told_to_stop_hands_back_the_rest_and_leaves() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let mut leaving = server.worker(&[]);
    let job = server.submit_room(LONGER);
    server.wait_until_halfway(&job);
    leaving.terminate();
    assert!(leaving.wait().success());
    // No lease has to expire for the next worker: the rest was handed back.
    let _next = server.worker(&[]);
    server.wait_for(&job, "the end", |r| r["state"] == "done");
}

#[test]
fn a_cancelled_job_stops_its_workers_and_the_next_job_runs() {
    let dir = TempDir::new().unwrap();
    let server = Server::impatient(dir.path(), "127.0.0.1:0");
    let _worker = server.worker(&[]);
    let first = server.submit_room(&["--samples", "4000"]);
    server.wait_for(&first, "baking", |r| r["phase"] == "bake");
    crate::harness::succeed(["cancel", &first, "--server", &server.url]);
    let second = server.submit_room(&[]);
    server.wait_for(&second, "the end", |r| r["state"] == "done");
    assert_eq!(server.get(&format!("/v1/jobs/{first}"))["state"], "cancelled");
}
