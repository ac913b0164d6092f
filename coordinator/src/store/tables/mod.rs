//! The statements of each table, and the transactions that join them.
//!
//! Decisions are those of the pure machines: a row is loaded, the machine says what follows, the row is saved and the actions are performed.
//! Rows are locked in one order, so that coordinators on one database never wait for each other in a circle: scene, job, task, attempt, shard,
//! worker; within a table by id.

pub(super) mod attempts;
pub(super) mod chunks;
pub(super) mod claims;
pub(super) mod events;
pub(super) mod figures;
pub(super) mod grants;
pub(super) mod jobs;
pub(super) mod late;
mod lies;
mod locks;
pub(super) mod lost;
mod opinions;
pub(super) mod packages;
pub(super) mod poison;
pub(super) mod requests;
pub(super) mod retention;
pub(super) mod scenes;
pub(super) mod shards;
pub(super) mod tasks;
pub(super) mod tokens;
pub(super) mod workers;
