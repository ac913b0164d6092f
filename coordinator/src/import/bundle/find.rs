//! What references inside a bundle lead to.
//!
//! Scenes are moved between machines that differ in what they hold for the same name, and exporters write the paths of their own. So a
//! reference may lead to a file that is meant beyond doubt, which is said; the very path always comes first.

use super::{Bundle, BundlePath};
use crate::import::uri;

/// What a reference inside the bundle leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found<'a> {
    /// The very path.
    Exact(&'a BundlePath),
    /// Another path that is meant beyond doubt: it differs in case, or only the file name fits and no other file has it.
    Near(&'a BundlePath),
}

impl<'a> Found<'a> {
    /// The path.
    pub(in crate::import) fn path(self) -> &'a BundlePath {
        let (Self::Exact(path) | Self::Near(path)) = self;
        path
    }

    /// The path; `warn` is told where it is another than the one that was `written`. `what`: what kind of file that is.
    pub(in crate::import) fn told(self, what: &str, written: &str, warn: impl FnOnce(String)) -> &'a BundlePath {
        if let Self::Near(path) = self {
            warn(format!("{what} `{written}` is not in the bundle; `{path}` is used instead"));
        }
        self.path()
    }
}

impl Bundle {
    /// Where `reference`, a path written in the file `from`, leads to inside the bundle.
    #[must_use]
    pub fn find(&self, from: &BundlePath, reference: &str) -> Option<Found<'_>> {
        self.first_of(from, &[reference])
    }

    /// Where an address written in the file `from` leads to inside the bundle: percent-encoded, as addresses are, or not, as some exporters
    /// have them. The very path in either spelling comes before one that is near to it.
    #[must_use]
    pub fn find_address(&self, from: &BundlePath, address: &str) -> Option<Found<'_>> {
        self.first_of(from, &[&uri::decoded(address), address])
    }

    fn first_of(&self, from: &BundlePath, spellings: &[&str]) -> Option<Found<'_>> {
        let exact = spellings.iter().find_map(|reference| self.exact(from, reference));
        let found = exact.map(Found::Exact);
        found.or_else(|| spellings.iter().find_map(|reference| self.near(from, reference)).map(Found::Near))
    }

    fn exact(&self, from: &BundlePath, reference: &str) -> Option<&BundlePath> {
        self.files.get_key_value(&from.join(reference)?).map(|(path, _)| path)
    }

    fn near(&self, from: &BundlePath, reference: &str) -> Option<&BundlePath> {
        let path = from.join(reference);
        let folded = path.and_then(|path| self.folded.get(&path.as_str().to_lowercase()));
        let name = || self.names.get(&reference.rsplit(['/', '\\']).next()?.trim().to_lowercase());
        [folded, name()].into_iter().flatten().find_map(|paths| if let [path] = paths.as_slice() { Some(path) } else { None })
    }
}
