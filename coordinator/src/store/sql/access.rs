//! The part of the store that is about access.

use super::{
    super::{StoreError, TokenStore, tables::tokens},
    SqlStore,
    database::writing,
};
use crate::{
    auth::{TokenId, TokenRow},
    records::UnixMillis,
};
use kiln_proto::ids::{Digest, JobId};

#[async_trait::async_trait]
impl TokenStore for SqlStore {
    async fn add_token(&self, token: &TokenRow) -> Result<(), StoreError> {
        writing!(self.database, tx => tokens::add(tx, token).await)
    }

    async fn token(&self, id: TokenId) -> Result<Option<TokenRow>, StoreError> {
        tokens::get(&mut self.database.read().await?, id).await
    }

    async fn tokens(&self) -> Result<Vec<TokenRow>, StoreError> {
        tokens::list(&mut self.database.read().await?).await
    }

    async fn has_tokens(&self) -> Result<bool, StoreError> {
        tokens::any(&mut self.database.read().await?).await
    }

    async fn rotate_token(&self, id: TokenId, hash: Digest) -> Result<bool, StoreError> {
        writing!(self.database, tx => tokens::rotate(tx, id, hash).await)
    }

    async fn revoke_token(&self, id: TokenId, now: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => tokens::revoke(tx, id, now).await)
    }

    async fn touch_token(&self, id: TokenId, now: UnixMillis) -> Result<(), StoreError> {
        writing!(self.database, tx => tokens::touch(tx, id, now).await)
    }

    async fn service_secret(&self, fresh: [u8; 32]) -> Result<[u8; 32], StoreError> {
        writing!(self.database, tx => tokens::service_secret(tx, fresh).await)
    }

    async fn job_owner(&self, id: JobId) -> Result<Option<Option<TokenId>>, StoreError> {
        tokens::job_owner(&mut self.database.read().await?, id).await
    }
}
