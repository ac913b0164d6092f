//! `/v1/jobs/{id}/links`: signed links to single files of a job, for people and programs without a token.
//!
//! A link is the file's own address with `expires` and `signature` behind it. It is valid for reading that one address until then; nothing
//! is stored, so that only the end of its time, or of its job, takes it back. Links to whole folders lost: a signature in the path would
//! give every file of a package two addresses.

use super::{
    App,
    catalogue::Kind,
    extract::{JobInPath, Json as JsonBody},
    gate::Caller,
    jobs,
    problem::{Answer, Failure},
};
use crate::{auth::audit::Action, engine::EngineError, records::UnixMillis};
use axum::{
    Json,
    extract::State,
    http::{Uri, request::Parts},
};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What may stand in a segment of a path as it is (RFC 3986, unreserved).
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
/// How long a link may live: thirty days, in seconds.
const LONGEST_S: u64 = 30 * 86_400;
/// How long it lives where nothing is said: a day.
const USUAL_S: u64 = 86_400;

/// A link to make.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewLink {
    /// What to link to: `bundle.zip` (the default), `bundle.tar.zst`, `preview.png`, `assets`, or `assets/PATH` for a file of the package.
    #[serde(default = "bundle")]
    #[schema(default = "bundle.zip", example = "assets/surfaces/floor.mtsp")]
    pub path: String,
    /// Seconds until it ends, at most 2592000 (thirty days).
    #[serde(default = "usual")]
    #[schema(default = 86400, minimum = 1, maximum = 2_592_000)]
    pub expires_s: u64,
}

fn bundle() -> String {
    "bundle.zip".into()
}

fn usual() -> u64 {
    USUAL_S
}

/// A signed link.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct SignedLink {
    /// The address, relative to this server.
    pub url: String,
    /// When it ends.
    pub expires_ms: UnixMillis,
}

/// Sign a link to a file of a job, which whoever has it may read until it ends.
#[utoipa::path(post, path = "/v1/jobs/{id}/links", operation_id = "createLink", tag = "packages", params(("id" = String, Path, description = "The job's id")),
    request_body = NewLink, responses((status = 200, description = "The link", body = SignedLink)))]
pub(super) async fn create(
    State(app): State<App>,
    caller: Caller,
    JobInPath(job): JobInPath,
    JsonBody(new): JsonBody<NewLink>,
) -> Answer<Json<SignedLink>> {
    let wrong = |detail: String, field: &str| Failure::new(Kind::WrongShape, detail).field(field);
    if !is_linkable(&new.path) {
        let detail = "path: expected bundle.zip, bundle.tar.zst, preview.png, assets, or assets/ and the path of a file";
        return Err(wrong(detail.into(), "path"));
    }
    if !(1..=LONGEST_S).contains(&new.expires_s) {
        return Err(wrong(format!("expires_s: {}; expected 1 to {LONGEST_S}", new.expires_s), "expires_s"));
    }
    app.engine.job(job).await?;
    let escaped: Vec<String> = new.path.split('/').map(|part| utf8_percent_encode(part, ESCAPED).to_string()).collect();
    let path = format!("{}/{}", jobs::location(job), escaped.join("/"));
    let expires_s = app.gate.verifier.now() / 1_000 + new.expires_s as i64;
    let signature = app.gate.verifier.keys().await.map_err(EngineError::Store)?.sign_link(&path, expires_s);
    caller.note(Action::LinkSigned, &path);
    Ok(Json(SignedLink { url: format!("{path}?expires={expires_s}&signature={signature}"), expires_ms: expires_s * 1_000 }))
}

fn is_linkable(path: &str) -> bool {
    let file = path.strip_prefix("assets/").is_some_and(|file| file.split('/').all(|part| !matches!(part, "" | "." | "..")));
    file || matches!(path, "assets" | "bundle.zip" | "bundle.tar.zst" | "preview.png")
}

/// The signed part of a link's query.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Link {
    /// Until when, seconds since 1970.
    pub expires_s: i64,
    /// The signature.
    pub signature: String,
}

/// Takes the signed part out of a request's query, so that handlers, which refuse what they do not know, never meet it.
pub(super) fn take(parts: &mut Parts) -> Option<Link> {
    let (mut expires, mut signature, mut rest) = (None, None, Vec::new());
    for pair in parts.uri.query()?.split('&') {
        match pair.split_once('=') {
            Some(("expires", value)) => expires = value.parse().ok(),
            Some(("signature", value)) => signature = Some(value.to_owned()),
            _ => rest.push(pair),
        }
    }
    let link = Link { expires_s: expires?, signature: signature? };
    let path = parts.uri.path();
    let cleaned = if rest.is_empty() { path.to_owned() } else { format!("{path}?{}", rest.join("&")) };
    let mut uri = parts.uri.clone().into_parts();
    uri.path_and_query = cleaned.parse().ok();
    parts.uri = Uri::from_parts(uri).ok()?;
    Some(link)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::Request;

    #[test]
    fn only_files_of_a_package_are_linked() {
        for good in ["bundle.zip", "bundle.tar.zst", "preview.png", "assets", "assets/manifest.json", "assets/a b/c"] {
            assert!(is_linkable(good), "{good}");
        }
        for bad in ["", "events", "../x", "assets/", "assets/../events", "assets/./x", "/bundle.zip", "bundle.zip/"] {
            assert!(!is_linkable(bad), "{bad}");
        }
    }

    #[test]
    fn the_signed_part_is_taken_out_and_the_rest_stays() {
        let taken = |uri: &str| {
            let mut parts = Request::get(uri).body(()).unwrap().into_parts().0;
            (take(&mut parts), parts.uri.to_string())
        };
        let link = Link { expires_s: 5, signature: "ab".into() };
        assert_eq!(taken("/p?w=3&expires=5&signature=ab&h=4"), (Some(link), "/p?w=3&h=4".into()));
        assert_eq!(taken("/p?expires=5&signature=ab").1, "/p");
        for half in ["/p", "/p?w=3", "/p?expires=5", "/p?signature=ab", "/p?expires=x&signature=ab"] {
            assert_eq!(taken(half), (None, half.into()));
        }
    }
}
