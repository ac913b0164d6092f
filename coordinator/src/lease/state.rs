//! The life of one lease attempt.
//!
//! ```text
//!            heartbeat, delivery, overtaken in part
//!            ┌──────┐
//!            │      ▼
//!   grant ─► Held ──complete──► Completed
//!            │  ├───release───► Released     the worker drains; the rest goes back, nothing is charged
//!            │  ├────fail─────► Released     the worker cannot bake the rest, or says it has and has not: suspicion
//!            │  ├──deadline───► Expired      the worker fell silent: suspicion; late deliveries are welcome
//!            │  └───refuse────► Fenced       it sent nonsense: suspicion
//!            └──────fence─────► Fenced       the job is gone, the worker is barred, or others have delivered everything it owes
//! ```
//! Pure: time comes in as a value, effects go out as [`Action`]s that the store applies in one transaction. A token names an attempt and
//! orders nothing. Good work is not thrown away after an outage: an expired attempt may still deliver, and the first valid segment of a
//! tile wins whoever brings it; a fenced, completed or released one may not. Whoever delivers a tile, every other attempt that owes it is
//! told ([`Event::Overtaken`]): so what an attempt owes is exact, nobody bakes on for nothing, and the loser of a pair of twins ends
//! fenced.

use super::rule::Rule;
use crate::records::UnixMillis;
use kiln_proto::tile::TileRuns;

/// Rays of one attempt that are believed. A worker may say what it likes, and the sums of a job must not overflow.
pub const RAYS: u64 = 10_000_000_000_000;

/// A lease attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Attempt {
    /// A worker bakes.
    Held {
        /// When it expires unless a heartbeat comes.
        deadline: UnixMillis,
        /// When it expires whatever comes.
        cap: UnixMillis,
        /// Its tiles that nobody has delivered.
        remaining: TileRuns,
    },
    /// Every tile was delivered.
    Completed,
    /// The worker gave the rest back, or could not bake it.
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
    /// Somebody else delivered these tiles first.
    Overtaken(TileRuns),
    /// The worker says that it is done.
    Complete,
    /// The worker gives the rest back because it leaves.
    Release,
    /// The worker cannot bake the rest.
    Fail,
    /// The clock was looked at.
    Tick,
    /// It must stop, through no fault of its tiles.
    Fence,
    /// It sent what cannot be accepted, and must stop.
    Refuse,
}

