//! `kiln view`: a package in a browser, without a farm.

use crate::{
    error::CommandError,
    host::{asked_to_stop, bind_error},
    output, viewer,
};
use clap::Args;
use kiln_coordinator::http::view::{self, ViewedPackage};
use kiln_proto::chain;
use std::{net::SocketAddr, path::PathBuf};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// Show a package in a browser
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// A package, or a folder made with --with-viewer
    package: PathBuf,
    /// Address to listen on, a loopback address; port 0 is any free port
    #[arg(long, default_value = "127.0.0.1:0")]
    listen: SocketAddr,
}

/// Serves until asked to stop.
pub async fn run(args: &ViewArgs, json: bool) -> Result<(), CommandError> {
    viewer::require()?;
    if !args.listen.ip().is_loopback() {
        return Err(CommandError::usage(format!(
            "refusing to listen on {}, which is no loopback address: `view` shows a package on this machine only; for others, put the folder of `kiln fetch --with-viewer` on \
             a web server",
            args.listen
        )));
    }
    let package = ViewedPackage::open(&args.package).map_err(|e| CommandError::work(chain(&e)))?;
    let listener = TcpListener::bind(args.listen).await.map_err(|e| bind_error(args.listen, &e))?;
    let address = listener.local_addr().map_err(|e| CommandError::from_error("cannot tell the address", &e))?;
    let url = format!("http://{address}/");
    if json {
        output::json(&serde_json::json!({ "url": url }))?;
    } else {
        output::line(&url)?;
    }
    let stop = CancellationToken::new();
    let _stop = stop.clone().drop_guard();
    tokio::select! {
        () = asked_to_stop() => Ok(()),
        served = view::serve(listener, package, stop) => served.map_err(|e| CommandError::from_error("the server stopped", &e)),
    }
}
