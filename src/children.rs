//! Worker processes that this process starts, restarts when they die, and drains when it stops.
//!
//! A child learns that its parent is gone by the end of its standard input, also when the parent was killed without a word: no worker is
//! left behind. The alternative, a parent-death signal, exists on Linux alone and fires when the *thread* that forked ends.

use crate::{error::CommandError, telemetry};
use kiln_proto::secret::Secret;
use std::{
    path::{Path, PathBuf},
    process::Stdio,
    time::Duration,
};
use tokio::{
    process::{Child, Command},
    task::JoinSet,
};
use tokio_util::sync::CancellationToken;

/// How long to wait before a worker that died is started again.
const RESTART_AFTER: Duration = Duration::from_secs(1);
/// How long a worker may take to drain before it is killed.
const DRAIN: Duration = Duration::from_secs(27);

/// How every worker is started.
#[derive(Debug, Clone)]
struct Order {
    url: String,
    token: Secret,
    threads: u32,
    spool: PathBuf,
}

/// Worker processes under supervision.
pub struct Children {
    supervisors: JoinSet<()>,
    stop: CancellationToken,
}

impl Children {
    /// Starts `count` workers for the coordinator at `url`, each with `threads` threads (0: all cores). What they have finished and not
    /// delivered lies in `spool`, where the workers of a coordinator that was killed leave it to those of the next. `token` reaches them
    /// through their environment: command lines are visible to everyone on the machine.
    pub fn start(url: &str, token: &Secret, count: u32, threads: u32, spool: &Path) -> Result<Self, CommandError> {
        let order = Order { url: url.to_owned(), token: token.clone(), threads, spool: spool.to_owned() };
        let stop = CancellationToken::new();
        let mut supervisors = JoinSet::new();
        for _ in 0..count {
            let first = spawn(&order)?;
            supervisors.spawn(supervise(first, order.clone(), stop.clone()));
        }
        Ok(Self { supervisors, stop })
    }

    /// Drains all of them.
    pub async fn stop(mut self) {
        self.stop.cancel();
        while self.supervisors.join_next().await.is_some() {}
    }
}

fn spawn(order: &Order) -> Result<Child, CommandError> {
    let program = std::env::current_exe().map_err(|e| CommandError::from_error("cannot find this program to start workers", &e))?;
    let mut command = Command::new(program);
    command.args(["work", "--join", &order.url, "--until-stdin-closes", "--threads", &order.threads.to_string()]);
    command.arg("--spool").arg(&order.spool);
    command.env("KILN_TOKEN", order.token.expose()).env_remove("KILN_CA");
    command.envs(telemetry::environment().iter().map(|(name, value)| (name, value)));
    // A process group of its own: Ctrl-C reaches the parent, and the parent drains its workers.
    command.stdin(Stdio::piped()).stdout(Stdio::null()).kill_on_drop(true).process_group(0);
    command.spawn().map_err(|e| CommandError::from_error("cannot start a worker", &e))
}

async fn supervise(mut child: Child, order: Order, stop: CancellationToken) {
    loop {
        // `wait` closes an input that the child still owns, which would tell the worker to leave.
        let input = child.stdin.take();
        tokio::select! {
            ended = child.wait() => tracing::warn!(status = ?ended.ok(), "a worker ended; starting another"),
            () = stop.cancelled() => {
                // Closing its input asks the worker to drain.
                drop(input);
                if tokio::time::timeout(DRAIN, child.wait()).await.is_err() {
                    child.kill().await.ok();
                }
                return;
            }
        }
        loop {
            tokio::select! {
                () = tokio::time::sleep(RESTART_AFTER) => {}
                () = stop.cancelled() => return,
            }
            match spawn(&order) {
                Ok(next) => {
                    child = next;
                    break;
                }
                Err(error) => tracing::error!(%error, "a worker could not be started"),
            }
        }
    }
}
