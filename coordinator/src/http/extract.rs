//! Extractors whose refusals are problems: path, query and JSON body, each strict about what it does not know.

use super::{
    body,
    catalogue::Kind,
    problem::{Answer, Failure},
};
use axum::{
    extract::{FromRequest, FromRequestParts, Request},
    http::{HeaderMap, header, request::Parts},
};
use kiln_proto::ids::JobId;
use serde::{Deserialize, de::DeserializeOwned};

/// Bytes of a JSON body: a settings file with a size for each of thousands of surfaces fits.
pub(super) const JSON_BYTES: u64 = 4 << 20;

/// The query, by the fields of `T`.
pub(super) struct Query<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Failure;
    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let axum::extract::Query(value) = axum::extract::Query::<T>::from_request_parts(parts, state).await?;
        Ok(Self(value))
    }
}

/// The parameters of the path.
pub(super) struct Path<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Path<T> {
    type Rejection = Failure;
    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let axum::extract::Path(value) = axum::extract::Path::<T>::from_request_parts(parts, state).await?;
        Ok(Self(value))
    }
}

/// The job that the path names by `{id}`. A text that is no id names no job: 404, as for any other unknown name.
pub(super) struct JobInPath(pub JobId);

impl<S: Send + Sync> FromRequestParts<S> for JobInPath {
    type Rejection = Failure;
    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        #[derive(Deserialize)]
        struct Id {
            id: String,
        }
        let Path(Id { id }) = Path::<Id>::from_request_parts(parts, state).await?;
        id.parse().map(Self).map_err(|error| Failure::new(Kind::UnknownJob, format!("{error}")))
    }
}

/// A JSON body of the shape of `T`.
pub(super) struct Json<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Json<T> {
    type Rejection = Failure;
    async fn from_request(request: Request, _: &S) -> Answer<Self> {
        json(&json_bytes(request).await?, Kind::WrongShape).map(Self)
    }
}

/// The bytes of a JSON body.
///
/// # Errors
/// A body of another media type, too large a one, an early end, a stall.
pub(super) async fn json_bytes(request: Request) -> Answer<Vec<u8>> {
    let media = media_type(request.headers());
    if !media.as_deref().is_some_and(|media| media == "application/json" || media.ends_with("+json")) {
        let found = media.unwrap_or_else(|| "nothing".into());
        return Err(Failure::new(Kind::UnsupportedMediaType, format!("Content-Type says {found}; this call takes application/json")));
    }
    body::read(request.into_body(), JSON_BYTES).await
}

/// Parses JSON; `kind_of_data` is the problem where it is well-formed but of another shape.
///
/// # Errors
/// Bytes that are not JSON, or not of this shape: the problem says field and position.
pub(super) fn json<T: DeserializeOwned>(bytes: &[u8], kind_of_data: Kind) -> Answer<T> {
    serde_json::from_slice(bytes).map_err(|error| Failure::json(&error, kind_of_data))
}

/// The media type without its parameters, in lower case.
#[must_use]
pub(super) fn media_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase())
}
