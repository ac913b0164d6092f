//! The part of a store that is about access: tokens, the secret of the service, and whose jobs are.

use super::StoreError;
use crate::{
    auth::{TokenId, TokenRow},
    records::UnixMillis,
};
use kiln_proto::ids::{Digest, JobId};

/// Tokens and owners. Every method is one transaction, as in [`Store`](super::Store).
#[async_trait::async_trait]
pub trait TokenStore: Send + Sync + 'static {
    /// Records a new token.
    async fn add_token(&self, token: &TokenRow) -> Result<(), StoreError>;

    /// A token.
    async fn token(&self, id: TokenId) -> Result<Option<TokenRow>, StoreError>;

    /// Every token that was ever made, oldest first.
    async fn tokens(&self) -> Result<Vec<TokenRow>, StoreError>;

    /// Whether any token was ever made. Revoked ones count: taking the last one back must not open the service.
    async fn has_tokens(&self) -> Result<bool, StoreError>;

    /// Gives a token that was not revoked another hash. Whether there is such a token.
    async fn rotate_token(&self, id: TokenId, hash: Digest) -> Result<bool, StoreError>;

    /// Takes a token back. Whether it was there and not revoked before.
    async fn revoke_token(&self, id: TokenId, now: UnixMillis) -> Result<bool, StoreError>;

    /// Notes that a token was used.
    async fn touch_token(&self, id: TokenId, now: UnixMillis) -> Result<(), StoreError>;

    /// The secret that the service signs with: `fresh` where there is none yet.
    async fn service_secret(&self, fresh: [u8; 32]) -> Result<[u8; 32], StoreError>;

    /// Whose a job is; the outer `None` where there is no such job.
    async fn job_owner(&self, id: JobId) -> Result<Option<Option<TokenId>>, StoreError>;
}
