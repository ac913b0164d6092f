//! When to give a picture up: nobody wants it any more, or it has taken too long.
//!
//! Asked between rows of rays and between reads of texels: often enough that a stop is felt at once, and seldom enough to cost nothing. A
//! thread cannot be ended from outside, and one that runs on holds up whoever waits for it, such as the end of the service. The hierarchy
//! is the one step that is not interrupted.

use std::time::Instant;
use tokio_util::sync::CancellationToken;

/// When to give up; by default, never.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    unwanted: CancellationToken,
    until: Option<Instant>,
}

/// Why a picture was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Stopped {
    /// Nobody waits for it, or the service stops.
    #[error("the picture is not wanted any more")]
    Unwanted,
    /// Its time was over.
    #[error("the picture takes too long")]
    Late,
}

impl Stop {
    /// When `unwanted` is cancelled or `until` has come, whichever is first.
    #[must_use]
    pub fn new(unwanted: CancellationToken, until: Instant) -> Self {
        Self { unwanted, until: Some(until) }
    }

    /// Whether to go on. Once it is not, it stays so.
    pub(super) fn check(&self) -> Result<(), Stopped> {
        if self.unwanted.is_cancelled() {
            Err(Stopped::Unwanted)
        } else if self.until.is_some_and(|until| Instant::now() >= until) {
            Err(Stopped::Late)
        } else {
            Ok(())
        }
    }
}
