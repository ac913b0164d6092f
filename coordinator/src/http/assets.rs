//! `/v1/jobs/{id}/assets`: the files of a finished package, with strong ETags and ranges.
//!
//! A published package never changes, so that its files may be cached for ever; the entity tag is the SHA-256 in the manifest.

use super::{
    App,
    catalogue::Kind,
    conditional::{Decision, decide, strong_etag},
    extract::{JobInPath, Path},
    problem::{Answer, Failure},
};
use crate::{
    engine::{EngineError, PackageFile},
    records::{JobRecord, JobState},
};
use axum::{
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use kiln_proto::ids::JobId;
use serde::Deserialize;
use std::ops::Range;

/// For what will never change under its URL. Private: later, who may see a job is decided per client.
pub const IMMUTABLE: &str = "private, max-age=31536000, immutable";

/// The manifest of a job's package: every file with its size, media type and SHA-256.
#[utoipa::path(get, path = "/v1/jobs/{id}/assets", tag = "packages", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "manifest.json of the package", body = Object)))]
pub async fn manifest(State(app): State<App>, JobInPath(job): JobInPath, method: Method, headers: HeaderMap) -> Answer<Response> {
    send(&app, job, "manifest.json", &method, &headers).await
}

/// The path within the package.
#[derive(Debug, Deserialize)]
pub struct FilePath {
    path: String,
}

/// A file of a job's package. Conditional and partial requests work as in RFC 9110, with one range at a time.
#[utoipa::path(get, path = "/v1/jobs/{id}/assets/{path}", tag = "packages",
    params(("id" = String, Path, description = "The job's id"),
        ("path" = String, Path, description = "Path of the file within the package; it may hold slashes"),
        ("range" = Option<String>, Header, description = "`bytes=FIRST-LAST`, `bytes=FIRST-` or `bytes=-COUNT`"),
        ("if-none-match" = Option<String>, Header, description = "ETag of the file that the client holds")),
    responses(
        (status = 200, description = "The file", body = String, content_type = "application/octet-stream",
            headers(("etag" = String, description = "SHA-256 of the file"), ("accept-ranges" = String, description = "bytes"))),
        (status = 206, description = "The part asked for", body = String, content_type = "application/octet-stream",
            headers(("content-range" = String, description = "Which part"))),
        (status = 304, description = "The client holds this file")))]
pub async fn file(
    State(app): State<App>,
    JobInPath(job): JobInPath,
    Path(FilePath { path }): Path<FilePath>,
    method: Method,
    headers: HeaderMap,
) -> Answer<Response> {
    send(&app, job, &path, &method, &headers).await
}

async fn send(app: &App, job: JobId, path: &str, method: &Method, headers: &HeaderMap) -> Answer<Response> {
    let file = match app.engine.package_file(job, path).await {
        Ok(file) => file,
        Err(error) => return Err(explain(app, job, error).await),
    };
    let etag = strong_etag(&file.sha256);
    let (status, range) = match decide(headers, &etag, file.bytes) {
        Decision::Whole => (StatusCode::OK, 0..file.bytes),
        Decision::Part(range) => (StatusCode::PARTIAL_CONTENT, range),
        Decision::NotModified => return Ok((StatusCode::NOT_MODIFIED, caching(&etag)?).into_response()),
        Decision::PreconditionFailed => {
            return Err(Failure::new(Kind::PreconditionFailed, format!("the file's entity tag is {etag}")));
        }
        Decision::NotSatisfiable => return Err(unsatisfiable(file.bytes)),
    };
    let body = if method == Method::HEAD {
        Body::empty()
    } else {
        Body::from_stream(app.engine.read_package_file(job, path, Some(range.clone())).await?.stream)
    };
    let mut response = (status, caching(&etag)?, body).into_response();
    describe(response.headers_mut(), &file, status, &range)?;
    Ok(response)
}

fn unsatisfiable(length: u64) -> Failure {
    let failure = Failure::new(Kind::RangeNotSatisfiable, format!("the range is malformed or outside the file's {length} bytes"));
    match HeaderValue::try_from(format!("bytes */{length}")) {
        Ok(value) => failure.header(header::CONTENT_RANGE, value),
        Err(_) => failure,
    }
}

/// Headers that say how long the answer may be kept and under which tag.
///
/// # Errors
/// A tag that is no header value, which only a damaged store can hold.
pub fn caching(etag: &str) -> Answer<HeaderMap> {
    let mut headers = HeaderMap::new();
    headers.insert(header::ETAG, value(etag)?);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(IMMUTABLE));
    Ok(headers)
}

fn describe(headers: &mut HeaderMap, file: &PackageFile, status: StatusCode, range: &Range<u64>) -> Answer<()> {
    headers.insert(header::CONTENT_TYPE, value(&file.media_type)?);
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(range.end - range.start));
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    if status == StatusCode::PARTIAL_CONTENT {
        headers.insert(header::CONTENT_RANGE, value(&format!("bytes {}-{}/{}", range.start, range.end - 1, file.bytes))?);
    }
    Ok(())
}

/// Text as a header value.
///
/// # Errors
/// Control characters.
pub fn value(text: &str) -> Answer<HeaderValue> {
    HeaderValue::from_str(text).map_err(Failure::internal)
}

/// Why the package, or a file of it, cannot be had; of a job that is not done, how far it is.
pub async fn explain(app: &App, job: JobId, error: EngineError) -> Failure {
    if !matches!(error, EngineError::Conflict { .. }) {
        return error.into();
    }
    match app.engine.job(job).await {
        Ok(record) => Failure::new(Kind::JobNotDone, how_far(&record)),
        Err(_) => error.into(),
    }
}

fn how_far(job: &JobRecord) -> String {
    let rest = match job.state {
        JobState::Queued => "is queued".to_owned(),
        JobState::Preparing => "is being prepared".to_owned(),
        JobState::Baking => {
            let phase = job.phase.map(|phase| phase.to_string()).unwrap_or_default();
            let crate::records::Progress { tiles, tiles_done, fraction, .. } = job.progress;
            format!("is baking: phase {phase}, {tiles_done} of {tiles} tiles, {:.0} %", 100.0 * fraction)
        }
        JobState::Assembling => "is being assembled".to_owned(),
        JobState::Done => "is done, but its package is not there yet".to_owned(),
        JobState::Cancelled => "was cancelled and has no package".to_owned(),
        JobState::Failed => {
            let why = job.problem.as_ref().map(|problem| format!(": {problem}")).unwrap_or_default();
            format!("has failed and has no package{why}")
        }
    };
    let waiting = job.waiting.as_ref().map(|why| format!(" ({why})")).unwrap_or_default();
    format!("job {} {rest}{waiting}", job.id)
}
