//! `/v1/worker/…`: frames in, frames out. Everything that means something happens in the engine; here bytes become messages and refusals
//! become statuses.
//!
//! A frame that is damaged, of another kind or too large is refused before its message exists, counted and logged.

use super::{
    App, assets,
    body::{self, Budget},
    catalogue::Kind,
    extract::Path,
    problem::Failure,
    routes::{Route, Verb},
};
use crate::{
    auth::Access,
    engine::{Download, EngineError},
};
use axum::{
    body::Body,
    extract::{FromRequestParts, Request, State},
    http::{HeaderValue, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
};
use kiln_proto::{
    BAKE_VERSION, chain,
    ids::{Digest, SceneHash, Token},
    limits,
    wire::{
        frame::{FrameError, HEADER_BYTES, Message, PROTOCOL_VERSION, from_frame, to_frame},
        message::{ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Refusal, Welcome},
    },
};
use serde::{Deserialize, de::DeserializeOwned};
use std::str::FromStr;

/// The media type of a frame.
pub(super) const FRAME: &str = "application/vnd.kiln.frame";
/// Bytes of a request's frame: names and numbers, and the text of a failure.
const MESSAGE_BYTES: u64 = 1 << 20;
/// What a worker that meets a passing difficulty should wait.
const LATER: Refusal = Refusal::Busy { retry_after_ms: 2_000 };

/// A refusal with the status that fits.
#[derive(Debug)]
pub(super) struct Refused(StatusCode, Refusal);

type Reply = Result<Response, Refused>;

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        let status = match refusal {
            Refusal::Incompatible { .. } => StatusCode::UPGRADE_REQUIRED,
            Refusal::UnknownWorker => StatusCode::NOT_FOUND,
            Refusal::Gone { .. } => StatusCode::GONE,
            Refusal::Invalid { .. } => StatusCode::UNPROCESSABLE_ENTITY,
            Refusal::Busy { .. } => StatusCode::SERVICE_UNAVAILABLE,
        };
        Self(status, refusal)
    }
}

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Self {
        match failure.kind() {
            Kind::StorageFull | Kind::Busy | Kind::Internal => {
                tracing::error!(error = chain(&failure), "a worker's call failed");
                LATER.into()
            }
            kind => Self(kind.entry().status, Refusal::Invalid { reason: failure.detail().to_owned() }),
        }
    }
}

impl From<EngineError> for Refused {
    fn from(error: EngineError) -> Self {
        Failure::from(error).into()
    }
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let Self(status, refusal) = self;
        let mut response = match to_frame(&refusal) {
            Ok(frame) => (status, [(header::CONTENT_TYPE, FRAME)], frame).into_response(),
            Err(_) => status.into_response(), // The status alone says most of it.
        };
        match refusal {
            Refusal::Busy { retry_after_ms } => {
                response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(retry_after_ms.div_ceil(1_000)));
            }
            Refusal::Incompatible { .. } => {
                response.headers_mut().insert(header::UPGRADE, HeaderValue::from_static("kiln"));
            }
            Refusal::UnknownWorker | Refusal::Gone { .. } | Refusal::Invalid { .. } => {}
        }
        response
    }
}

/// What calls of a route may be refused with, whatever they are for.
pub(super) fn refusals(route: &Route) -> Vec<(u16, &'static str)> {
    const NAMED: &[(u16, &str)] = &[(404, "nothing has that name")];
    const BODY: &[(u16, &str)] = &[
        (400, "the body is damaged or ended early"),
        (408, "the body stopped coming"),
        (413, "the body is too large"),
        (422, "what the body says is not acceptable"),
    ];
    const MESSAGE: &[(u16, &str)] = &[(426, "another protocol or bake version")];
    const ALWAYS: &[(u16, &str)] = &[(503, "later")];
    if route.access != Access::Work {
        return vec![];
    }
    let parts = [(route.path.contains('{'), NAMED), (route.verb != Verb::Get, BODY), (route.verb == Verb::Post, MESSAGE), (true, ALWAYS)];
    parts.into_iter().filter(|(applies, _)| *applies).flat_map(|(_, part)| part.iter().copied()).collect()
}

