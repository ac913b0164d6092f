//! Both ends of the simulated network: a listener for axum, and what carries the requests of a worker's real client.
//!
//! The client is hyper's, pool and all, as in production below `reqwest`, which opens its connections itself and cannot be given others.

use super::witness::Witness;
use crate::http::peer::Peer;
use axum::{extract::connect_info::Connected, http::Uri, serve::IncomingStream};
use hyper_util::{
    client::legacy::{
        Client,
        connect::{Connected as Established, Connection},
    },
    rt::{TokioExecutor, TokioIo},
};
use kiln_worker::client::transport::{Carried, Carrier, Cause};
use std::{
    io,
    net::{Ipv4Addr, SocketAddr},
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    time::timeout,
};
use tower::util::BoxCloneSyncService;
use turmoil::net::{TcpListener, TcpStream};

/// The coordinator's name and address on the network.
pub(super) const COORDINATOR: &str = "coordinator";
const PORT: u16 = 80;
/// As the workers' own.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// A listener for axum.
pub(super) struct SimulatedDoor(TcpListener);

impl SimulatedDoor {
    pub(super) async fn open() -> io::Result<Self> {
        Ok(Self(TcpListener::bind((Ipv4Addr::UNSPECIFIED, PORT)).await?))
    }
}

impl axum::serve::Listener for SimulatedDoor {
    type Io = TcpStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (TcpStream, SocketAddr) {
        loop {
            // A connection that is gone before it is taken is nobody's.
            if let Ok(taken) = self.0.accept().await {
                return taken;
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.0.local_addr()
    }
}

impl Connected<IncomingStream<'_, SimulatedDoor>> for Peer {
    fn connect_info(stream: IncomingStream<'_, SimulatedDoor>) -> Self {
        Self { address: *stream.remote_addr(), tls: false }
    }
}

/// A connection as hyper wants it.
struct Line(TcpStream);

impl Connection for Line {
    fn connected(&self) -> Established {
        Established::new()
    }
}

impl AsyncRead for Line {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_read(context, buffer)
    }
}

impl AsyncWrite for Line {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(context, bytes)
    }
    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(context)
    }
    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(context)
    }
}

type Connector = BoxCloneSyncService<Uri, TokioIo<Line>, Cause>;

/// Carries the requests of one host; a witness sees every answer that arrives.
pub(super) struct SimulatedCarrier {
    host: String,
    client: Client<Connector, reqwest::Body>,
    witness: Arc<Witness>,
}

impl SimulatedCarrier {
    pub(super) fn new(host: &str, witness: Arc<Witness>) -> Self {
        let connect = tower::service_fn(|_: Uri| async {
            let stream = timeout(CONNECT_TIMEOUT, TcpStream::connect((COORDINATOR, PORT))).await??;
            Ok(TokioIo::new(Line(stream)))
        });
        let client = Client::builder(TokioExecutor::new()).build(BoxCloneSyncService::new(connect));
        Self { host: host.to_owned(), client, witness }
    }

    async fn ask(&self, request: reqwest::Request) -> Result<reqwest::Response, Cause> {
        let (path, patience) = (request.url().path().to_owned(), request.timeout().copied());
        let sent = request.body().and_then(reqwest::Body::as_bytes).map(<[u8]>::to_vec).unwrap_or_default();
        let answered = async {
            let (head, body) = self.client.request(request.try_into()?).await?.into_parts();
            let body = axum::body::to_bytes(axum::body::Body::new(body), usize::MAX).await?;
            Ok::<_, Cause>((head, body))
        };
        let outcome = match patience {
            Some(patience) => timeout(patience, answered).await.unwrap_or_else(|late| Err(late.into())),
            None => answered.await,
        };
        match outcome {
            Ok((head, body)) => {
                self.witness.answered(&self.host, &path, &sent, head.status.as_u16(), &body);
                Ok(axum::http::Response::from_parts(head, body).into())
            }
            Err(cause) => {
                self.witness.unanswered(&self.host, &path);
                Err(cause)
            }
        }
    }
}

impl Carrier for SimulatedCarrier {
    fn carry(&self, request: reqwest::Request) -> Carried<'_> {
        Box::pin(self.ask(request))
    }
}
