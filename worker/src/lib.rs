//! Kiln's worker: scene -> bounding volume hierarchy -> capture -> encode -> stream.
//!
//! Light transport (`accel`, `sampling`, `bsdf`, `light`, `path`, `capture`) knows nothing of networks; the client (`client`) knows
//! nothing of light; `run` joins the two.
#![deny(unsafe_op_in_unsafe_fn)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod accel;
pub mod bsdf;
pub mod capture;
pub mod client;
pub mod config;
pub mod encode;
pub mod eval;
pub mod light;
pub mod path;
pub mod run;
pub mod sampling;
pub mod scene;
pub mod simd;

#[cfg(test)]
mod testing;
