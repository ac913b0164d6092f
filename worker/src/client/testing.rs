//! A coordinator made of answers: it keeps what it is given, and misbehaves as a test asks.

use super::session::{CallError, Session};
use axum::{
    Router,
    body::{Body, Bytes},
    extract::{Request, State},
    http::{HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use kiln_proto::{
    ids::{Token, WorkerId},
    wire::{
        frame::{self, Message},
        message::{ChunkVerdict, HeartbeatReply, Hello, Refusal, Welcome},
    },
};
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    net::SocketAddr,
    sync::{Arc, Mutex},
};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;

/// How one upload is answered.
#[derive(Debug, Clone)]
pub(crate) enum Upload {
    /// Not in a frame, as proxies do.
    Status(u16, Option<&'static str>),
    Refuse(u16, Refusal),
    /// The connection breaks before the body is read.
    CutBefore,
    /// The chunk is taken, but the connection breaks within the answer.
    CutAfter,
}

/// What the fake has seen and should do.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    /// Answers to the next uploads; then every one is taken.
    pub(crate) script: VecDeque<Upload>,
    /// Every hello is answered by this.
    pub(crate) door: Option<Upload>,
    /// Attempts whose heartbeats are answered with a cancel.
    pub(crate) expired: BTreeSet<Token>,
    /// Uploads begun.
    pub(crate) uploads: usize,
    /// Chunks taken, in order, each once.
    pub(crate) taken: Vec<(Token, u32)>,
    pub(crate) bytes: BTreeMap<(Token, u32), Bytes>,
    /// Ends told: `complete` or `release`.
    pub(crate) ended: Vec<(Token, String)>,
}

/// The fake, up or away.
pub(crate) struct Fake {
    address: SocketAddr,
    seen: Arc<Mutex<Seen>>,
    running: Option<Runtime>,
}

impl Fake {
    pub(crate) fn start() -> Self {
        rustls::crypto::ring::default_provider().install_default().ok();
        let mut fake = Self { address: ([127, 0, 0, 1], 0).into(), seen: Arc::default(), running: None };
        fake.come();
        fake
    }

    /// Comes up on its address.
    pub(crate) fn come(&mut self) {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let (seen, address) = (self.seen.clone(), self.address);
        let (bound, at) = std::sync::mpsc::channel();
        runtime.spawn(async move {
            let listener = tokio::net::TcpListener::bind(address).await.unwrap();
            bound.send(listener.local_addr().unwrap()).unwrap();
            axum::serve(listener, Router::new().fallback(answer).with_state(seen)).await
        });
        self.address = at.recv().unwrap();
        self.running = Some(runtime);
    }

    /// Goes away with every connection.
    pub(crate) fn go(&mut self) {
        self.running.take().unwrap().shutdown_background();
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub(crate) fn seen<T>(&self, look: impl FnOnce(&mut Seen) -> T) -> T {
        look(&mut self.seen.lock().unwrap())
    }

    pub(crate) async fn try_session(&self, stop: &CancellationToken) -> Result<Session, CallError> {
        let hello = Hello { bake_version: 1, name: "test".into(), threads: 1, features: vec![] };
        Session::open(&self.url(), &crate::config::Access::default(), hello, stop.clone()).await
    }

    pub(crate) async fn session(&self, stop: &CancellationToken) -> Arc<Session> {
        Arc::new(self.try_session(stop).await.unwrap())
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        if let Some(runtime) = self.running.take() {
            runtime.shutdown_background();
        }
    }
}

fn reply<M: Message>(status: u16, message: &M) -> Response {
    (StatusCode::from_u16(status).unwrap(), frame::to_frame(message).unwrap()).into_response()
}

/// Ends the connection, without the words of a panic.
fn cut() -> ! {
    std::panic::resume_unwind(Box::new("the connection breaks"))
}

async fn answer(State(seen): State<Arc<Mutex<Seen>>>, request: Request) -> Response {
    let path: Vec<String> = request.uri().path().split('/').skip(3).map(str::to_owned).collect();
    let path: Vec<&str> = path.iter().map(String::as_str).collect();
    match (request.method().clone(), path.as_slice()) {
        (Method::POST, ["hello"]) => {
            let door = seen.lock().unwrap().door.clone();
            let welcome = Welcome { worker: WorkerId::random(), heartbeat_ms: 10, chunk_bytes: 1 << 20, chunk_ms: 50 };
            door.map_or_else(|| reply(200, &welcome), misbehave)
        }
        (Method::POST, ["attempts", token, "heartbeat"]) => {
            let expired = seen.lock().unwrap().expired.contains(&token.parse().unwrap());
            reply(200, &if expired { HeartbeatReply::Cancel } else { HeartbeatReply::Continue })
        }
        (Method::PUT, ["attempts", token, "chunks", number]) => {
            let key = (token.parse().unwrap(), number.parse().unwrap());
            upload(&seen, key, request.into_body()).await
        }
        (Method::POST, ["attempts", token, end]) => {
            seen.lock().unwrap().ended.push((token.parse().unwrap(), (*end).to_owned()));
            StatusCode::NO_CONTENT.into_response()
        }
        _ => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn upload(seen: &Mutex<Seen>, key: (Token, u32), body: Body) -> Response {
    let next = {
        let mut seen = seen.lock().unwrap();
        seen.uploads += 1;
        seen.script.pop_front()
    };
    if let Some(other) = next.clone().filter(|n| !matches!(n, Upload::CutAfter)) {
        return misbehave(other);
    }
    let bytes = axum::body::to_bytes(body, usize::MAX).await.unwrap();
    {
        let mut seen = seen.lock().unwrap();
        if let Some(before) = seen.bytes.insert(key, bytes.clone()) {
            assert_eq!(before, bytes, "the same chunk with other bytes");
        } else {
            seen.taken.push(key);
        }
    }
    // The chunk is recorded; its sender never hears of it.
    next.map_or_else(|| reply(200, &ChunkVerdict { tiles: vec![] }), misbehave)
}

fn misbehave(how: Upload) -> Response {
    match how {
        Upload::Status(status, retry_after) => {
            let mut response = (StatusCode::from_u16(status).unwrap(), "<html>not a frame</html>").into_response();
            if let Some(seconds) = retry_after {
                response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static(seconds));
            }
            response
        }
        Upload::Refuse(status, refusal) => reply(status, &refusal),
        Upload::CutBefore | Upload::CutAfter => cut(),
    }
}
