//! What a request presents: a bearer token, a session's cookie, or nothing; and whether a page of ours sent it.

use axum::http::{HeaderMap, Uri, header, request::Parts, uri::Authority};

/// The name of the session's cookie.
pub(super) const COOKIE: &str = "kiln_session";

/// What a request presents.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Credentials<'a> {
    None,
    Bearer(&'a str),
    Cookie(&'a str),
    /// An Authorization header of another kind.
    Other,
}

/// What these headers present. A bearer token goes before a cookie: it was sent on purpose.
pub(super) fn of(headers: &HeaderMap) -> Credentials<'_> {
    if let Some(value) = headers.get(header::AUTHORIZATION) {
        let parted = value.to_str().ok().and_then(|text| text.split_once(' '));
        return match parted {
            Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => Credentials::Bearer(token.trim()),
            _ => Credentials::Other,
        };
    }
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(';'));
    let session = cookies.filter_map(|pair| pair.trim().split_once('=')).find(|(name, _)| *name == COOKIE);
    session.map_or(Credentials::None, |(_, value)| Credentials::Cookie(value))
}

/// Whether a page of this service sent the request, by the browser's own word; `None` where it says nothing.
///
/// Sec-Fetch-Site is what browsers themselves conclude, but they send it only over TLS and to loopback; elsewhere Origin is compared with
/// the host that was asked.
pub(super) fn same_origin(parts: &Parts) -> Option<bool> {
    if let Some(site) = parts.headers.get("sec-fetch-site") {
        return Some(site == "same-origin");
    }
    let origin = parts.headers.get(header::ORIGIN)?;
    let origin = origin.to_str().ok().and_then(|text| text.parse::<Uri>().ok());
    let asked = parts.uri.authority().map(Authority::as_str).or_else(|| parts.headers.get(header::HOST)?.to_str().ok());
    let origin = origin.as_ref().and_then(Uri::authority).map(Authority::as_str);
    Some(matches!((origin, asked), (Some(origin), Some(asked)) if origin.eq_ignore_ascii_case(asked)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderName, Request};

    fn parts(uri: &str, headers: &[(HeaderName, &str)]) -> Parts {
        let request = headers.iter().fold(Request::post(uri), |request, (name, value)| request.header(name, *value));
        request.body(()).unwrap().into_parts().0
    }

    #[test]
    fn tokens_go_before_cookies_and_other_schemes_are_none() {
        let read = |headers: &[(HeaderName, &str)]| format!("{:?}", of(&parts("/", headers).headers));
        assert_eq!(read(&[]), "None");
        assert_eq!(read(&[(header::COOKIE, "a=b; kiln_session=x.1.2"), (header::AUTHORIZATION, "bearer  t ")]), "Bearer(\"t\")");
        assert_eq!(read(&[(header::COOKIE, "a=b"), (header::COOKIE, "c=d; kiln_session=x.1.2")]), "Cookie(\"x.1.2\")");
        assert_eq!(read(&[(header::COOKIE, "other_kiln_session=x")]), "None");
        assert_eq!(read(&[(header::AUTHORIZATION, "Basic eDp5")]), "Other");
    }

    #[test]
    fn the_browser_s_word_or_its_origin_tells_whose_page_it_was() {
        let site = HeaderName::from_static("sec-fetch-site");
        let (host, origin) = (header::HOST, header::ORIGIN);
        for (uri, headers, expected) in [
            ("/", &[][..], None),
            ("/", &[(site.clone(), "same-origin")], Some(true)),
            ("/", &[(site.clone(), "same-site")], Some(false)),
            ("/", &[(site, "cross-site"), (host.clone(), "a"), (origin.clone(), "http://a")], Some(false)),
            ("/", &[(host.clone(), "a:1"), (origin.clone(), "http://A:1")], Some(true)),
            ("/", &[(host.clone(), "a:1"), (origin.clone(), "http://a:2")], Some(false)),
            ("/", &[(host, "a"), (origin.clone(), "null")], Some(false)),
            ("https://a/", &[(origin.clone(), "https://a")], Some(true)),
            ("/", &[(origin, "https://a")], Some(false)),
        ] {
            assert_eq!(same_origin(&parts(uri, headers)), expected, "{uri} {headers:?}");
        }
    }
}
