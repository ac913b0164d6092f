//! Answers that are not the one asked for: refusals in frames, problems in JSON, and what proxies say.

use super::{session::CallError, transport::Cause};
use kiln_proto::{
    limits,
    wire::{frame, message::Refusal},
};
use reqwest::header::{HeaderMap, LOCATION, RETRY_AFTER};
use std::time::Duration;

/// Characters of somebody else's words that are worth repeating.
const DETAIL_CHARS: usize = 300;

/// The error that an unsuccessful answer is.
pub(super) fn failure(url: &str, status: u16, headers: &HeaderMap, body: &[u8]) -> CallError {
    let refusal = frame::from_frame::<Refusal>(body).ok();
    match refusal {
        // Access is no matter of the message, whatever the body says: what was refused is good and keeps for a better token.
        Some(refusal) if !matches!(status, 401 | 403) => CallError::Refused(refusal),
        refusal => {
            let detail = refusal.map(|r| r.to_string()).or_else(|| problem(body)).or_else(|| moved(headers));
            CallError::Status { url: url.to_owned(), status, detail: detail.unwrap_or_default(), retry_after: retry_after(headers) }
        }
    }
}

/// The `detail` of a problem in JSON (RFC 9457), as a clause.
fn problem(body: &[u8]) -> Option<String> {
    let json: serde_json::Value = serde_json::from_slice(body).ok()?;
    let detail: String = json.get("detail")?.as_str()?.chars().filter(|c| !c.is_control()).take(DETAIL_CHARS).collect();
    Some(detail)
}

/// Where a redirection points. It is not followed: most turn the call into another one on the way.
fn moved(headers: &HeaderMap) -> Option<String> {
    let to = headers.get(LOCATION)?.to_str().ok()?;
    Some(format!("moved to {}", to.chars().filter(|c| !c.is_control()).take(DETAIL_CHARS).collect::<String>()))
}

/// Seconds of a `Retry-After` header. Its other form, a date, is rare and would need clocks that agree: such an answer is met with the
/// usual waits.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let seconds: u64 = headers.get(RETRY_AFTER)?.to_str().ok()?.trim().parse().ok()?;
    Some(Duration::from_secs(seconds))
}

/// No answer at all.
pub(super) fn failed(url: &str, source: impl Into<Cause>) -> CallError {
    CallError::Transport { url: url.to_owned(), source: source.into() }
}

/// Success without the answer that belongs to it.
pub(super) fn nothing(url: &str) -> CallError {
    CallError::Status { url: url.to_owned(), status: 204, detail: String::new(), retry_after: None }
}

/// The bytes of a blob.
pub(super) fn unpack(packed: &[u8]) -> std::io::Result<Vec<u8>> {
    use std::io::Read;
    let mut plain = Vec::new();
    let mut reader = zstd::stream::read::Decoder::new(packed)?.take(limits::SCENE_BYTES as u64 + 1);
    reader.read_to_end(&mut plain)?;
    if plain.len() > limits::SCENE_BYTES {
        return Err(std::io::Error::other("larger than any scene may be"));
    }
    Ok(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(reqwest::header::HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    #[test]
    fn a_frame_is_a_refusal_but_not_where_access_is_denied() {
        let body = frame::to_frame(&Refusal::Invalid { reason: "no such token".into() }).unwrap();
        assert!(matches!(failure("u", 422, &HeaderMap::new(), &body), CallError::Refused(Refusal::Invalid { .. })));
        let denied = failure("u", 401, &HeaderMap::new(), &body);
        assert!(matches!(&denied, CallError::Status { status: 401, detail, .. } if detail == "no such token"), "{denied:?}");
    }

    #[test]
    fn what_proxies_and_problems_say_is_kept() {
        let busy = failure("u", 503, &headers(&[(RETRY_AFTER, " 7 ")]), b"<html>");
        assert!(matches!(busy, CallError::Status { retry_after: Some(d), .. } if d == Duration::from_secs(7)));
        let dated = failure("u", 503, &headers(&[(RETRY_AFTER, "Wed, 21 Oct 2026 07:28:00 GMT")]), b"");
        assert!(matches!(dated, CallError::Status { retry_after: None, .. }));
        let problem = failure("u", 421, &HeaderMap::new(), br#"{"detail": "not a\n loopback name"}"#);
        assert!(problem.to_string().ends_with("u answered 421: not a loopback name"), "{problem}");
        let moved = failure("u", 301, &headers(&[(LOCATION, "https://elsewhere/")]), b"");
        assert!(moved.to_string().contains("moved to https://elsewhere/"), "{moved}");
        assert!(failure("u", 404, &HeaderMap::new(), b"").to_string().ends_with("u answered 404"));
    }
}
