//! `rule = cumulative`: the longest segment between two data samples for which every skipped sample has a summed error below T, which is
//! what the thesis's chapter 8 reports (averages under 2 at T = 6, under 3 at T = 9).
//!
//! The longest, not the first that fails to grow: a segment may fail at one length and pass at a greater one. Trying all lengths would be
//! O(D^3); the cone of slopes that no channel may leave rules out most lengths, and those left are tried from the longest down. T = 0
//! allows no error at all, as in the thesis's own rule: "below 0" would keep every sample and compress nothing.

use super::{Corner, cone::Cone, difference};
use kiln_proto::codec::pwl::{Sample, between};

pub(super) fn pick(x: &[Sample], threshold: i32) -> Vec<Corner> {
    // Whole errors: a sum below T is a sum of at most T - 1.
    let most = threshold.max(1) - 1;
    let mut kept = vec![Corner { step: 0, rgb: x[0] }];
    let mut step = 0;
    let mut candidates = Vec::with_capacity(x.len());
    while step + 1 < x.len() {
        candidates_from(x, step, most, &mut candidates);
        step = candidates.iter().rev().copied().find(|end| holds(x, step, *end, most)).unwrap_or(step + 1);
        kept.push(Corner { step, rgb: x[step] });
    }
    kept
}

/// The ends whose slopes no skipped sample rules out by one channel alone, ascending.
fn candidates_from(x: &[Sample], from: usize, most: i32, out: &mut Vec<usize>) {
    out.clear();
    let mut cones = [Cone::OPEN; 3];
    for step in from + 1..x.len() {
        let rise = difference(x[step], x[from]);
        let within = |c: usize| {
            let (first, last) = cones[c].rises(step - from);
            (first..=last).contains(&rise[c])
        };
        if (0..3).all(within) {
            out.push(step);
        }
        for c in 0..3 {
            cones[c].narrow(step - from, rise[c], most);
        }
        if cones.iter().any(Cone::is_empty) {
            break;
        }
    }
}

fn holds(x: &[Sample], from: usize, to: usize, most: i32) -> bool {
    let error = |t: usize| difference(between(x[from], x[to], t, to - from), x[from + t]).iter().map(|e| e.abs()).sum::<i32>();
    (1..to - from).all(|t| error(t) <= most)
}
