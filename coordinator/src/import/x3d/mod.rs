//! X3D and VRML97: three encodings become one document.
//!
//! ```text
//! bytes ─ encoding ─► text ─ xml | classic | json ─► syntax ─ resolve ─► document ─ evaluate ─► document at a time
//! ```
//! A reader of an encoding knows brackets and quotes and nothing of X3D; `table` knows the nodes and nothing of brackets; `resolve` joins
//! them, and everything that crosses names (DEF, USE, PROTO, IS, ROUTE, Inline) happens there, once. Values stay slices of the text until
//! the table says what they are, so a file costs its text and its numbers, and an unknown node costs nothing. The alternative, a reader
//! that types values as it goes, needs no second look at them, and writes PROTO three times.

mod classic;
mod document;
mod encoding;
mod evaluate;
mod geometry;
mod json;
mod limits;
mod literal;
mod lower;
mod node;
mod references;
mod resolve;
mod rewrite;
mod scene;
mod syntax;
mod table;
mod value;
mod write;
mod xml;

use super::{Bundle, BundlePath, findings::Findings, images::Images};
use kiln_proto::{options::ImportOptions, scene::Scene};

pub(super) use document::{Document, Inlined, NodeId};
pub(super) use node::NodeRef;
pub(super) use references::{Reference, references};
pub use rewrite::{Rewritten, rewrite};
pub use write::X3dEncoding;

/// Reads an X3D or VRML97 file of a bundle with all that it refers to, at `time` (seconds since the scene was loaded; `None`: at rest,
/// before any event). Unknown and unsupported things are warnings; `None`, with errors, where the file cannot be read.
///
/// Cost: linear in the files and in what prototypes multiply; bounded by `limits`.
pub(super) fn read(bundle: &Bundle, main: &BundlePath, bytes: &[u8], time: Option<f64>, findings: &mut Findings) -> Option<Document> {
    let mut document = resolve::resolve(bundle, main, bytes, findings)?;
    if let Some(time) = time {
        evaluate::evaluate(&mut document, time, findings);
    }
    Some(document)
}

/// The canonical scene of an X3D or VRML97 file of a bundle; `None` where there were errors.
pub(super) fn import(
    bundle: &Bundle,
    main: &BundlePath,
    bytes: &[u8],
    options: &ImportOptions,
    images: &mut Images,
    findings: &mut Findings,
) -> Option<Scene> {
    let document = read(bundle, main, bytes, options.time, findings)?;
    scene::build(bundle, &document, options, images, findings)
}

/// The version in a text such as `3.3`, times ten; 0 where there is none.
fn parse_version(text: &str) -> u32 {
    let (major, minor) = text.trim().split_once('.').unwrap_or((text.trim(), "0"));
    let digit = |t: &str| t.chars().next().and_then(|c| c.to_digit(10));
    major.parse::<u32>().ok().filter(|m| *m < 100).map_or(0, |m| 10 * m + digit(minor).unwrap_or_default())
}
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
