//! Workers that are cut off, killed and sent away: what they have finished arrives, once.

use crate::harness::{PATIENCE, Process, Server, assert_same_package, bake_room, fail, kiln};
use std::{
    io::Read,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Enough work that half-way lasts long enough to be caught.
const LONGER: &[&str] = &["--samples", "96"];
/// Leases that are silent for as long as this have expired.
const TTL: Duration = Duration::from_millis(1500);

/// A coordinator whose leases are long to bake and short-lived without heartbeats.
fn coordinator(dir: &Path, listen: &str) -> Server {
    let config = dir.join("kiln.toml");
    std::fs::write(&config, "[lease]\nttl_ms = 1500\nheartbeat_ms = 300\ntarget_ms = 60000\n\n[chunks]\nage_ms = 50\n").unwrap();
    Server::start(&dir.join("data"), listen, &["--config", config.to_str().unwrap()])
}

/// A worker with a spool of the test's own.
fn worker(server: &Server, spool: &Path, more: &[&str]) -> Process {
    server.worker(&[&["--spool", spool.to_str().unwrap()], more].concat())
}

fn undisturbed(dir: &TempDir) -> PathBuf {
    let path = dir.path().join("undisturbed");
    bake_room(&path, LONGER);
    path
}

/// Chunks that wait on disk.
fn spooled(spool: &Path) -> Vec<PathBuf> {
    let mut folders = vec![spool.to_owned()];
    let mut chunks = vec![];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "chunk") {
                chunks.push(path);
            }
        }
    }
    chunks
}

fn wait_until(what: &str, is: impl Fn() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < PATIENCE, "waiting for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Kills the coordinator when the bake is under way, and waits until the worker has put some of what it goes on to bake aside.
fn cut_off(server: &mut Server, job: &str, spool: &Path) {
    server.wait_until_halfway(job);
    server.process.kill();
    wait_until("chunks in the spool", || spooled(spool).len() >= 3);
    // Until every lease has run out.
    std::thread::sleep(TTL);
}

fn figure(metrics: &str, name: &str) -> u64 {
    let line = metrics.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(' ')).unwrap_or_else(|| panic!("{name} in {metrics}"));
    line.parse().unwrap()
}

fn counter(server: &Server, name: &str) -> u64 {
    figure(&server.text("/metrics"), name)
}

/// Every tile came once, and the package is what it should be.
fn assert_nothing_was_baked_twice(server: &Server, package: &Path, expected: &Path) {
    assert_same_package(expected, package);
    assert_eq!((counter(server, "kiln_tiles_duplicate_total"), counter(server, "kiln_tiles_conflicting_total")), (0, 0));
}

