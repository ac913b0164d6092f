//! `/v1/jobs/{id}/preview.png`: a finished package as a picture, rendered here.
//!
//! The entity tag is known before the picture is: it is a hash of the package's hash, the parameters as they were understood and the
//! renderer's version. Whoever holds the picture costs a look into the store; the same view, written in another way, is the same picture.

use super::{
    App,
    assets::{explain, value},
    catalogue::Kind,
    conditional::{Decision, decide, strong_etag},
    extract::{JobInPath, Query},
    problem::{Answer, Failure},
};
use crate::{
    engine::EngineError,
    preview::{BadView, RENDERER_VERSION, View},
};
use axum::{
    extract::State,
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use kiln_proto::{
    format::{PackageHash, Sha256Hex},
    ids::JobId,
};
use serde::Deserialize;
use std::sync::Arc;
use utoipa::IntoParams;

/// A package does not change, but the renderer may, with a new version of the service.
const CACHING: &str = "private, max-age=3600";

/// Query of a picture. Everything is text here, so that a refusal can name the parameter and say what it expected.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PictureQuery {
    /// Where the eye is, `x,y,z` in metres; by default such that the whole scene is seen.
    #[param(example = "0,1.6,4.5")]
    pub eye: Option<String>,
    /// What it looks at, `x,y,z` in metres; by default the middle of the scene.
    #[param(example = "0,1,0")]
    pub target: Option<String>,
    /// Vertical field of view in degrees, 1 to 170; by default 45.
    #[param(example = "45")]
    pub fov: Option<String>,
    /// Width in pixels, 1 to 4096; by default 640. A picture has at most 8388608 pixels.
    #[param(example = "640")]
    pub w: Option<String>,
    /// Height in pixels, 1 to 4096; by default 480.
    #[param(example = "480")]
    pub h: Option<String>,
    /// Stops on top of the exposure of the bake, -20 to 20; by default 0.
    #[param(example = "0")]
    pub exposure: Option<String>,
    /// `light-field`, the default: as it looks from the eye; `diffuse`: without what depends on the eye.
    #[param(example = "light-field")]
    pub mode: Option<String>,
}

impl PictureQuery {
    fn text(&self, name: &str) -> Option<String> {
        let field = match name {
            "eye" => &self.eye,
            "target" => &self.target,
            "fov" => &self.fov,
            "w" => &self.w,
            "h" => &self.h,
            "exposure" => &self.exposure,
            "mode" => &self.mode,
            _ => &None,
        };
        field.clone()
    }
}

/// A picture of a job's package.
///
/// Rendered on the server from the light field; black where it has nothing.
#[utoipa::path(get, path = "/v1/jobs/{id}/preview.png", operation_id = "getPreview", tag = "packages",
    params(("id" = String, Path, description = "The job's id"), PictureQuery,
        ("if-none-match" = Option<String>, Header, description = "ETag of the picture that the client holds")),
    responses(
        (status = 200, description = "The picture", body = String, content_type = "image/png",
            headers(("etag" = String, description = "Of this package, this view and this renderer"))),
        (status = 304, description = "The client holds this picture")))]
pub(super) async fn picture(
    State(app): State<App>,
    JobInPath(job): JobInPath,
    Query(query): Query<PictureQuery>,
    headers: HeaderMap,
) -> Answer<Response> {
    let view = View::from_query(|name| query.text(name)).map_err(|error| refused(&error))?;
    let hash = match app.engine.package_hash(job).await {
        Ok(hash) => hash,
        Err(error) => return Err(explain(&app, job, error).await),
    };
    let etag = strong_etag(&tag(hash, &view)?);
    let mut answer = HeaderMap::new();
    answer.insert(header::ETAG, value(&etag)?);
    answer.insert(header::CACHE_CONTROL, HeaderValue::from_static(CACHING));
    // Ranges are not served here, which every client must expect.
    match decide(&headers, &etag, 0) {
        Decision::NotModified => return Ok((StatusCode::NOT_MODIFIED, answer).into_response()),
        Decision::PreconditionFailed => {
            return Err(Failure::new(Kind::PreconditionFailed, format!("the picture's entity tag is {etag}")));
        }
        Decision::Whole | Decision::Part(_) | Decision::NotSatisfiable => {}
    }
    let png = match app.pictures.find(&etag) {
        Some(png) => png,
        None => make(&app, job, view, etag).await?,
    };
    answer.insert(header::CONTENT_TYPE, HeaderValue::from_static("image/png"));
    Ok((answer, png).into_response())
}

/// The entity tag's text.
fn tag(package: PackageHash, view: &View) -> Answer<String> {
    let view = serde_json::to_string(view).map_err(Failure::internal)?;
    Ok(Sha256Hex::of(format!("renderer {RENDERER_VERSION}\n{package}\n{view}").as_bytes()).to_string())
}

/// Renders the picture and keeps it. A client that goes away in between finds it when it comes back.
async fn make(app: &App, job: JobId, view: View, etag: String) -> Answer<Bytes> {
    let leave = app.pictures.leave().await?;
    if let Some(png) = app.pictures.find(&etag) {
        return Ok(png); // Someone else wanted it, too.
    }
    let package = app.engine.stored_package(job).await?;
    let pictures = Arc::clone(&app.pictures);
    let made = tokio::task::spawn_blocking(move || -> Result<_, EngineError> {
        let png = package.picture(&view)?.map(Bytes::from);
        if let Ok(png) = &png {
            pictures.keep(etag, png.clone());
        }
        drop(leave);
        Ok(png)
    });
    let made = made.await.map_err(Failure::internal)??;
    made.map_err(|error| refused(&error.into()))
}

fn refused(error: &BadView) -> Failure {
    Failure::new(Kind::InvalidRequest, error.to_string()).field(error.field)
}
