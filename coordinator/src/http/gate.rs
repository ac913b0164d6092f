//! The gate: the one place that decides, for every request, who calls and whether that caller may.
//!
//! Without any token in the store the service is open to whoever reaches it, which on loopback is the person at this machine: Host and
//! Origin are checked then, because a browser reaches loopback for any page. From the first token on, or with `access.require_tokens`,
//! every request needs one, a session or a signed link, except for what the table of routes calls public.
//!
//! A job that a caller may not see does not exist for that caller. This is decided here and not in handlers: the routes of a job are many,
//! and one that forgot to ask would give it away.

use super::{
    App,
    catalogue::Kind,
    credentials::{self, Credentials},
    extract::JobInPath,
    layers::{self, HostPolicy},
    links,
    peer::Peer,
    problem::{Answer, Failure},
    routes::{Routes, Verb},
};
use crate::{
    auth::{
        Access, Buckets, Invalid, Known, Presented, Principal, Rate, Role, Scope, Session, TokenId, Verdict, Verifier,
        audit::{self, Action},
        decide, same,
    },
    engine::{Engine, EngineError},
    store::StoreError,
};
use axum::{
    extract::{ConnectInfo, FromRequestParts, MatchedPath, Request, State},
    http::{HeaderValue, Method, header, request::Parts},
    middleware::Next,
    response::{IntoResponse, Response},
};
use kiln_proto::ids::Digest;
use std::{
    collections::HashMap,
    fmt,
    net::{IpAddr, Ipv6Addr},
    sync::{Mutex, MutexGuard, PoisonError},
};

/// How often an address may present what gives no access before it has to wait: a mistyped token is forgiven, a search is not.
const FAILURES: Rate = Rate { per_s: 0.2, burst: 20.0 };

/// Who calls, for handlers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Caller {
    /// Who.
    pub principal: Principal,
    /// From where; behind a proxy, the proxy's address.
    pub from: Option<IpAddr>,
}

