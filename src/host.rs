//! A coordinator in this process with worker processes beside it: what `serve` and `bake` have in common.

use crate::{children::Children, error::CommandError};
use kiln_coordinator::{
    auth::{self, TokenId},
    config::Config,
    engine::Engine,
    http::{self, Door, TlsIdentity},
    sandbox::Sandbox,
};
use kiln_proto::{chain, secret::Secret};
use std::{
    net::{Ipv4Addr, SocketAddr},
    path::Path,
    sync::Arc,
    time::Duration,
};
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
    tls: bool,
}

impl Host {
    /// Opens the data folder, binds the address and starts the workers that the configuration asks for. Where nothing would check who
    /// calls, only a loopback address is opened, unless `insecure`.
    pub async fn start(config: Config, insecure: bool) -> Result<Self, CommandError> {
        let identity = match (&config.access.tls_cert, &config.access.tls_key) {
            (Some(certificate), Some(key)) => {
                Some(TlsIdentity::read(certificate, key).map_err(|e| CommandError::usage(format!("cannot serve TLS: {}", chain(&e))))?)
            }
            _ => None,
        };
        // Bound first: a port in use is told before a data folder is touched.
        let listener = TcpListener::bind(config.listen).await.map_err(|e| bind_error(config.listen, &e))?;
        let address = listener.local_addr().map_err(|e| CommandError::from_error("cannot tell the address", &e))?;
        let (workers, threads, tls) = (config.workers, config.worker_threads, identity.is_some());
        let spool = config.data_dir.join("worker-spool");
        let program = std::env::current_exe().map_err(|e| CommandError::from_error("cannot find this program", &e))?;
        let sandbox = Sandbox::new(program, config.sandbox);
        let engine = Engine::open_through(config, Arc::new(sandbox)).await;
        let engine = engine.map_err(|e| CommandError::from_error("cannot start the coordinator", &e))?;
        if !address.ip().is_loopback() && !insecure {
            require_tokens(&engine, address).await?;
        }
        let mut doors = vec![Door::new(listener, identity)];
        let mut url = format!("http://{address}");
        if tls && workers > 0 {
            // The certificate is for the service's name, which this machine may not reach itself under.
            let inside = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
            let listener = TcpListener::bind(inside).await.map_err(|e| bind_error(inside, &e))?;
            let inside = listener.local_addr().map_err(|e| CommandError::from_error("cannot tell the address", &e))?;
            url = format!("http://{inside}");
            doors.push(Door::Plain(listener));
        }
        let token = own_worker_token()?;
        let stop = CancellationToken::new();
        let server = tokio::spawn({
            let (engine, token, stop) = (engine.clone(), token.clone(), stop.clone());
            async move { http::serve(doors, engine, Some(&token), stop).await }
        });
        let children = Children::start(&url, &token, workers, threads, &spool)?;
        Ok(Self { engine, server, children, stop, address, tls })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its address as a URL.
    pub fn url(&self) -> String {
        format!("{}://{}", if self.tls { "https" } else { "http" }, self.address)
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

/// Refuses an address that others reach as long as nothing checks who calls.
async fn require_tokens(engine: &Engine, address: SocketAddr) -> Result<(), CommandError> {
    let has = engine.tokens().has_tokens().await.map_err(|e| CommandError::from_error("cannot look for tokens", &e))?;
    if has || engine.config().access.require_tokens {
        return Ok(());
    }
    engine.shut_down().await;
    Err(refusal(address, &engine.config().data_dir))
}

fn refusal(address: SocketAddr, data: &Path) -> CommandError {
    CommandError::usage(format!(
        "refusing to listen on {address}: no access token was made yet, and anyone who reaches it could use it; make one with \
         `kiln token create --name NAME --role admin --data {}`, listen on 127.0.0.1, or say --insecure-no-auth",
        data.display()
    ))
}

/// What the workers present that this process starts itself: made now, known to this process alone, and never stored.
fn own_worker_token() -> Result<Secret, CommandError> {
    let failed = |e: auth::NoRandomness| CommandError::from_error("cannot make a secret for the workers", &e);
    Ok(auth::mint(TokenId::from_random(auth::random().map_err(failed)?), auth::random().map_err(failed)?))
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
