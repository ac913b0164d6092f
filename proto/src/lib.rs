//! What crosses a process or file boundary in Kiln: identifiers, units, the canonical scene, direction grids, tiles, wire messages,
//! file formats and their decoders.
//!
//! The coordinator and the worker meet only here. Nothing in this crate opens a file, a socket or a thread: bytes come in, values and
//! typed errors go out, so that every part can be fuzzed, simulated and reused by a tool that is neither coordinator nor worker.
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod chain;
pub mod codec;
pub mod format;
pub mod frame;
pub mod grid;
pub mod ids;
pub mod limits;
pub mod lookup;
pub mod math;
pub mod options;
pub mod plan;
pub mod probe;
pub mod scene;
pub mod secret;
pub mod segment;
pub mod sets;
pub mod settings;
pub mod texel;
mod text;
pub mod tile;
pub mod units;
pub mod wire;

pub use chain::chain;

/// A number that changes whenever baked bytes may change. A job pins the version it was created with and is leased only to workers of the
/// same version, so that the segments of one package never mix two generations of the estimator or the codec.
pub const BAKE_VERSION: u32 = 3;
