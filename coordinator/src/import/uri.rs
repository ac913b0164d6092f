//! URIs in scenes: relative paths, percent-encoded or not, and data inside the file (RFC 2397).

use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use std::borrow::Cow;

/// Data URIs with and without padding are in use.
const BASE64: GeneralPurpose =
    GeneralPurpose::new(&STANDARD, GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent));

/// What stays as it is in a relative path: the unreserved characters of RFC 3986, and the slashes between folders.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b'/');

/// The path that a URI means, where it is not the data themselves and not elsewhere. Exporters that forget to encode write `100%.png`: what
/// is no escape stays as it is.
pub(super) fn path(uri: &str) -> Option<String> {
    let is_path = !is_data(uri) && !uri.contains("://");
    is_path.then(|| decoded(uri))
}

/// A URI without its escapes; what is no escape stays as it is.
pub(super) fn decoded(uri: &str) -> String {
    percent_decode_str(uri).decode_utf8_lossy().into_owned()
}

/// A relative path as a URI says it.
pub(crate) fn encoded(path: &str) -> String {
    utf8_percent_encode(path, ESCAPED).to_string()
}

/// Whether a URI holds data itself.
pub(super) fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// The bytes of a data URI (RFC 2397), without its `data:`; else what is wrong with it.
pub(super) fn data(uri: &str) -> Result<Vec<u8>, String> {
    let (head, body) = uri.split_once(',').ok_or("the data URI has no comma before its data")?;
    let mut words = head.split(';');
    let media = words.next().unwrap_or_default();
    let words: Vec<&str> = words.collect();
    let (is_base64, parameters) = match words.split_last() {
        Some((last, parameters)) if last.eq_ignore_ascii_case("base64") => (true, parameters),
        _ => (false, words.as_slice()),
    };
    if let Some(wrong) = parameters.iter().find(|p| !p.contains('=')) {
        return Err(format!("the data URI has the parameter `{wrong}`, which is no `name=value`"));
    }
    if !media.is_empty() && !media.contains('/') {
        return Err(format!("the data URI has `{media}`, which is no media type"));
    }
    let body: Cow<'_, [u8]> = percent_decode_str(body).into();
    if is_base64 { BASE64.decode(&body).map_err(|e| format!("the data URI is not base64: {e}")) } else { Ok(body.into_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_escaped_and_read_again() {
        for (path, uri) in [("../t/my wall#1.png", "../t/my%20wall%231.png"), ("100%.png", "100%25.png"), ("a-b_c~1.x3d", "a-b_c~1.x3d")] {
            assert_eq!((encoded(path).as_str(), decoded(uri).as_str()), (uri, path));
        }
    }

    #[test]
    fn data_uris_are_decoded_or_refused_with_words() {
        assert_eq!(data("application/octet-stream;base64,AQID").unwrap(), [1, 2, 3]);
        assert_eq!(data(";base64,AQI=").unwrap(), [1, 2]);
        assert_eq!(data("base64,AQI").unwrap_err(), "the data URI has `base64`, which is no media type");
        assert_eq!(data("a/b;charset=x;BASE64,AQI").unwrap(), [1, 2]);
        assert_eq!(data(",a%20b").unwrap(), b"a b");
        assert!(data("application/octet-stream;;base64,AA==").unwrap_err().contains("no `name=value`"));
        assert!(data("a/b;base64,A!").unwrap_err().contains("not base64"));
        assert!(data("a/b;base64").unwrap_err().contains("no comma"));
    }
}
