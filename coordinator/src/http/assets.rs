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
    engine::EngineError,
    records::{JobRecord, JobState, PackageFile},
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

/// For what may be another next time: kept, but asked for again.
pub(super) const REVALIDATE: &str = "no-cache";
/// For what will never change under its URL. Private: later, who may see a job is decided per client.
pub(super) const IMMUTABLE: &str = "private, max-age=31536000, immutable";

/// The manifest of a job's package: every file with its size, media type and SHA-256.
#[utoipa::path(get, path = "/v1/jobs/{id}/assets", operation_id = "getManifest", tag = "packages", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "manifest.json of the package", body = Object)))]
pub(super) async fn manifest(State(app): State<App>, JobInPath(job): JobInPath, method: Method, headers: HeaderMap) -> Answer<Response> {
    send(&app, job, "manifest.json", &method, &headers).await
}

/// The path within the package.
#[derive(Debug, Deserialize)]
pub(super) struct FilePath {
    path: String,
}

/// A file of a job's package. Conditional and partial requests work as in RFC 9110, with one range at a time.
#[utoipa::path(get, path = "/v1/jobs/{id}/assets/{path}", operation_id = "getAsset", tag = "packages",
    params(("id" = String, Path, description = "The job's id"),
        ("path" = String, Path, description = "Path of the file within the package; it may hold slashes"),
        ("range" = Option<String>, Header, description = "`bytes=FIRST-LAST`, `bytes=FIRST-` or `bytes=-COUNT`"),
        ("if-none-match" = Option<String>, Header, description = "ETag of the file that the client holds")),
    responses(
        (status = 200, description = "The file, of its own media type", body = String, content_type = "*/*",
            headers(("etag" = String, description = "SHA-256 of the file"), ("accept-ranges" = String, description = "bytes"))),
        (status = 206, description = "The part asked for", body = String, content_type = "*/*",
            headers(("content-range" = String, description = "Which part"))),
        (status = 304, description = "The client holds this file")))]
pub(super) async fn file(
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
    let (status, headers, range) = head(&file, IMMUTABLE, headers)?;
    let body = match range {
        Some(range) if method != Method::HEAD => Body::from_stream(app.engine.read_package_file(job, path, Some(range)).await?.stream),
        _ => Body::empty(),
    };
    Ok((status, headers, body).into_response())
}

/// Status and headers for a request with the given headers, and the bytes to send where there are any.
pub(super) fn head(file: &PackageFile, keep: &'static str, asked: &HeaderMap) -> Answer<(StatusCode, HeaderMap, Option<Range<u64>>)> {
    let etag = strong_etag(&file.sha256);
    let mut headers = caching(&etag, keep)?;
    let (status, range) = match decide(asked, &etag, file.bytes) {
        Decision::Whole => (StatusCode::OK, 0..file.bytes),
        Decision::Part(range) => (StatusCode::PARTIAL_CONTENT, range),
        Decision::NotModified => return Ok((StatusCode::NOT_MODIFIED, headers, None)),
        Decision::PreconditionFailed => {
            return Err(Failure::new(Kind::PreconditionFailed, format!("the file's entity tag is {etag}")));
        }
        Decision::NotSatisfiable => return Err(unsatisfiable(file.bytes)),
    };
    headers.insert(header::CONTENT_TYPE, value(&file.media_type)?);
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(range.end - range.start));
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    if status == StatusCode::PARTIAL_CONTENT {
        headers.insert(header::CONTENT_RANGE, value(&format!("bytes {}-{}/{}", range.start, range.end - 1, file.bytes))?);
    }
    Ok((status, headers, Some(range)))
}

fn unsatisfiable(length: u64) -> Failure {
    let failure = Failure::new(Kind::RangeNotSatisfiable, format!("the range is malformed or outside the file's {length} bytes"));
    match HeaderValue::try_from(format!("bytes */{length}")) {
        Ok(value) => failure.header(header::CONTENT_RANGE, value),
        Err(_) => failure,
    }
}

/// For a file that is sent whole or not at all: the headers to send it with, or the whole answer where the client has it. A range is
/// answered with everything, which the standard allows.
///
/// # Errors
/// A client that expects another file.
pub(super) fn whole(etag: &str, keep: &'static str, asked: &HeaderMap) -> Answer<Result<HeaderMap, Response>> {
    let headers = caching(etag, keep)?;
    match decide(asked, etag, 0) {
        Decision::NotModified => Ok(Err((StatusCode::NOT_MODIFIED, headers).into_response())),
        Decision::PreconditionFailed => Err(Failure::new(Kind::PreconditionFailed, format!("the file's entity tag is {etag}"))),
        Decision::Whole | Decision::Part(_) | Decision::NotSatisfiable => Ok(Ok(headers)),
    }
}

/// Headers that say how long the answer may be kept and under which tag.
///
/// # Errors
/// A tag that is no header value, which only a damaged store can hold.
pub(super) fn caching(etag: &str, keep: &'static str) -> Answer<HeaderMap> {
    let mut headers = HeaderMap::new();
    headers.insert(header::ETAG, value(etag)?);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(keep));
    Ok(headers)
}

/// Text as a header value.
///
/// # Errors
/// Control characters.
pub(super) fn value(text: &str) -> Answer<HeaderValue> {
    HeaderValue::from_str(text).map_err(Failure::internal)
}

/// Why the package, or a file of it, cannot be had; of a job that is not done, how far it is.
pub(super) async fn explain(app: &App, job: JobId, error: EngineError) -> Failure {
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
        JobState::Paused => "is paused".to_owned(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(name: header::HeaderName, text: &str) -> Answer<(StatusCode, HeaderMap, Option<Range<u64>>)> {
        let file =
            PackageFile { path: "a.mtsp".into(), media_type: "application/octet-stream".into(), bytes: 100, sha256: "ab".repeat(32) };
        head(&file, IMMUTABLE, &[(name, text.parse().unwrap())].into_iter().collect())
    }

    #[test]
    fn a_part_says_which_it_is() {
        let (status, headers, range) = ask(header::RANGE, "bytes=-10").unwrap();
        assert_eq!((status, range), (StatusCode::PARTIAL_CONTENT, Some(90..100)));
        assert_eq!(headers[header::CONTENT_RANGE], "bytes 90-99/100");
        assert_eq!(headers[header::CONTENT_LENGTH], "10");
        assert_eq!(headers[header::CACHE_CONTROL], IMMUTABLE);
    }

    #[test]
    fn a_held_file_is_not_sent_again() {
        let (status, headers, range) = ask(header::IF_NONE_MATCH, &format!("\"{}\"", "ab".repeat(32))).unwrap();
        assert_eq!((status, range), (StatusCode::NOT_MODIFIED, None));
        assert!(headers.contains_key(header::ETAG) && !headers.contains_key(header::CONTENT_LENGTH));
    }

    #[test]
    fn a_range_outside_the_file_says_how_long_it_is() {
        let response = ask(header::RANGE, "bytes=100-").unwrap_err().into_response();
        assert_eq!(response.status(), StatusCode::RANGE_NOT_SATISFIABLE);
        assert_eq!(response.headers()[header::CONTENT_RANGE], "bytes */100");
    }
}
