//! `/v1/jobs`: submit, estimate, list, look up, cancel, delete.

use super::{
    App,
    catalogue::Kind,
    extract::{self, JobInPath, Json as JsonBody, Query},
    gate::Caller,
    problem::{Answer, Failure},
    repeats::Repeatable,
};
use crate::{
    auth::audit::Action,
    engine::{Estimate, JobFilter, JobPage},
    records::{JobChange, JobRecord, JobState, NewJob, SceneState},
};
use axum::{
    Json,
    extract::{Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use kiln_proto::{
    ids::{Digest, JobId},
    settings::{BadSetting, SettingsPatch},
};
use serde::Deserialize;
use std::sync::Arc;
use utoipa::IntoParams;

/// Query of a submission.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct CreateQuery {
    /// Answer what the job would cost, and create nothing.
    #[serde(default)]
    pub dry_run: bool,
}

/// Submit a job.
///
/// The scene may still be importing, except for `dry_run`, which answers texels, tiles, bytes and the time to expect.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "createJob", tag = "jobs", 
    params(CreateQuery, ("Idempotency-Key" = Option<String>, Header, description = "Repeats are answered as the first was, for 24 hours")),
    request_body = NewJob,
    responses(
        (status = 201, description = "Created", body = JobRecord, headers(("location" = String, description = "The job"))),
        (status = 200, description = "With `dry_run`: what it would cost", body = Estimate)))]
pub(super) async fn create(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<CreateQuery>,
    repeatable: Repeatable,
    request: Request,
) -> Answer<Response> {
    let body = extract::json_bytes(request).await?;
    let new: NewJob = extract::json(&body, Kind::WrongShape)?;
    check(&new.settings)?;
    if query.dry_run {
        usable(&app, &caller, &new).await?;
        return Ok(Json(app.engine.estimate(&new, &caller.principal).await?).into_response());
    }
    let engine = Arc::clone(&app.engine);
    let contents = Digest::of(&body);
    repeatable.once(&engine, &caller, contents, |id| submit(app, caller, JobId(id), new)).await
}

async fn submit(app: App, caller: Caller, id: JobId, new: NewJob) -> Answer<Response> {
    usable(&app, &caller, &new).await?;
    let job = app.engine.create_job_as(id, new, &caller.principal).await?;
    caller.note(Action::JobCreated, &job.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location(job.id))], Json(job)).into_response())
}

/// Refuses a scene that no job can use.
async fn usable(app: &App, caller: &Caller, new: &NewJob) -> Answer<()> {
    let scene = app.engine.scene(&new.scene, caller.principal.sees()).await?;
    if scene.state == SceneState::Rejected {
        let detail = format!("the scene {} was rejected; no job can use it", new.scene);
        return Err(Failure::new(Kind::SceneNotReady, detail).problems(scene.problems));
    }
    Ok(())
}

/// Where a job is.
#[must_use]
pub(super) fn location(job: JobId) -> String {
    format!("/v1/jobs/{job}")
}

/// Settings that cannot be used are refused by field before anything is created.
///
/// # Errors
/// The first field out of its range.
pub(super) fn check(settings: &SettingsPatch) -> Answer<()> {
    let wrong = |bad: BadSetting| Failure::new(Kind::InvalidSettings, bad.to_string()).field(bad.field);
    settings.resolve().map(drop).map_err(wrong)
}

/// Query of the list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ListQuery {
    /// Only jobs in this state.
    #[param(inline)]
    pub state: Option<JobState>,
    /// Only jobs with this label: `name:value`.
    #[param(example = "project:atrium")]
    pub label: Option<String>,
    /// `next` of the page before.
    #[param(value_type = Option<String>)]
    pub cursor: Option<JobId>,
    /// At most this many; 100 unless given, and never more than 1,000.
    #[serde(default)]
    #[param(maximum = 1000)]
    pub limit: u32,
}

