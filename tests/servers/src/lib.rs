//! Real servers for tests: PostgreSQL.
//!
//! Each is a child of the test's process in a folder of its own, on a port that was free, and is gone when its value is dropped. A server that
//! is not installed is an error with one sentence on what to install, never a test that is passed over.
#![forbid(unsafe_code)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // For tests: what goes wrong here ends them.

mod postgres;

pub use postgres::Postgres;

use std::net::TcpListener;

/// A port of the loopback address that nobody listens on just now.
#[must_use]
pub fn free_port() -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a loopback address");
    listener.local_addr().expect("an address").port()
}
