//! What follows from a call that failed: try again, after how long, what to say meanwhile, and what a person can do about the rest.
//!
//! Nobody reads a line for every try, and nobody likes a worker that waits without a word: the reason is told once an outage has lasted a
//! few seconds, then once a minute, and its end is told as well.

use super::{backoff::Backoff, session::CallError};
use kiln_proto::{
    BAKE_VERSION,
    wire::{
        frame::{FrameError, PROTOCOL_VERSION},
        message::Refusal,
    },
};
use std::time::{Duration, Instant};

/// The longest wait that a server may ask for: a typing error in a proxy's configuration should not send a farm to sleep for a day.
const LONGEST_ASKED: Duration = Duration::from_secs(60);
/// Shorter outages are no news.
const FIRST_WORD: Duration = Duration::from_secs(3);
const NEXT_WORD: Duration = Duration::from_secs(60);

impl CallError {
    /// Whether the same call may succeed later.
    pub(crate) fn passes(&self) -> bool {
        match self {
            CallError::Transport { .. }
            | CallError::Silent { .. }
            | CallError::Damaged { .. }
            | CallError::Refused(Refusal::Busy { .. })
            | CallError::Frame(FrameError::Checksum { .. } | FrameError::Length { .. }) => true,
            CallError::Status { status, .. } => *status >= 500 || matches!(*status, 408 | 425 | 429),
            CallError::Refused(_) | CallError::Setup(_) | CallError::Frame(_) | CallError::Stopped => false,
        }
    }

    /// How long the server asked to be left alone.
    fn asked(&self) -> Option<Duration> {
        match self {
            CallError::Refused(Refusal::Busy { retry_after_ms }) => Some(Duration::from_millis(*retry_after_ms)),
            CallError::Status { retry_after, .. } => *retry_after,
            _ => None,
        }
    }

    /// What a person can do about an error that no waiting will change, as a clause; empty where that is nothing.
    #[must_use]
    pub fn advice(&self) -> String {
        let text = match self {
            CallError::Refused(Refusal::Incompatible { .. }) | CallError::Frame(FrameError::Version { .. }) => {
                return format!(
                    "this worker speaks protocol {PROTOCOL_VERSION} and bake version {BAKE_VERSION}: install the same release of kiln on both sides"
                );
            }
            CallError::Status { status: 401, .. } => {
                "the coordinator asks for a token: give this worker a valid one with the role worker, by --token or KILN_TOKEN"
            }
            CallError::Status { status: 403, .. } => {
                "the coordinator does not let this worker in: give it a token with the role worker, by --token or KILN_TOKEN"
            }
            CallError::Status { status: 413, .. } => {
                "something before the coordinator limits the size of uploads: let it pass bodies of `chunks.bytes` and one segment, or lower that setting"
            }
            CallError::Status { .. } | CallError::Frame(_) => {
                "no coordinator of kiln answers there: check the address, its path, and http against https"
            }
            _ => "",
        };
        text.to_owned()
    }
}

/// The waits and words of one series of tries.
#[derive(Debug)]
pub(crate) struct Retry {
    seed: u64,
    backoff: Backoff,
    trouble: Trouble,
}

impl Retry {
    pub(crate) fn new(seed: u64) -> Self {
        Self { seed, backoff: Backoff::new(seed), trouble: Trouble::default() }
    }

    /// A call failed: how long to wait before the next try. What the server asks for is granted, and some of the usual wait added, so that
    /// those who were sent away together do not come back together.
    pub(crate) fn after(&mut self, server: &str, error: &CallError) -> Duration {
        let wait = error.asked().unwrap_or_default().min(LONGEST_ASKED) + self.backoff.wait();
        let reason = error as &(dyn std::error::Error + 'static);
        match self.trouble.failed(Instant::now()) {
            Some(since) => {
                tracing::warn!(
                    server,
                    seconds = since.as_secs(),
                    reason,
                    "the coordinator takes no calls for now; this worker keeps trying"
                );
            }
            None => tracing::debug!(server, reason, ?wait, "trying again"),
        }
        wait
    }

    /// A call succeeded.
    pub(crate) fn succeeded(&mut self, server: &str) {
        if let Some(lasted) = self.trouble.ended(Instant::now()) {
            tracing::warn!(server, seconds = lasted.as_secs(), "the coordinator takes calls again");
        }
        self.backoff = Backoff::new(self.seed);
    }
}

/// When to speak of an outage.
#[derive(Debug, Default)]
struct Trouble {
    since: Option<Instant>,
    said: Option<Instant>,
}

impl Trouble {
    /// How long the outage has lasted, when it is time to say so.
    fn failed(&mut self, now: Instant) -> Option<Duration> {
        let lasted = now.duration_since(*self.since.get_or_insert(now));
        let due = match self.said {
            None => lasted >= FIRST_WORD,
            Some(said) => now.duration_since(said) >= NEXT_WORD,
        };
        due.then(|| {
            self.said = Some(now);
            lasted
        })
    }

    /// How long it lasted, where it was spoken of.
    fn ended(&mut self, now: Instant) -> Option<Duration> {
        let Trouble { since, said } = std::mem::take(self);
        said.and(since).map(|since| now.duration_since(since))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(status: u16, retry_after: Option<Duration>) -> CallError {
        CallError::Status { url: "u".into(), status, detail: String::new(), retry_after }
    }

    #[test]
    fn what_a_server_asks_for_is_granted_within_reason() {
        let wait = |error: &CallError| Retry::new(7).after("s", error);
        let most = Backoff::new(7).wait();
        assert_eq!(wait(&status(503, None)), most);
        assert_eq!(wait(&status(503, Some(Duration::from_secs(7)))), Duration::from_secs(7) + most);
        assert_eq!(wait(&status(429, Some(Duration::from_secs(86_400)))), LONGEST_ASKED + most);
        let busy = |retry_after_ms| CallError::Refused(Refusal::Busy { retry_after_ms });
        assert_eq!(wait(&busy(500)), Duration::from_millis(500) + most);
        assert_eq!(wait(&busy(u64::MAX)), LONGEST_ASKED + most);
    }

    #[test]
    fn what_passes_is_told_from_what_does_not() {
        assert!([408, 425, 429, 500, 502, 503, 504].iter().all(|s| status(*s, None).passes()));
        assert!(![301, 400, 401, 403, 404, 405, 413, 421].iter().any(|s| status(*s, None).passes()));
        for (code, word) in [(401, "token"), (403, "role"), (413, "size of uploads"), (404, "address"), (301, "http against https")] {
            assert!(status(code, None).advice().contains(word), "{code}");
        }
        let other = CallError::Refused(Refusal::Incompatible { protocol: 9, bake_version: 9 });
        assert!(!other.passes() && other.advice().contains("same release"));
    }

    #[test]
    fn an_outage_is_told_after_a_few_seconds_then_every_minute_and_at_its_end() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut trouble = Trouble::default();
        let said: Vec<u64> = (0..130).filter(|s| trouble.failed(at(*s)).is_some()).collect();
        assert_eq!(said, [3, 63, 123]);
        assert_eq!(trouble.ended(at(130)), Some(Duration::from_secs(130)));
        assert_eq!(trouble.failed(at(200)), None, "a new outage");
        assert_eq!(trouble.ended(at(201)), None, "too short to have been spoken of");
    }
}