/// Jobs, youngest first.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "listJobs", tag = "jobs", params(ListQuery),
    responses((status = 200, description = "A page of jobs", body = JobPage)))]
pub(super) async fn list(State(app): State<App>, caller: Caller, Query(query): Query<ListQuery>) -> Answer<Json<JobPage>> {
    let label = query.label.as_deref().map(split_label).transpose()?;
    let filter = JobFilter { scope: caller.principal.sees(), state: query.state, label, cursor: query.cursor, limit: query.limit };
    Ok(Json(app.engine.jobs(&filter).await?))
}

/// Name and value of a label. The first colon or equals sign parts them, so that values may hold either.
fn split_label(text: &str) -> Answer<(String, String)> {
    let parted = text.split_once([':', '=']).filter(|(name, _)| !name.is_empty());
    let wrong = || Failure::new(Kind::InvalidRequest, format!("label `{}`: expected name:value", text.escape_debug())).field("label");
    parted.map(|(name, value)| (name.to_owned(), value.to_owned())).ok_or_else(wrong)
}

/// A job: state, phase, progress, and why nothing happens where nothing does.
#[utoipa::path(get, path = "/v1/jobs/{id}", operation_id = "getJob", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job", body = JobRecord)))]
pub(super) async fn get(State(app): State<App>, JobInPath(job): JobInPath) -> Answer<Json<JobRecord>> {
    Ok(Json(app.engine.job(job).await?))
}

/// Pause, resume, or change the priority of a job.
///
/// A paused job leases nothing; what is leased is still delivered and counts. Pausing what is paused, or resuming what bakes, changes nothing.
#[utoipa::path(patch, path = "/v1/jobs/{id}", operation_id = "changeJob", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    request_body = JobChange, responses((status = 200, description = "The job as it is now", body = JobRecord)))]
pub(super) async fn change(
    State(app): State<App>,
    caller: Caller,
    JobInPath(job): JobInPath,
    JsonBody(change): JsonBody<JobChange>,
) -> Answer<Json<JobRecord>> {
    let record = app.engine.change_job(job, &change).await?;
    caller.note(Action::JobChanged, &job);
    Ok(Json(record))
}

/// Try the tiles again that were given up.
///
/// For a job that failed because workers failed a tile again and again; what was baked is kept.
#[utoipa::path(post, path = "/v1/jobs/{id}/retry", operation_id = "retryJob", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job as it is now", body = JobRecord)))]
pub(super) async fn retry(State(app): State<App>, caller: Caller, JobInPath(job): JobInPath) -> Answer<Json<JobRecord>> {
    let record = app.engine.retry_job(job).await?;
    caller.note(Action::JobRetried, &job);
    Ok(Json(record))
}

/// Cancel a job. One that has ended is left as it is.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", operation_id = "cancelJob", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job as it is now", body = JobRecord)))]
pub(super) async fn cancel(State(app): State<App>, caller: Caller, JobInPath(job): JobInPath) -> Answer<Json<JobRecord>> {
    let record = app.engine.cancel_job(job).await?;
    caller.note(Action::JobCancelled, &job);
    Ok(Json(record))
}

/// Cancel a job and remove every trace of it, its package included.
#[utoipa::path(delete, path = "/v1/jobs/{id}", operation_id = "deleteJob", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 204, description = "Gone")))]
pub(super) async fn delete(State(app): State<App>, caller: Caller, JobInPath(job): JobInPath) -> Answer<StatusCode> {
    app.engine.delete_job(job).await?;
    caller.note(Action::JobDeleted, &job);
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_a_name_and_a_value() {
        let pair = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        assert_eq!(split_label("a:b").unwrap(), pair("a", "b"));
        assert_eq!(split_label("url=http://x").unwrap(), pair("url", "http://x"));
        assert_eq!(split_label("a:").unwrap(), pair("a", ""));
        assert!(split_label(":b").is_err() && split_label("ab").is_err());
    }
}
