//! `kiln work`: a worker.

use crate::{
    access_args::{self, AccessArgs},
    error::CommandError,
};
use clap::{Args, ValueEnum};
use kiln_proto::chain;
use kiln_worker::{
    config::{SpoolConfig, TileOrder, WorkerConfig},
    simd::Simd,
};
use std::{path::PathBuf, time::Duration};
use tokio::{
    io::AsyncReadExt,
    signal::unix::{SignalKind, signal},
};
use tokio_util::sync::CancellationToken;

/// Bake tiles for a coordinator; scale by starting more
#[derive(Debug, Args)]
pub struct WorkArgs {
    /// The coordinator's address
    #[arg(long, value_name = "URL", env = "KILN_SERVER")]
    join: String,
    #[command(flatten)]
    access: AccessArgs,
    /// Threads to trace with; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// What to call this worker [default: host name and process id]
    #[arg(long)]
    name: Option<String>,
    /// Seconds that a worker told to stop may take to finish its tile and deliver it; told twice, it ends at once
    #[arg(long, value_name = "SECONDS", default_value_t = 25)]
    drain_timeout: u64,
    /// Folder where finished work waits while the coordinator is away; workers may share it [default: kiln/spool in the user's cache folder]
    #[arg(long, value_name = "DIR", env = "KILN_SPOOL")]
    spool: Option<PathBuf>,
    /// Bytes of finished work that may wait there, beyond which baking waits too; 0 for no spool
    #[arg(long, value_name = "BYTES", default_value_t = 2 << 30)]
    spool_bytes: u64,
    /// Vector instructions to use; results are the same
    #[arg(long, value_enum, default_value = "auto", env = "KILN_SIMD")]
    simd: SimdArg,
    /// Order of the tiles of a lease; results are the same
    #[arg(long, value_enum, default_value = "forward")]
    tile_order: OrderArg,
    /// Drain when standard input closes: how a parent process keeps its workers from outliving it
    #[arg(long, hide = true)]
    until_stdin_closes: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SimdArg {
    /// The best that this processor has.
    Auto,
    /// None beyond the baseline.
    Portable,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum OrderArg {
    Forward,
    Reverse,
}

/// Works until told to stop.
pub async fn run(args: &WorkArgs) -> Result<(), CommandError> {
    let stop = CancellationToken::new();
    tokio::spawn(heed_signals(stop.clone()));
    if args.until_stdin_closes {
        let by_parent = stop.clone();
        tokio::spawn(async move {
            let mut sink = [0; 64];
            let mut input = tokio::io::stdin();
            while input.read(&mut sink).await.is_ok_and(|n| n > 0) {}
            by_parent.cancel();
        });
    }
    let server = access_args::address(&args.join);
    let config = WorkerConfig {
        access: args.access.to(&server),
        server,
        name: args.name.clone().unwrap_or_else(default_name),
        threads: if args.threads == 0 { cores() } else { args.threads },
        simd: match args.simd {
            SimdArg::Auto => Simd::Auto,
            SimdArg::Portable => Simd::Portable,
        },
        order: match args.tile_order {
            OrderArg::Forward => TileOrder::Forward,
            OrderArg::Reverse => TileOrder::Reverse,
        },
        drain_timeout: Duration::from_secs(args.drain_timeout),
        spool: Some(SpoolConfig { folder: args.spool.clone().unwrap_or_else(default_spool), bytes: args.spool_bytes }),
    };
    kiln_worker::run::run(config, stop).await.map_err(|error| {
        let advice = error.advice();
        let separator = if advice.is_empty() { "" } else { "; " };
        CommandError::work(format!("{}{separator}{advice}", chain(&error)))
    })
}

/// The first signal asks for a drain, the second for an end.
async fn heed_signals(stop: CancellationToken) {
    let (mut interrupt, mut terminate) = match (signal(SignalKind::interrupt()), signal(SignalKind::terminate())) {
        (Ok(interrupt), Ok(terminate)) => (interrupt, terminate),
        (Err(error), _) | (_, Err(error)) => {
            tracing::warn!(%error, "signals cannot be caught; one ends this worker at once");
            return;
        }
    };
    let mut next = async || {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    };
    next().await;
    stop.cancel();
    next().await;
    eprintln!("told to stop twice: leaving at once; finished work in the spool waits for the next worker");
    // Nothing needs an orderly end: files are whole or not there, and the system takes the spool's lock back.
    std::process::exit(1);
}

/// Where finished work waits unless told otherwise: what is left there after a crash should survive a reboot, and nobody else should read it.
fn default_spool() -> PathBuf {
    let folder = |name| std::env::var_os(name).map(PathBuf::from).filter(|path: &PathBuf| path.is_absolute());
    let cache = folder("XDG_CACHE_HOME").or_else(|| folder("HOME").filter(|home| home.is_dir()).map(|home| home.join(".cache")));
    match cache {
        Some(cache) => cache.join("kiln/spool"),
        None => std::env::temp_dir().join(format!("kiln-spool-{}", rustix::process::geteuid().as_raw())),
    }
}

/// Cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn default_name() -> String {
    let host = rustix::system::uname().nodename().to_string_lossy().into_owned();
    format!("{host}-{}", std::process::id())
}
