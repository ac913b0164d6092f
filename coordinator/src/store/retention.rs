//! The part of a store that forgets what is long over.

use super::StoreError;
use crate::records::UnixMillis;
use kiln_proto::ids::JobId;
use uuid::Uuid;

/// Forgetting. Every method is one transaction, as in [`Store`](super::Store): what is found is looked at again before it is deleted.
#[async_trait::async_trait]
pub trait RetentionStore: Send + Sync + 'static {
    /// Jobs that ended at this moment or before: done, failed (also where they could be tried again) or cancelled.
    async fn ended_jobs(&self, before: UnixMillis) -> Result<Vec<JobId>, StoreError>;

    /// Removes every row of a job that still is one of [`RetentionStore::ended_jobs`]. Whether it was.
    async fn delete_ended_job(&self, id: JobId, before: UnixMillis) -> Result<bool, StoreError>;

    /// Uploads of this moment or before, imported or rejected, that no job uses.
    async fn unused_scenes(&self, before: UnixMillis) -> Result<Vec<Uuid>, StoreError>;

    /// Removes an upload that still is one of [`RetentionStore::unused_scenes`]. Whether it was.
    async fn delete_unused_scene(&self, id: Uuid, before: UnixMillis) -> Result<bool, StoreError>;
}