/// The message in the body of a request.
async fn message<M: Message>(app: &App, body: Body) -> Result<M, Refused> {
    let bytes = body::read(body, MESSAGE_BYTES + HEADER_BYTES as u64).await?;
    from_frame(&bytes).map_err(|error| {
        app.metrics.frame_refused();
        tracing::warn!(error = chain(&error), expected = ?M::KIND, "a frame was refused");
        match error {
            FrameError::Version { .. } => Refusal::Incompatible { protocol: PROTOCOL_VERSION, bake_version: BAKE_VERSION }.into(),
            other => Refused(StatusCode::BAD_REQUEST, Refusal::Invalid { reason: other.to_string() }),
        }
    })
}

fn reply<M: Message>(message: &M) -> Reply {
    match to_frame(message) {
        Ok(frame) => Ok(([(header::CONTENT_TYPE, FRAME)], frame).into_response()),
        Err(error) => Err(Failure::internal(error).into()),
    }
}

/// What the path names.
pub(super) struct InPath<T>(T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for InPath<T> {
    type Rejection = Refused;
    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Refused> {
        let Path(value) = Path::from_request_parts(parts, state).await?;
        Ok(Self(value))
    }
}

/// The fence in the path. A text that is no token names an attempt that never was.
fn token(text: &str) -> Result<Token, Refused> {
    text.parse().map_err(|_| Refusal::Gone { state: "unknown".into() }.into())
}

/// A worker introduces itself.
#[utoipa::path(post, path = "/v1/worker/hello", operation_id = "workerHello", tag = "worker", request_body(content = String, content_type = FRAME, description = "Hello"),
    responses((status = 200, description = "Welcome", body = String, content_type = FRAME),
        (status = 426, description = "Refusal: another protocol or bake version", body = String, content_type = FRAME)))]
pub(super) async fn hello(State(app): State<App>, request: Request) -> Reply {
    let hello: Hello = message(&app, request.into_body()).await?;
    let welcome: Welcome = app.engine.hello(&hello).await?;
    reply(&welcome)
}

/// A worker asks for work and waits for it.
#[utoipa::path(post, path = "/v1/worker/leases", operation_id = "workerLease", tag = "worker",
    request_body(content = String, content_type = FRAME, description = "LeaseRequest"),
    responses((status = 200, description = "LeaseGrant", body = String, content_type = FRAME),
        (status = 204, description = "No work within the time that the worker is willing to wait"),
        (status = 404, description = "Refusal: unknown worker", body = String, content_type = FRAME)))]
pub(super) async fn lease(State(app): State<App>, request: Request) -> Reply {
    let request: LeaseRequest = message(&app, request.into_body()).await?;
    let grant: Option<LeaseGrant> = tokio::select! {
        grant = app.engine.lease(&request) => grant?,
        () = app.closing.cancelled() => None,
    };
    match grant {
        Some(grant) => reply(&grant),
        None => Ok(StatusCode::NO_CONTENT.into_response()),
    }
}

/// A canonical scene, one zstd frame.
#[utoipa::path(get, path = "/v1/worker/scenes/{hash}", operation_id = "workerScene", tag = "worker", params(("hash" = String, Path, description = "The scene's hash")),
    responses((status = 200, description = "The scene", body = String, content_type = "application/zstd")))]
pub(super) async fn scene(State(app): State<App>, InPath(hash): InPath<String>) -> Reply {
    let hash: SceneHash = name(&hash)?;
    blob(app.engine.scene_bytes(hash).await?, &hash.to_string())
}

/// A plan, one zstd frame.
#[utoipa::path(get, path = "/v1/worker/plans/{digest}", operation_id = "workerPlan", tag = "worker", params(("digest" = String, Path, description = "The plan's digest")),
    responses((status = 200, description = "The plan", body = String, content_type = "application/zstd")))]
pub(super) async fn plan(State(app): State<App>, InPath(digest): InPath<String>) -> Reply {
    let digest: Digest = name(&digest)?;
    blob(app.engine.plan_bytes(digest).await?, &digest.to_string())
}

fn name<T: FromStr<Err: std::fmt::Display>>(text: &str) -> Result<T, Refused> {
    text.parse().map_err(|error: T::Err| Refused(StatusCode::NOT_FOUND, Refusal::Invalid { reason: error.to_string() }))
}

