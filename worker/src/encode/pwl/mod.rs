//! The rules that pick which samples of a texel are kept (formats: `pwl`, "Picking samples").
//!
//! A rule sees one texel's 8-bit samples x[0..D) in walk order and returns the corners of the line that stands for them. All arithmetic is
//! in integers: a texel that two workers encode is the same bytes.

mod bounded;
mod cone;
mod cumulative;
mod thesis;

use kiln_proto::{codec::pwl::Sample, settings::Rule};

/// A corner of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corner {
    /// Which step of the walk.
    pub step: usize,
    /// Its value.
    pub rgb: Sample,
}

/// The corners that `rule` keeps of a texel's samples in walk order: at least the first and the last step. A texel has at least two.
#[must_use]
pub fn pick(x: &[Sample], rule: Rule) -> Vec<Corner> {
    match rule {
        Rule::Thesis { threshold } => thesis::pick(x, i32::from(threshold)),
        Rule::Cumulative { threshold } => cumulative::pick(x, i32::from(threshold)),
        Rule::Bounded { eps } => bounded::pick(x, i32::from(eps)),
    }
}

/// Channel-wise `a - b`.
fn difference(a: Sample, b: Sample) -> [i32; 3] {
    std::array::from_fn(|c| i32::from(a[c]) - i32::from(b[c]))
}

#[cfg(test)]
mod tests;
