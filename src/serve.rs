//! `kiln serve`: the service.

use crate::{
    error::CommandError,
    host::{Host, asked_to_stop},
    token::duration,
};
use clap::Args;
use kiln_coordinator::{blob::Location, config::Config};
use kiln_proto::chain;
use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
    time::Duration,
};

/// Run the coordinator, with workers of its own unless told otherwise
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Address to listen on; one that other machines reach needs access tokens (`kiln token`) [default: 127.0.0.1:8080]
    #[arg(long, env = "KILN_LISTEN")]
    listen: Option<SocketAddr>,
    /// Folder for state, blobs and packages [default: kiln-data]
    #[arg(long, env = "KILN_DATA")]
    data: Option<PathBuf>,
    /// Database of state: postgres://USER:PASSWORD@HOST/DATABASE, which several coordinators may share [default: SQLite in the data folder]
    #[arg(long, value_name = "URL", env = "KILN_STORE", hide_env_values = true)]
    store: Option<String>,
    /// Where blobs live: s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX or file:///FOLDER, with credentials and endpoint in
    /// the environment [default: in the data folder]
    #[arg(long, value_name = "URL", env = "KILN_BLOBS")]
    blobs: Option<String>,
    /// Worker processes to start beside the coordinator; 0 leaves the work to `kiln work` [default: 1]
    #[arg(long, value_name = "N")]
    workers: Option<u32>,
    /// Threads of each worker; 0 for all cores [default: 0]
    #[arg(long, value_name = "N")]
    threads: Option<u32>,
    /// The share of tiles that two workers bake, so that their bytes can be compared, in [0, 1]; a job may ask for another [default: 0]
    #[arg(long, value_name = "SHARE", value_parser = crate::submit::share)]
    verify: Option<f64>,
    /// Leases that the jobs of one token hold at a time, at most; without tokens, each job [default: no bound]
    #[arg(long, value_name = "N")]
    leases_per_token: Option<u64>,
    /// A configuration file; flags override it
    #[arg(long, value_name = "FILE.toml", env = "KILN_CONFIG")]
    config: Option<PathBuf>,
    /// The service's certificate with its chain (PEM): it speaks TLS
    #[arg(long, value_name = "FILE", env = "KILN_TLS_CERT", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The key of the certificate (PEM)
    #[arg(long, value_name = "FILE", env = "KILN_TLS_KEY", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Delete jobs that ended this long ago, such as 30d, with everything they hold, and uploads that no job uses [default: never]
    #[arg(long, value_name = "TIME", value_parser = duration)]
    keep: Option<Duration>,
    /// Where webhooks of jobs may go; may be repeated. Without a port, the scheme's own [default: nowhere]
    #[arg(long, value_name = "HOST[:PORT]")]
    webhook_allow: Vec<String>,
    /// A file with the secret that webhooks are signed with: `whsec_` and 24 to 64 bytes in base64
    #[arg(long, value_name = "FILE")]
    webhook_secret_file: Option<PathBuf>,
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
        config.verify = self.verify.unwrap_or(config.verify);
        config.lease.per_token = self.leases_per_token.or(config.lease.per_token);
        if let Some(data) = &self.data {
            config.data_dir.clone_from(data);
        }
        if self.store.is_some() {
            config.store.clone_from(&self.store);
        }
        if let Some(blobs) = &self.blobs {
            let place: Result<Location, _> = blobs.parse();
            config.blobs = Some(place.map_err(|e| CommandError::usage(format!("--blobs: {e}")))?.to_string());
        }
        if self.tls_cert.is_some() {
            config.access.tls_cert.clone_from(&self.tls_cert);
            config.access.tls_key.clone_from(&self.tls_key);
        }
        if let Some(kept) = self.keep {
            config.keep.jobs_ms = Some(kept.as_millis() as u64);
        }
        if !self.webhook_allow.is_empty() {
            config.webhooks.allow.clone_from(&self.webhook_allow);
        }
        if self.webhook_secret_file.is_some() {
            config.webhooks.secret_file.clone_from(&self.webhook_secret_file);
        }
        let problems = config.check();
        if !problems.is_empty() {
            let list: Vec<String> = problems.iter().map(ToString::to_string).collect();
            return Err(CommandError::usage(list.join("; ")));
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
    let host = Host::start(config, args.insecure_no_auth).await?;
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
