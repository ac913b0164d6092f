//! Identifiers: a job is not a worker is not a token, and the compiler knows.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use uuid::Uuid;

/// A text that is not the identifier it was taken for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a {what}")]
pub struct BadId {
    /// What was expected, for the sentence.
    pub what: &'static str,
    /// What was found.
    pub text: String,
}

macro_rules! uuid_id {
    ($(#[$doc:meta])* $name:ident, $what:literal, $new:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub Uuid);

        impl $name {
            /// A fresh identifier.
            #[must_use]
            pub fn random() -> Self { Self(Uuid::$new()) }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result { self.0.fmt(f) }
        }

        impl FromStr for $name {
            type Err = BadId;
            fn from_str(text: &str) -> Result<Self, BadId> {
                Uuid::parse_str(text).map(Self).map_err(|_| BadId { what: $what, text: text.to_owned() })
            }
        }
    };
}

uuid_id!(
    /// One bake of one scene with one set of settings. Time-ordered (RFC 9562 version 7), so that listing by id lists by age.
    JobId,
    "job id",
    now_v7
);
uuid_id!(
    /// One running worker process.
    WorkerId,
    "worker id",
    now_v7
);
uuid_id!(
    /// The fence of one lease attempt or one coordinator task: random (version 4), names an attempt, orders nothing.
    Token,
    "lease token",
    new_v4
);

macro_rules! hash_id {
    ($(#[$doc:meta])* $name:ident, $what:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub [u8; 32]);

        impl $name {
            /// The BLAKE3 hash of `bytes`.
            #[must_use]
            pub fn of(bytes: &[u8]) -> Self { Self(*blake3::hash(bytes).as_bytes()) }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result { self.0.iter().try_for_each(|b| write!(f, "{b:02x}")) }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result { write!(f, "{}({self})", stringify!($name)) }
        }

        impl FromStr for $name {
            type Err = BadId;
            fn from_str(text: &str) -> Result<Self, BadId> {
                let bad = || BadId { what: $what, text: text.chars().take(80).collect() };
                if text.len() != 64 || !text.is_ascii() {
                    return Err(bad());
                }
                let mut out = [0; 32];
                for (byte, pair) in out.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
                    let digit = |c: u8| (c as char).to_digit(16).ok_or_else(bad);
                    *byte = (digit(pair[0])? * 16 + digit(pair[1])?) as u8;
                }
                Ok(Self(out))
            }
        }

        // Text where a person reads it (JSON), 32 bytes where only machines do (frames).
        impl Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                if s.is_human_readable() { s.collect_str(self) } else { self.0.serialize(s) }
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                if d.is_human_readable() {
                    String::deserialize(d)?.parse().map_err(serde::de::Error::custom)
                } else {
                    Ok(Self(Deserialize::deserialize(d)?))
                }
            }
        }
    };
}

hash_id!(
    /// The BLAKE3 hash of a canonical scene's bytes: two uploads that mean the same scene have the same hash.
    SceneHash,
    "scene hash (64 hexadecimal digits)"
);
hash_id!(
    /// The BLAKE3 hash of some bytes *before* any compression: segments, plans, blobs.
    Digest,
    "digest (64 hexadecimal digits)"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_round_trip_through_text_and_refuse_nonsense() {
        let job = JobId::random();
        assert_eq!(job.to_string().parse::<JobId>(), Ok(job));
        let digest = Digest::of(b"kiln");
        assert_eq!(digest.to_string().parse::<Digest>(), Ok(digest));
        assert_eq!(serde_json::from_str::<Digest>(&serde_json::to_string(&digest).unwrap()).unwrap(), digest);
        for bad in ["", "zz", &"g".repeat(64), &"é".repeat(32)] {
            assert!(bad.parse::<Digest>().is_err(), "{bad} was accepted");
        }
    }
}
