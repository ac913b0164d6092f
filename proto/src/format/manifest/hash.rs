//! SHA-256, of files and of whole packages.

use super::REPORT_PATH;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::{fmt, str::FromStr};

/// A SHA-256, as 64 hexadecimal digits in JSON.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Sha256Hex(pub [u8; 32]);

/// The hash of a package: see [`package_hash`].
pub type PackageHash = Sha256Hex;

impl Sha256Hex {
    /// The SHA-256 of `bytes`.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }
}

impl fmt::Display for Sha256Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

impl fmt::Debug for Sha256Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Sha256Hex({self})")
    }
}

/// A text that is not 64 hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a SHA-256 is 64 hexadecimal digits")]
pub struct BadSha256;

impl FromStr for Sha256Hex {
    type Err = BadSha256;
    fn from_str(text: &str) -> Result<Self, BadSha256> {
        // The same notation as the project's own hashes, whose parser is tested.
        text.parse::<crate::ids::Digest>().map(|d| Self(d.0)).map_err(|_| BadSha256)
    }
}

crate::written_as_text!(Sha256Hex);

/// The hash of a package: the SHA-256 of one line `SHA256␣␣PATH` for every file but `report.json`, in byte order of the paths. It is what
/// `sha256sum` prints, so anyone can compute it without this program:
/// `find * -type f ! -path report.json | LC_ALL=C sort | xargs -d '\n' sha256sum | sha256sum`. Lengths need no place of their own in it:
/// files of different lengths have different hashes.
#[must_use]
pub fn package_hash<'a>(files: impl IntoIterator<Item = (&'a str, Sha256Hex)>) -> PackageHash {
    let mut files: Vec<_> = files.into_iter().filter(|(path, _)| *path != REPORT_PATH).collect();
    files.sort_unstable();
    let mut hash = Sha256::new();
    files.iter().for_each(|(path, sha)| hash.update(format!("{sha}  {path}\n")));
    Sha256Hex(hash.finalize().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_hash_is_what_sha256sum_says() {
        let files = [("surfaces/a.mti", Sha256Hex::of(b"x")), ("manifest.json", Sha256Hex::of(b"")), ("report.json", Sha256Hex::of(b"y"))];
        let text = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  manifest.json\n\
                    2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881  surfaces/a.mti\n";
        assert_eq!(package_hash(files), Sha256Hex::of(text.as_bytes()));
    }
}