fn blob(download: Download, digest: &str) -> Reply {
    let headers = [(header::CONTENT_TYPE, "application/zstd".to_owned()), (header::CONTENT_LENGTH, download.length.to_string())];
    let caching = assets::caching(&super::conditional::strong_etag(digest), assets::IMMUTABLE)?;
    Ok((headers, caching, Body::from_stream(download.stream)).into_response())
}

/// Which chunk of which attempt.
#[derive(Debug, Deserialize)]
pub(super) struct ChunkPath {
    token: String,
    n: u64,
}

/// A chunk of finished segments.
#[utoipa::path(put, path = "/v1/worker/attempts/{token}/chunks/{n}", operation_id = "workerChunk", tag = "worker",
    params(("token" = String, Path, description = "The attempt's token"), ("n" = u64, Path, description = "The chunk's number")),
    request_body(content = String, content_type = "application/octet-stream", description = "Segments, trailer frame, its length"),
    responses((status = 200, description = "ChunkVerdict", body = String, content_type = FRAME),
        (status = 410, description = "Refusal: the attempt may not deliver", body = String, content_type = FRAME),
        (status = 422, description = "Refusal: the bytes are not a chunk of this attempt", body = String, content_type = FRAME)))]
pub(super) async fn chunk(State(app): State<App>, InPath(path): InPath<ChunkPath>, request: Request) -> Reply {
    let token = token(&path.token)?;
    // More uploads at once than this would fill the spool faster than the engine empties it.
    let Ok(_slot) = app.chunk_slots.try_acquire() else {
        return Err(LATER.into());
    };
    body::within(request.body(), limits::CHUNK_BYTES)?;
    let mut stream = request.into_body().into_data_stream();
    let spooled = body::spool(&app.engine, &mut stream, &mut Budget::new(limits::CHUNK_BYTES)).await?;
    let verdict: ChunkVerdict = app.engine.chunk(token, path.n, spooled.path).await?;
    reply(&verdict)
}

/// A sign of life of an attempt.
#[utoipa::path(post, path = "/v1/worker/attempts/{token}/heartbeat", operation_id = "workerHeartbeat", tag = "worker",
    params(("token" = String, Path, description = "The attempt's token")),
    request_body(content = String, content_type = FRAME, description = "Heartbeat"),
    responses((status = 200, description = "HeartbeatReply", body = String, content_type = FRAME),
        (status = 410, description = "Refusal: that is no token", body = String, content_type = FRAME)))]
pub(super) async fn heartbeat(State(app): State<App>, InPath(text): InPath<String>, request: Request) -> Reply {
    let heartbeat: Heartbeat = message(&app, request.into_body()).await?;
    let answer: HeartbeatReply = app.engine.heartbeat(token(&text)?, &heartbeat).await?;
    reply(&answer)
}

/// Every tile of an attempt has been delivered.
#[utoipa::path(post, path = "/v1/worker/attempts/{token}/complete", operation_id = "workerComplete", tag = "worker",
    params(("token" = String, Path, description = "The attempt's token")),
    request_body(content = String, content_type = FRAME, description = "Finish"),
    responses((status = 204, description = "Noted"),
        (status = 410, description = "Refusal: the attempt is over already", body = String, content_type = FRAME)))]
pub(super) async fn complete(State(app): State<App>, InPath(text): InPath<String>, request: Request) -> Reply {
    let finish: Finish = message(&app, request.into_body()).await?;
    app.engine.complete(token(&text)?, &finish).await?;
    Ok(StatusCode::NO_CONTENT.into_response())
}

/// A worker gives the rest of an attempt back.
#[utoipa::path(post, path = "/v1/worker/attempts/{token}/release", operation_id = "workerRelease", tag = "worker",
    params(("token" = String, Path, description = "The attempt's token")),
    request_body(content = String, content_type = FRAME, description = "Finish"),
    responses((status = 204, description = "Noted"),
        (status = 410, description = "Refusal: the attempt is over already", body = String, content_type = FRAME)))]
pub(super) async fn release(State(app): State<App>, InPath(text): InPath<String>, request: Request) -> Reply {
    let finish: Finish = message(&app, request.into_body()).await?;
    app.engine.release(token(&text)?, &finish).await?;
    Ok(StatusCode::NO_CONTENT.into_response())
}
