//! The HTTP face of the coordinator: the API of farm.md, the worker protocol, and what operators ask.
//!
//! Handlers translate: bytes to values, values to the engine, its answers and errors back to bytes. They hold no state and decide nothing
//! about jobs. One file per resource; `routes` joins them, `problem` is the only place where an error becomes HTTP.

mod admission;
mod archive;
mod assets;
mod bakes;
mod body;
mod catalogue;
mod conditional;
mod events;
mod extract;
mod health;
mod import_query;
mod index;
mod jobs;
mod layers;
mod live;
mod metrics;
mod openapi;
mod page;
mod pictures;
mod preview;
mod problem;
mod routes;
mod scenes;
mod settings_schema;
mod tiles;
mod upload;
pub mod view;
mod worker_protocol;
mod workers;

#[cfg(test)]
mod tests;

pub use events::Snapshot;
pub use layers::HostPolicy;
pub use openapi::openapi;
pub use tiles::DoneTiles;

use self::{admission::Admission, catalogue::Kind, metrics::Metrics, pictures::Pictures, problem::Failure, routes::Routes};
use crate::engine::Engine;
use axum::{Router, extract::DefaultBodyLimit, middleware};
use kiln_proto::limits;
use std::{io, sync::Arc, time::Duration};
use tokio::{net::TcpListener, sync::Semaphore};
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;

/// How long requests under way may take to finish once a shut-down has begun.
const GRACE: Duration = Duration::from_secs(20);
/// How often samples of the latency histogram are folded into its buckets.
const UPKEEP: Duration = Duration::from_secs(5);
/// Chunks that may be on their way to the spool for each that the engine checks at the same time.
const SPOOLING_PER_CHECK: usize = 4;

/// What handlers share.
#[derive(Clone)]
struct App {
    engine: Arc<Engine>,
    metrics: Arc<Metrics>,
    hosts: HostPolicy,
    /// Cancelled when the service stops: streams and long polls end.
    closing: CancellationToken,
    chunk_slots: Arc<Semaphore>,
    pictures: Arc<Pictures>,
    live: Arc<Admission>,
}

impl App {
    fn new(engine: Arc<Engine>, hosts: HostPolicy, closing: CancellationToken) -> Self {
        let slots = engine.config().chunks.concurrent as usize * SPOOLING_PER_CHECK;
        Self {
            engine,
            metrics: Arc::default(),
            hosts,
            closing,
            chunk_slots: Arc::new(Semaphore::new(slots)),
            pictures: Arc::default(),
            live: Arc::new(live::admission()),
        }
    }

    fn router(self) -> Router {
        self.surround(Routes::all().router)
    }

    /// Fallbacks and layers around `routes`; the last layer is the outermost.
    fn surround(self, routes: Router<App>) -> Router {
        routes
            .fallback(async || Failure::new(Kind::NotFound, "nothing is served under this path"))
            .method_not_allowed_fallback(async || Failure::new(Kind::MethodNotAllowed, "the resource does not take this method"))
            .layer(DefaultBodyLimit::max(usize::try_from(limits::BUNDLE_BYTES + extract::JSON_BYTES).unwrap_or(usize::MAX)))
            .layer(CatchPanicLayer::custom(layers::panicked))
            .layer(middleware::from_fn_with_state(self.hosts, layers::guard))
            .layer(middleware::from_fn_with_state(self.clone(), layers::observe))
            .with_state(self)
    }
}

/// The whole API over `engine`, for tests and for other transports; `closing` ends streams and long polls.
pub fn router(engine: Arc<Engine>, hosts: HostPolicy, closing: CancellationToken) -> Router {
    App::new(engine, hosts, closing).router()
}

/// Serves the API on `listener` until `shutdown` is cancelled; then takes no more connections, ends streams and long polls, and gives
/// requests under way 20 s to finish. A loopback listener admits only loopback names and pages; whether another address may be opened
/// without tokens is for the caller to decide before it binds. The engine is left running.
///
/// # Errors
/// A listener that cannot say its address.
pub async fn serve(listener: TcpListener, engine: Arc<Engine>, shutdown: CancellationToken) -> io::Result<()> {
    let hosts = if listener.local_addr()?.ip().is_loopback() { HostPolicy::Loopback } else { HostPolicy::Any };
    let app = App::new(engine, hosts, shutdown.clone());
    let metrics = Arc::clone(&app.metrics);
    let serving = axum::serve(listener, app.router()).with_graceful_shutdown(shutdown.clone().cancelled_owned());
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
        served = serving => served,
        () = upkeep => Ok(()),
        () = patience => Ok(()),
    }
}
