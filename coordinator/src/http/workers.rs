//! `/v1/workers`: who is here.

use super::{App, problem::Answer};
use crate::records::WorkerRecord;
use axum::{Json, extract::State};
use serde::Serialize;
use utoipa::ToSchema;

/// The workers.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct WorkerList {
    /// Youngest first; those long silent are left out.
    pub workers: Vec<WorkerRecord>,
}

/// Workers that were heard not too long ago.
#[utoipa::path(get, path = "/v1/workers", operation_id = "listWorkers", tag = "operations", responses((status = 200, description = "The workers", body = WorkerList)))]
pub(super) async fn list(State(app): State<App>) -> Answer<Json<WorkerList>> {
    Ok(Json(WorkerList { workers: app.engine.workers().await? }))
}
