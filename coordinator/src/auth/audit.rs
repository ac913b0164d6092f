//! The audit log: one structured event under the target `kiln::audit` for everything that changes who may do what, or what is baked.
//!
//! Its fields are the action, who did it, from which address, and what it was about: ids, never the text of a token.

use super::Principal;
use std::{fmt, net::IpAddr};

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// A token was made.
    TokenCreated,
    /// A token got a new secret.
    TokenRotated,
    /// A token was taken back.
    TokenRevoked,
    /// A browser's session was opened.
    LoggedIn,
    /// A browser's session was closed.
    LoggedOut,
    /// Someone presented what gives no access.
    Denied,
    /// Someone known asked for what is not theirs to ask.
    Forbidden,
    /// A job was created.
    JobCreated,
    /// A job was cancelled.
    JobCancelled,
    /// A job was paused, resumed, or got another priority.
    JobChanged,
    /// A job that failed is tried again.
    JobRetried,
    /// A job was deleted.
    JobDeleted,
    /// A link to a file was signed.
    LinkSigned,
}

impl Action {
    fn name(self) -> &'static str {
        match self {
            Action::TokenCreated => "token-created",
            Action::TokenRotated => "token-rotated",
            Action::TokenRevoked => "token-revoked",
            Action::LoggedIn => "logged-in",
            Action::LoggedOut => "logged-out",
            Action::Denied => "denied",
            Action::Forbidden => "forbidden",
            Action::JobCreated => "job-created",
            Action::JobCancelled => "job-cancelled",
            Action::JobChanged => "job-changed",
            Action::JobRetried => "job-retried",
            Action::JobDeleted => "job-deleted",
            Action::LinkSigned => "link-signed",
        }
    }
}

/// Writes one event. `subject` is an id, a path or a reason: nothing secret.
pub fn note(action: Action, who: &Principal, from: Option<IpAddr>, subject: &dyn fmt::Display) {
    let address = from.map_or_else(|| "unknown".to_owned(), |ip| ip.to_string());
    tracing::info!(target: "kiln::audit", action = action.name(), principal = %who, address, %subject, "audit");
}
