//! `/v1/workers` and `/v1/throughput`: who is here, and what is done.

use super::{App, gate::Caller, problem::Answer};
use crate::auth::Scope;
use crate::records::{Throughput, WorkerRecord};
use axum::{Json, extract::State};
use serde::Serialize;
use utoipa::ToSchema;

/// The workers.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct WorkerList {
    /// Youngest first; those long silent are left out.
    pub workers: Vec<WorkerRecord>,
}

/// Workers that were heard not too long ago. Which job each bakes is told to those who may see every job.
#[utoipa::path(get, path = "/v1/workers", operation_id = "listWorkers", tag = "operations", responses((status = 200, description = "The workers", body = WorkerList)))]
pub(super) async fn list(State(app): State<App>, caller: Caller) -> Answer<Json<WorkerList>> {
    let mut workers = app.engine.workers().await?;
    if caller.principal.sees() != Scope::All {
        workers.iter_mut().for_each(|worker| worker.job = None);
    }
    Ok(Json(WorkerList { workers }))
}

/// What the farm did over the last hour, in spans of five seconds. Kept in memory, so that a restart forgets it.
#[utoipa::path(get, path = "/v1/throughput", operation_id = "throughput", tag = "operations", responses((status = 200, description = "Sums by span", body = Throughput)))]
pub(super) async fn throughput(State(app): State<App>) -> Json<Throughput> {
    Json(app.engine.throughput())
}
