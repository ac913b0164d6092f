//! `/v1/bakes`: a scene and a job in one call, made for curl.

use super::{
    App,
    catalogue::Kind,
    extract::{self, Query},
    gate::Caller,
    import_query::upload_query,
    jobs,
    problem::{Answer, Failure},
    repeats::Repeatable,
    scenes,
    upload::Upload,
};
use crate::{
    auth::audit::Action,
    engine::check_share,
    job::OnPoison,
    records::{JobRecord, NewJob, SceneRecord},
};
use axum::{
    Json,
    extract::{Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use kiln_proto::{ids::JobId, options::ImportOptions, settings::SettingsPatch};
use serde::Serialize;
use std::sync::Arc;
use utoipa::ToSchema;

upload_query! {
    /// Query of a bake.
    BakeQuery {
        /// Name of the file when the body is a single one, such as `room.obj`.
        name: Option<String>,
        /// Settings as JSON (schema SettingsPatch), where no part `settings` gives them.
        #[param(example = r#"{"preset":"draft"}"#)]
        settings: Option<String>,
        /// Higher goes first.
        #[serde(default)]
        priority: i32,
        /// The share of its tiles that two workers bake, in [0, 1].
        #[serde(default)]
        verify: Option<f64>,
        /// Whom to tell when the job is done, has failed or was cancelled: an address that the service is configured to allow.
        webhook: Option<String>,
        /// What becomes of the job when one of its tiles is given up: it fails (`fail`, the default), or ends without the tile (`skip`).
        #[serde(default)]
        #[param(inline)]
        on_poison: OnPoison,
    }
}

/// What a bake began.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Bake {
    /// The scene, imported or still importing.
    pub scene: SceneRecord,
    /// The job.
    pub job: JobRecord,
}

/// Upload a scene and bake it.
///
/// The body is that of `POST /v1/scenes`; a part `settings` (or the query parameter) holds the settings as JSON.
#[utoipa::path(post, path = "/v1/bakes", operation_id = "bake", tag = "jobs", 
    params(BakeQuery, ("Idempotency-Key" = Option<String>, Header, description = "Repeats are answered as the first was, for 24 hours")),
    request_body(description = "The files, and the settings", content(
        (String = "multipart/form-data"), (String = "application/zip"), (String = "model/obj"), (String = "application/octet-stream"))),
    responses((status = 201, description = "Scene and job", body = Bake, headers(("location" = String, description = "The job")))))]
pub(super) async fn create(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<BakeQuery>,
    repeatable: Repeatable,
    request: Request,
) -> Answer<Response> {
    // What the query says is judged before gigabytes are read.
    let options = query.options()?;
    let given = query.settings.as_deref().map(|text| parse(text.as_bytes())).transpose()?;
    query.webhook.as_deref().map_or(Ok(()), |address| app.engine.check_webhook(address))?;
    check_share(query.verify)?;
    let mut upload = Upload::receive(&app.engine, request, query.name.as_deref()).await?;
    let part = upload.settings.take().map(|json| parse(&json)).transpose()?;
    if given.is_some() && part.is_some() {
        return Err(Failure::new(Kind::InvalidRequest, "settings come both in the query and in a part; say them once").field("settings"));
    }
    let settings = given.or(part).unwrap_or_default();
    let BakeQuery { priority, verify, webhook, on_poison, .. } = query;
    let new = NewJob { settings, priority, verify, webhook, on_poison, ..NewJob::default() };
    let engine = Arc::clone(&app.engine);
    repeatable.once(&engine, &caller, upload.contents, |id| bake(app, caller, JobId(id), upload, options, new)).await
}

/// Imports the upload and creates `new` of it.
async fn bake(app: App, caller: Caller, id: JobId, upload: Upload, options: ImportOptions, new: NewJob) -> Answer<Response> {
    let scene = scenes::import(&app.engine, upload, options, caller.principal.owner()).await?;
    let job = app.engine.create_job_as(id, NewJob { scene: scene.id.to_string(), ..new }, &caller.principal).await?;
    caller.note(Action::JobCreated, &job.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, jobs::location(job.id))], Json(Bake { scene, job })).into_response())
}

fn parse(json: &[u8]) -> Answer<SettingsPatch> {
    let settings = extract::json(json, Kind::InvalidSettings)?;
    jobs::check(&settings)?;
    Ok(settings)
}