/// A coordinator that has just come back is given what lies in `chunks` files before it leases anything. One of them it may have accepted
/// before it was killed, and been killed before it said so.
fn assert_finished_work_comes_first(server: &Server, chunks: usize) {
    let start = Instant::now();
    loop {
        let metrics = server.text("/metrics");
        if figure(&metrics, "kiln_leases_granted_total") > 0 {
            let done = figure(&metrics, "kiln_tiles_done_total");
            assert!(done + 1 >= chunks as u64, "{done} tiles from {chunks} chunks were accepted when the first lease was granted");
            return;
        }
        assert!(start.elapsed() < PATIENCE, "waiting for a lease: {metrics}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_coordinator_away_for_longer_than_its_leases_costs_no_re_bake() {
    let dir = TempDir::new().unwrap();
    let (expected, spool) = (undisturbed(&dir), dir.path().join("spool"));
    let mut server = coordinator(dir.path(), "127.0.0.1:0");
    let mut worker = worker(&server, &spool, &[]);
    let job = server.submit_room(LONGER);
    cut_off(&mut server, &job, &spool);
    let chunks = spooled(&spool).len();
    let server = coordinator(dir.path(), &format!("127.0.0.1:{}", server.port));
    assert_finished_work_comes_first(&server, chunks);
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert!(counter(&server, "kiln_attempts_expired_total") >= 1, "the lease had run out");
    assert_nothing_was_baked_twice(&server, &package, &expected);
    worker.terminate();
    assert!(worker.wait().success());
    assert!(std::fs::read_dir(&spool).unwrap().next().is_none(), "an empty spool is taken away");
}

#[test]
fn what_a_killed_worker_had_finished_is_delivered_by_the_next() {
    let dir = TempDir::new().unwrap();
    let (expected, spool) = (undisturbed(&dir), dir.path().join("spool"));
    let mut server = coordinator(dir.path(), "127.0.0.1:0");
    let mut victim = worker(&server, &spool, &[]);
    let job = server.submit_room(LONGER);
    cut_off(&mut server, &job, &spool);
    victim.kill();
    let chunks = spooled(&spool).len();
    assert!(chunks >= 3);
    let server = coordinator(dir.path(), &format!("127.0.0.1:{}", server.port));
    let _heir = worker(&server, &spool, &[]);
    assert_finished_work_comes_first(&server, chunks);
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_nothing_was_baked_twice(&server, &package, &expected);
    assert!(spooled(&spool).is_empty());
}

#[test]
fn a_drain_without_a_coordinator_ends_in_time_and_keeps_what_is_finished() {
    let dir = TempDir::new().unwrap();
    let (expected, spool) = (undisturbed(&dir), dir.path().join("spool"));
    let mut server = coordinator(dir.path(), "127.0.0.1:0");
    let mut leaving = worker(&server, &spool, &["--drain-timeout", "1"]);
    let job = server.submit_room(LONGER);
    cut_off(&mut server, &job, &spool);
    leaving.terminate();
    assert!(leaving.wait().success(), "it leaves as it was told to");
    assert!(spooled(&spool).len() >= 3);
    let server = coordinator(dir.path(), &format!("127.0.0.1:{}", server.port));
    let _heir = worker(&server, &spool, &[]);
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_nothing_was_baked_twice(&server, &package, &expected);
}

#[test]
fn a_second_signal_ends_a_worker_at_once() {
    let dir = TempDir::new().unwrap();
    let spool = dir.path().join("spool");
    let mut server = coordinator(dir.path(), "127.0.0.1:0");
    // Alone it would wait for the coordinator for longer than this test.
    let mut stubborn = worker(&server, &spool, &["--drain-timeout", "100000"]);
    let job = server.submit_room(LONGER);
    cut_off(&mut server, &job, &spool);
    stubborn.terminate();
    // It goes on until what it has begun is delivered; signals that come together are one.
    std::thread::sleep(Duration::from_millis(500));
    assert!(stubborn.0.try_wait().unwrap().is_none());
    stubborn.terminate();
    assert_eq!(stubborn.wait().code(), Some(1));
    assert!(spooled(&spool).len() >= 3, "what is finished waits for the next worker");
}

#[test]
fn a_tile_that_takes_too_long_does_not_keep_a_worker() {
    let dir = TempDir::new().unwrap();
    let server = coordinator(dir.path(), "127.0.0.1:0");
    let mut leaving = worker(&server, &dir.path().join("spool"), &["--drain-timeout", "1"]);
    let job = server.submit_room(&["--samples", "1000000"]);
    server.wait_for(&job, "baking", |r| r["phase"] == "bake" && r["progress"]["workers"] == 1);
    leaving.terminate();
    assert!(leaving.wait().success());
    assert_eq!(counter(&server, "kiln_attempts_expired_total"), 0, "its lease was handed back");
    assert_eq!(counter(&server, "kiln_attempts_held"), 0);
}

#[test]
fn a_spool_without_room_slows_a_worker_and_loses_nothing() {
    let dir = TempDir::new().unwrap();
    let (expected, spool) = (undisturbed(&dir), dir.path().join("spool"));
    let server = coordinator(dir.path(), "127.0.0.1:0");
    // No file may be longer than a kilobyte, which is how a full disk looks; the signal that comes with it here would kill the process.
    let mut command = Command::new("bash");
    command.args(["-euc", "trap '' XFSZ; ulimit -f 1; exec \"$@\"", "bash", env!("CARGO_BIN_EXE_kiln")]);
    command.args(["work", "--threads", "1", "--join", &server.url, "--spool"]).arg(&spool);
    let mut child = Process(command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
    let job = server.submit_room(LONGER);
    let package = dir.path().join("package");
    server.fetch_when_done(&job, &package);
    assert_nothing_was_baked_twice(&server, &package, &expected);
    child.terminate();
    assert!(child.wait().success());
    let mut said = String::new();
    child.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    let complaints = said.lines().filter(|l| l.contains("the spool takes no more")).count();
    assert_eq!(complaints, 1, "once: {said}");
}

#[test]
fn a_worker_says_what_is_wrong_with_its_address_or_its_spool() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "not a folder").unwrap();
    fail(1, &["http://host:8080"], ["work", "--join", "http://"]);
    fail(1, &["only http and https"], ["work", "--join", "ftp://example"]);
    fail(1, &["--spool", "file"], ["work", "--join", "http://127.0.0.1:9", "--spool", file.join("x").to_str().unwrap()]);
    let server = coordinator(dir.path(), "127.0.0.1:0");
    let elsewhere = format!("{}/elsewhere", server.url);
    fail(1, &["/elsewhere/v1/worker/hello answered 4", "check the address"], ["work", "--join", &elsewhere, "--spool-bytes", "0"]);
}

#[test]
fn a_worker_without_a_coordinator_says_what_it_waits_for() {
    let dir = TempDir::new().unwrap();
    let mut server = coordinator(dir.path(), "127.0.0.1:0");
    server.process.kill();
    let mut command = kiln(["work", "--join", &server.url, "--spool-bytes", "0"]);
    let mut waiting = Process(command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
    let mut said = vec![];
    let mut log = waiting.0.stderr.take().unwrap();
    // Its first word comes by itself; without one the test hangs, and with it the test runner's limit speaks.
    while !String::from_utf8_lossy(&said).contains("keeps trying") {
        let mut some = [0; 512];
        let n = log.read(&mut some).unwrap();
        assert!(n > 0, "it gave up: {}", String::from_utf8_lossy(&said));
        said.extend_from_slice(&some[..n]);
    }
    waiting.terminate();
    assert!(waiting.wait().success());
}
