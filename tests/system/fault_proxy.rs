//! Proxies that misbehave on purpose, between a client and a real server. They count, and never toss a coin: a test that failed fails again.
//!
//! [`FaultProxy::http`] answers some requests itself, late or by half; [`FaultProxy::tcp`] knows no protocol, and cuts and delays
//! connections. One may stand before the other.

use crate::harness::runtime;
use axum::{
    Router,
    body::{Body, to_bytes},
    extract::{Request, State},
    http::{HeaderMap, Method, StatusCode, Uri, header},
    response::Response,
};
use std::{
    io,
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{
        TcpListener, TcpStream,
        tcp::{OwnedReadHalf, OwnedWriteHalf},
    },
    runtime::Runtime,
};

/// What befalls a request.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fault {
    /// It is answered with this status and never arrives.
    Status(u16),
    /// It arrives; half of the answer comes back before the connection breaks.
    Half,
    /// It arrives this much later.
    Late(Duration),
}

/// Decides on a request by its number, from 1, and what it asks for.
pub(crate) type Rule = dyn Fn(u64, &Method, &Uri) -> Option<Fault> + Send + Sync;

/// What befalls connections.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TcpFaults {
    /// Each begins this much later.
    pub(crate) delay: Duration,
    /// Whichever is at work when all together have carried so many bytes, both ways, is cut: how many connections a client keeps, and for
    /// how long, changes nothing about the number of cuts.
    pub(crate) first_cut: u64,
    /// And again whenever so many more have been carried. It must let through what is asked for at once, or that never comes through.
    pub(crate) cut_every: u64,
}

/// A proxy on a port of its own; it ends with the value.
pub(crate) struct FaultProxy {
    pub(crate) address: SocketAddr,
    faults: Arc<AtomicU64>,
    runtime: Option<Runtime>,
}

impl FaultProxy {
    /// Passes HTTP requests on to `upstream`, but for what `rule` decides.
    pub(crate) fn http(upstream: SocketAddr, rule: impl Fn(u64, &Method, &Uri) -> Option<Fault> + Send + Sync + 'static) -> Self {
        Self::start(|listener, faults| {
            let client = reqwest::Client::builder().no_proxy().redirect(reqwest::redirect::Policy::none()).build().unwrap();
            let http = Http { client, upstream, rule: Box::new(rule), requests: AtomicU64::new(0), faults };
            let router = Router::new().fallback(answer).with_state(Arc::new(http));
            async move { axum::serve(listener, router).await.unwrap() }
        })
    }

    /// Passes bytes on to `upstream`, but for the faults.
    pub(crate) fn tcp(upstream: SocketAddr, faults: TcpFaults) -> Self {
        Self::start(|listener, count| async move {
            let toll = Arc::new(Toll { left: AtomicU64::new(faults.first_cut), cut_every: faults.cut_every });
            while let Ok((client, _)) = listener.accept().await {
                let (count, toll) = (Arc::clone(&count), Arc::clone(&toll));
                tokio::spawn(async move {
                    tokio::time::sleep(faults.delay).await;
                    let Ok(server) = TcpStream::connect(upstream).await else { return };
                    if relay(client, server, &toll).await == Ok(Ended::Cut) {
                        count.fetch_add(1, Ordering::SeqCst);
                    }
                });
            }
        })
    }

    fn start<F: Future<Output = ()> + Send + 'static>(serve: impl FnOnce(TcpListener, Arc<AtomicU64>) -> F) -> Self {
        drop(runtime()); // Chooses what TLS is made of, for the client below.
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = listener.local_addr().unwrap();
        let faults = Arc::<AtomicU64>::default();
        runtime.spawn(serve(listener, Arc::clone(&faults)));
        Self { address, faults, runtime: Some(runtime) }
    }

    /// Its address as a URL.
    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Faults so far.
    pub(crate) fn faults(&self) -> u64 {
        self.faults.load(Ordering::SeqCst)
    }
}

impl Drop for FaultProxy {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

struct Http {
    client: reqwest::Client,
    upstream: SocketAddr,
    rule: Box<Rule>,
    requests: AtomicU64,
    faults: Arc<AtomicU64>,
}

async fn answer(State(http): State<Arc<Http>>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let number = http.requests.fetch_add(1, Ordering::SeqCst) + 1;
    let fault = (http.rule)(number, &parts.method, &parts.uri);
    http.faults.fetch_add(u64::from(fault.is_some()), Ordering::SeqCst);
    // A client that sees an answer before it has sent everything may take it for another fault than it is.
    let Ok(body) = to_bytes(body, usize::MAX).await else { return plain(400) };
    match fault {
        Some(Fault::Status(status)) => return plain(status),
        Some(Fault::Late(time)) => tokio::time::sleep(time).await,
        Some(Fault::Half) | None => {}
    }
    let url = format!("http://{}{}", http.upstream, parts.uri.path_and_query().map_or("/", |p| p.as_str()));
    let sent = http.client.request(parts.method, url).headers(end_to_end(&parts.headers)).body(body).send().await;
    let Ok(reply) = sent else { return plain(502) };
    let mut response = Response::new(Body::empty());
    (*response.status_mut(), *response.headers_mut()) = (reply.status(), end_to_end(reply.headers()));
    let Ok(bytes) = reply.bytes().await else { return plain(502) };
    *response.body_mut() = match fault {
        Some(Fault::Half) => {
            let half = bytes.slice(..bytes.len() / 2);
            Body::from_stream(futures_util::stream::iter([Ok(half), Err(io::Error::other("half is enough"))]))
        }
        _ if bytes.is_empty() => Body::empty(), // The length that a HEAD is told stays.
        _ => Body::from(bytes),
    };
    response
}

fn plain(status: u16) -> Response {
    let mut response = Response::new(Body::from("a fault on purpose"));
    *response.status_mut() = StatusCode::from_u16(status).unwrap();
    response
}

/// Headers without those that belong to one connection.
fn end_to_end(headers: &HeaderMap) -> HeaderMap {
    let mut headers = headers.clone();
    for name in [header::CONNECTION, header::TRANSFER_ENCODING, header::UPGRADE, header::TE] {
        headers.remove(name);
    }
    headers
}

#[derive(Debug, PartialEq, Eq)]
enum Ended {
    Closed,
    Cut,
}

/// What all connections of a proxy may carry until the next cut.
struct Toll {
    left: AtomicU64,
    cut_every: u64,
}

impl Toll {
    /// Whether these bytes are the ones too many.
    fn is_due(&self, length: u64) -> bool {
        let pay = |left: u64| Some(left.checked_sub(length).unwrap_or(self.cut_every));
        self.left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, pay).is_ok_and(|left| left < length)
    }
}

/// Carries bytes both ways until one side closes or the toll is due; both connections are closed then.
async fn relay(client: TcpStream, server: TcpStream, toll: &Toll) -> Result<Ended, io::ErrorKind> {
    let ((from_client, to_client), (from_server, to_server)) = (client.into_split(), server.into_split());
    tokio::select! {
        ended = carry(from_client, to_server, toll) => ended,
        ended = carry(from_server, to_client, toll) => ended,
    }
    .map_err(|e| e.kind())
}

async fn carry(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, toll: &Toll) -> io::Result<Ended> {
    let mut block = vec![0; 16 << 10];
    loop {
        let length = from.read(&mut block).await?;
        if length == 0 {
            return Ok(Ended::Closed);
        }
        if toll.is_due(length as u64) {
            return Ok(Ended::Cut);
        }
        to.write_all(&block[..length]).await?;
    }
}
