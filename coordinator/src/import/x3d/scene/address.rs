//! What the addresses of a picture lead to. They are tried in order: data in the file itself, or a file of the bundle; nothing is fetched
//! from elsewhere.

use crate::import::{Bundle, BundlePath, findings::Findings, uri, x3d::NodeRef};

/// What an address leads to.
#[derive(Clone, Copy)]
pub(super) enum Target<'b, 'd> {
    /// A data URI, without its `data:`.
    Data(&'d str),
    /// A file of the bundle.
    File(&'b BundlePath),
}

/// The first address of a node, counted from `from`, that leads somewhere: its number, and where.
pub(super) fn next<'b, 'd>(bundle: &'b Bundle, node: NodeRef<'d>, from: usize, findings: &mut Findings) -> Option<(usize, Target<'b, 'd>)> {
    for (number, url) in node.mf_string("url").iter().enumerate().skip(from) {
        let url = url.trim();
        if uri::is_data(url) {
            return Some((number, Target::Data(&url[5..])));
        }
        if let Some(found) = bundle.find_address(node.file_of("url"), url) {
            let path = found.told("the image", url, |message| findings.warn(node.at_field("url"), message));
            return Some((number, Target::File(path)));
        }
    }
    None
}

/// What is said of a node whose addresses lead nowhere.
pub(super) fn missing(node: NodeRef<'_>) -> String {
    let listed: Vec<&str> = node.mf_string("url").iter().map(AsRef::as_ref).take(5).collect();
    format!("the image `{}` is not in the bundle; nothing is fetched from elsewhere", listed.join("`, `"))
}
