//! Conditional and partial requests (RFC 9110, sections 13 and 14), decided from headers alone.
//!
//! The order of section 13.2.2: If-Match, then If-None-Match, then Range under If-Range. Entity tags are strong: the SHA-256 of the file,
//! so that a download resumes safely over a restart, a move to another machine or a second bake of the same scene. One range is served; a
//! request for several gets the whole file, which the standard allows and which keeps multipart/byteranges, and its abuse, out of here.

use axum::http::{HeaderMap, header};
use std::ops::Range;

/// What to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Decision {
    /// 200: all of it.
    Whole,
    /// 206: these bytes.
    Part(Range<u64>),
    /// 304: the client has it.
    NotModified,
    /// 412: the client expects another file.
    PreconditionFailed,
    /// 416: no such bytes.
    NotSatisfiable,
}

/// A strong entity tag for a file of the given digest.
#[must_use]
pub(super) fn strong_etag(digest: &str) -> String {
    format!("\"{digest}\"")
}

/// Decides for a GET or HEAD of a file of `length` bytes with the entity tag `etag` (with its quotes).
#[must_use]
pub(super) fn decide(headers: &HeaderMap, etag: &str, length: u64) -> Decision {
    let text = |name| headers.get(name).map(|value: &axum::http::HeaderValue| value.to_str().unwrap_or_default());
    if let Some(wanted) = text(header::IF_MATCH)
        && !tags(wanted).any(|tag| tag == "*" || tag == etag)
    {
        return Decision::PreconditionFailed;
    }
    if let Some(held) = text(header::IF_NONE_MATCH)
        && tags(held).any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
    {
        return Decision::NotModified;
    }
    let fresh = text(header::IF_RANGE).is_none_or(|tag| tag.trim() == etag);
    match text(header::RANGE) {
        Some(range) if fresh => one_range(range, length),
        _ => Decision::Whole,
    }
}

/// The entity tags of a list. Tags of this server hold no commas, so that splitting there cannot turn a foreign tag into one of ours.
fn tags(list: &str) -> impl Iterator<Item = &str> {
    list.split(',').map(str::trim)
}

fn one_range(range: &str, length: u64) -> Decision {
    let Some((unit, set)) = range.split_once('=') else {
        return Decision::NotSatisfiable;
    };
    if !unit.trim().eq_ignore_ascii_case("bytes") || set.contains(',') {
        return Decision::Whole;
    }
    let found = match set.trim().split_once('-') {
        Some(("", count)) => number(count).filter(|n| *n > 0 && length > 0).map(|n| length.saturating_sub(n)..length),
        Some((first, "")) => number(first).map(|first| first..length),
        Some((first, last)) => match (number(first), number(last)) {
            (Some(first), Some(last)) if first <= last => Some(first..last.saturating_add(1).min(length)),
            _ => None,
        },
        None => None,
    };
    found.filter(|part| part.start < part.end).map_or(Decision::NotSatisfiable, Decision::Part)
}

/// Digits only: `u64::from_str` would take a sign.
fn number(text: &str) -> Option<u64> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAG: &str = "\"abc\"";

    fn with(pairs: &[(header::HeaderName, &str)]) -> Decision {
        let headers = pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        decide(&headers, TAG, 100)
    }

    #[test]
    fn ranges_are_cut_to_the_file_or_refused() {
        for (text, expected) in [
            ("bytes=0-9", Decision::Part(0..10)),
            ("bytes=90-", Decision::Part(90..100)),
            ("bytes=90-500", Decision::Part(90..100)),
            ("bytes=-7", Decision::Part(93..100)),
            ("bytes=-700", Decision::Part(0..100)),
            ("BYTES = 5-5", Decision::Part(5..6)),
            ("bytes=0-18446744073709551615", Decision::Part(0..100)),
            ("bytes=100-", Decision::NotSatisfiable),
            ("bytes=9-2", Decision::NotSatisfiable),
            ("bytes=-0", Decision::NotSatisfiable),
            ("bytes=-", Decision::NotSatisfiable),
            ("bytes=+1-2", Decision::NotSatisfiable),
            ("bytes=x-y", Decision::NotSatisfiable),
            ("bytes", Decision::NotSatisfiable),
            ("bytes=0-1,5-6", Decision::Whole),
            ("lines=1-2", Decision::Whole),
        ] {
            assert_eq!(with(&[(header::RANGE, text)]), expected, "{text}");
        }
        assert_eq!(decide(&[(header::RANGE, "bytes=-5".parse().unwrap())].into_iter().collect(), TAG, 0), Decision::NotSatisfiable);
    }

    #[test]
    fn conditions_come_before_ranges_in_the_order_of_the_standard() {
        let range = (header::RANGE, "bytes=0-0");
        assert_eq!(with(&[range.clone(), (header::IF_NONE_MATCH, "\"x\", W/\"abc\"")]), Decision::NotModified);
        assert_eq!(with(&[range.clone(), (header::IF_MATCH, "\"x\"")]), Decision::PreconditionFailed);
        assert_eq!(with(&[range.clone(), (header::IF_MATCH, "W/\"abc\"")]), Decision::PreconditionFailed);
        assert_eq!(with(&[(header::IF_MATCH, "\"x\""), (header::IF_NONE_MATCH, TAG)]), Decision::PreconditionFailed);
        assert_eq!(with(&[range.clone(), (header::IF_MATCH, "*"), (header::IF_RANGE, TAG)]), Decision::Part(0..1));
        assert_eq!(with(&[range.clone(), (header::IF_RANGE, "\"old\"")]), Decision::Whole);
        assert_eq!(with(&[range, (header::IF_RANGE, "Wed, 21 Oct 2026 07:28:00 GMT")]), Decision::Whole);
    }
}
