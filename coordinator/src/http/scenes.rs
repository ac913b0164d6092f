//! `/v1/scenes`: upload and look up.

use super::{
    App,
    extract::{Path, Query},
    gate::Caller,
    import_query::upload_query,
    problem::{Answer, Failure},
    repeats::Repeatable,
    upload::Upload,
};
use crate::{
    auth::TokenId,
    engine::{Engine, EngineError},
    records::{SceneRecord, SceneState},
};
use axum::{
    Json,
    extract::{Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use kiln_proto::options::ImportOptions;
use std::{sync::Arc, time::Duration};

/// How long an upload waits for its import before the answer is 202.
pub(super) const IMPORT_WAIT: Duration = Duration::from_secs(30);

upload_query! {
    /// Query of an upload.
    UploadQuery {
        /// Name of the file when the body is a single one, such as `room.obj`.
        name: Option<String>,
    }
}

/// Upload a scene.
///
/// Either `multipart/form-data` with one part per file, whose `filename` is the path that the scene uses for it, or one file as the body:
/// an OBJ, or a ZIP with everything that it refers to. The answer comes when the scene has been imported, or after 30 s as 202.
#[utoipa::path(post, path = "/v1/scenes", operation_id = "createScene", tag = "scenes", 
    params(UploadQuery, ("Idempotency-Key" = Option<String>, Header, description = "Repeats are answered as the first was, for 24 hours")),
    request_body(description = "The files", content(
        (String = "multipart/form-data"), (String = "application/zip"), (String = "model/obj"), (String = "application/octet-stream"))),
    responses(
        (status = 201, description = "Imported", body = SceneRecord, headers(("location" = String, description = "The scene"))),
        (status = 202, description = "Still importing; ask again at Location", body = SceneRecord)))]
pub(super) async fn create(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<UploadQuery>,
    repeatable: Repeatable,
    request: Request,
) -> Answer<Response> {
    let options = query.options()?;
    let upload = Upload::receive(&app.engine, request, query.name.as_deref()).await?;
    let engine = Arc::clone(&app.engine);
    let work = async move |upload: Upload| {
        let scene = import(&app.engine, upload, options, caller.principal.owner()).await?;
        let status = if scene.state == SceneState::Ready { StatusCode::CREATED } else { StatusCode::ACCEPTED };
        Ok((status, [(header::LOCATION, format!("/v1/scenes/{}", scene.id))], Json(scene)).into_response())
    };
    repeatable.once(&engine, &caller, upload.contents, |_| work(upload)).await
}

/// The scene of an upload, imported or still importing.
///
/// # Errors
/// A rejected scene, with every problem found.
pub(super) async fn import(engine: &Engine, upload: Upload, options: ImportOptions, owner: Option<TokenId>) -> Answer<SceneRecord> {
    let rejected = |error| match error {
        EngineError::Invalid(problems) => Failure::scene_rejected(problems),
        other => other.into(),
    };
    let added = upload.give(|files| engine.add_scene(files, options, owner)).await.map_err(rejected)?;
    let scene = engine.wait_for_scene(added.id, IMPORT_WAIT).await?;
    if scene.state == SceneState::Rejected { Err(Failure::scene_rejected(scene.problems)) } else { Ok(scene) }
}

/// A scene, by the id of its upload or by its hash.
#[utoipa::path(get, path = "/v1/scenes/{scene}", operation_id = "getScene", tag = "scenes",
    params(("scene" = String, Path, description = "Id of the upload, or the scene's hash")),
    responses((status = 200, description = "The scene; a rejected one lists its problems", body = SceneRecord)))]
pub(super) async fn get(State(app): State<App>, caller: Caller, Path(scene): Path<String>) -> Answer<Json<SceneRecord>> {
    Ok(Json(app.engine.scene(&scene, caller.principal.sees()).await?))
}
