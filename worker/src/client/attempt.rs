//! One lease attempt as everybody sees it who works on it: the threads that trace, the heartbeat and the courier; and the heartbeat itself.

use super::{
    ledger::Ledger,
    session::{CallError, Session},
};
use kiln_proto::{
    ids::Token,
    wire::message::{Heartbeat, HeartbeatReply, Refusal},
};
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};
use tokio::{task::JoinHandle, time::timeout};

/// The least time that a heartbeat may take before it counts as lost.
const PATIENCE: Duration = Duration::from_secs(1);

/// What an attempt has done, and whether it should go on.
#[derive(Debug)]
pub struct Attempt {
    token: Token,
    texels: AtomicU64,
    rays: AtomicU64,
    expired: AtomicBool,
    refused: AtomicBool,
}

impl Attempt {
    /// A fresh attempt.
    #[must_use]
    pub fn new(token: Token) -> Self {
        let no = || AtomicBool::new(false);
        Self { token, texels: AtomicU64::new(0), rays: AtomicU64::new(0), expired: no(), refused: no() }
    }

    /// Its fence.
    #[must_use]
    pub fn token(&self) -> Token {
        self.token
    }

    /// Counts work for the record.
    pub fn did(&self, texels: u64, rays: u64) {
        self.texels.fetch_add(texels, Ordering::Relaxed);
        self.rays.fetch_add(rays, Ordering::Relaxed);
    }

    /// Rays traced so far.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// The coordinator has given its tiles back: no more should be begun, but what is finished may still be wanted.
    pub fn expire(&self) {
        self.expired.store(true, Ordering::Relaxed);
    }

    /// The coordinator takes nothing more of it.
    pub fn refuse(&self) {
        self.refused.store(true, Ordering::Relaxed);
    }

    /// Whether nothing more of it is taken.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.refused.load(Ordering::Relaxed)
    }

    /// Whether no more tiles should be begun, and nobody waits to hear of its end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.expired.load(Ordering::Relaxed) || self.is_refused()
    }
}

/// The heartbeat of an attempt; it ends with its owner.
#[derive(Debug)]
pub struct Heart(JoinHandle<()>);

impl Heart {
    /// Beats until dropped, or until the coordinator says that the attempt is over.
    #[must_use]
    pub fn start(session: Arc<Session>, attempt: Arc<Attempt>, ledger: Ledger) -> Self {
        Self(tokio::spawn(beat(session, attempt, ledger)))
    }
}

impl Drop for Heart {
    fn drop(&mut self) {
        self.0.abort();
    }
}

async fn beat(session: Arc<Session>, attempt: Arc<Attempt>, ledger: Ledger) {
    let token = attempt.token;
    let every = Duration::from_millis(session.welcome().heartbeat_ms.max(10));
    loop {
        tokio::time::sleep(every).await;
        let beat = Heartbeat { texels_done: attempt.texels.load(Ordering::Relaxed), rays: attempt.rays() };
        // Waiting longer for one than until the next would hide that the attempt may be running out.
        match timeout(every.max(PATIENCE), session.heartbeat(token, beat)).await {
            Ok(Ok(HeartbeatReply::Continue)) => ledger.alive(token),
            Ok(Ok(HeartbeatReply::Cancel) | Err(CallError::Refused(Refusal::Gone { .. }))) => {
                tracing::info!(%token, "the attempt has run out or its job is over; no more of its tiles are begun");
                attempt.expire();
                ledger.doubtful(token);
                return;
            }
            // The attempt goes on: a coordinator that comes back in time has not missed it, and a later one takes what is finished.
            Ok(Err(error)) => {
                tracing::debug!(%token, error = &error as &dyn std::error::Error, "a heartbeat was lost");
                ledger.doubtful(token);
            }
            Err(_) => ledger.doubtful(token),
        }
    }
}
