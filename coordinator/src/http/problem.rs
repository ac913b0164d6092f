//! The only place where an error becomes HTTP: `application/problem+json` (RFC 9457).
//!
//! Handlers return [`Failure`]; it knows its [`Kind`], the sentence for this occurrence, and where in the input the fault lies. What a
//! client cannot act on (a database error, a panic) is logged with its sources and answered without them.

use super::catalogue::Kind;
use crate::{engine::EngineError, records::Problem};
use axum::{
    extract::rejection::{PathRejection, QueryRejection},
    http::{HeaderName, HeaderValue, header},
    response::{IntoResponse, Response},
};
use kiln_proto::chain;
use serde::Serialize;
use std::error::Error;
use utoipa::ToSchema;

/// A problem as clients read it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[schema(example = json!({"type": "/problems/unknown-job", "title": "There is no such job", "status": 404, "detail": "there is no job 0198…"}))]
pub(super) struct ProblemDetails {
    /// The kind of problem; the URI leads to its page on this server.
    #[serde(rename = "type")]
    #[schema(example = "/problems/scene-rejected")]
    pub kind: String,
    /// The kind in words.
    pub title: &'static str,
    /// The HTTP status, again.
    #[schema(example = 422)]
    pub status: u16,
    /// What happened this time.
    pub detail: String,
    /// The file of the upload that is to blame, where one is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Line in that file, or in the JSON body, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u32>,
    /// Column in the JSON body, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<u32>,
    /// The field or parameter that is to blame, where one is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// All findings, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub problems: Vec<Problem>,
}

/// Why a request was not fulfilled.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}", .0.kind.entry().slug, .0.detail)]
pub(super) struct Failure(#[source] Box<Inner>);

#[derive(Debug, thiserror::Error)]
#[error("{detail}")]
struct Inner {
    kind: Kind,
    detail: String,
    place: Problem,
    column: Option<u32>,
    field: Option<String>,
    problems: Vec<Problem>,
    headers: Vec<(HeaderName, HeaderValue)>,
    source: Option<Box<dyn Error + Send + Sync>>,
}

/// What handlers answer.
pub(super) type Answer<T> = Result<T, Failure>;

impl Failure {
    /// A problem of the given kind; `detail` is one sentence about this occurrence.
    #[must_use]
    pub(super) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        let place = Problem::new("");
        let (column, field, problems, headers, source) = (None, None, vec![], vec![], None);
        Self(Box::new(Inner { kind, detail: detail.into(), place, column, field, problems, headers, source }))
    }

    /// A fault of ours: `error` and its sources go to the log, a general sentence to the client.
    #[must_use]
    pub(super) fn internal(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        let mut failure = Self::new(Kind::Internal, "the request met a fault of the server; its log has the details");
        failure.0.source = Some(error.into());
        failure
    }

    /// A scene that was read and found unusable.
    #[must_use]
    pub(super) fn scene_rejected(problems: Vec<Problem>) -> Self {
        let first = problems.first().map_or_else(|| "no reason was given".to_owned(), ToString::to_string);
        let more = problems.len().saturating_sub(1);
        let mut failure = Self::new(Kind::SceneRejected, if more == 0 { first } else { format!("{first} (and {more} more)") });
        if let Some(place) = problems.first() {
            failure.0.place = place.clone();
        }
        failure.0.problems = problems;
        failure
    }

    /// JSON that is none, or not of the expected shape. `kind_of_data` is the kind where the text itself is well-formed.
    #[must_use]
    pub(super) fn json(error: &serde_json::Error, kind_of_data: Kind) -> Self {
        let kind = if error.is_data() { kind_of_data } else { Kind::InvalidJson };
        let mut failure = Self::new(kind, error.to_string());
        failure.0.place.line = u32::try_from(error.line()).ok().filter(|line| *line > 0);
        failure.0.column = u32::try_from(error.column()).ok().filter(|_| error.line() > 0);
        failure.0.field = quoted_field(&error.to_string());
        failure
    }

    /// Lists every finding.
    #[must_use]
    pub(super) fn problems(mut self, problems: Vec<Problem>) -> Self {
        self.0.problems = problems;
        self
    }

    /// Names the field or parameter to blame.
    #[must_use]
    pub(super) fn field(mut self, field: impl Into<String>) -> Self {
        self.0.field = Some(field.into());
        self
    }

    /// Names the uploaded file to blame.
    #[must_use]
    pub(super) fn file(mut self, file: impl Into<String>) -> Self {
        self.0.place.file = Some(file.into());
        self
    }

    /// Adds a header to the response.
    #[must_use]
    pub(super) fn header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.0.headers.push((name, value));
        self
    }

    /// Says when to try again, in seconds.
    #[must_use]
    pub(super) fn retry_after(self, seconds: u64) -> Self {
        self.header(header::RETRY_AFTER, HeaderValue::from(seconds))
    }

    /// Keeps the cause for the log.
    #[must_use]
    pub(super) fn caused_by(mut self, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        self.0.source = Some(source.into());
        self
    }

    /// The kind.
    #[must_use]
    pub(super) fn kind(&self) -> Kind {
        self.0.kind
    }

    /// The sentence about this occurrence.
    #[must_use]
    pub(super) fn detail(&self) -> &str {
        &self.0.detail
    }
}

