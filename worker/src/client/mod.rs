//! The worker's side of the protocol: a session with the coordinator, and the stream of segments that goes to it.
//!
//! The client knows nothing of light. A coordinator that is away is not an error here: calls wait and try again until the worker is told
//! to stop, because the work in hand stays good.

pub mod backoff;
pub mod session;
pub mod stream;
