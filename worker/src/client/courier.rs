//! Brings finished work to the coordinator, one parcel after another, for as long as that takes.
//!
//! A chunk leaves the spool only with a verdict: accepted, known already, or a refusal that no waiting will change. One upload at a time: a
//! link that is slow does not get faster by sharing it, and the order keeps the end of an attempt behind its chunks. The lease of an attempt
//! may run out meanwhile; the coordinator takes its finished tiles all the same, where nobody else has done them.

use super::{
    ledger::Ledger,
    outbox::{Content, End, Outbox, Parcel},
    session::{CallError, Session},
    spool::{Spool, Spooled},
};
use bytes::Bytes;
use kiln_proto::{
    ids::Token,
    wire::message::{ChunkVerdict, Refusal, Verdict},
};
use std::sync::Arc;
use tokio::sync::mpsc;

/// Carries parcels.
pub struct Courier {
    session: Arc<Session>,
    spool: Option<Arc<Spool>>,
    ledger: Ledger,
    parcels: mpsc::UnboundedReceiver<Parcel>,
}

impl Courier {
    /// A courier and the way in. What earlier workers left is carried first.
    #[must_use]
    pub fn new(session: Arc<Session>, spool: Option<Spool>, inherited: Vec<Spooled>) -> (Self, Outbox, Ledger) {
        let (sender, parcels) = mpsc::unbounded_channel();
        let ledger = Ledger::new(inherited.len());
        for content in inherited.into_iter().map(Content::Spooled) {
            // The receiver is right here.
            sender.send(Parcel::Chunk { owner: None, content }).ok();
        }
        let spool = spool.map(Arc::new);
        let outbox = Outbox::new(spool.clone(), sender);
        (Self { session, spool, ledger: ledger.clone(), parcels }, outbox, ledger)
    }

    /// Delivers until the outbox is gone and everything is told.
    ///
    /// # Errors
    /// [`CallError::Stopped`] with the session, and errors that no waiting will change. What is spooled stays there in both cases.
    pub async fn run(mut self) -> Result<(), CallError> {
        while let Some(parcel) = self.parcels.recv().await {
            match parcel {
                Parcel::Chunk { owner, content } => {
                    let inherited = owner.is_none();
                    let refused = owner.as_ref().is_some_and(|owner| owner.is_refused());
                    let token = owner.as_ref().map(|owner| owner.token());
                    let taken = self.chunk(token, content, refused).await?;
                    match owner {
                        Some(owner) if !taken => owner.refuse(),
                        _ if inherited => self.ledger.settled_inherited(),
                        _ => {}
                    }
                }
                Parcel::End(end) => self.end(*end).await?,
            }
        }
        Ok(())
    }

    /// Whether the coordinator takes more of this attempt.
    async fn chunk(&self, token: Option<Token>, content: Content, refused: bool) -> Result<bool, CallError> {
        match content {
            Content::Spooled(spooled) => {
                let taken = if refused { false } else { self.spooled(&spooled).await? };
                if let Some(spool) = &self.spool {
                    spool.remove(&spooled);
                }
                Ok(taken)
            }
            Content::Held { number, bytes, delivered } => {
                let taken = match token {
                    Some(token) if !refused => self.deliver(token, number, bytes).await?,
                    _ => false,
                };
                // Whoever waited may have left.
                delivered.send(()).ok();
                Ok(taken)
            }
        }
    }

    async fn spooled(&self, spooled: &Spooled) -> Result<bool, CallError> {
        let Some(spool) = self.spool.clone() else { return Ok(false) };
        let chunk = spooled.clone();
        let loaded = tokio::task::spawn_blocking(move || spool.load(&chunk)).await;
        match loaded {
            Ok(Ok(bytes)) => self.deliver(spooled.token, spooled.number, bytes).await,
            Ok(Err(error)) => {
                let reason = &error as &(dyn std::error::Error + 'static);
                tracing::error!(token = %spooled.token, reason, "a finished chunk is lost; its tiles are baked again");
                // The attempt goes on: the tiles that are missing at its end go back to the coordinator.
                Ok(true)
            }
            Err(interrupted) => {
                tracing::error!(token = %spooled.token, %interrupted, "a finished chunk is lost; its tiles are baked again");
                Ok(true)
            }
        }
    }

    async fn deliver(&self, token: Token, number: u32, bytes: Bytes) -> Result<bool, CallError> {
        let size = bytes.len();
        match self.session.chunk(token, number, bytes).await {
            Ok(verdict) => {
                report(token, number, size, &verdict);
                Ok(true)
            }
            Err(CallError::Refused(Refusal::Gone { state })) => {
                tracing::info!(%token, number, state, "a finished chunk came too late and is dropped");
                Ok(false)
            }
            Err(CallError::Refused(Refusal::Invalid { reason })) => {
                tracing::error!(%token, number, reason, "the coordinator finds a chunk wrong; it is dropped");
                Ok(false)
            }
            Err(other) => Err(other),
        }
    }

    async fn end(&self, end: End) -> Result<(), CallError> {
        let End { attempt, finish, whole, _heart: heart } = end;
        let token = attempt.token();
        let told = match (attempt.is_over(), whole) {
            (true, _) => Ok(()),
            (false, true) => self.session.complete(token, finish).await,
            (false, false) => self.session.release(token, finish).await,
        };
        drop(heart);
        self.ledger.close(token);
        match told {
            Ok(()) => Ok(()),
            // It has ended without us: expired, or its job is over.
            Err(CallError::Refused(refusal)) => {
                tracing::info!(%token, %refusal, "the end of the attempt was not taken");
                Ok(())
            }
            Err(other) => Err(other),
        }
    }
}

fn report(token: Token, number: u32, size: usize, verdict: &ChunkVerdict) {
    let of = |wanted: Verdict| verdict.tiles.iter().filter(|(_, v)| *v == wanted).count();
    let (accepted, duplicates, conflicts) = (of(Verdict::Accepted), of(Verdict::Duplicate), of(Verdict::Conflict));
    if conflicts > 0 {
        tracing::warn!(%token, number, conflicts, "another worker baked other bytes for the same tiles; one of the machines is not sound");
    }
    tracing::debug!(%token, number, size, accepted, duplicates, "chunk taken");
}
