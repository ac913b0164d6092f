//! Where finished work is handed in. It returns as soon as a chunk is safe on disk, so that tracing goes on whatever the network does.
//!
//! Where the spool has no room, or its disk fails, the chunk stays in memory and its owner waits until it is delivered: tracing slows down
//! to the speed of delivery, and stands still while the coordinator is away, but nothing finished is thrown away. Stopping instead would
//! make a full disk an outage, and more memory instead would make it a dead worker.

use super::{
    attempt::{Attempt, Heart},
    spool::{Spool, Spooled},
};
use bytes::Bytes;
use kiln_proto::{chain, wire::message::Finish};
use std::{
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::{mpsc, oneshot};

/// How often a lack of room is spoken of: a full disk has room for a small chunk now and then, and none for the next.
const SAY_AGAIN: Duration = Duration::from_secs(600);

/// The courier has ended: nothing is taken any more.
#[derive(Debug, thiserror::Error)]
#[error("nothing is delivered any more")]
pub struct Closed;

/// What the courier carries, in the order in which it was handed in.
#[derive(Debug)]
pub(super) enum Parcel {
    /// A chunk; those of earlier workers have no owner here.
    Chunk { owner: Option<Arc<Attempt>>, content: Content },
    /// The end of an attempt, behind its last chunk.
    End(Box<End>),
}

/// Where a chunk's bytes are.
#[derive(Debug)]
pub(super) enum Content {
    Spooled(Spooled),
    /// There was no room: somebody waits for its delivery.
    Held {
        number: u32,
        bytes: Bytes,
        delivered: oneshot::Sender<()>,
    },
}

/// How an attempt ended. Its heart beats until that is told.
#[derive(Debug)]
pub(super) struct End {
    pub(super) attempt: Arc<Attempt>,
    pub(super) finish: Finish,
    pub(super) whole: bool,
    pub(super) _heart: Heart,
}

/// The way in.
#[derive(Debug)]
pub struct Outbox {
    spool: Option<Arc<Spool>>,
    parcels: mpsc::UnboundedSender<Parcel>,
    /// When a lack of room was spoken of.
    said: Mutex<Option<Instant>>,
}

impl Outbox {
    /// An outbox before a spool, or before none: then every chunk waits for its delivery.
    pub(super) fn new(spool: Option<Arc<Spool>>, parcels: mpsc::UnboundedSender<Parcel>) -> Self {
        Self { spool, parcels, said: Mutex::default() }
    }

    /// Hands in chunk `number` of an attempt; returns when it is safe.
    ///
    /// # Errors
    /// [`Closed`] when the courier has ended; a chunk that found no room on disk is lost then.
    pub async fn chunk(&self, owner: &Arc<Attempt>, number: u32, bytes: Bytes) -> Result<(), Closed> {
        let content = match self.store(owner, number, &bytes).await {
            Some(spooled) => Content::Spooled(spooled),
            None => return self.hold(owner, number, bytes).await,
        };
        // Where nobody delivers any more it is safe all the same: the next worker finds it.
        self.parcels.send(Parcel::Chunk { owner: Some(owner.clone()), content }).map_err(|_| Closed)
    }

    async fn hold(&self, owner: &Arc<Attempt>, number: u32, bytes: Bytes) -> Result<(), Closed> {
        let (delivered, wait) = oneshot::channel();
        let content = Content::Held { number, bytes, delivered };
        self.parcels.send(Parcel::Chunk { owner: Some(owner.clone()), content }).map_err(|_| Closed)?;
        wait.await.map_err(|_| Closed)
    }

    async fn store(&self, owner: &Arc<Attempt>, number: u32, bytes: &Bytes) -> Option<Spooled> {
        let spool = self.spool.clone()?;
        let (token, bytes) = (owner.token(), bytes.clone());
        let folder = spool.folder().to_owned();
        let stored = tokio::task::spawn_blocking(move || spool.store(token, number, &bytes)).await;
        let reason = match stored {
            Ok(Ok(Some(spooled))) => return Some(spooled),
            Ok(Ok(None)) => "it holds as much as --spool-bytes allows".to_owned(),
            Ok(Err(error)) => chain(&error),
            Err(interrupted) => interrupted.to_string(),
        };
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if said.is_none_or(|at| at.elapsed() >= SAY_AGAIN) {
            *said = Some(Instant::now());
            let folder = folder.display();
            tracing::warn!(%folder, reason, "the spool takes no more: tracing waits until finished chunks are delivered; nothing is lost");
        }
        None
    }

    /// Hands in the end of an attempt: `whole` where every tile was delivered, otherwise the rest goes back.
    ///
    /// # Errors
    /// [`Closed`] when the courier has ended.
    pub fn end(&self, attempt: Arc<Attempt>, finish: Finish, whole: bool, heart: Heart) -> Result<(), Closed> {
        self.parcels.send(Parcel::End(Box::new(End { attempt, finish, whole, _heart: heart }))).map_err(|_| Closed)
    }
}
