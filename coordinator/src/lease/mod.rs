//! Leases: attempts, the tiles they are cut from, and how much of them a worker gets. All pure.

mod policy;
mod shard;
#[cfg(test)]
mod simulation;
mod state;

pub use policy::{Sizing, Speeds, run_length};
pub use shard::{SHARD_TILES, Shard, shard_of};
pub use state::{Action, Attempt, Event, Illegal};