/// The field that a serde message is about: the first word it puts between backticks.
fn quoted_field(message: &str) -> Option<String> {
    let (about, rest) = message.split_once('`')?;
    let names_a_field = about.ends_with("field ");
    names_a_field.then(|| rest.split('`').next().unwrap_or_default().to_owned())
}

impl IntoResponse for Failure {
    fn into_response(self) -> Response {
        let Inner { kind, detail, place, column, field, problems, headers, source } = *self.0;
        let entry = kind.entry();
        if entry.status.is_server_error() {
            let cause = source.as_deref().map(|source| chain(source)).unwrap_or_default();
            tracing::error!(problem = entry.slug, detail, cause, "request failed");
        }
        let details = ProblemDetails {
            kind: kind.uri(),
            title: entry.title,
            status: entry.status.as_u16(),
            detail,
            file: place.file,
            line: place.line,
            column,
            field,
            problems,
        };
        let body = serde_json::to_vec(&details).unwrap_or_default();
        let mut response = (entry.status, [(header::CONTENT_TYPE, "application/problem+json")], body).into_response();
        response.headers_mut().extend(headers);
        response
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let detail = error.to_string();
        match error {
            EngineError::NotFound { what, .. } => Failure::new(unknown(what), detail),
            EngineError::Conflict { what, .. } => Failure::new(conflict(&what), detail),
            EngineError::Invalid(problems) => Failure::new(Kind::InvalidSettings, detail).problems(problems),
            EngineError::Webhook(_) => Failure::new(Kind::WebhookRefused, detail).field("webhook"),
            EngineError::NoSpace { .. } => Failure::new(Kind::StorageFull, detail),
            EngineError::Unavailable(_) => Failure::new(Kind::Busy, detail).retry_after(2),
            other @ (EngineError::Locked { .. }
            | EngineError::DataFolder { .. }
            | EngineError::Blobs(_)
            | EngineError::Store(_)
            | EngineError::Blob(_)
            | EngineError::Broken(_)) => Failure::internal(other),
        }
    }
}

/// The kind for a name that the engine does not know, by what it was a name of.
fn unknown(what: &str) -> Kind {
    match what {
        "scene" => Kind::UnknownScene,
        "job" => Kind::UnknownJob,
        "file" | "package file" => Kind::UnknownAsset,
        _ => Kind::NotFound,
    }
}

/// The kind for a resource in the wrong state, by the resource.
fn conflict(what: &str) -> Kind {
    match what.trim_start_matches("the ").split(' ').next() {
        Some("scene") => Kind::SceneNotReady,
        Some("job") => Kind::JobNotDone,
        _ => Kind::Conflict,
    }
}

impl From<PathRejection> for Failure {
    fn from(rejection: PathRejection) -> Self {
        // What cannot be read as a name names nothing.
        Failure::new(Kind::NotFound, format!("the path cannot be read: {}", rejection.body_text()))
    }
}

impl From<QueryRejection> for Failure {
    fn from(rejection: QueryRejection) -> Self {
        let text = rejection.body_text();
        let failure = Failure::new(Kind::InvalidRequest, format!("the query cannot be read: {text}"));
        match quoted_field(&text) {
            Some(field) => failure.field(field),
            None => failure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    async fn body(failure: Failure) -> (u16, String, serde_json::Value) {
        let response = failure.into_response();
        let status = response.status().as_u16();
        let kind = response.headers()[header::CONTENT_TYPE].to_str().unwrap().to_owned();
        let bytes = axum::body::to_bytes(response.into_body(), 1 << 20).await.unwrap();
        (status, kind, serde_json::from_slice(&bytes).unwrap())
    }

    #[tokio::test]
    async fn a_rejected_scene_names_file_and_line() {
        let finding = |line| Problem { message: "bad index".into(), file: Some("a.obj".into()), line: Some(line) };
        let (status, media, json) = body(Failure::scene_rejected(vec![finding(3), finding(9)])).await;
        assert_eq!((status, media.as_str()), (422, "application/problem+json"));
        assert_eq!(json["type"], "/problems/scene-rejected");
        assert_eq!(json["detail"], "a.obj:3: bad index (and 1 more)");
        assert_eq!((&json["file"], &json["line"], &json["problems"][1]["line"]), (&"a.obj".into(), &3.into(), &9.into()));
    }

    #[tokio::test]
    async fn json_errors_say_field_and_position() {
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Shape {
            #[allow(dead_code)]
            a: u32,
        }
        let parse = |text: &str| Failure::json(&serde_json::from_str::<Shape>(text).unwrap_err(), Kind::WrongShape);
        let (status, _, json) = body(parse("{\n \"a\": 1, \"b\": 2}")).await;
        assert_eq!((status, &json["field"], &json["line"]), (422, &"b".into(), &2.into()));
        let (status, _, json) = body(parse("{\"a\": }")).await;
        assert_eq!((status, &json["type"], &json["column"]), (400, &"/problems/invalid-json".into(), &7.into()));
    }

    #[tokio::test]
    async fn internal_causes_stay_inside() {
        let secret = std::io::Error::other("password in the URL");
        let (status, _, json) = body(Failure::internal(secret)).await;
        assert_eq!(status, 500);
        assert!(!json.to_string().contains("password"));
    }
}
