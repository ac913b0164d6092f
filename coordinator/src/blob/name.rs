//! The name of a blob: `blake3/` and 64 hexadecimal digits.

use kiln_proto::ids::{BadId, Digest};
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// The name of a blob, which is the BLAKE3 hash of its bytes as stored (a compressed scene's blob is not named by the scene's hash).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct BlobName(pub Digest);

impl BlobName {
    /// What every name begins with, up to the slash.
    pub(super) const FOLDER: &str = "blake3";

    /// The name of these bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(Digest::of(bytes))
    }
}

impl fmt::Display for BlobName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", Self::FOLDER, self.0)
    }
}

impl FromStr for BlobName {
    type Err = BadId;
    fn from_str(text: &str) -> Result<Self, BadId> {
        let bad = || BadId { what: "blob name", text: text.chars().take(80).collect() };
        let digits = text.strip_prefix(Self::FOLDER).and_then(|rest| rest.strip_prefix('/'));
        digits.ok_or_else(bad)?.parse().map(Self)
    }
}

kiln_proto::written_as_text!(BlobName);
