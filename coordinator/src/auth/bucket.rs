//! Token buckets: how often something may happen, per key. In memory, because losing them with a restart costs nothing.

use crate::records::UnixMillis;
use std::{collections::HashMap, hash::Hash};

/// Keys remembered at most. Whoever is forgotten begins with a full bucket.
const KEYS: usize = 10_000;

/// How fast a bucket fills, and how much it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// Drops per second.
    pub per_s: f64,
    /// Drops when full.
    pub burst: f64,
}

impl Rate {
    /// A level after so many milliseconds. A clock that was set back fills nothing and takes nothing.
    fn filled(self, level: f64, ms: i64) -> f64 {
        (level + ms.max(0) as f64 / 1e3 * self.per_s).min(self.burst)
    }
}

/// A bucket for each key.
#[derive(Debug)]
pub struct Buckets<K> {
    rate: Rate,
    levels: HashMap<K, (f64, UnixMillis)>,
}

impl<K: Eq + Hash> Buckets<K> {
    /// Full buckets.
    #[must_use]
    pub fn new(rate: Rate) -> Self {
        Self { rate, levels: HashMap::new() }
    }

    /// Takes a drop.
    ///
    /// # Errors
    /// An empty bucket: seconds until there is a drop again, at least 1.
    pub fn take(&mut self, key: K, now: UnixMillis) -> Result<(), u64> {
        self.look(&key, now)?;
        let level = self.level(&key, now);
        self.make_room(now);
        self.levels.insert(key, (level - 1.0, now));
        Ok(())
    }

    /// Whether there is a drop, without taking it.
    ///
    /// # Errors
    /// As [`Buckets::take`].
    pub fn look(&self, key: &K, now: UnixMillis) -> Result<(), u64> {
        let level = self.level(key, now);
        if level < 1.0 { Err(((1.0 - level) / self.rate.per_s).ceil().max(1.0) as u64) } else { Ok(()) }
    }

    fn level(&self, key: &K, now: UnixMillis) -> f64 {
        self.levels.get(key).map_or(self.rate.burst, |(level, at)| self.rate.filled(*level, now.saturating_sub(*at)))
    }

    /// Forgets full buckets, which are as good as new ones; where all are in use, all.
    fn make_room(&mut self, now: UnixMillis) {
        if self.levels.len() < KEYS {
            return;
        }
        let rate = self.rate;
        self.levels.retain(|_, (level, at)| rate.filled(*level, now.saturating_sub(*at)) < rate.burst);
        if self.levels.len() >= KEYS {
            self.levels.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_then_the_rate() {
        let mut buckets = Buckets::new(Rate { per_s: 2.0, burst: 3.0 });
        for _ in 0..3 {
            assert_eq!(buckets.take("a", 0), Ok(()));
        }
        assert_eq!((buckets.take("a", 0), buckets.look(&"a", 499)), (Err(1), Err(1)));
        assert_eq!(buckets.take("b", 0), Ok(()), "each key has its own");
        assert_eq!((buckets.take("a", 500), buckets.take("a", 500)), (Ok(()), Err(1)));
        for _ in 0..3 {
            assert_eq!(buckets.take("a", 1_000_000), Ok(()));
        }
        assert!(buckets.take("a", 1_000_000).is_err(), "a bucket holds no more than a burst");
    }

    #[test]
    fn a_slow_rate_says_how_long_to_wait_and_a_clock_set_back_does_no_harm() {
        let mut buckets = Buckets::new(Rate { per_s: 0.1, burst: 1.0 });
        assert_eq!((buckets.take((), 1_000), buckets.take((), 1_000)), (Ok(()), Err(10)));
        assert_eq!(buckets.take((), -50_000), Err(10));
    }

    #[test]
    fn the_number_of_keys_is_bounded() {
        let mut buckets = Buckets::new(Rate { per_s: 1.0, burst: 5.0 });
        for key in 0..3 * KEYS {
            buckets.take(key, 0).unwrap();
            assert!(buckets.levels.len() <= KEYS);
        }
    }
}
