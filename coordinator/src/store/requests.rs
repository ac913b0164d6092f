//! The part of a store that remembers requests which may be repeated: one answer for each Idempotency-Key of an owner.

use super::StoreError;
use crate::{auth::TokenId, records::UnixMillis};
use kiln_proto::ids::{Digest, Token};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// How long an answer is remembered, milliseconds: a day, counted from the first request.
pub const REQUEST_KEPT: i64 = 24 * 3_600_000;

/// A request that asks for the right to be answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewRequest {
    /// Whose key it is; none where the service asks for no tokens.
    pub owner: Option<TokenId>,
    /// The client's key.
    pub key: String,
    /// Hash of everything that the request says.
    pub print: Digest,
    /// The id of what it creates, if it is the first; whoever answers in its place after a crash gets the same.
    pub subject: Uuid,
    /// The fence: only its holder may answer.
    pub claim: Token,
    /// Until when the claim holds without being renewed.
    pub deadline: UnixMillis,
}

/// What a request gets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Claimed {
    /// The claim: perform the request and keep the answer. The id is that of what it creates.
    Granted(Uuid),
    /// Somebody is about to answer.
    Running,
    /// The key belongs to another request.
    Other,
    /// The answer to the first of these requests.
    Answered(KeptAnswer),
}

/// An answer that can be given again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptAnswer {
    /// The HTTP status.
    pub status: u16,
    /// Headers by name, those that clients read.
    pub headers: Vec<(String, String)>,
    /// The body, which is JSON.
    pub body: String,
}

/// Requests that may be repeated. Every method is one transaction, as in [`Store`](super::Store).
#[async_trait::async_trait]
pub trait RequestStore: Send + Sync + 'static {
    /// Claims a request. A claim that has expired, as after a crash, goes to the next that asks with the same request; what is older than
    /// [`REQUEST_KEPT`] counts as forgotten.
    async fn claim_request(&self, request: &NewRequest, now: UnixMillis) -> Result<Claimed, StoreError>;

    /// Extends a claim. Whether it still holds.
    async fn renew_request(&self, claim: Token, deadline: UnixMillis) -> Result<bool, StoreError>;

    /// Keeps the answer, which ends the claim. Whether it still held.
    async fn answer_request(&self, claim: Token, answer: &KeptAnswer) -> Result<bool, StoreError>;

    /// Gives a claim up without an answer: the key is free again. Whether it still held.
    async fn release_request(&self, claim: Token) -> Result<bool, StoreError>;

    /// Forgets requests that began before a moment. How many.
    async fn forget_requests(&self, before: UnixMillis) -> Result<u64, StoreError>;
}
