//! A worker's conversation with its coordinator: hello, leases, blobs, and what concerns one attempt.

use super::{
    answer,
    retry::Retry,
    transport::{self, Carrier, Cause, TransportError},
};
use crate::config::Access;
use bytes::Bytes;
use kiln_proto::{
    ids::{Digest, SceneHash, Token},
    wire::{
        frame::{self, FrameError, Message},
        message::{ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Refusal, Welcome},
    },
};
use reqwest::{
    Method, Request, Url,
    header::{CONTENT_TYPE, HeaderValue},
};
use std::{
    sync::{PoisonError, RwLock},
    time::Duration,
};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// Longer than the coordinator holds a long poll.
const CALL_TIMEOUT: Duration = Duration::from_secs(60);
/// The slowest link that is worth waiting for, bytes a second: a chunk may take as long as it takes there.
const SLOWEST_LINK: u64 = 16 << 10;
/// How long the worker asks to be held while there is no work.
const LEASE_WAIT_MS: u64 = 20_000;

/// Why a call did not succeed.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The coordinator said no, and why.
    #[error("the coordinator refused")]
    Refused(#[source] Refusal),
    /// No answer, or one from something that is not a coordinator.
    #[error("the coordinator at {url} cannot be reached")]
    Transport {
        /// The address called.
        url: String,
        /// What went wrong.
        #[source]
        source: Cause,
    },
    /// Nothing came for longer than a coordinator is ever silent.
    #[error("{url} fell silent")]
    Silent {
        /// The address called.
        url: String,
    },
    /// What the user gave makes no client.
    #[error("no connection can be made")]
    Setup(#[from] TransportError),
    /// An answer without a refusal in it.
    #[error("{url} answered {status}{}{detail}", if detail.is_empty() { "" } else { ": " })]
    Status {
        /// The address called.
        url: String,
        /// The HTTP status.
        status: u16,
        /// What the answer says about it; may be empty.
        detail: String,
        /// How long it asks to be left alone.
        retry_after: Option<Duration>,
    },
    /// An answer that cannot be read.
    #[error("the coordinator's answer cannot be read")]
    Frame(#[from] FrameError),
    /// Bytes that are not what their name says.
    #[error("{what} arrived damaged: expected {expected}, found {found}")]
    Damaged {
        /// What was fetched.
        what: &'static str,
        /// The hash asked for.
        expected: String,
        /// The hash of what came.
        found: String,
    },
    /// The worker was told to stop while it waited.
    #[error("stopped while waiting for the coordinator")]
    Stopped,
}

/// A session: who the worker is, and where its coordinator lives.
pub struct Session {
    carrier: Box<dyn Carrier>,
    base: String,
    hello: Hello,
    welcome: RwLock<Welcome>,
    stop: CancellationToken,
}

impl Session {
    /// Says hello, waiting for a coordinator that is not there yet. `stop` ends every wait of this session.
    ///
    /// # Errors
    /// A coordinator of another version or one that refuses the token, an address that cannot be called, or `stop`.
    pub async fn open(base: &str, access: &Access, hello: Hello, stop: CancellationToken) -> Result<Self, CallError> {
        let base = base.trim_end_matches('/').to_owned();
        // Redirections are told, not followed: most turn a POST into a GET on the way.
        let http = transport::builder(&base, access)?.redirect(reqwest::redirect::Policy::none()).build();
        let http = http.map_err(|source| CallError::Transport { url: base.clone(), source: source.into() })?;
        Self::through(Box::new(http), base, hello, stop).await
    }

    /// As [`Session::open`], where something else carries the requests.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub async fn through(carrier: Box<dyn Carrier>, base: String, hello: Hello, stop: CancellationToken) -> Result<Self, CallError> {
        let nobody = Welcome { worker: kiln_proto::ids::WorkerId(Default::default()), heartbeat_ms: 0, chunk_bytes: 0, chunk_ms: 0 };
        let session = Self { carrier, base, hello, welcome: RwLock::new(nobody), stop };
        session.introduce().await?;
        Ok(session)
    }

    /// What the coordinator said at the last hello.
    pub fn welcome(&self) -> Welcome {
        self.welcome.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Asks for work once; `None` when there is none for now. Says hello again when the coordinator has forgotten this worker.
    ///
    /// # Errors
    /// Every [`CallError`]: whether to ask again after one depends on what happened meanwhile to the work in hand.
    pub async fn lease(&self) -> Result<Option<LeaseGrant>, CallError> {
        match self.call(Method::POST, "/v1/worker/leases", self.lease_request()).await {
            Err(CallError::Refused(Refusal::UnknownWorker)) => {
                self.introduce().await?;
                Ok(None)
            }
            other => other,
        }
    }

    /// The canonical bytes of a scene.
    ///
    /// # Errors
    /// Refusals that no waiting will change, or `stop`.
    pub async fn scene(&self, hash: SceneHash) -> Result<Vec<u8>, CallError> {
        self.blob("the scene", &format!("/v1/worker/scenes/{hash}"), &hash.to_string()).await
    }

    /// The bytes of a plan.
    ///
    /// # Errors
    /// See [`Session::scene`].
    pub async fn plan(&self, digest: Digest) -> Result<Vec<u8>, CallError> {
        self.blob("the plan", &format!("/v1/worker/plans/{digest}"), &digest.to_string()).await
    }

    /// Sends one chunk; waits for a coordinator that is away. Repeating a chunk is harmless: (token, number) is its name.
    ///
    /// # Errors
    /// [`Refusal::Gone`] when the attempt may not add to the job any more, and other refusals.
    pub async fn chunk(&self, token: Token, number: u32, body: Bytes) -> Result<ChunkVerdict, CallError> {
        let path = format!("/v1/worker/attempts/{token}/chunks/{number}");
        self.retrying(|| async {
            let reply: Option<ChunkVerdict> = self.send(Method::PUT, &path, body.clone()).await?;
            reply.ok_or_else(|| answer::nothing(&path))
        })
        .await
    }

    /// Tells the coordinator that this attempt lives. One try: the next heartbeat comes soon enough.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn heartbeat(&self, token: Token, beat: Heartbeat) -> Result<HeartbeatReply, CallError> {
        let path = format!("/v1/worker/attempts/{token}/heartbeat");
        let reply: Option<HeartbeatReply> = self.call(Method::POST, &path, beat).await?;
        Ok(reply.unwrap_or(HeartbeatReply::Continue))
    }

    /// Ends an attempt: everything done.
    ///
    /// # Errors
    /// See [`Session::scene`].
    pub async fn complete(&self, token: Token, finish: Finish) -> Result<(), CallError> {
        self.finish(format!("/v1/worker/attempts/{token}/complete"), finish).await
    }

    /// Ends an attempt: the rest goes back.
    ///
    /// # Errors
    /// See [`Session::scene`].
    pub async fn release(&self, token: Token, finish: Finish) -> Result<(), CallError> {
        self.finish(format!("/v1/worker/attempts/{token}/release"), finish).await
    }

    async fn finish(&self, path: String, finish: Finish) -> Result<(), CallError> {
        self.retrying(|| async {
            let _: Option<HeartbeatReply> = self.call(Method::POST, &path, finish.clone()).await?;
            Ok(())
        })
        .await
    }

    fn lease_request(&self) -> LeaseRequest {
        LeaseRequest { worker: self.welcome().worker, wait_ms: LEASE_WAIT_MS }
    }

    async fn introduce(&self) -> Result<(), CallError> {
        let welcome: Welcome = self
            .retrying(|| async {
                let reply = self.call(Method::POST, "/v1/worker/hello", self.hello.clone()).await?;
                reply.ok_or_else(|| answer::nothing(&self.base))
            })
            .await?;
        *self.welcome.write().unwrap_or_else(PoisonError::into_inner) = welcome;
        Ok(())
    }

    async fn blob(&self, what: &'static str, path: &str, expected: &str) -> Result<Vec<u8>, CallError> {
        self.retrying(|| async {
            let url = format!("{}{path}", self.base);
            let silent = |_| CallError::Silent { url: url.clone() };
            let asked = self.carrier.carry(self.request(Method::GET, &url)?);
            let mut response = timeout(CALL_TIMEOUT, asked).await.map_err(silent)?.map_err(|source| answer::failed(&url, source))?;
            let (status, headers) = (response.status(), response.headers().clone());
            // However large a scene is, it may come as slowly as it likes as long as it comes.
            let mut body = Vec::new();
            while let Some(piece) = timeout(CALL_TIMEOUT, response.chunk()).await.map_err(silent)?.map_err(|e| answer::failed(&url, e))? {
                body.extend_from_slice(&piece);
            }
            if !status.is_success() {
                return Err(answer::failure(&url, status.as_u16(), &headers, &body));
            }
            let plain = answer::unpack(&body).map_err(FrameError::Decompress)?;
            let found = Digest::of(&plain).to_string();
            if found == expected { Ok(plain) } else { Err(CallError::Damaged { what, expected: expected.to_owned(), found }) }
        })
        .await
    }

    async fn call<Q: Message, R: Message>(&self, method: Method, path: &str, message: Q) -> Result<Option<R>, CallError> {
        self.send(method, path, Bytes::from(frame::to_frame(&message)?)).await
    }

    async fn send<R: Message>(&self, method: Method, path: &str, body: Bytes) -> Result<Option<R>, CallError> {
        let url = format!("{}{path}", self.base);
        let mut request = self.request(method, &url)?;
        *request.timeout_mut() = Some(CALL_TIMEOUT + Duration::from_secs(body.len() as u64 / SLOWEST_LINK));
        request.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/octet-stream"));
        *request.body_mut() = Some(body.into());
        let response = self.carrier.carry(request).await.map_err(|source| answer::failed(&url, source))?;
        let (status, headers) = (response.status().as_u16(), response.headers().clone());
        let body = response.bytes().await.map_err(|source| answer::failed(&url, source))?;
        match status {
            204 => Ok(None),
            200..=299 if body.is_empty() => Ok(None),
            200..=299 => Ok(Some(frame::from_frame(&body)?)),
            _ => Err(answer::failure(&url, status, &headers, &body)),
        }
    }

    fn request(&self, method: Method, url: &str) -> Result<Request, CallError> {
        let parsed = Url::parse(url).map_err(|_| TransportError::Address(self.base.clone()))?;
        Ok(Request::new(method, parsed))
    }

    /// The waits and words of a series of tries.
    pub(crate) fn retry(&self) -> Retry {
        Retry::new(self.hello.name.bytes().fold(0x9e37_79b9, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3)))
    }

    /// The coordinator's address.
    pub(crate) fn server(&self) -> &str {
        &self.base
    }

    /// Repeats a call while it fails for reasons that pass.
    async fn retrying<T, F: Future<Output = Result<T, CallError>>>(&self, call: impl Fn() -> F) -> Result<T, CallError> {
        let mut retry = self.retry();
        loop {
            let outcome = tokio::select! {
                outcome = call() => outcome,
                () = self.stop.cancelled() => return Err(CallError::Stopped),
            };
            let wait = match outcome {
                Err(error) if error.passes() => retry.after(&self.base, &error),
                other => {
                    retry.succeeded(&self.base);
                    return other;
                }
            };
            tokio::select! {
                () = tokio::time::sleep(wait) => {}
                () = self.stop.cancelled() => return Err(CallError::Stopped),
            }
        }
    }
}
