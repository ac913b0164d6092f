//! Worker processes that this process starts, restarts when they die, and drains when it stops.
//!
//! A child learns that its parent is gone by the end of its standard input, also when the parent was killed without a word: no worker is
//! left behind. The alternative, a parent-death signal, exists on Linux alone and fires when the *thread* that forked ends.

use crate::error::CommandError;
use std::{process::Stdio, time::Duration};
use tokio::{
    process::{Child, Command},
    task::JoinSet,
};
use tokio_util::sync::CancellationToken;

/// How long to wait before a worker that died is started again.
const RESTART_AFTER: Duration = Duration::from_secs(1);
/// How long a worker may take to drain before it is killed.
const DRAIN: Duration = Duration::from_secs(27);

/// Worker processes under supervision.
pub struct Children {
    supervisors: JoinSet<()>,
    stop: CancellationToken,
}

impl Children {
    /// Starts `count` workers for the coordinator at `url`, each with `threads` threads (0: all cores).
    pub fn start(url: &str, count: u32, threads: u32) -> Result<Self, CommandError> {
        let stop = CancellationToken::new();
        let mut supervisors = JoinSet::new();
        for _ in 0..count {
            let first = spawn(url, threads)?;
            supervisors.spawn(supervise(first, url.to_owned(), threads, stop.clone()));
        }
        Ok(Self { supervisors, stop })
    }

    /// Drains all of them.
    pub async fn stop(mut self) {
        self.stop.cancel();
        while self.supervisors.join_next().await.is_some() {}
    }
}

fn spawn(url: &str, threads: u32) -> Result<Child, CommandError> {
    let program = std::env::current_exe().map_err(|e| CommandError::from_error("cannot find this program to start workers", &e))?;
    let mut command = Command::new(program);
    command.args(["work", "--join", url, "--until-stdin-closes", "--threads", &threads.to_string()]);
    // A process group of its own: Ctrl-C reaches the parent, and the parent drains its workers.
    command.stdin(Stdio::piped()).stdout(Stdio::null()).kill_on_drop(true).process_group(0);
    command.spawn().map_err(|e| CommandError::from_error("cannot start a worker", &e))
}

async fn supervise(mut child: Child, url: String, threads: u32, stop: CancellationToken) {
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
            match spawn(&url, threads) {
                Ok(next) => {
                    child = next;
                    break;
                }
                Err(error) => tracing::error!(%error, "a worker could not be started"),
            }
        }
    }
}
