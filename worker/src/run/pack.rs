//! Segments into chunks, by size or age, and chunks into the outbox.

use crate::client::{
    attempt::Attempt,
    outbox::Outbox,
    stream::{Chunk, Packed},
};
use kiln_proto::{chain, wire::message::Welcome};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

/// Hands in segments as they come, until the tracer is done or given up; then what there is.
pub(super) async fn pack(
    outbox: &Outbox,
    welcome: &Welcome,
    attempt: &Arc<Attempt>,
    segments: &mut mpsc::Receiver<Packed>,
    give_up: &CancellationToken,
) -> Result<(), String> {
    let age = Duration::from_millis(welcome.chunk_ms);
    let mut open = Open { outbox, attempt, chunk: Chunk::default(), number: 0, limit: welcome.chunk_bytes };
    loop {
        let due = open.chunk.since().map(|since| tokio::time::Instant::from_std(since + age));
        let next = tokio::select! {
            next = segments.recv() => next,
            () = async { tokio::time::sleep_until(due.unwrap_or_else(tokio::time::Instant::now)).await }, if due.is_some() => {
                open.close().await?;
                continue;
            }
            () = give_up.cancelled() => None,
        };
        match next {
            Some(segment) => open.push(&segment).await?,
            None => break,
        }
    }
    // Finished before the tracer was given up.
    while let Ok(segment) = segments.try_recv() {
        open.push(&segment).await?;
    }
    open.close().await
}

/// The chunk that is being filled.
struct Open<'a> {
    outbox: &'a Outbox,
    attempt: &'a Arc<Attempt>,
    chunk: Chunk,
    number: u32,
    limit: u64,
}

impl Open<'_> {
    async fn push(&mut self, segment: &Packed) -> Result<(), String> {
        self.chunk.push(segment, Instant::now());
        if self.chunk.is_full(self.limit) { self.close().await } else { Ok(()) }
    }

    async fn close(&mut self) -> Result<(), String> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let (bytes, tiles) = self.chunk.close().map_err(|e| chain(&e))?;
        tracing::debug!(token = %self.attempt.token(), number = self.number, tiles, size = bytes.len(), "chunk closed");
        self.outbox.chunk(self.attempt, self.number, bytes).await.map_err(|e| chain(&e))?;
        self.number += 1;
        Ok(())
    }
}
