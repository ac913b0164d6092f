//! The rules that the core keeps, by name, so that the simulation can break one at a time and must notice.
//!
//! In production every rule holds: [`Rule::holds`] is a constant there and costs nothing. In test builds a thread may break one rule for
//! the length of a closure. The alternative, a set of rules as a parameter of every function, doubled the signatures of the whole core for
//! the sake of its tests.

/// A rule that the simulation can break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rule {
    /// A fenced attempt may not deliver.
    Fence,
    /// An attempt whose deadline has passed ends.
    Expiry,
    /// Heartbeats do not carry an attempt beyond its hard cap.
    HardCap,
    /// A heartbeat that comes too late is not believed.
    LateHeartbeat,
    /// An expired attempt may still deliver.
    LateDelivery,
    /// A worker that says it is done has delivered everything.
    Completeness,
    /// A release without a failure is no suspicion.
    Drain,
    /// The first valid segment of a tile wins.
    Once,
    /// What is done is not given back.
    Done,
    /// What another attempt still holds is not given back.
    TwinHolds,
    /// After an expiry or a failure a lease is cut in halves.
    Halving,
    /// Only leases of a single tile are charged.
    Singles,
    /// One worker alone quarantines nothing while others are connected.
    TwoWorkers,
    /// A twin goes to another worker.
    OtherTwin,
    /// A tile is checked by another worker than the one that baked it.
    OtherJudge,
    /// What is delivered while a job is paused counts.
    PausedCounts,
    /// A hole needs no delivery.
    Holes,
}

impl Rule {
    /// Whether the rule holds here: always, outside the simulation.
    #[cfg(not(test))]
    pub(crate) const fn holds(self) -> bool {
        true
    }

    /// Whether this thread keeps the rule.
    #[cfg(test)]
    pub(crate) fn holds(self) -> bool {
        BROKEN.get() != Some(self)
    }

    /// Runs something on this thread with the rule broken.
    #[cfg(test)]
    pub(crate) fn broken<T>(self, run: impl FnOnce() -> T) -> T {
        let before = BROKEN.replace(Some(self));
        let outcome = run();
        BROKEN.set(before);
        outcome
    }
}

#[cfg(test)]
thread_local! {
    static BROKEN: std::cell::Cell<Option<Rule>> = const { std::cell::Cell::new(None) };
}
