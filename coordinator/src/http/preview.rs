//! `/v1/jobs/{id}/preview.png`: a finished package as a picture, rendered here.
//!
//! The entity tag is known before the picture is: it is a hash of the package's hash, the parameters as they were understood and the
//! renderer's version. Whoever holds the picture costs a look into the store; the same view, written in another way, is the same picture.
//!
//! A picture that nobody waits for any more is given up, and so is one that takes longer than [`DEADLINE`]: the cores belong to the bake.

use super::{
    App,
    assets::{explain, value},
    catalogue::Kind,
    conditional::{Decision, decide, strong_etag},
    extract::{JobInPath, Query},
    problem::{Answer, Failure},
};
use crate::{
    engine::PictureError,
    preview::{BadView, RENDERER_VERSION, Stop, Stopped, View},
};
use axum::{
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use kiln_proto::{
    format::{PackageHash, Sha256Hex},
    ids::JobId,
};
use serde::Deserialize;
use std::{
    sync::Arc,
    time::{Duration, Instant},
};
use utoipa::IntoParams;

/// How long a picture may take once it is its turn.
const DEADLINE: Duration = Duration::from_secs(20);
/// Seconds after which a picture that was given up may be asked for again.
const RETRY: u64 = 2;
/// A package does not change, but the renderer may, with a new version of the service.
const CACHING: &str = "private, max-age=3600";

/// Query of a picture. Everything is text here, so that a refusal can name the parameter and say what it expected.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PictureQuery {
    /// A camera of the scene, by its name, in the place of `eye`, `target` and `fov`.
    #[param(example = "Entrance")]
    pub camera: Option<String>,
    /// Where the eye is, `x,y,z` in metres; by default such that the whole scene is seen.
    #[param(example = "0,1.6,4.5")]
    pub eye: Option<String>,
    /// What it looks at, `x,y,z` in metres; by default the middle of the scene.
    #[param(example = "0,1,0")]
    pub target: Option<String>,
    /// What points up in the picture, x,y,z; by default +Y. For scenes whose +Z is up: 0,0,1.
    #[param(example = "0,1,0")]
    pub up: Option<String>,
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
    /// Rays along each side of a pixel, 1 to 4, which show its mean; by default 2, and 1 above the default size. At most 8388608 rays in
    /// all.
    #[param(example = "2")]
    pub antialias: Option<String>,
    /// `true` for a plain colour behind a scene that has an environment; by default `false`.
    #[param(example = "false")]
    pub hide_environment: Option<String>,
}

impl PictureQuery {
    fn text(&self, name: &str) -> Option<String> {
        let field = match name {
            "camera" => &self.camera,
            "eye" => &self.eye,
            "target" => &self.target,
            "up" => &self.up,
            "fov" => &self.fov,
            "w" => &self.w,
            "h" => &self.h,
            "exposure" => &self.exposure,
            "mode" => &self.mode,
            "antialias" => &self.antialias,
            "hide_environment" => &self.hide_environment,
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
    method: Method,
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
    answer.insert(header::CONTENT_TYPE, HeaderValue::from_static("image/png"));
    if method == Method::HEAD {
        return Ok((answer, Body::empty()).into_response()); // How long it is would be known only once it is made.
    }
    let png = match app.pictures.find(&etag) {
        Some(png) => png,
        None => make(&app, job, view, etag).await?,
    };
    Ok((answer, png).into_response())
}

/// The entity tag's text.
fn tag(package: PackageHash, view: &View) -> Answer<String> {
    let view = serde_json::to_string(view).map_err(Failure::internal)?;
    Ok(Sha256Hex::of(format!("renderer {RENDERER_VERSION}\n{package}\n{view}").as_bytes()).to_string())
}

/// Makes the picture and keeps it.
async fn make(app: &App, job: JobId, view: View, etag: String) -> Answer<Bytes> {
    let leave = app.pictures.admission.leave().await?;
    if let Some(png) = app.pictures.find(&etag) {
        return Ok(png); // Someone else wanted it, too.
    }
    let package = app.engine.stored_package(job).await?;
    // Cancelled by the end of the service and, when this is dropped because the client has gone, by the guard.
    let unwanted = app.closing.child_token();
    let stop = Stop::new(unwanted.clone(), Instant::now() + DEADLINE);
    let _gone = unwanted.drop_guard();
    let pictures = Arc::clone(&app.pictures);
    let made = tokio::task::spawn_blocking(move || {
        let png = Bytes::from(package.picture(&view, &stop)?);
        pictures.keep(etag, png.clone());
        drop(leave);
        Ok::<_, PictureError>(png)
    });
    match made.await.map_err(Failure::internal)? {
        Ok(png) => Ok(png),
        Err(error) => Err(failure(app, job, error).await),
    }
}

/// What a client is told about a picture that there is not.
pub(super) async fn failure(app: &App, job: JobId, error: PictureError) -> Failure {
    let detail = error.to_string();
    match error {
        PictureError::View(error) => refused(&error.into()),
        PictureError::SceneTooLarge { .. } => Failure::new(Kind::SceneTooLarge, detail),
        PictureError::Stopped(Stopped::Late) => {
            let seconds = DEADLINE.as_secs();
            let detail = format!("{detail}: more than {seconds} s; ask for fewer pixels or a smaller `antialias`, or when less is baked");
            Failure::new(Kind::Busy, detail).retry_after(RETRY)
        }
        PictureError::Stopped(Stopped::Unwanted) => Failure::new(Kind::Busy, "the service is shutting down").retry_after(RETRY),
        // Files that go while they are read are those of a job that was deleted meanwhile.
        PictureError::Package(_) => match app.engine.package_hash(job).await {
            Ok(_) => Failure::internal(error),
            Err(gone) => explain(app, job, gone).await,
        },
        PictureError::Png(_) => Failure::internal(error),
    }
}

fn refused(error: &BadView) -> Failure {
    Failure::new(Kind::InvalidRequest, error.to_string()).field(error.field)
}