impl Caller {
    /// Writes what this caller did into the audit log.
    pub(super) fn note(&self, action: Action, subject: &dyn fmt::Display) {
        audit::note(action, &self.principal, self.from, subject);
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Failure;
    async fn from_request_parts(parts: &mut Parts, _: &S) -> Answer<Self> {
        parts.extensions.get::<Caller>().copied().ok_or_else(|| Failure::internal("a request came past the gate"))
    }
}

/// What the gate knows and remembers.
pub(super) struct Gate {
    pub(super) verifier: Verifier,
    hosts: HostPolicy,
    require_tokens: bool,
    /// Hash of the secret of the workers that the service started itself.
    own_worker: Option<Digest>,
    table: HashMap<(Verb, &'static str), Access>,
    requests: Mutex<Buckets<TokenId>>,
    failures: Mutex<Buckets<Option<IpAddr>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing behind these locks can be left half done by a panic.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn store_failed(error: StoreError) -> Failure {
    EngineError::Store(error).into()
}

impl Gate {
    pub(super) fn new(engine: &Engine, hosts: HostPolicy, own_worker: Option<Digest>) -> Self {
        let access = &engine.config().access;
        let rate = Rate { per_s: f64::from(access.requests_per_s), burst: f64::from(access.burst) };
        Self {
            verifier: Verifier::new(engine.tokens(), engine.clock()),
            hosts,
            require_tokens: access.require_tokens,
            own_worker,
            table: Routes::all().list.iter().map(|route| ((route.verb, route.path), route.access)).collect(),
            requests: Mutex::new(Buckets::new(rate)),
            failures: Mutex::new(Buckets::new(FAILURES)),
        }
    }

    /// Who calls, if that caller may.
    async fn admit(&self, engine: &Engine, parts: &mut Parts) -> Answer<Caller> {
        let from = parts.extensions.get::<ConnectInfo<Peer>>().map(|peer| peer.0.address.ip());
        let access = self.access(parts);
        let link = if access == Some(Access::Package) { links::take(parts) } else { None };
        if !self.require_tokens && !self.verifier.is_closed().await.map_err(store_failed)? {
            layers::admit(self.hosts, &parts.uri, &parts.headers)?;
            return Ok(Caller { principal: Principal::Local, from });
        }
        let principal = match link {
            _ if access == Some(Access::Public) => self.passer_by(parts)?,
            Some(link) if self.is_signed(&link, parts).await? => Principal::Link,
            _ => self.identify(parts, from).await?,
        };
        let caller = Caller { principal, from };
        // Before the verdict: what is refused is written to the audit log, which nobody should fill.
        self.slow_down(access, &principal)?;
        match decide(access, &principal) {
            Verdict::Allow => {}
            Verdict::Authenticate => return Err(unauthenticated("this service asks for an access token")),
            Verdict::Forbid => {
                caller.note(Action::Forbidden, &format_args!("{} {}", parts.method, parts.uri.path()));
                return Err(Failure::new(Kind::Forbidden, needed(access)));
            }
        }
        self.own_job(engine, parts, access, &principal).await?;
        Ok(caller)
    }

    /// Whether a caller that was admitted still would be, for streams: its token was not revoked and has not expired meanwhile.
    pub(super) async fn still_admits(&self, caller: &Caller) -> Result<bool, StoreError> {
        match caller.principal {
            Principal::Token { id, .. } => self.verifier.is_live(id).await,
            _ => Ok(true),
        }
    }

    /// What the table says of the route that matched; nothing where none did.
    fn access(&self, parts: &Parts) -> Option<Access> {
        let verb = Verb::of(&parts.method)?;
        let path = parts.extensions.get::<MatchedPath>()?;
        self.table.get(&(verb, path.as_str())).copied()
    }

    /// Someone at a public route. Who logs in or out must not be sent by a foreign page.
    fn passer_by(&self, parts: &Parts) -> Answer<Principal> {
        if !parts.method.is_safe() && credentials::same_origin(parts) == Some(false) {
            return Err(Failure::new(Kind::ForeignOrigin, "the request was sent by a page of another origin"));
        }
        Ok(Principal::Anonymous)
    }

    async fn is_signed(&self, link: &links::Link, parts: &Parts) -> Answer<bool> {
        let reads = matches!(parts.method, Method::GET | Method::HEAD);
        let keys = self.verifier.keys().await.map_err(store_failed)?;
        Ok(reads && keys.is_signed(parts.uri.path(), link.expires_s, &link.signature, self.verifier.now() / 1_000))
    }

    async fn identify(&self, parts: &Parts, from: Option<IpAddr>) -> Answer<Principal> {
        match credentials::of(&parts.headers) {
            Credentials::None => Ok(Principal::Anonymous),
            Credentials::Bearer(text) if self.is_own_worker(text) => Ok(Principal::OwnWorker),
            Credentials::Bearer(text) => Ok(self.token(text, from).await?.principal()),
            Credentials::Other => Err(self.deny(Invalid::Malformed, None, from)),
            Credentials::Cookie(text) => {
                let known = self.session(text, from).await?;
                // A cookie travels with whatever a browser is made to send.
                if !parts.method.is_safe() && credentials::same_origin(parts) != Some(true) {
                    let detail = "a session changes things only from a page of this service; programs send a token";
                    return Err(Failure::new(Kind::ForeignOrigin, detail));
                }
                Ok(known.principal())
            }
        }
    }

    fn is_own_worker(&self, text: &str) -> bool {
        self.own_worker.is_some_and(|own| same(own, Digest::of(text.as_bytes())))
    }

    /// The holder of a token, for headers and for logging in.
    ///
    /// # Errors
    /// A token that gives no access, or an address that has presented too many such.
    pub(super) async fn token(&self, text: &str, from: Option<IpAddr>) -> Answer<Known> {
        let Some(presented) = Presented::parse(text) else {
            self.patience(from)?;
            return Err(self.deny(Invalid::Malformed, None, from));
        };
        if !self.verifier.remembers(&presented) {
            self.patience(from)?;
        }
        let known = self.verifier.token(&presented).await.map_err(store_failed)?;
        known.map_err(|why| self.deny(why, Some(presented.id), from))
    }

    async fn session(&self, text: &str, from: Option<IpAddr>) -> Answer<Known> {
        let Ok(session) = text.parse::<Session>() else { return Err(self.deny(Invalid::Malformed, None, from)) };
        let known = self.verifier.session(&session).await.map_err(store_failed)?;
        // A session that is over is no attack: pages that stay open overnight present them every two seconds.
        known.map_err(|why| unauthenticated(&format!("the session is over: {why}")))
    }

    /// Refuses what gives no access, and remembers the address that presented it.
    fn deny(&self, why: Invalid, id: Option<TokenId>, from: Option<IpAddr>) -> Failure {
        // The answer is the same whether this was the last drop; the next question is not asked.
        let _ = lock(&self.failures).take(from.map(network), self.verifier.now());
        let who = id.map_or_else(|| "a token".to_owned(), |id| format!("the token {id}"));
        audit::note(Action::Denied, &Principal::Anonymous, from, &format_args!("{who}: {why}"));
        let challenge = HeaderValue::from_static("Bearer realm=\"kiln\", error=\"invalid_token\"");
        Failure::new(Kind::Unauthenticated, format!("the access token is not accepted: {why}")).header(header::WWW_AUTHENTICATE, challenge)
    }

    fn patience(&self, from: Option<IpAddr>) -> Answer<()> {
        lock(&self.failures).look(&from.map(network), self.verifier.now()).map_err(|seconds| {
            Failure::new(Kind::TooManyRequests, "too many tokens that are not accepted came from this address").retry_after(seconds)
        })
    }

    /// Limits how often one token asks. The worker protocol has limits of its own, and a farm needs all it can get.
    fn slow_down(&self, access: Option<Access>, principal: &Principal) -> Answer<()> {
        match principal {
            Principal::Token { id, roles } if access != Some(Access::Work) || !roles.has(Role::Worker) => lock(&self.requests)
                .take(*id, self.verifier.now())
                .map_err(|seconds| Failure::new(Kind::TooManyRequests, format!("the token {id} asks too often")).retry_after(seconds)),
            _ => Ok(()),
        }
    }

    /// Hides the job in the path from those who may not see it.
    async fn own_job(&self, engine: &Engine, parts: &mut Parts, access: Option<Access>, principal: &Principal) -> Answer<()> {
        let Some(scope) = access.and_then(|access| access.jobs(principal)).filter(|scope| *scope != Scope::All) else { return Ok(()) };
        // The very extractor of the handlers: what is no id for it is none for them.
        let Ok(JobInPath(job)) = JobInPath::from_request_parts(parts, &()).await else { return Ok(()) };
        match engine.tokens().job_owner(job).await.map_err(store_failed)? {
            Some(owner) if scope.covers(owner) => Ok(()),
            _ => Err(EngineError::NotFound { what: "job", id: job.to_string() }.into()),
        }
    }
}

/// An address as far as failures are counted: an IPv6 customer has a whole /64.
fn network(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V4(_) => address,
        IpAddr::V6(v6) => IpAddr::V6(Ipv6Addr::from_bits(v6.to_bits() >> 64 << 64)),
    }
}

fn unauthenticated(detail: &str) -> Failure {
    Failure::new(Kind::Unauthenticated, detail).header(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"kiln\""))
}

fn needed(access: Option<Access>) -> String {
    let roles: Vec<&str> = access.into_iter().flat_map(|access| access.roles().iter()).map(|role| role.name()).collect();
    format!("this call needs a token with the role {}", roles.join(" or "))
}

/// The layer.
pub(super) async fn pass(State(app): State<App>, request: Request, next: Next) -> Response {
    let (mut parts, body) = request.into_parts();
    match app.gate.admit(&app.engine, &mut parts).await {
        Ok(caller) => {
            parts.extensions.insert(caller);
            next.run(Request::from_parts(parts, body)).await
        }
        Err(failure) => failure.into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ipv6_addresses_count_by_network() {
        let net = |text: &str| network(text.parse().unwrap());
        assert_eq!(net("2001:db8:1:2:3::4"), net("2001:db8:1:2:ffff::1"));
        assert_ne!(net("2001:db8:1:2:3::4"), net("2001:db8:1:3::4"));
        assert_ne!(net("10.0.0.1"), net("10.0.0.2"));
    }
}
