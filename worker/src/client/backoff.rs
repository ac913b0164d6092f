//! How long to wait before trying again: doubling from 50 ms to 5 s, each wait drawn evenly from its upper half, so that a hundred workers
//! that lost the same coordinator do not come back in step.

use std::time::Duration;

const FIRST: Duration = Duration::from_millis(50);
const LAST: Duration = Duration::from_secs(5);

/// The waits of one series of attempts.
#[derive(Debug, Clone)]
pub struct Backoff {
    next: Duration,
    random: u64,
}

impl Backoff {
    /// A fresh series; `seed` tells workers apart.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { next: FIRST, random: seed | 1 }
    }

    /// The next wait.
    pub fn wait(&mut self) -> Duration {
        // xorshift64: timing alone depends on it.
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        let half = self.next / 2;
        let wait = half + half.mul_f64((self.random >> 11) as f64 / (1u64 << 53) as f64);
        self.next = (self.next * 2).min(LAST);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_a_bound_and_differ_between_workers() {
        let series = |seed| {
            let mut b = Backoff::new(seed);
            (0..20).map(|_| b.wait()).collect::<Vec<_>>()
        };
        let waits = series(1);
        assert!(waits[0] <= FIRST && waits[0] >= FIRST / 2);
        assert!(waits[10..].iter().all(|w| *w <= LAST && *w >= LAST / 2));
        assert_ne!(waits, series(0x9e37_79b9));
    }
}
