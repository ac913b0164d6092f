//! What the service signs with its own secret: browser sessions and links to single files.
//!
//! Both are BLAKE3 keyed hashes over what they grant and until when, under keys derived from one secret in the store, so that every
//! coordinator of a farm accepts what another one signed. Nothing is stored per session or link. A session is sealed together with the hash
//! of its token: revoking or rotating the token ends it. A link knows no token, and lives until its time is over or its job is gone.

use super::TokenId;
use kiln_proto::ids::Digest;
use std::{fmt, str::FromStr};

/// Keys derived from the secret of the service.
pub struct Keys {
    session: [u8; 32],
    link: [u8; 32],
}

/// A browser's session, as its cookie holds it: `ID.EXPIRES.SEAL`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Session {
    /// The token that opened it.
    pub token: TokenId,
    /// When it ends, seconds since 1970.
    pub expires_s: i64,
    seal: blake3::Hash,
}

impl fmt::Display for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.token, self.expires_s, self.seal.to_hex())
    }
}

/// A text that is no session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("this is not a session")]
pub struct BadSession;

impl FromStr for Session {
    type Err = BadSession;
    fn from_str(text: &str) -> Result<Self, BadSession> {
        let mut parts = text.split('.');
        let (Some(token), Some(expires), Some(seal), None) = (parts.next(), parts.next(), parts.next(), parts.next()) else {
            return Err(BadSession);
        };
        let seal = blake3::Hash::from_hex(seal).map_err(|_| BadSession)?;
        Ok(Self { token: token.parse().map_err(|_| BadSession)?, expires_s: expires.parse().map_err(|_| BadSession)?, seal })
    }
}

impl Keys {
    /// The keys of a secret.
    #[must_use]
    pub fn of(secret: &[u8; 32]) -> Self {
        Self { session: blake3::derive_key("kiln 2026 browser session", secret), link: blake3::derive_key("kiln 2026 signed link", secret) }
    }

    /// Opens a session of a token, whose stored hash is `token_hash`.
    #[must_use]
    pub fn open_session(&self, token: TokenId, token_hash: Digest, expires_s: i64) -> Session {
        Session { token, expires_s, seal: self.session_seal(token, token_hash, expires_s) }
    }

    /// Whether this service opened the session for the token as it is now, and it has not ended. In constant time.
    #[must_use]
    pub fn is_open(&self, session: &Session, token_hash: Digest, now_s: i64) -> bool {
        self.session_seal(session.token, token_hash, session.expires_s) == session.seal && now_s < session.expires_s
    }

    fn session_seal(&self, token: TokenId, token_hash: Digest, expires_s: i64) -> blake3::Hash {
        blake3::keyed_hash(&self.session, format!("{token}\n{token_hash}\n{expires_s}").as_bytes())
    }

    /// The signature of a link: 64 hexadecimal digits.
    #[must_use]
    pub fn sign_link(&self, path: &str, expires_s: i64) -> String {
        self.link_seal(path, expires_s).to_hex().to_string()
    }

    /// Whether this service signed a link to `path` until `expires_s`, and that is not over. In constant time.
    #[must_use]
    pub fn is_signed(&self, path: &str, expires_s: i64, signature: &str, now_s: i64) -> bool {
        blake3::Hash::from_hex(signature).is_ok_and(|found| self.link_seal(path, expires_s) == found) && now_s < expires_s
    }

    fn link_seal(&self, path: &str, expires_s: i64) -> blake3::Hash {
        blake3::keyed_hash(&self.link, format!("GET\n{path}\n{expires_s}").as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(n: u8) -> TokenId {
        TokenId::from_random([n; 8])
    }

    #[test]
    fn a_session_ends_with_its_time_its_token_and_its_secret() {
        let (keys, hash) = (Keys::of(&[1; 32]), Digest::of(b"a"));
        let session: Session = keys.open_session(id(1), hash, 100).to_string().parse().unwrap();
        assert!(keys.is_open(&session, hash, 99));
        assert!(!keys.is_open(&session, hash, 100));
        assert!(!keys.is_open(&session, Digest::of(b"rotated"), 99));
        assert!(!Keys::of(&[2; 32]).is_open(&session, hash, 99));
        for forged in [Session { token: id(2), ..session }, Session { expires_s: 10_000, ..session }] {
            assert!(!keys.is_open(&forged, hash, 99));
        }
    }

    #[test]
    fn what_is_no_session_is_refused() {
        let good = Keys::of(&[1; 32]).open_session(id(1), Digest::of(b"a"), 100).to_string();
        for bad in ["", "a.b.c", &good[1..], &good[..good.len() - 1], &format!("{good}.x")] {
            assert_eq!(bad.parse::<Session>(), Err(BadSession), "{bad}");
        }
    }

    #[test]
    fn a_link_is_for_one_path_and_one_time() {
        let keys = Keys::of(&[1; 32]);
        let signature = keys.sign_link("/v1/jobs/a/bundle.zip", 100);
        assert!(keys.is_signed("/v1/jobs/a/bundle.zip", 100, &signature, 99));
        assert!(!keys.is_signed("/v1/jobs/a/bundle.zip", 100, &signature, 100));
        assert!(!keys.is_signed("/v1/jobs/a/bundle.zip", 101, &signature, 99));
        assert!(!keys.is_signed("/v1/jobs/b/bundle.zip", 100, &signature, 99));
        for forged in ["", "zz", &"0".repeat(64), &signature[..62]] {
            assert!(!keys.is_signed("/v1/jobs/a/bundle.zip", 100, forged, 99), "{forged}");
        }
    }
}
