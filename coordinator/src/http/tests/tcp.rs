//! The service on a real socket: what the in-process router cannot show. Cut connections, slow clients, streams, an orderly end.

use super::*;
use crate::http::{Door, serve};
use kiln_proto::{
    BAKE_VERSION,
    wire::{
        frame::{from_frame, to_frame},
        message::{Hello, LeaseRequest, Welcome},
    },
};
use std::net::SocketAddr;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    task::JoinHandle,
};

/// A served bench.
struct Service {
    bench: Bench,
    address: SocketAddr,
    shutdown: CancellationToken,
    serving: JoinHandle<std::io::Result<()>>,
}

impl Service {
    async fn start() -> Self {
        let bench = Bench::new().await;
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let (address, shutdown) = (listener.local_addr().unwrap(), CancellationToken::new());
        let serving = tokio::spawn(serve(vec![Door::Plain(listener)], Arc::clone(&bench.engine), None, shutdown.clone()));
        Self { bench, address, shutdown, serving }
    }

    /// A connection on which the head of a request and the beginning of its body have been sent.
    async fn begin(&self, head: &str, body: &[u8]) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).await.unwrap();
        let head = format!("{head}\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address);
        stream.write_all(head.as_bytes()).await.unwrap();
        stream.write_all(body).await.unwrap();
        stream
    }

    async fn ask(&self, head: &str, body: &[u8]) -> (u16, Vec<u8>) {
        finish(self.begin(head, body).await).await
    }
}

/// Status and body of the answer, read until the server closes.
async fn finish(mut stream: TcpStream) -> (u16, Vec<u8>) {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).await.unwrap();
    let split = bytes.windows(4).position(|four| four == b"\r\n\r\n").expect("an answer with a head");
    let status = String::from_utf8_lossy(&bytes[..split]).split(' ').nth(1).unwrap().parse().unwrap();
    (status, bytes[split + 4..].to_vec())
}

fn upload_head(length: usize) -> String {
    format!("POST /v1/scenes HTTP/1.1\r\nContent-Type: {MULTIPART}\r\nContent-Length: {length}")
}

#[tokio::test]
async fn an_upload_arrives_over_a_socket() {
    let service = Service::start().await;
    let body = parts(&[("scene", Some("room.obj"), OBJ)]);
    let (status, answer) = service.ask(&upload_head(body.len()), body.as_bytes()).await;
    assert_eq!(status, 201, "{}", String::from_utf8_lossy(&answer));
}

#[tokio::test]
async fn a_connection_that_closes_early_leaves_nothing_behind() {
    let service = Service::start().await;
    let before = service.bench.files();
    let body = parts(&[("scene", Some("room.obj"), OBJ)]);
    let mut stream = service.begin(&upload_head(body.len()), &body.as_bytes()[..body.len() / 2]).await;
    stream.shutdown().await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400"), "{answer}");
    assert_eq!(service.bench.files(), before);
}

#[tokio::test]
async fn others_are_served_while_one_is_slow() {
    let service = Service::start().await;
    let body = parts(&[("scene", Some("room.obj"), OBJ)]);
    let (first, rest) = body.as_bytes().split_at(body.len() / 2);
    let mut slow = service.begin(&upload_head(body.len()), first).await;
    let quick = (0..16).map(|_| async { service.ask("GET /v1/jobs HTTP/1.1", b"").await.0 });
    assert_eq!(futures_util::future::join_all(quick).await, [200; 16]);
    slow.write_all(rest).await.unwrap();
    assert_eq!(finish(slow).await.0, 201);
}

#[tokio::test]
async fn a_foreign_host_is_refused_on_a_loopback_socket() {
    let service = Service::start().await;
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    stream.write_all(b"GET /v1/jobs HTTP/1.1\r\nHost: kiln.evil.example\r\nConnection: close\r\n\r\n").await.unwrap();
    let (status, body) = finish(stream).await;
    assert_eq!(status, 403);
    assert!(String::from_utf8_lossy(&body).contains("/problems/foreign-host"));
}

/// A long poll and an event stream would hold a shut-down up for ever; they end, and `serve` returns.
#[tokio::test]
async fn a_shut_down_ends_long_polls_and_streams() {
    let service = Service::start().await;
    let hello = to_frame(&Hello { bake_version: BAKE_VERSION, name: "test".into(), threads: 1, features: vec![] }).unwrap();
    let (_, answer) = service.ask(&format!("POST /v1/worker/hello HTTP/1.1\r\nContent-Length: {}", hello.len()), &hello).await;
    let welcome: Welcome = from_frame(&answer).unwrap();
    let wait = to_frame(&LeaseRequest { worker: welcome.worker, wait_ms: 25_000 }).unwrap();
    let body = parts(&[("scene", Some("room.obj"), OBJ)]);
    let head = format!("POST /v1/bakes HTTP/1.1\r\nContent-Type: {MULTIPART}\r\nContent-Length: {}", body.len());
    let (_, answer) = service.ask(&head, body.as_bytes()).await;
    let bake: Value = serde_json::from_slice(&answer).unwrap();
    let follow = format!("GET /v1/jobs/{}/events HTTP/1.1", bake["job"]["id"].as_str().unwrap());
    let mut events = service.begin(&follow, b"").await;
    let mut first = [0; 15];
    events.read_exact(&mut first).await.unwrap();
    assert_eq!(&first, b"HTTP/1.1 200 OK");
    let poll = service.begin(&format!("POST /v1/worker/leases HTTP/1.1\r\nContent-Length: {}", wait.len()), &wait).await;
    assert_eq!(service.ask("GET /healthz HTTP/1.1", b"").await.0, 200);
    let began = std::time::Instant::now();
    service.shutdown.cancel();
    service.serving.await.unwrap().unwrap();
    assert!(began.elapsed().as_secs() < 15, "the shut-down waited for the long poll or the stream");
    let mut rest = String::new();
    events.read_to_string(&mut rest).await.unwrap();
    assert!(rest.contains("event: state"), "{rest}");
    drop(poll);
}
