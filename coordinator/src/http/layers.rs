//! What surrounds every handler: a request id and a trace span, figures, security headers, the check of Host and Origin, and the net that
//! catches panics.

use super::{App, catalogue::Kind, problem::Failure};
use axum::{
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Uri, header, uri::Authority},
    middleware::Next,
    response::{IntoResponse, Response},
};
use kiln_proto::chain;
use std::{any::Any, net::IpAddr, time::Instant};
use tracing::Instrument;
use uuid::Uuid;

/// Which names requests may use for this server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostPolicy {
    /// Only loopback names, and no foreign web pages: whoever can reach a loopback port without tokens may do anything, and a browser
    /// reaches it for any page that resolves its own name to 127.0.0.1 (DNS rebinding).
    Loopback,
    /// Any: the operator has opened the service to a network.
    Any,
}

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Headers that every response carries, unless it brings its own. Nothing here is ever framed, sniffed or allowed to load anything.
const SECURITY: [(HeaderName, HeaderValue); 5] = [
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
    ),
    (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    (header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY")),
    (HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin")),
];

/// What the page may load: its own files, and pictures that it draws itself. No script or style may stand within HTML.
pub(super) const PAGE_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; worker-src 'self'; \
     font-src 'self'; base-uri 'self'; frame-ancestors 'none'; form-action 'none'",
);

/// The outermost layer: id, span, figures, headers.
pub(super) async fn observe(State(app): State<App>, request: Request, next: Next) -> Response {
    let began = Instant::now();
    let id = Uuid::now_v7();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().map_or_else(|| "unmatched".to_owned(), |path| path.as_str().to_owned());
    let span = tracing::info_span!("request", %id, %method, route, otel.kind = "server", status = tracing::field::Empty);
    let mut response = async {
        let response = next.run(request).await;
        tracing::Span::current().record("status", response.status().as_u16());
        tracing::debug!(status = response.status().as_u16(), micros = began.elapsed().as_micros(), "answered");
        response
    }
    .instrument(span)
    .await;
    app.metrics.request(&route, &method, response.status(), began.elapsed());
    let headers = response.headers_mut();
    secure(headers);
    if let Ok(id) = HeaderValue::try_from(id.to_string()) {
        headers.insert(REQUEST_ID, id);
    }
    response
}

/// Adds what keeps a response safe where it says nothing itself.
pub(super) fn secure(headers: &mut HeaderMap) {
    for (name, value) in SECURITY {
        headers.entry(name).or_insert(value);
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
}

/// Refuses foreign names and foreign pages.
pub(super) async fn guard(State(hosts): State<HostPolicy>, request: Request, next: Next) -> Response {
    match admit(hosts, request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(failure) => failure.into_response(),
    }
}

pub(super) fn admit(policy: HostPolicy, uri: &Uri, headers: &HeaderMap) -> Result<(), Failure> {
    if policy == HostPolicy::Any {
        return Ok(());
    }
    // HTTP/2 carries the name in the URI. A request without any cannot come from a browser.
    for host in
        uri.authority().map(Authority::as_str).into_iter().map(Some).chain(headers.get_all(header::HOST).iter().map(|h| h.to_str().ok()))
    {
        if !host.is_some_and(is_loopback) {
            let shown = host.unwrap_or("unreadable").escape_debug().to_string();
            return Err(Failure::new(Kind::ForeignHost, format!("the request is for the host `{shown}`, which is not a loopback name")));
        }
    }
    for origin in headers.get_all(header::ORIGIN) {
        let origin = origin.to_str().unwrap_or("unreadable");
        let own = origin.parse::<Uri>().is_ok_and(|uri| uri.authority().is_some_and(|authority| is_loopback(authority.as_str())));
        if !own {
            let detail = format!("the request comes from a page of `{}`", origin.escape_debug());
            return Err(Failure::new(Kind::ForeignOrigin, detail));
        }
    }
    Ok(())
}

/// Whether `host`, with or without a port, is a loopback name.
fn is_loopback(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else {
        return false;
    };
    let name = authority.host();
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    !authority.as_str().contains('@') && (name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback()))
}

/// A handler has panicked: a fault of ours, logged, that must not cost anyone else their answer.
#[allow(clippy::needless_pass_by_value)] // The shape that the layer calls.
pub(super) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let words = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let failure = Failure::internal(format!("a handler panicked: {}", words.unwrap_or("without words")));
    tracing::error!(error = chain(&failure), "panic");
    failure.into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(uri: &str, headers: &[(HeaderName, &str)]) -> Option<Kind> {
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        admit(HostPolicy::Loopback, &uri.parse().unwrap(), &headers).err().map(|failure| failure.kind())
    }

    #[test]
    fn loopback_names_are_admitted_and_no_others() {
        for host in ["localhost", "LOCALHOST:80", "127.0.0.1:8080", "127.8.9.1", "[::1]:1", "[::1]"] {
            assert_eq!(kind("/", &[(header::HOST, host)]), None, "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example:8080", "10.0.0.1", "user@localhost", "", "[::2]", "a b"]
        {
            assert_eq!(kind("/", &[(header::HOST, host)]), Some(Kind::ForeignHost), "{host}");
        }
        assert_eq!(kind("http://evil.example/", &[]), Some(Kind::ForeignHost));
        let mut twice = HeaderMap::new();
        twice.append(header::HOST, HeaderValue::from_static("localhost"));
        twice.append(header::HOST, HeaderValue::from_static("evil.example"));
        assert!(admit(HostPolicy::Loopback, &"/".parse().unwrap(), &twice).is_err());
    }

    #[test]
    fn foreign_pages_are_refused() {
        let from = |origin| kind("/", &[(header::HOST, "localhost"), (header::ORIGIN, origin)]);
        assert_eq!(from("http://localhost:5173"), None);
        assert_eq!(from("http://[::1]:8080"), None);
        for origin in ["https://evil.example", "null", "http://localhost@evil.example", "file://"] {
            assert_eq!(from(origin), Some(Kind::ForeignOrigin), "{origin}");
        }
    }

    #[test]
    fn an_opened_service_takes_any_name() {
        let headers = [(header::HOST, "bake.example".parse().unwrap())].into_iter().collect();
        assert!(admit(HostPolicy::Any, &"/".parse().unwrap(), &headers).is_ok());
    }
}
