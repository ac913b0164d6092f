//! A disk without room, for real: the job says so, and the service goes on.
//!
//! Filling a disk of the machine is out of the question, and a file system of one's own cannot be mounted by everybody. A limit on the size
//! of a file can be set by every user and binds root as well: writing beyond it fails in the middle of a file as on a full disk, while small
//! files still find room. Where a file system may be mounted, a small one is filled to the last byte.

use crate::harness::{LARGE, PATIENCE, Server, room, succeed};
use serde_json::Value;
use std::{
    path::Path,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Waits until the job fails or waits for want of room; what it says.
fn complaint(server: &Server, job: &str) -> String {
    let start = Instant::now();
    loop {
        let record = server.get(&format!("/v1/jobs/{job}"));
        let said = [&record["problem"]["message"], &record["waiting"]];
        let said = said.iter().filter_map(|v| v.as_str()).find(|s| ["disk", "written", "full", "large"].iter().any(|w| s.contains(w)));
        if let Some(said) = said {
            return said.to_owned();
        }
        assert!(record["state"] != "done" && record["state"] != "failed", "no word of the disk: {record}");
        assert!(start.elapsed() < PATIENCE, "the job neither fails nor says what it waits for: {record}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn bakes_to_the_end(server: &Server, job: &str, package: &Path) {
    server.fetch_when_done(job, package);
    succeed(["inspect", "--verify", package.to_str().unwrap()]);
}

#[test]
fn a_job_that_cannot_fit_is_refused_before_it_begins() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("kiln.toml");
    // Nothing has this much room.
    std::fs::write(&config, "reserve_bytes = 1000000000000000000\n").unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &["--config", config.to_str().unwrap()]);
    let said: Value = serde_json::from_str(&succeed(["--json", "submit", "--server", &server.url, &room().display().to_string()])).unwrap();
    let why = complaint(&server, said["id"].as_str().unwrap());
    assert!(why.contains("disk") && why.contains("free"), "{why}");
    assert_eq!(server.get("/v1/jobs")["jobs"].as_array().unwrap().len(), 1);
}

#[test]
fn a_file_that_finds_no_room_stops_its_job_and_no_other() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("kiln.toml");
    std::fs::write(&config, "[chunks]\nbytes = 2000000\n").unwrap();
    // 16 MiB a file: more than the database, a chunk or the small job's files, and half of the large job's largest. The signal that comes with
    // the error would kill the process; a full disk sends none.
    let limit = "trap '' XFSZ; ulimit -f 16384";
    let server = Server::start_after(limit, &dir.path().join("data"), &["--config", config.to_str().unwrap()]);
    let _worker = server.worker(&[]);
    let large = server.submit_room(LARGE);
    let why = complaint(&server, &large);
    println!("the large job: {why}");
    assert!(why.contains("written") || why.contains("full") || why.contains("large"), "{why}");
    let small = server.submit_room(&[]);
    bakes_to_the_end(&server, &small, &dir.path().join("package"));
    assert_ne!(server.get(&format!("/v1/jobs/{large}"))["state"], "done");
}
