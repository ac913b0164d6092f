//! Several coordinators on one PostgreSQL and one S3, behind a balancer, with workers that know only the balancer: one coordinator is killed, and
//! whoever watches, bakes or fetches goes on through the other.

use crate::{
    harness::{Process, Server, assert_same_package, bake_room, kiln, quick, room, runtime, succeed},
    servers::{S3, s3_environment},
};
use kiln_test_servers::Postgres;
use serde_json::Value;
use std::{
    io::{self, Read},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    path::Path,
    process::Stdio,
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};
use tempfile::TempDir;

/// Enough work that half-way lasts long enough to be caught.
const LONGER: &[&str] = &["--samples", "96"];

/// Passes connections on to whichever of some servers takes them, in turn.
pub(crate) struct Balancer {
    address: SocketAddr,
    servers: Arc<Mutex<Vec<u16>>>,
}

impl Balancer {
    /// Before servers on these ports.
    pub(crate) fn before(servers: Vec<u16>) -> Self {
        let servers = Arc::new(Mutex::new(servers));
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let turn = Arc::new(AtomicUsize::new(0));
        let behind = Arc::clone(&servers);
        // It ends with the test's process.
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let (servers, turn) = (behind.lock().unwrap().clone(), Arc::clone(&turn));
                thread::spawn(move || {
                    let first = turn.fetch_add(1, Ordering::Relaxed);
                    let reached =
                        (0..servers.len()).find_map(|k| TcpStream::connect(("127.0.0.1", servers[(first + k) % servers.len()])).ok());
                    if let Some(server) = reached {
                        join(client, server);
                    }
                });
            }
        });
        Self { address, servers }
    }

    /// The n-th server listens on another port now.
    pub(crate) fn moved(&self, n: usize, port: u16) {
        self.servers.lock().unwrap()[n] = port;
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }
}

/// Both ways, until either end closes.
fn join(client: TcpStream, server: TcpStream) {
    let copy = |mut from: TcpStream, mut to: TcpStream| {
        let _ = io::copy(&mut from, &mut to);
        let _ = to.shutdown(Shutdown::Both);
        let _ = from.shutdown(Shutdown::Both);
    };
    let (Ok(from), Ok(to)) = (client.try_clone(), server.try_clone()) else { return };
    let there = thread::spawn(move || copy(from, to));
    copy(server, client);
    let _ = there.join();
}

/// A coordinator on a database and an S3 at `endpoint`, with leases that are short enough for a test.
pub(crate) fn coordinator(dir: &Path, name: &str, store: &str, endpoint: &str) -> Server {
    let config = dir.join(format!("{name}.toml"));
    std::fs::write(&config, "[lease]\nttl_ms = 3000\nheartbeat_ms = 500\ntarget_ms = 600\n\n[chunks]\nage_ms = 150\n").unwrap();
    let environment = s3_environment(endpoint);
    let more = ["--blobs", "s3://kiln/farm", "--config", config.to_str().unwrap(), "--store", store];
    Server::start_with(&environment, &dir.join(name), &more)
}

fn worker(url: &str) -> Process {
    let mut command = kiln(["work", "--threads", "1", "--join", url]);
    Process(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}

fn manifest(url: &str, job: &str) -> Vec<u8> {
    let url = format!("{url}/v1/jobs/{job}/assets");
    runtime().block_on(async { reqwest::get(url).await.unwrap().error_for_status().unwrap().bytes().await.unwrap().to_vec() })
}

#[test]
fn a_coordinator_killed_mid_bake_is_not_missed() {
    let dir = TempDir::new().unwrap();
    let expected = dir.path().join("undisturbed");
    bake_room(&expected, LONGER);
    let (postgres, s3) = (Postgres::start(), S3::start());
    let (store, bucket) = (postgres.database(), format!("http://{}", s3.address));
    let mut doomed = coordinator(dir.path(), "doomed", &store, &bucket);
    let heir = coordinator(dir.path(), "heir", &store, &bucket);
    let balancer = Balancer::before(vec![doomed.port, heir.port]);
    let _workers: Vec<Process> = (0..4).map(|_| worker(&balancer.url())).collect();
    let mut args: Vec<String> = ["--json", "submit", "--server", &balancer.url()].map(str::to_owned).to_vec();
    args.push(room().display().to_string());
    args.extend(crate::harness::nominal());
    args.extend(quick(LONGER));
    let said: Value = serde_json::from_str(&succeed(args)).unwrap();
    let job = said["id"].as_str().unwrap();
    let watching = kiln(["watch", job, "--server", &balancer.url()]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut watching = Process(watching);
    let before = heir.wait_until_halfway(job);
    doomed.process.kill();
    let after = heir.wait_for(job, "the end", |r| r["state"] == "done");
    assert!(after["progress"]["tiles_done"].as_u64() >= before["progress"]["tiles_done"].as_u64());
    let status = watching.wait();
    let mut words = String::new();
    watching.0.stderr.take().unwrap().read_to_string(&mut words).ok();
    assert!(status.success(), "`kiln watch` went on through the other: {words}");
    // A third one, on the same store and bucket, serves what the others made.
    let late = coordinator(dir.path(), "late", &store, &bucket);
    assert_eq!(manifest(&heir.url, job), manifest(&late.url, job));
    let package = dir.path().join("package");
    succeed(["fetch", job, "--server", &late.url, "-o", package.to_str().unwrap()]);
    assert_same_package(&expected, &package);
}
