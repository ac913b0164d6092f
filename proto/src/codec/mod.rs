//! Bitstreams and reference decoders.
pub mod pwl;
