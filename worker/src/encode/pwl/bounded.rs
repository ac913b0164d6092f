//! `rule = bounded`: a swing filter (Elmeleegy et al. 2009) with whole-numbered corners. No decoded sample and channel differs from its
//! original by more than eps.
//!
//! From each corner the cone of admissible slopes is narrowed sample by sample; the segment ends at the last step where a whole value
//! within eps of the data lies in the cone of all samples before it. Corners need not be data, which lets segments reach further than
//! corners on data do. Each segment costs one pass until the cone is empty. An optimal choice of corners, a dynamic programme over all
//! pairs of steps, would keep fewer at O(D^2).

use super::{Corner, cone::Cone, difference};
use kiln_proto::codec::pwl::Sample;

pub(super) fn pick(x: &[Sample], eps: i32) -> Vec<Corner> {
    let mut kept = vec![Corner { step: 0, rgb: x[0] }];
    let mut corner = kept[0];
    while corner.step + 1 < x.len() {
        corner = furthest(x, corner, eps);
        kept.push(corner);
    }
    kept
}

/// The end of the longest segment from `from` that this filter finds; the next sample itself always is one.
fn furthest(x: &[Sample], from: Corner, eps: i32) -> Corner {
    let mut cones = [Cone::OPEN; 3];
    let mut best = Corner { step: from.step + 1, rgb: x[from.step + 1] };
    for step in from.step + 1..x.len() {
        let distance = step - from.step;
        if let Some(rgb) = end_at(&cones, from.rgb, x[step], distance, eps) {
            best = Corner { step, rgb };
        }
        let rise = difference(x[step], from.rgb);
        for c in 0..3 {
            cones[c].narrow(distance, rise[c], eps);
        }
        if cones.iter().any(Cone::is_empty) {
            break;
        }
    }
    best
}

/// The value nearest to the data that the cones and eps allow at `distance`.
fn end_at(cones: &[Cone; 3], from: Sample, data: Sample, distance: usize, eps: i32) -> Option<Sample> {
    let mut out = Sample::default();
    for c in 0..3 {
        let (first, last) = cones[c].rises(distance);
        let (from, data) = (i32::from(from[c]), i32::from(data[c]));
        let low = (from + first).max(data - eps).max(0);
        let high = (from + last).min(data + eps).min(255);
        if low > high {
            return None;
        }
        out[c] = data.clamp(low, high) as u8; // within 0..=255
    }
    Some(out)
}
