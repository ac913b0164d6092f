//! What processes say of themselves: log lines that machines read, spans in a collector.

use crate::harness::{Process, Server, fail, kiln, runtime, succeed};
use axum::{Router, body::Bytes, http::HeaderMap, routing::post};
use serde_json::Value;
use std::{
    io::{BufRead, BufReader},
    net::SocketAddr,
    process::{Command, Stdio},
    sync::{Arc, Mutex},
};
use tempfile::TempDir;

/// A collector that keeps what it is sent.
struct Collector {
    address: SocketAddr,
    bodies: Arc<Mutex<Vec<u8>>>,
    _runtime: tokio::runtime::Runtime,
}

impl Collector {
    fn start() -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
        let (address, bodies) = (listener.local_addr().unwrap(), Arc::<Mutex<Vec<u8>>>::default());
        let kept = Arc::clone(&bodies);
        let take = move |headers: HeaderMap, body: Bytes| {
            assert_eq!(headers["content-type"], "application/x-protobuf");
            kept.lock().unwrap().extend(body);
            async {}
        };
        runtime.spawn(async { axum::serve(listener, Router::new().route("/v1/traces", post(take))).await.unwrap() });
        Self { address, bodies, _runtime: runtime }
    }

    fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Strings are plain in protocol buffers.
    fn has(&self, text: &str) -> bool {
        self.bodies.lock().unwrap().windows(text.len()).any(|window| window == text.as_bytes())
    }
}

#[test]
fn spans_of_requests_tasks_and_attempts_reach_a_collector() {
    let (dir, collector) = (TempDir::new().unwrap(), Collector::start());
    let mut server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &["--otlp", &collector.url()]);
    let mut worker = server.worker(&["--otlp", &collector.url()]);
    let job = server.submit_room(&[]);
    server.wait_for(&job, "the end", |r| r["state"] == "done");
    worker.terminate();
    worker.wait();
    server.process.terminate();
    assert!(server.process.wait().success());
    for text in ["kiln-coordinator", "kiln-worker", "request", "/v1/worker/leases", "task", "Assemble", "attempt", &job] {
        assert!(collector.has(text), "no span holds `{text}`");
    }
}

#[test]
fn a_collector_that_is_away_costs_nothing_but_spans() {
    let dir = TempDir::new().unwrap();
    let nobody = format!("http://127.0.0.1:{}", kiln_test_servers::free_port());
    let mut server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &["--otlp", &nobody]);
    let _worker = server.worker(&[]);
    let job = server.submit_room(&[]);
    server.wait_for(&job, "the end", |r| r["state"] == "done");
    server.process.terminate();
    assert!(server.process.wait().success());
    fail(2, &["--otlp ftp://host", "OTLP/HTTP"], ["jobs", "--otlp", "ftp://host"]);
}

#[test]
fn logs_can_be_read_by_machines() {
    let dir = TempDir::new().unwrap();
    let mut command: Command =
        kiln(["serve", "--listen", "127.0.0.1:0", "--workers", "0", "--log", "info", "--log-format", "json", "--data"]);
    let mut server = Process(command.arg(dir.path()).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap());
    let mut lines = BufReader::new(server.0.stderr.take().unwrap()).lines().map(Result::unwrap);
    let address = lines.find_map(|line| Some(line.split_once("http://")?.1.split_whitespace().next()?.to_owned())).unwrap();
    let refused = runtime().block_on(async { reqwest::get(format!("http://{address}/v1/jobs/none")).await.unwrap().status() });
    assert!(refused.is_client_error());
    // Something is logged at the end, whatever it is.
    succeed(["token", "create", "--data", dir.path().to_str().unwrap(), "--name", "x", "--role", "read"]);
    server.terminate();
    server.wait();
    let parsed: Vec<Value> = lines.filter(|line| line.starts_with('{')).map(|line| serde_json::from_str(&line).unwrap()).collect();
    assert!(parsed.iter().all(|line| line["level"].is_string() && line["timestamp"].is_string()), "{parsed:?}");
}
