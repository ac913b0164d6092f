//! Paths inside a bundle: relative, with `/`, without a way out.

use kiln_proto::limits;
use std::{collections::BTreeSet, fmt};

/// A safe relative path: non-empty components joined by `/`, none of them `.` or `..`, no drive, no control characters.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BundlePath(String);

/// Why a path was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BadPath {
    /// Nothing left, or too much.
    #[error("a path in a bundle has 1 to {max} bytes", max = limits::NAME_BYTES)]
    Length,
    /// `/a`, `\a`, `C:a`.
    #[error("the path is absolute; only relative paths are allowed in a bundle")]
    Absolute,
    /// `..`.
    #[error("the path leads out of the bundle")]
    Parent,
    /// NUL and its kin.
    #[error("the path has control characters")]
    Control,
    /// A second file of a name.
    #[error("another file of the bundle has this name, or one that differs in case only")]
    Twice,
}

/// The names of a bundle in the making, whatever it comes as: each is safe, and they are distinct also where case is ignored, because
/// nobody knows on which system the scene refers to them.
#[derive(Debug, Default)]
pub struct Paths(BTreeSet<String>);

impl Paths {
    /// Takes the name of one more file, as a client, an archive or a folder gives it.
    ///
    /// # Errors
    /// Those of [`BundlePath::parse`], and a name that is taken.
    pub fn take(&mut self, name: &str) -> Result<BundlePath, BadPath> {
        let path = BundlePath::parse(name)?;
        if self.0.insert(path.as_str().to_lowercase()) { Ok(path) } else { Err(BadPath::Twice) }
    }
}

impl BundlePath {
    /// Reads a path as a client, an archive or a folder gives it; `\` counts as `/`.
    ///
    /// # Errors
    /// Paths that are absolute, lead out of the bundle, or cannot be file names.
    pub fn parse(text: &str) -> Result<Self, BadPath> {
        let text = text.replace('\\', "/");
        if text.chars().any(char::is_control) {
            return Err(BadPath::Control);
        }
        if text.starts_with('/') || has_drive(&text) {
            return Err(BadPath::Absolute);
        }
        let parts: Vec<&str> = text.split('/').filter(|p| !p.is_empty() && *p != ".").collect();
        if parts.contains(&"..") {
            return Err(BadPath::Parent);
        }
        let path = parts.join("/");
        if path.is_empty() || path.len() > limits::NAME_BYTES { Err(BadPath::Length) } else { Ok(Self(path)) }
    }

    /// The path as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Its last component.
    #[must_use]
    pub fn file_name(&self) -> &str {
        self.0.rsplit('/').next().unwrap_or(&self.0)
    }

    /// Its last component without the ending.
    #[must_use]
    pub fn stem(&self) -> &str {
        let name = self.file_name();
        name.rsplit_once('.').map_or(name, |(stem, _)| if stem.is_empty() { name } else { stem })
    }

    /// The path that `reference`, written in this file, means; `..` is followed as far as it stays inside the bundle. `None` for anything
    /// absolute or outside.
    #[must_use]
    pub fn join(&self, reference: &str) -> Option<Self> {
        let reference = reference.replace('\\', "/");
        if reference.starts_with('/') || has_drive(&reference) || reference.chars().any(char::is_control) {
            return None;
        }
        let mut parts: Vec<&str> = self.0.split('/').collect();
        parts.pop();
        for part in reference.split('/') {
            match part {
                "" | "." => {}
                ".." => {
                    parts.pop()?;
                }
                name => parts.push(name),
            }
        }
        let path = parts.join("/");
        (!path.is_empty() && path.len() <= limits::NAME_BYTES).then_some(Self(path))
    }
}

fn has_drive(text: &str) -> bool {
    let bytes = text.as_bytes();
    bytes.len() >= 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':'
}

impl fmt::Display for BundlePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_out_are_refused() {
        for (path, error) in [
            ("/etc/passwd", BadPath::Absolute),
            ("\\\\server\\share", BadPath::Absolute),
            ("C:\\a.obj", BadPath::Absolute),
            ("c:a.obj", BadPath::Absolute),
            ("../a.obj", BadPath::Parent),
            ("a/../../b", BadPath::Parent),
            ("a\\..\\..\\b", BadPath::Parent),
            ("a\0b", BadPath::Control),
            ("", BadPath::Length),
            ("./", BadPath::Length),
        ] {
            assert_eq!(BundlePath::parse(path), Err(error), "{path:?}");
        }
        assert_eq!(BundlePath::parse(&"x".repeat(2_000)), Err(BadPath::Length));
    }

    #[test]
    fn names_are_distinct_however_they_are_written() {
        let mut paths = Paths::default();
        assert_eq!(paths.take("Tex\\Wood.png").unwrap().as_str(), "Tex/Wood.png");
        for same in ["Tex/Wood.png", "tex/wood.PNG", "./Tex//Wood.png"] {
            assert_eq!(paths.take(same), Err(BadPath::Twice), "{same}");
        }
        assert_eq!(paths.take("../a"), Err(BadPath::Parent));
        assert!(paths.take("tex/wood2.png").is_ok());
    }

    #[test]
    fn paths_are_normalised_and_joined_inside() {
        let path = BundlePath::parse(".//models\\room.v2.obj").unwrap();
        assert_eq!((path.as_str(), path.file_name(), path.stem()), ("models/room.v2.obj", "room.v2.obj", "room.v2"));
        let join = |r: &str| path.join(r).map(|p| p.to_string());
        assert_eq!(join("tex/a.png").as_deref(), Some("models/tex/a.png"));
        assert_eq!(join("..\\a.png").as_deref(), Some("a.png"));
        assert_eq!((join("../../a.png"), join("/a.png"), join("D:/a.png"), join("..")), (None, None, None, None));
    }
}
