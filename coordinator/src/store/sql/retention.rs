//! The part of the store that forgets what is long over.

use super::{
    super::{RetentionStore, StoreError, tables::retention},
    SqlStore,
    database::writing,
};
use crate::records::UnixMillis;
use kiln_proto::ids::JobId;
use uuid::Uuid;

#[async_trait::async_trait]
impl RetentionStore for SqlStore {
    async fn ended_jobs(&self, before: UnixMillis) -> Result<Vec<JobId>, StoreError> {
        retention::ended_jobs(&mut self.database.read().await?, before).await
    }

    async fn delete_ended_job(&self, id: JobId, before: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => retention::delete_job(tx, id, before).await)
    }

    async fn unused_scenes(&self, before: UnixMillis) -> Result<Vec<Uuid>, StoreError> {
        retention::unused_scenes(&mut self.database.read().await?, before).await
    }

    async fn delete_unused_scene(&self, id: Uuid, before: UnixMillis) -> Result<bool, StoreError> {
        writing!(self.database, tx => retention::delete_scene(tx, id, before).await)
    }
}
