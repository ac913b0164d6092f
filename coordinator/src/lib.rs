//! Kiln's coordinator: import -> unwrap -> split -> lease -> collect -> assemble -> serve.
//!
//! Decisions are pure (`job`, `lease`): `apply(state, event, now) -> state + actions`. Effects happen at the rim (`store`, `blob`, `http`),
//! and one module, `engine`, joins the two. A coordinator holds no state that a restart may not lose.
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod assemble;
pub mod auth;
pub mod blob;
pub mod config;
pub mod crypto;
pub mod engine;
pub mod export;
#[doc(hidden)]
pub mod fuzzing;
pub mod http;
pub mod import;
pub mod job;
pub mod lease;
pub mod page;
pub mod preview;
pub mod records;
pub mod sandbox;
pub mod split;
pub mod store;
pub mod unwrap;
pub mod webhook;
