//! Leases: attempts, the tiles they are cut from, who gets which and how much, what failures mean, and whose word is checked. All pure:
//! what happened and the time come in, the new state and what follows go out.
//!
//! | module | decides |
//! |---|---|
//! | `kind` | what an attempt is for |
//! | `state` | what may happen to it |
//! | `shard` | which tiles wait, are leased, done, quarantined |
//! | `policy` | how many tiles a worker gets |
//! | `fair` | whose tiles go first |
//! | `poison` | which tiles and which workers are to blame for failures |
//! | `twin` | which attempt is so late that an idle worker bakes along |
//! | `verify` | which tiles are baked twice, and who lied |

mod fair;
mod kind;
mod poison;
mod policy;
pub(crate) mod rule;
mod shard;
#[cfg(test)]
pub(crate) mod simulation;
mod state;
mod text;
mod twin;
mod verify;

pub use fair::{Claim, Ledger};
pub use kind::Kind;
pub use poison::{BAR_AFTER, CHARGES, Ceilings, Charges, Refuted, Suspicion, failures, poisoned};
pub use policy::{Sizing, Speeds, run_length};
pub use shard::{Accepted, SHARD_TILES, Shard, shard_of};
pub use state::{Action, Attempt, Event, Illegal, RAYS};
pub use text::BadText;
pub use twin::{Field, Finished, Running, Twin};
pub use verify::{Checks, Verdict, is_checked};
