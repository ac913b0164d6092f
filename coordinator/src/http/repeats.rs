//! `Idempotency-Key`: a request that is sent again is performed once, and answered as it was the first time.
//!
//! After draft-ietf-httpapi-idempotency-key-header-07. Keys are taken as they stand, with quotation marks or without. A key belongs to the
//! token that sends it, and to one request: method, path, query and body, of which the store keeps a hash. It is claimed when the body has
//! arrived whole and is well-formed, so that a cut upload takes no key. Whoever holds the claim performs the request to its end, also when
//! the client goes away, because what comes next is the same request again. Answers of 500 and above are not remembered: they say that the
//! same may succeed later.

use super::{
    catalogue::Kind,
    gate::Caller,
    problem::{Answer, Failure},
};
use crate::{
    engine::{Engine, EngineError},
    store::{Claimed, KeptAnswer, NewRequest, StoreError},
};
use axum::{
    body::Body,
    extract::FromRequestParts,
    http::{HeaderName, HeaderValue, StatusCode, request::Parts},
    response::{IntoResponse, Response},
};
use kiln_proto::ids::{Digest, Token};
use std::{sync::Arc, time::Duration};
use tracing::Instrument;
use uuid::Uuid;

/// The header with the key.
const KEY: HeaderName = HeaderName::from_static("idempotency-key");
/// The header that tells an answer which is given again.
const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");
/// Bytes of a key.
const KEY_BYTES: usize = 255;
/// Bytes of an answer: records of a scene with thousands of findings fit.
const ANSWER_BYTES: usize = 64 << 20;
/// A claim is free again this long after it was renewed last, milliseconds: what a crash costs whoever repeats the request.
const TTL: i64 = 30_000;
/// It is renewed this often.
const RENEW: Duration = Duration::from_secs(10);
/// Seconds after which a request that is under way may be repeated.
const RETRY: u64 = 1;

/// What a request says of being repeated, and the part of it that is known before its body.
#[derive(Debug)]
pub(super) struct Repeatable {
    key: Option<String>,
    /// Method, path and query.
    call: String,
}

impl<S: Send + Sync> FromRequestParts<S> for Repeatable {
    type Rejection = Failure;
    async fn from_request_parts(parts: &mut Parts, _: &S) -> Answer<Self> {
        let mut found = parts.headers.get_all(KEY).iter();
        let key = found.next().map(key).transpose()?;
        if found.next().is_some() {
            return Err(bad_key("comes more than once"));
        }
        Ok(Self { key, call: format!("{} {}", parts.method, parts.uri.path_and_query().map_or("/", |path| path.as_str())) })
    }
}

fn key(value: &HeaderValue) -> Answer<String> {
    match value.to_str() {
        Ok("") => Err(bad_key("is empty")),
        Ok(text) if text.len() > KEY_BYTES => Err(bad_key(&format!("has {} bytes; at most {KEY_BYTES} are allowed", text.len()))),
        Ok(text) => Ok(text.to_owned()),
        Err(_) => Err(bad_key("holds something else than printable ASCII")),
    }
}

fn bad_key(why: &str) -> Failure {
    Failure::new(Kind::InvalidRequest, format!("the header Idempotency-Key {why}; a fresh UUID makes a good key")).field("Idempotency-Key")
}

fn store_failed(error: StoreError) -> Failure {
    EngineError::Store(error).into()
}

impl Repeatable {
    /// Performs a request whose body hashes to `contents`, or answers as the first of its kind was answered. `work` gets the id of what it
    /// creates: the same again where a crash cut the first try off.
    ///
    /// # Errors
    /// What `work` answers; a key that another request has, or whose request is under way.
    pub(super) async fn once<F>(
        self,
        engine: &Arc<Engine>,
        caller: &Caller,
        contents: Digest,
        work: impl FnOnce(Uuid) -> F,
    ) -> Answer<Response>
    where
        F: Future<Output = Answer<Response>> + Send + 'static,
    {
        let Some(key) = self.key else { return work(Uuid::now_v7()).await };
        let (now, claim) = (engine.now(), Token::random());
        let print = Digest::of(format!("{}\n{contents}", self.call).as_bytes());
        let owner = caller.principal.owner();
        let request = NewRequest { owner, key, print, subject: Uuid::now_v7(), claim, deadline: now + TTL };
        let subject = match engine.requests().claim_request(&request, now).await.map_err(store_failed)? {
            Claimed::Granted(subject) => subject,
            Claimed::Answered(answer) => return replay(answer),
            Claimed::Running => {
                return Err(Failure::new(Kind::KeyInUse, "the first request with this key is not answered yet").retry_after(RETRY));
            }
            Claimed::Other => {
                return Err(Failure::new(Kind::KeyReused, "this key came before, with another request").field("Idempotency-Key"));
            }
        };
        let performed = tokio::spawn(perform(Arc::clone(engine), claim, work(subject)).in_current_span());
        match performed.await {
            Ok(response) => Ok(response),
            Err(panicked) => {
                let _ = engine.requests().release_request(claim).await;
                Err(Failure::internal(panicked))
            }
        }
    }
}

/// Sees the request through and keeps its answer.
async fn perform(engine: Arc<Engine>, claim: Token, work: impl Future<Output = Answer<Response>>) -> Response {
    let response = renewed(&engine, claim, work).await.unwrap_or_else(IntoResponse::into_response);
    if response.status().is_server_error() {
        kept(engine.requests().release_request(claim).await);
        return response;
    }
    let (head, body) = response.into_parts();
    let body = match axum::body::to_bytes(body, ANSWER_BYTES).await {
        Ok(body) => body,
        Err(error) => return Failure::internal(error).into_response(),
    };
    let headers = head.headers.iter().filter_map(|(name, value)| Some((name.as_str().to_owned(), value.to_str().ok()?.to_owned())));
    let answer = KeptAnswer { status: head.status.as_u16(), headers: headers.collect(), body: String::from_utf8_lossy(&body).into_owned() };
    kept(engine.requests().answer_request(claim, &answer).await);
    Response::from_parts(head, Body::from(body))
}

/// What was done is done, whether that could be recorded or not: a repetition finds what was created by its id.
fn kept(recorded: Result<bool, StoreError>) {
    match recorded {
        Ok(true) => {}
        Ok(false) => tracing::warn!("a request took too long: its key was free again before it was answered"),
        Err(error) => tracing::error!(%error, "the answer to a request with a key could not be kept"),
    }
}

/// Runs work while renewing its claim.
async fn renewed<T>(engine: &Engine, claim: Token, work: impl Future<Output = T>) -> T {
    tokio::pin!(work);
    let mut tick = tokio::time::interval(RENEW);
    tick.tick().await;
    loop {
        tokio::select! {
            done = &mut work => return done,
            _ = tick.tick() => if let Err(error) = engine.requests().renew_request(claim, engine.now() + TTL).await {
                tracing::error!(%error, "renewing the claim of a request failed");
            },
        }
    }
}

fn replay(answer: KeptAnswer) -> Answer<Response> {
    let status = StatusCode::from_u16(answer.status).map_err(Failure::internal)?;
    let mut response = (status, answer.body).into_response();
    for (name, value) in answer.headers {
        let name = HeaderName::try_from(name).map_err(Failure::internal)?;
        response.headers_mut().insert(name, HeaderValue::try_from(value).map_err(Failure::internal)?);
    }
    response.headers_mut().insert(REPLAYED, HeaderValue::from_static("true"));
    Ok(response)
}
