//! Where samples come from: scrambled sequences, the maps from the unit square to what is sampled, and how two techniques share a sample.

pub mod mis;
pub mod sequence;
pub mod warp;

#[cfg(test)]
pub(crate) mod chi_square;

pub use sequence::{Dimension, TexelKey};
