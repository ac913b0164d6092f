//! Serving on sockets: one or several doors into the same service, and an orderly end.

use super::{
    App, HostPolicy,
    peer::Peer,
    tls::{TlsIdentity, TlsListener},
};
use crate::engine::Engine;
use futures_util::future::{BoxFuture, FutureExt, try_join_all};
use kiln_proto::{ids::Digest, secret::Secret};
use std::{future::IntoFuture, io, net::SocketAddr, sync::Arc, time::Duration};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// How long requests under way may take to finish once a shut-down has begun.
const GRACE: Duration = Duration::from_secs(20);
/// How often samples of the latency histogram are folded into its buckets.
const UPKEEP: Duration = Duration::from_secs(5);

/// A way in.
pub enum Door {
    /// Plain HTTP.
    Plain(TcpListener),
    /// HTTP over TLS.
    Tls(TlsListener),
}

impl Door {
    /// TLS where there is an identity for it.
    #[must_use]
    pub fn new(listener: TcpListener, identity: Option<TlsIdentity>) -> Self {
        match identity {
            Some(identity) => Door::Tls(TlsListener::new(listener, identity)),
            None => Door::Plain(listener),
        }
    }

    fn address(&self) -> io::Result<SocketAddr> {
        match self {
            Door::Plain(listener) => listener.local_addr(),
            Door::Tls(listener) => axum::serve::Listener::local_addr(listener),
        }
    }

    fn serve(self, app: &App, shutdown: CancellationToken) -> BoxFuture<'static, io::Result<()>> {
        let service = app.clone().router().into_make_service_with_connect_info::<Peer>();
        let stop = shutdown.cancelled_owned();
        match self {
            Door::Plain(listener) => axum::serve(listener, service).with_graceful_shutdown(stop).into_future().boxed(),
            Door::Tls(listener) => axum::serve(listener, service).with_graceful_shutdown(stop).into_future().boxed(),
        }
    }
}

/// Serves the API at `doors` until `shutdown` is cancelled; then takes no more connections, ends streams and long polls, and gives requests
/// under way 20 s to finish. As long as no token exists, a service whose first door is at a loopback address admits only loopback names and
/// pages; whether another address may be opened without tokens is for the caller to decide before. `own_worker` is what workers present
/// that the caller starts itself: it is known here alone, and never stored. The engine is left running.
///
/// # Errors
/// A listener that cannot say its address.
pub async fn serve(doors: Vec<Door>, engine: Arc<Engine>, own_worker: Option<&Secret>, shutdown: CancellationToken) -> io::Result<()> {
    let loopback = doors.first().map(Door::address).transpose()?.is_some_and(|address| address.ip().is_loopback());
    let hosts = if loopback { HostPolicy::Loopback } else { HostPolicy::Any };
    let own_worker = own_worker.map(|secret| Digest::of(secret.expose().as_bytes()));
    let app = App::new(engine, hosts, own_worker, shutdown.clone());
    let metrics = Arc::clone(&app.metrics);
    let serving = try_join_all(doors.into_iter().map(|door| door.serve(&app, shutdown.clone())));
    let upkeep = async {
        loop {
            tokio::time::sleep(UPKEEP).await;
            metrics.upkeep();
        }
    };
    let patience = async {
        shutdown.cancelled().await;
        tokio::time::sleep(GRACE).await;
        tracing::warn!("requests were still under way {} s after the shut-down began; they are cut", GRACE.as_secs());
    };
    tokio::select! {
        served = serving => served.map(drop),
        () = upkeep => Ok(()),
        () = patience => Ok(()),
    }
}
