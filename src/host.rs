//! A coordinator in this process with worker processes beside it: what `serve` and `bake` have in common.

use crate::{children::Children, error::CommandError};
use kiln_coordinator::{config::Config, engine::Engine, http};
use std::{net::SocketAddr, sync::Arc, time::Duration};
use tokio::{net::TcpListener, task::JoinHandle};
use tokio_util::sync::CancellationToken;

/// How often the server is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A running coordinator.
pub struct Host {
    engine: Arc<Engine>,
    server: JoinHandle<std::io::Result<()>>,
    children: Children,
    stop: CancellationToken,
    address: SocketAddr,
}

impl Host {
    /// Opens the data folder, binds the address and starts the workers that the configuration asks for.
    pub async fn start(config: Config) -> Result<Self, CommandError> {
        // Bound first: a port in use is told before a data folder is touched.
        let listener = TcpListener::bind(config.listen).await.map_err(|e| bind_error(config.listen, &e))?;
        let address = listener.local_addr().map_err(|e| CommandError::from_error("cannot tell the address", &e))?;
        let (workers, threads) = (config.workers, config.worker_threads);
        let engine = Engine::open(config).await.map_err(|e| CommandError::from_error("cannot start the coordinator", &e))?;
        let stop = CancellationToken::new();
        let server = tokio::spawn(http::serve(listener, engine.clone(), stop.clone()));
        let children = Children::start(&format!("http://{address}"), workers, threads)?;
        Ok(Self { engine, server, children, stop, address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its address as a URL.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Resolves when the server has ended although nobody asked it to.
    pub async fn ended(&self) {
        // What it ended with is reported by `stop`, which awaits the same handle.
        while !self.server.is_finished() {
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Drains the workers, answers what is under way, and stops.
    pub async fn stop(self) -> Result<(), CommandError> {
        self.children.stop().await;
        self.stop.cancel();
        let served = self.server.await;
        self.engine.shut_down().await;
        match served {
            Ok(Ok(())) => Ok(()),
            Ok(Err(e)) => Err(CommandError::from_error("the server stopped", &e)),
            Err(e) => Err(CommandError::from_error("the server stopped", &e)),
        }
    }
}

/// Why an address cannot be listened on, and what to do.
pub fn bind_error(address: SocketAddr, error: &std::io::Error) -> CommandError {
    let hint = match error.kind() {
        std::io::ErrorKind::AddrInUse => "another program listens there; choose another with --listen",
        std::io::ErrorKind::PermissionDenied => "ports below 1024 need privileges; choose another with --listen",
        std::io::ErrorKind::AddrNotAvailable => "this machine has no such address",
        _ => "choose another with --listen",
    };
    CommandError::work(format!("cannot listen on {address}: {error}; {hint}"))
}

/// Resolves when the user or the system asks the process to stop.
pub async fn asked_to_stop() {
    let interrupt = tokio::signal::ctrl_c();
    let Ok(mut terminate) = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) else {
        interrupt.await.ok();
        return;
    };
    tokio::select! {
        _ = interrupt => {}
        _ = terminate.recv() => {}
    }
}
