//! `rule = thesis`: its pseudo-code (7.2.4), with the slope anchored at the last kept sample. One pass, O(D).
//!
//! It bounds the change of slope, not the error: slow drifts pass, and at T = 6 single samples are off by 8 to 11 levels. Comparing with
//! the slope of the sample before, the other reading of the text, drifts to 22 to 39 levels and lost.

use super::{Corner, difference};
use kiln_proto::codec::pwl::Sample;

pub(super) fn pick(x: &[Sample], threshold: i32) -> Vec<Corner> {
    let corner = |step: usize| Corner { step, rgb: x[step] };
    let slope = |i: usize| difference(x[i], x[i - 1]);
    let mut kept = vec![corner(0)];
    let mut current = slope(1);
    for i in 1..x.len() - 1 {
        let next = slope(i + 1);
        if turns(current, next, threshold) {
            kept.push(corner(i));
            current = next;
        }
    }
    kept.push(corner(x.len() - 1));
    kept
}

/// Whether the line has to have a corner between two slopes.
fn turns(current: [i32; 3], next: [i32; 3], threshold: i32) -> bool {
    let change: [i32; 3] = std::array::from_fn(|c| (next[c] - current[c]).abs());
    let sum: i32 = change.iter().sum();
    // T = 0 asks for no loss: any change is a corner, but no change is none, although 0 >= T.
    sum >= threshold.max(1) || change.iter().any(|c| *c > 0 && 2 * c >= threshold) || (0..3).any(|c| next[c] * current[c] < 0)
}
