//! Who may do what: roles, tokens, principals, and the table of what each may touch.
//!
//! Decisions here are pure: time, random bytes and stored rows come in as values. [`Desk`] (making and revoking tokens) and [`Verifier`]
//! (who is it that calls?) are the rim that joins them with a store; `http::gate` asks them once for every request, so that no handler can
//! forget to. The alternative, a check in each handler, is one forgotten line away from an open door.

mod access;
pub mod audit;
mod bucket;
mod desk;
mod principal;
mod role;
mod seal;
mod token;
mod verifier;

pub use access::{Access, Verdict, decide};
pub use bucket::{Buckets, Rate};
pub use desk::{Desk, DeskError, Minted};
pub use principal::{Principal, Scope};
pub use role::{BadRole, Role, Roles};
pub use seal::{Keys, Session};
pub(crate) use token::same;
pub use token::{BadTokenId, Invalid, NoRandomness, Presented, TokenId, TokenRow, mint, random};
pub use verifier::{Known, Verifier};
