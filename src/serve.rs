//! `kiln serve`: the service.

use crate::{
    error::{CommandError, chain},
    host::{Host, asked_to_stop},
};
use clap::Args;
use kiln_coordinator::config::Config;
use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
};

/// Run the coordinator, with workers of its own unless told otherwise
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Address to listen on; only loopback addresses, until access tokens exist [default: 127.0.0.1:8080]
    #[arg(long, env = "KILN_LISTEN")]
    listen: Option<SocketAddr>,
    /// Folder for state, blobs and packages [default: kiln-data]
    #[arg(long, env = "KILN_DATA")]
    data: Option<PathBuf>,
    /// Worker processes to start beside the coordinator; 0 leaves the work to `kiln work` [default: 1]
    #[arg(long, value_name = "N")]
    workers: Option<u32>,
    /// Threads of each worker; 0 for all cores [default: 0]
    #[arg(long, value_name = "N")]
    threads: Option<u32>,
    /// A configuration file; flags override it
    #[arg(long, value_name = "FILE.toml", env = "KILN_CONFIG")]
    config: Option<PathBuf>,
    /// Listen on an address that other machines reach although nothing checks who calls
    #[arg(long)]
    insecure_no_auth: bool,
}

impl ServeArgs {
    fn config(&self) -> Result<Config, CommandError> {
        let mut config = match &self.config {
            Some(path) => read_config(path)?,
            None => Config::default(),
        };
        config.listen = self.listen.unwrap_or(config.listen);
        config.workers = self.workers.unwrap_or(config.workers);
        config.worker_threads = self.threads.unwrap_or(config.worker_threads);
        if let Some(data) = &self.data {
            config.data_dir.clone_from(data);
        }
        if !config.listen.ip().is_loopback() && !self.insecure_no_auth {
            return Err(CommandError::usage(format!(
                "refusing to listen on {}: anyone who reaches it could use it; listen on 127.0.0.1, put a proxy that checks access in front, \
                 or say --insecure-no-auth",
                config.listen
            )));
        }
        Ok(config)
    }
}

/// Reads and checks a configuration file.
pub fn read_config(path: &Path) -> Result<Config, CommandError> {
    let name = path.display();
    let config = Config::read(path).map_err(|e| CommandError::usage(chain(&e)))?;
    let problems = config.check();
    if problems.is_empty() {
        return Ok(config);
    }
    let list: Vec<String> = problems.iter().map(|p| format!("\n  {p}")).collect();
    Err(CommandError::usage(format!("configuration {name}:{}", list.concat())))
}

/// Runs until asked to stop.
pub async fn run(args: &ServeArgs, json: bool) -> Result<(), CommandError> {
    let config = args.config()?;
    let data = config.data_dir.clone();
    let host = Host::start(config).await?;
    if json {
        crate::output::json(&serde_json::json!({"url": host.url(), "port": host.address().port(), "data": data}))?;
    } else {
        eprintln!("kiln serves {} from {}; stop with Ctrl-C", host.url(), data.display());
    }
    tokio::select! {
        () = asked_to_stop() => eprintln!("stopping: workers finish their tile"),
        () = host.ended() => eprintln!("the server ended by itself"),
    }
    host.stop().await
}
