//! The life of one lease attempt.
//!
//! ```text
//!            heartbeat, delivery
//!            ┌──────┐
//!            │      ▼
//!   grant ─► Held ──complete──► Completed
//!            │  ├───release───► Released     the worker drains or lacks tiles; the rest goes back
//!            │  └───deadline──► Expired      the worker fell silent; the rest goes back, late deliveries are welcome
//!            └──────fence─────► Fenced       it sent nonsense, or the job is gone
//! ```
//! Pure: time comes in as a value, effects go out as [`Action`]s that the store applies in one transaction. A token names an attempt and
//! orders nothing. Good work is not thrown away after an outage: an expired attempt may still deliver, and the first valid segment of a
//! tile wins whoever brings it; a fenced, completed or released one may not.

use crate::records::UnixMillis;
use kiln_proto::tile::TileRuns;

/// A lease attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Attempt {
    /// A worker bakes.
    Held {
        /// When it expires unless a heartbeat comes.
        deadline: UnixMillis,
        /// When it expires whatever comes.
        cap: UnixMillis,
        /// Its tiles that it has not delivered.
        remaining: TileRuns,
    },
    /// Every tile was delivered.
    Completed,
    /// The worker gave the rest back.
    Released,
    /// The worker fell silent.
    Expired,
    /// It may do nothing any more.
    Fenced,
}

/// What may happen to an attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A sign of life; the deadline moves this many milliseconds ahead of now.
    Heartbeat {
        /// Milliseconds.
        ttl: i64,
    },
    /// A valid chunk with these tiles.
    Deliver(TileRuns),
    /// The worker says that it is done.
    Complete,
    /// The worker gives the rest back.
    Release,
    /// The clock was looked at.
    Tick,
    /// It must stop.
    Fence,
}

/// What follows from a transition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// These tiles, where nobody has delivered them, wait for a worker again.
    Return(TileRuns),
}

/// What a late, duplicated or forged message meets: the state it found, so that the answer can say so.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{event} does not fit an attempt that is {state}")]
pub struct Illegal {
    /// The event.
    pub event: &'static str,
    /// The state.
    pub state: &'static str,
}

impl Attempt {
    /// The state after an event, and what follows.
    ///
    /// # Errors
    /// [`Illegal`] where the diagram has no such arrow.
    pub fn apply(self, event: Event, now: UnixMillis) -> Result<(Attempt, Vec<Action>), Illegal> {
        let back = |remaining: TileRuns| if remaining.is_empty() { vec![] } else { vec![Action::Return(remaining)] };
        match (self, event) {
            // A heartbeat that comes too late is not believed, even if nobody has looked at the clock since.
            (Attempt::Held { deadline, cap, remaining }, Event::Heartbeat { .. } | Event::Tick) if now >= deadline.min(cap) => {
                Ok((Attempt::Expired, back(remaining)))
            }
            (Attempt::Held { cap, remaining, .. }, Event::Heartbeat { ttl }) => {
                Ok((Attempt::Held { deadline: now.saturating_add(ttl), cap, remaining }, vec![]))
            }
            (held @ Attempt::Held { .. }, Event::Tick) => Ok((held, vec![])),
            (Attempt::Held { deadline, cap, remaining }, Event::Deliver(tiles)) => {
                Ok((Attempt::Held { deadline, cap, remaining: remaining.minus(&tiles) }, vec![]))
            }
            (Attempt::Expired, Event::Deliver(_)) => Ok((Attempt::Expired, vec![])),
            (Attempt::Held { remaining, .. }, Event::Complete) if remaining.is_empty() => Ok((Attempt::Completed, vec![])),
            (Attempt::Held { remaining, .. }, Event::Complete | Event::Release) => Ok((Attempt::Released, back(remaining))),
            (Attempt::Held { remaining, .. }, Event::Fence) => Ok((Attempt::Fenced, back(remaining))),
            (Attempt::Expired, Event::Fence) => Ok((Attempt::Fenced, vec![])),
            // The answer to the first one was lost: saying it twice changes nothing.
            (Attempt::Completed, Event::Complete) => Ok((Attempt::Completed, vec![])),
            (Attempt::Released, Event::Release) => Ok((Attempt::Released, vec![])),
            (state, event) => Err(Illegal { event: event.name(), state: state.name() }),
        }
    }

    /// The name of the state, as stored and as told to workers.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Attempt::Held { .. } => "held",
            Attempt::Completed => "completed",
            Attempt::Released => "released",
            Attempt::Expired => "expired",
            Attempt::Fenced => "fenced",
        }
    }
}

impl Event {
    fn name(&self) -> &'static str {
        match self {
            Event::Heartbeat { .. } => "a heartbeat",
            Event::Deliver(_) => "a delivery",
            Event::Complete => "completion",
            Event::Release => "release",
            Event::Tick => "the clock",
            Event::Fence => "a fence",
        }
    }
}
