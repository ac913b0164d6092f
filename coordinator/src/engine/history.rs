//! What the farm did over the last hour, in steps of five seconds, for the dashboard.
//!
//! In memory, 30 kB, and lost with a restart: figures for looking at, not for accounting, which the store does. Rates follow from sums, so
//! sums are what is kept.

use crate::records::{ThroughputPoint, UnixMillis};
use std::collections::VecDeque;

/// One point's span, milliseconds.
pub(super) const INTERVAL: i64 = 5_000;
/// How far back it goes, milliseconds.
const KEPT: i64 = 3_600_000;

/// Points by time, without those in which nothing was noted.
#[derive(Default)]
pub(super) struct History {
    points: VecDeque<ThroughputPoint>,
}

impl History {
    /// The point of a moment, to add to. A clock that was set back adds to the youngest point until it has caught up.
    pub(super) fn at(&mut self, now: UnixMillis) -> &mut ThroughputPoint {
        let mut point = ThroughputPoint { at_ms: now - now.rem_euclid(INTERVAL), ..ThroughputPoint::default() };
        while self.points.front().is_some_and(|oldest| oldest.at_ms <= point.at_ms - KEPT) {
            self.points.pop_front();
        }
        match self.points.pop_back() {
            Some(last) if last.at_ms >= point.at_ms => point = last,
            Some(last) => self.points.push_back(last),
            None => {}
        }
        self.points.push_back(point);
        let youngest = self.points.len() - 1;
        &mut self.points[youngest]
    }

    /// The points of the last hour, oldest first.
    pub(super) fn points(&self, now: UnixMillis) -> Vec<ThroughputPoint> {
        self.points.iter().filter(|point| point.at_ms > now - KEPT).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(history: &History, now: UnixMillis) -> Vec<UnixMillis> {
        history.points(now).iter().map(|point| point.at_ms).collect()
    }

    #[test]
    fn what_happens_within_five_seconds_is_one_point() {
        let mut history = History::default();
        for now in [20_000, 24_999, 25_000, 41_000] {
            history.at(now).rays += 1;
        }
        assert_eq!(times(&history, 41_000), [20_000, 25_000, 40_000]);
        assert_eq!(history.points(41_000).iter().map(|point| point.rays).collect::<Vec<_>>(), [2, 1, 1]);
    }

    #[test]
    fn points_are_kept_for_an_hour() {
        let mut history = History::default();
        (0..2_000).for_each(|n| history.at(n * INTERVAL).tiles = 1);
        let last = 1_999 * INTERVAL;
        assert_eq!(history.points.len() as i64, KEPT / INTERVAL);
        assert_eq!(times(&history, last).first(), Some(&(last - KEPT + INTERVAL)));
        assert_eq!(times(&history, last + KEPT - 1), [last]);
        assert!(times(&history, last + KEPT).is_empty());
    }

    #[test]
    fn a_clock_that_is_set_back_keeps_the_order() {
        let mut history = History::default();
        history.at(50_000).rays = 1;
        history.at(10_000).rays += 1;
        history.at(55_000).rays = 1;
        assert_eq!(times(&history, 60_000), [50_000, 55_000]);
        assert_eq!(history.points(60_000)[0].rays, 2);
    }
}