/// What follows from a transition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// These tiles wait for a worker again.
    Return(TileRuns),
    /// These tiles were left by a failure: they wait for a worker again, in smaller leases, and one of them may be to blame
    /// ([`Shard::suspect`](super::Shard::suspect)).
    Suspect(TileRuns),
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
        let nothing = vec![];
        let back = |rest: TileRuns| if rest.is_empty() { vec![] } else { vec![Action::Return(rest)] };
        let suspect = |rest: TileRuns| if rest.is_empty() { vec![] } else { vec![Action::Suspect(rest)] };
        match (self, event) {
            (Attempt::Held { deadline, cap, remaining }, Event::Tick) if is_past(deadline, cap, now) => {
                Ok((Attempt::Expired, suspect(remaining)))
            }
            // A heartbeat that comes too late is not believed, even if nobody has looked at the clock since.
            (Attempt::Held { deadline, cap, remaining }, Event::Heartbeat { .. })
                if is_past(deadline, cap, now) && Rule::LateHeartbeat.holds() =>
            {
                Ok((Attempt::Expired, suspect(remaining)))
            }
            (Attempt::Held { cap, remaining, .. }, Event::Heartbeat { ttl }) => {
                Ok((Attempt::Held { deadline: now.saturating_add(ttl), cap, remaining }, nothing))
            }
            (held @ Attempt::Held { .. }, Event::Tick) => Ok((held, nothing)),
            (Attempt::Held { deadline, cap, remaining }, Event::Deliver(tiles)) => {
                Ok((Attempt::Held { deadline, cap, remaining: remaining.minus(&tiles) }, nothing))
            }
            (Attempt::Held { deadline, cap, remaining }, Event::Overtaken(tiles)) => {
                let rest = remaining.minus(&tiles);
                let lost = rest.is_empty() && !remaining.is_empty();
                Ok((if lost { Attempt::Fenced } else { Attempt::Held { deadline, cap, remaining: rest } }, nothing))
            }
            // It owes nothing any more.
            (ended, Event::Overtaken(_)) => Ok((ended, nothing)),
            (Attempt::Expired, Event::Deliver(_)) if Rule::LateDelivery.holds() => Ok((Attempt::Expired, nothing)),
            (Attempt::Fenced, Event::Deliver(_)) if !Rule::Fence.holds() => Ok((Attempt::Fenced, nothing)),
            (Attempt::Held { remaining, .. }, Event::Complete) if remaining.is_empty() || !Rule::Completeness.holds() => {
                Ok((Attempt::Completed, nothing))
            }
            (Attempt::Held { remaining, .. }, Event::Release) if Rule::Drain.holds() => Ok((Attempt::Released, back(remaining))),
            // Whoever says that it is done and is not has failed too: without suspicion a worker could say so for ever.
            (Attempt::Held { remaining, .. }, Event::Fail | Event::Complete | Event::Release) => {
                Ok((Attempt::Released, suspect(remaining)))
            }
            (Attempt::Held { remaining, .. }, Event::Fence) => Ok((Attempt::Fenced, back(remaining))),
            (Attempt::Held { remaining, .. }, Event::Refuse) => Ok((Attempt::Fenced, suspect(remaining))),
            (Attempt::Expired, Event::Fence | Event::Refuse) => Ok((Attempt::Fenced, nothing)),
            // The answer to the first one was lost: saying it twice changes nothing.
            (Attempt::Completed, Event::Complete) => Ok((Attempt::Completed, nothing)),
            (Attempt::Released, Event::Release | Event::Fail) => Ok((Attempt::Released, nothing)),
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

fn is_past(deadline: UnixMillis, cap: UnixMillis, now: UnixMillis) -> bool {
    let due = if Rule::HardCap.holds() { deadline.min(cap) } else { deadline };
    now >= due && Rule::Expiry.holds()
}

impl Event {
    fn name(&self) -> &'static str {
        match self {
            Event::Heartbeat { .. } => "a heartbeat",
            Event::Deliver(_) => "a delivery",
            Event::Complete => "completion",
            Event::Overtaken(_) => "another's delivery",
            Event::Release => "release",
            Event::Fail => "a failure",
            Event::Tick => "the clock",
            Event::Fence => "a fence",
            Event::Refuse => "a refusal",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TTL: i64 = 30;

    fn held() -> Attempt {
        Attempt::Held { deadline: 10, cap: 100, remaining: TileRuns::all(3) }
    }

    #[test]
    fn a_late_heartbeat_is_not_believed_and_a_late_delivery_is() {
        let (expired, actions) = held().apply(Event::Heartbeat { ttl: TTL }, 10).unwrap();
        assert_eq!((&expired, actions), (&Attempt::Expired, vec![Action::Suspect(TileRuns::all(3))]));
        assert!(expired.clone().apply(Event::Deliver(TileRuns::all(1)), 11).is_ok());
        assert_eq!(expired.apply(Event::Complete, 11), Err(Illegal { event: "completion", state: "expired" }));
        let (fenced, _) = held().apply(Event::Fence, 5).unwrap();
        assert!(fenced.apply(Event::Deliver(TileRuns::all(1)), 6).is_err());
        // The hard cap ends an attempt whose heartbeats never stop.
        let (held, _) = held().apply(Event::Heartbeat { ttl: 1_000 }, 9).unwrap();
        assert_eq!(held.apply(Event::Heartbeat { ttl: 1_000 }, 100).unwrap().0, Attempt::Expired);
    }

    /// Which ends put suspicion on what is left, and which do not.
    #[test]
    fn only_failures_are_suspicious() {
        let all = || TileRuns::all(3);
        for (event, state, action) in [
            (Event::Release, Attempt::Released, Action::Return(all())),
            (Event::Fence, Attempt::Fenced, Action::Return(all())),
            (Event::Fail, Attempt::Released, Action::Suspect(all())),
            (Event::Complete, Attempt::Released, Action::Suspect(all())),
            (Event::Refuse, Attempt::Fenced, Action::Suspect(all())),
        ] {
            assert_eq!(held().apply(event.clone(), 5), Ok((state, vec![action])), "{event:?}");
        }
        let (done, _) = held().apply(Event::Deliver(all()), 5).unwrap();
        for event in [Event::Release, Event::Fail, Event::Fence, Event::Refuse, Event::Complete] {
            assert_eq!(done.clone().apply(event, 5).unwrap().1, [], "nothing is left");
        }
        assert_eq!(done.apply(Event::Complete, 5).unwrap().0, Attempt::Completed);
    }

    #[test]
    fn whoever_is_overtaken_by_all_it_owes_is_fenced() {
        let part = |start, end| Event::Overtaken(TileRuns::from_run(kiln_proto::tile::TileRun { start, end }));
        let (held, _) = held().apply(part(0, 2), 5).unwrap();
        assert!(matches!(&held, Attempt::Held { remaining, .. } if remaining.len() == 1));
        assert_eq!(held.clone().apply(part(2, 3), 5).unwrap(), (Attempt::Fenced, vec![]));
        // One that has delivered everything itself only waits to say so.
        let (done, _) = held.apply(Event::Deliver(TileRuns::all(3)), 5).unwrap();
        assert!(matches!(done.apply(part(0, 3), 5).unwrap().0, Attempt::Held { .. }));
        assert_eq!(Attempt::Expired.apply(part(0, 3), 5).unwrap().0, Attempt::Expired);
    }
}
