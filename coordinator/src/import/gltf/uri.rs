//! What the URIs of buffers and images lead to: data inside the file, or a file of the bundle.

use super::{json::Json, report::Report};
use crate::import::{Bundle, BundlePath, uri};

/// What a URI leads to.
pub(super) enum Target<'b> {
    /// Bytes written into the URI itself.
    Data(Vec<u8>),
    /// A file of the bundle.
    File(&'b BundlePath),
}

/// Whether a value is a URI that holds the bytes themselves.
pub(super) fn is_data(at: Json<'_>) -> bool {
    at.string().is_some_and(|text| uri::is_data(&text))
}

/// Follows a URI written in the file `from`; `None` where that was an error.
pub(super) fn resolve<'b>(bundle: &'b Bundle, from: &BundlePath, at: Json<'_>, report: &mut Report<'_>) -> Option<Target<'b>> {
    let Some(text) = at.string() else {
        report.error(at, "a URI must be a string");
        return None;
    };
    if uri::is_data(&text) {
        return uri::data(&text[5..]).map(Target::Data).map_err(|message| report.error(at, message)).ok();
    }
    let Some(decoded) = uri::path(&text) else {
        let scheme = text.split(':').next().unwrap_or_default();
        report.error(at, format!("the URI leads out of the bundle (`{scheme}:`); only files of the bundle are read"));
        return None;
    };
    let Some(found) = bundle.find_address(from, &text) else {
        report.error(at, format!("the file `{decoded}` is not in the bundle"));
        return None;
    };
    Some(Target::File(found.told("the file", &decoded, |message| report.warn(at, message))))
}
