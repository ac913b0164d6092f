//! URIs of buffers and images: data inside the file, or a relative path inside the bundle.

use super::{json::Json, report::Report};
use crate::import::{Bundle, BundlePath, bundle::Found};
use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;

/// Data URIs with and without padding are in use.
const BASE64: GeneralPurpose =
    GeneralPurpose::new(&STANDARD, GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent));

/// What a URI leads to.
pub(super) enum Target<'b> {
    /// Bytes written into the URI itself.
    Data(Vec<u8>),
    /// A file of the bundle.
    File(&'b BundlePath),
}

/// The path that a URI means, where it is not the data themselves and not elsewhere. Exporters that forget to encode write `100%.png`: what
/// is no escape stays as it is.
pub(super) fn path(uri: &str) -> Option<String> {
    let is_path = !is_data(uri) && !uri.contains("://");
    is_path.then(|| percent_decode_str(uri).decode_utf8_lossy().into_owned())
}

fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Follows a URI written in the file `from`; `None` where that was an error.
pub(super) fn resolve<'b>(bundle: &'b Bundle, from: &BundlePath, at: Json<'_>, report: &mut Report<'_>) -> Option<Target<'b>> {
    let Some(uri) = at.string() else {
        report.error(at, "a URI must be a string");
        return None;
    };
    if is_data(&uri) {
        return data(&uri[5..]).map(Target::Data).map_err(|message| report.error(at, message)).ok();
    }
    let Some(decoded) = path(&uri) else {
        let scheme = uri.split(':').next().unwrap_or_default();
        report.error(at, format!("the URI leads out of the bundle (`{scheme}:`); only files of the bundle are read"));
        return None;
    };
    let found = [decoded.as_str(), uri.as_ref()].into_iter().find_map(|path| bundle.find(from, path));
    match found {
        Some(Found::Exact(path)) => Some(Target::File(path)),
        Some(Found::Near(path)) => {
            report.warn(at, format!("the file `{decoded}` is not in the bundle; `{path}` is used instead"));
            Some(Target::File(path))
        }
        None => {
            report.error(at, format!("the file `{decoded}` is not in the bundle"));
            None
        }
    }
}

/// The bytes of a data URI (RFC 2397), without its `data:`.
fn data(uri: &str) -> Result<Vec<u8>, String> {
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
