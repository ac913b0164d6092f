//! The part of the store that remembers requests.

use super::{
    super::{Claimed, KeptAnswer, NewRequest, RequestStore, StoreError, tables::requests},
    SqlStore,
    database::writing,
};
use crate::records::UnixMillis;
use kiln_proto::ids::Token;

#[async_trait::async_trait]
impl RequestStore for SqlStore {
    async fn claim_request(&self, request: &NewRequest, now: UnixMillis) -> Result<Claimed, StoreError> {
        writing!(self.database, tx => requests::claim(tx, request, now).await)
    }

    async fn renew_request(&self, claim: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => requests::renew(tx, claim, deadline).await)
    }

    async fn answer_request(&self, claim: Token, answer: &KeptAnswer) -> Result<bool, StoreError> {
        writing!(self.database, tx => requests::answer(tx, claim, answer).await)
    }

    async fn release_request(&self, claim: Token) -> Result<bool, StoreError> {
        writing!(self.database, tx => requests::release(tx, claim).await)
    }

    async fn forget_requests(&self, before: UnixMillis) -> Result<u64, StoreError> {
        writing!(self.database, tx => requests::forget(tx, before).await)
    }
}
