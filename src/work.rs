//! `kiln work`: a worker.

use crate::{error::CommandError, host::asked_to_stop};
use clap::{Args, ValueEnum};
use kiln_worker::{
    config::{TileOrder, WorkerConfig},
    simd::Simd,
};
use std::time::Duration;
use tokio::io::AsyncReadExt;
use tokio_util::sync::CancellationToken;

/// Bake tiles for a coordinator; scale by starting more
#[derive(Debug, Args)]
pub struct WorkArgs {
    /// The coordinator's address
    #[arg(long, value_name = "URL", env = "KILN_SERVER")]
    join: String,
    /// Threads to trace with; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// What to call this worker [default: host name and process id]
    #[arg(long)]
    name: Option<String>,
    /// Seconds that a worker told to stop may take to finish its tile
    #[arg(long, value_name = "SECONDS", default_value_t = 25)]
    drain_timeout: u64,
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
    let by_signal = stop.clone();
    tokio::spawn(async move {
        asked_to_stop().await;
        by_signal.cancel();
    });
    if args.until_stdin_closes {
        let by_parent = stop.clone();
        tokio::spawn(async move {
            let mut sink = [0; 64];
            let mut input = tokio::io::stdin();
            while input.read(&mut sink).await.is_ok_and(|n| n > 0) {}
            by_parent.cancel();
        });
    }
    let config = WorkerConfig {
        server: if args.join.contains("://") { args.join.clone() } else { format!("http://{}", args.join) },
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
    };
    kiln_worker::run::run(config, stop).await.map_err(|e| CommandError::work(crate::error::chain(&e)))
}

/// Cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn default_name() -> String {
    let host = rustix::system::uname().nodename().to_string_lossy().into_owned();
    format!("{host}-{}", std::process::id())
}
