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
mod credentials;
mod events;
mod extract;
mod gate;
mod health;
mod import_query;
mod index;
mod jobs;
mod layers;
mod links;
mod live;
mod metrics;
mod openapi;
mod page;
mod peer;
mod pictures;
mod preview;
mod problem;
mod repeats;
mod routes;
mod scenes;
mod serve;
mod session;
mod settings_schema;
mod tiles;
mod tls;
mod upload;
pub mod view;
mod worker_protocol;
mod workers;

#[cfg(test)]
mod tests;

pub use events::Snapshot;
pub use layers::HostPolicy;
pub use openapi::openapi;
pub use serve::{Door, serve};
pub use tiles::DoneTiles;
pub use tls::{TlsError, TlsIdentity, TlsListener};

use self::{admission::Admission, catalogue::Kind, gate::Gate, metrics::Metrics, pictures::Pictures, problem::Failure, routes::Routes};
use crate::engine::Engine;
use axum::{Router, extract::DefaultBodyLimit, middleware};
use kiln_proto::{ids::Digest, limits};
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;

/// Chunks that may be on their way to the spool for each that the engine checks at the same time.
const SPOOLING_PER_CHECK: usize = 4;

/// What handlers share.
#[derive(Clone)]
struct App {
    engine: Arc<Engine>,
    metrics: Arc<Metrics>,
    gate: Arc<Gate>,
    /// Cancelled when the service stops: streams and long polls end.
    closing: CancellationToken,
    chunk_slots: Arc<Semaphore>,
    pictures: Arc<Pictures>,
    live: Arc<Admission>,
}

impl App {
    fn new(engine: Arc<Engine>, hosts: HostPolicy, own_worker: Option<Digest>, closing: CancellationToken) -> Self {
        let slots = engine.config().chunks.concurrent as usize * SPOOLING_PER_CHECK;
        Self {
            gate: Arc::new(Gate::new(&engine, hosts, own_worker)),
            engine,
            metrics: Arc::default(),
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
            .layer(middleware::from_fn_with_state(self.clone(), gate::pass))
            .layer(middleware::from_fn_with_state(self.clone(), layers::observe))
            .with_state(self)
    }
}

/// The whole API over `engine`, for tests and for other transports; `closing` ends streams and long polls.
pub fn router(engine: Arc<Engine>, hosts: HostPolicy, closing: CancellationToken) -> Router {
    App::new(engine, hosts, None, closing).router()
}
