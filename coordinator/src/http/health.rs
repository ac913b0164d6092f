//! `/healthz`: this process runs. `/readyz`: it can also do its work. An orchestrator restarts for the first and routes by the second, so
//! that a full disk does not lead to a restart.

use super::{
    App,
    catalogue::Kind,
    problem::{Answer, Failure},
};
use axum::extract::State;
use kiln_proto::chain;

/// Liveness.
#[utoipa::path(get, path = "/healthz", operation_id = "healthz", tag = "operations", responses((status = 200, description = "Alive", body = String, content_type = "text/plain")))]
pub(super) async fn healthz() -> &'static str {
    "ok\n"
}

/// Readiness: store and blobs answer, the disk has room, and no shut-down has begun.
#[utoipa::path(get, path = "/readyz", operation_id = "readyz", tag = "operations", responses((status = 200, description = "Ready", body = String, content_type = "text/plain")))]
pub(super) async fn readyz(State(app): State<App>) -> Answer<&'static str> {
    if app.closing.is_cancelled() {
        return Err(Failure::new(Kind::NotReady, "the service is shutting down"));
    }
    match app.engine.ready().await {
        Ok(()) => Ok("ok\n"),
        Err(error) => Err(Failure::new(Kind::NotReady, chain(&error)).retry_after(5).caused_by(error)),
    }
}
