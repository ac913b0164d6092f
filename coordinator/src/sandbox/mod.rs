//! Import and unwrapping in a process of their own.
//!
//! They read what strangers send, and take whatever time and memory that asks for. In a child with limits of its own, a scene that takes too
//! much, or makes a decoder crash, costs its sender an answer with the reason, and the coordinator nothing. It costs a process,
//! and the scene's bytes once more through a pipe. Threads with a time-out were the alternative: a thread cannot be stopped, and memory has
//! no owner within a process.
//!
//! The child is this program itself, started with [`COMMAND`], which calls [`child`](child::run). It gets no environment, finds its orders on
//! standard input, and answers on standard output.

pub mod child;
mod orders;
mod parent;

pub use parent::Sandbox;

use serde::{Deserialize, Serialize};

/// The hidden subcommand that a program must hand on to [`child::run`].
pub const COMMAND: &str = "sandbox";

/// What a child may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SandboxConfig {
    /// Address space, bytes.
    pub memory_bytes: u64,
    /// Processor time of all threads together, seconds.
    pub cpu_seconds: u64,
    /// Time by the clock, seconds.
    pub seconds: u64,
}

impl Default for SandboxConfig {
    fn default() -> Self {
        Self { memory_bytes: 16 << 30, cpu_seconds: 3_600, seconds: 3_600 }
    }
}
