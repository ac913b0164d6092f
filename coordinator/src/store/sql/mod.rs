//! Two databases behind one small interface: a statement is text with `$1`, `$2`, … and values; a row answers by column.
//!
//! The statements of [`tables`](super::tables) are written by hand for what both dialects share, and twice where they differ ([`either`]):
//! locks, arrays, JSON. What surrounds them (pools, BEGIN, durability, schema, clocks, retries) differs throughout and has a file for each
//! database. sqlx's own `Any` driver was the alternative: it knows neither PostgreSQL's arrays nor which dialect it speaks, so that every
//! difference would have hidden in strings; and two whole copies of the statements would have drifted.

mod access;
mod database;
mod group;
mod postgres;
mod requests;
mod retention;
mod sqlite;
mod statement;
mod store;
mod transaction;

#[cfg(test)]
mod postgres_tests;
#[cfg(test)]
mod sqlite_tests;

pub(super) use statement::{Row, either, sql};
pub use store::SqlStore;
pub(super) use transaction::Tx;
