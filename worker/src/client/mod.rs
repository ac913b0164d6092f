//! The worker's side of the protocol: a session with the coordinator, and the way of finished segments to it.
//!
//! ```text
//! segments ─► stream (chunks) ─► outbox ─► spool (files) ─► courier ─► session ─► coordinator
//! ```
//! The client knows nothing of light. A coordinator that is away is not an error here: finished chunks wait on disk and calls are tried
//! again until the worker is told to stop, because the work in hand stays good.

pub mod address;
mod answer;
pub mod attempt;
pub mod backoff;
pub mod courier;
pub mod ledger;
pub mod outbox;
pub mod retry;
pub mod session;
pub mod spool;
pub mod stream;
pub mod transport;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
