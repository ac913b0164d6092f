//! How a command fails: what happened, where, and with which exit code.
//!
//! 0 is done, 1 means that the work failed, 2 that the command was not understood (clap exits with 2 for what it catches itself).

use kiln_proto::chain;
use std::fmt;

/// A failed command.
#[derive(Debug)]
pub struct CommandError {
    kind: Kind,
    message: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Work,
    /// The other side is away; it may be back.
    Away,
    /// Nobody listens at the address; perhaps nobody ever will.
    Absent,
    Usage,
}

impl CommandError {
    /// The work failed.
    pub fn work(message: impl Into<String>) -> Self {
        Self { kind: Kind::Work, message: message.into() }
    }

    /// The command cannot be followed as it stands.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { kind: Kind::Usage, message: message.into() }
    }

    /// The other side cannot be reached, or is not itself, for now.
    pub fn away(message: impl Into<String>) -> Self {
        Self { kind: Kind::Away, message: message.into() }
    }

    /// Nobody listens where the other side should be.
    pub fn absent(message: impl Into<String>) -> Self {
        Self { kind: Kind::Absent, message: message.into() }
    }

    /// Whether the same may succeed a little later.
    pub fn is_away(&self) -> bool {
        matches!(self.kind, Kind::Away | Kind::Absent)
    }

    /// Whether nobody listened.
    pub fn is_absent(&self) -> bool {
        self.kind == Kind::Absent
    }

    /// The work failed with `error` while doing what `context` says; causes follow in the same line.
    pub fn from_error(context: impl fmt::Display, error: &dyn std::error::Error) -> Self {
        Self::work(format!("{context}: {}", chain(error)))
    }

    /// Whether the command cannot be followed as it stands.
    pub fn is_usage(&self) -> bool {
        self.kind == Kind::Usage
    }

    /// The process's exit code.
    pub fn exit_code(&self) -> u8 {
        match self.kind {
            Kind::Work | Kind::Away | Kind::Absent => 1,
            Kind::Usage => 2,
        }
    }
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for CommandError {}
