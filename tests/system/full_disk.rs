//! A disk without room, for real: the job says so, and the service goes on.
//!
//! Filling a disk of the machine is out of the question, and a file system of one's own cannot be mounted by everybody. A limit on the size
//! of a file can be set by every user and binds root as well: writing beyond it fails in the middle of a file as on a full disk, while
//! small files still find room. Where a file system may be mounted, a small one is filled to the last byte.

use crate::harness::{LARGE, PATIENCE, Server, assert_same_package, bake_room, room, succeed};
use serde_json::Value;
use std::{
    fs::File,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
    process::Command,
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
    // 16 MiB a file: more than the database, a chunk or the small job's files, and half of the large job's largest. The signal that comes
    // with the error would kill the process; a full disk sends none.
    let limit = ["bash", "-euc", "trap '' XFSZ; ulimit -f 16384; exec \"$@\"", "bash"];
    let server = Server::start_through(&limit, &dir.path().join("data"), &["--config", config.to_str().unwrap()]);
    let _worker = server.worker(&[]);
    let large = server.submit_room(LARGE);
    let why = complaint(&server, &large);
    println!("the large job: {why}");
    assert!(why.contains("written") || why.contains("full") || why.contains("large"), "{why}");
    let small = server.submit_room(&[]);
    bakes_to_the_end(&server, &small, &dir.path().join("package"));
    assert_ne!(server.get(&format!("/v1/jobs/{large}"))["state"], "done");
}

/// Writes zeros until nothing more fits.
fn fill(file: &Path) {
    let (mut file, zeros) = (File::create(file).unwrap(), [0; 4096]);
    loop {
        match file.write(&zeros) {
            Ok(_) => {}
            Err(e) if e.kind() == ErrorKind::StorageFull => return,
            Err(e) => panic!("{e}"),
        }
    }
}

#[test]
fn a_disk_that_fills_up_mid_bake_delays_the_job_and_loses_nothing() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let mount = format!("mount -t tmpfs -o size=64m tmpfs '{}'; exec \"$@\"", data.display());
    let wrapper = ["unshare", "--map-root-user", "--mount", "bash", "-euc", &mount, "bash"];
    if !Command::new(wrapper[0]).args(&wrapper[1..]).arg("true").output().is_ok_and(|o| o.status.success()) {
        // Containers and some systems forbid it even to root.
        println!("NOT RUN: this user may not mount a file system; a limit on file sizes is what is left to test a full disk with");
        return;
    }
    let longer = ["--samples", "96"];
    let expected = dir.path().join("undisturbed");
    bake_room(&expected, &longer);
    let config = dir.path().join("kiln.toml");
    let brisk = "reserve_bytes = 1000000\n[lease]\nttl_ms = 1500\nheartbeat_ms = 300\ntarget_ms = 600\n\n[chunks]\nage_ms = 150\n";
    std::fs::write(&config, brisk).unwrap();
    let server = Server::start_through(&wrapper, &data, &["--config", config.to_str().unwrap()]);
    let _worker = server.worker(&[]);
    let job = server.submit_room(&longer);
    server.wait_until_halfway(&job);
    // The file system exists for that process alone, but can be reached through it.
    let filler = PathBuf::from(format!("/proc/{}/root{}/filler", server.process.0.id(), data.display()));
    fill(&filler);
    let why = complaint(&server, &job);
    assert!(why.contains("full") && why.contains(data.to_str().unwrap()), "{why}");
    assert!(succeed(["jobs", "--server", &server.url]).contains(&job), "it still answers");
    assert_eq!(server.get(&format!("/v1/jobs/{job}"))["state"], "baking");
    std::fs::remove_file(&filler).unwrap();
    let package = dir.path().join("package");
    bakes_to_the_end(&server, &job, &package);
    assert_same_package(&expected, &package);
}
