//! Access tokens: `kiln_` ID `_` SECRET, in Crockford's base 32.
//!
//! The id (50 bits) is public: lists and logs name a token by it. The secret is 256 random bits; what is stored is a BLAKE3 hash of the
//! whole text, and two hashes are compared in constant time. A slow password hash would add nothing: nobody guesses 256 bits. The fixed prefix
//! lets scanners of repositories find a token that was committed by mistake.

use super::Roles;
use crate::records::UnixMillis;
use kiln_proto::{ids::Digest, secret::Secret};
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

const DIGITS: &[u8; 32] = b"0123456789abcdefghjkmnpqrstvwxyz";
const PREFIX: &str = "kiln_";
const ID_DIGITS: usize = 10;
const SECRET_DIGITS: usize = 52;

/// The operating system gives no random bytes.
#[derive(Debug, thiserror::Error)]
#[error("the operating system gives no random bytes")]
pub struct NoRandomness(#[source] getrandom::Error);

/// Random bytes, fit for secrets.
///
/// # Errors
/// A system without a source of them.
pub fn random<const N: usize>() -> Result<[u8; N], NoRandomness> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(NoRandomness)?;
    Ok(bytes)
}

/// The public name of a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct TokenId(u64);

impl TokenId {
    /// The id in these random bytes.
    #[must_use]
    pub fn from_random(bytes: [u8; 8]) -> Self {
        Self(u64::from_le_bytes(bytes) >> (64 - 5 * ID_DIGITS))
    }
}

impl fmt::Display for TokenId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digit = |n: usize| char::from(DIGITS[(self.0 >> (5 * n)) as usize & 31]);
        f.write_str(&(0..ID_DIGITS).rev().map(digit).collect::<String>())
    }
}

impl From<TokenId> for String {
    fn from(id: TokenId) -> String {
        id.to_string()
    }
}

impl TryFrom<String> for TokenId {
    type Error = BadTokenId;
    fn try_from(text: String) -> Result<Self, BadTokenId> {
        text.parse()
    }
}

/// A text that names no token.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("this is not the id of a token: ten letters and digits, as `kiln token list` shows them")]
pub struct BadTokenId;

impl FromStr for TokenId {
    type Err = BadTokenId;
    fn from_str(text: &str) -> Result<Self, BadTokenId> {
        if text.len() != ID_DIGITS {
            return Err(BadTokenId); // The text stays out of the message: it may be a whole token.
        }
        let digit = |byte: u8| DIGITS.iter().position(|d| *d == byte).ok_or(BadTokenId);
        text.bytes().try_fold(0, |sum, byte| Ok(sum << 5 | digit(byte)? as u64)).map(Self)
    }
}

/// The text of a token with this id and these secret bytes.
#[must_use]
pub fn mint(id: TokenId, secret: [u8; 32]) -> Secret {
    // 256 bits, five at a time from the front; the last digit holds one.
    let digit = |n: usize| {
        let bit = |k: usize| secret.get(k / 8).map_or(0, |byte| byte >> (7 - k % 8) & 1);
        let value = (0..5).fold(0, |sum, k| sum << 1 | bit(5 * n + k));
        char::from(DIGITS[value as usize])
    };
    Secret::new(format!("{PREFIX}{id}_{}", (0..SECRET_DIGITS).map(digit).collect::<String>()))
}

/// What a client presented, as far as it may be kept: never the text itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Presented {
    /// Which token it says it is.
    pub id: TokenId,
    /// Hash of the whole text.
    pub hash: Digest,
}

impl Presented {
    /// Reads the text of a token; `None` where it has not the form of one.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
        let whole = secret.len() == SECRET_DIGITS && secret.bytes().all(|byte| DIGITS.contains(&byte));
        whole.then_some(Self { id: id.parse().ok()?, hash: Digest::of(text.as_bytes()) })
    }
}

/// A token as stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TokenRow {
    /// Its public name.
    pub id: TokenId,
    /// What a person calls it.
    pub name: String,
    /// What it is for.
    pub roles: Roles,
    /// Hash of its text.
    #[serde(skip)]
    pub hash: Digest,
    /// When it was made.
    pub created_ms: UnixMillis,
    /// When it was last used, to about a minute.
    pub used_ms: Option<UnixMillis>,
    /// From when it is worth nothing.
    pub expires_ms: Option<UnixMillis>,
    /// When it was revoked.
    pub revoked_ms: Option<UnixMillis>,
}

/// Why a token gives no access.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Invalid {
    /// It has not the form of a token.
    #[error("it is not a Kiln token")]
    Malformed,
    /// Nobody made it, or its secret is another.
    #[error("it is unknown here")]
    Unknown,
    /// It was taken back.
    #[error("it was revoked")]
    Revoked,
    /// Its time is over.
    #[error("it has expired")]
    Expired,
}

impl TokenRow {
    /// Whether it gives access now.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, now: UnixMillis) -> Result<(), Invalid> {
        if self.revoked_ms.is_some() {
            return Err(Invalid::Revoked);
        }
        if self.expires_ms.is_some_and(|at| at <= now) { Err(Invalid::Expired) } else { Ok(()) }
    }

    /// Whether `presented` is this token, and gives access now. The hashes are compared in constant time.
    ///
    /// # Errors
    /// Why it gives none.
    pub fn accept(&self, presented: &Presented, now: UnixMillis) -> Result<(), Invalid> {
        if !same(self.hash, presented.hash) {
            return Err(Invalid::Unknown);
        }
        self.check(now)
    }
}

/// Equality that takes the same time whatever differs.
pub(crate) fn same(a: Digest, b: Digest) -> bool {
    blake3::Hash::from_bytes(a.0) == blake3::Hash::from_bytes(b.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn row(text: &Secret) -> TokenRow {
        let Presented { id, hash } = Presented::parse(text.expose()).unwrap();
        let (name, roles) = ("ci".to_owned(), Roles::ALL);
        TokenRow { id, name, roles, hash, created_ms: 0, used_ms: None, expires_ms: Some(100), revoked_ms: None }
    }

    #[test]
    fn the_text_of_tokens_never_changes() {
        let text = mint(TokenId::from_random([0xff, 0, 0, 0, 0, 0, 0, 0x80]), [0xff; 32]);
        assert_eq!(text.expose(), format!("kiln_g000000000_{}g", "z".repeat(51)));
    }

    proptest! {
        #[test]
        fn tokens_are_read_as_they_were_made(id: [u8; 8], secret: [u8; 32]) {
            let id = TokenId::from_random(id);
            prop_assert_eq!(id.to_string().parse::<TokenId>(), Ok(id));
            let text = mint(id, secret);
            let presented = Presented::parse(text.expose()).unwrap();
            prop_assert_eq!(presented, Presented { id, hash: Digest::of(text.expose().as_bytes()) });
        }

        #[test]
        fn different_secrets_are_different_texts(a: [u8; 32], b: [u8; 32]) {
            let id = TokenId::from_random([1; 8]);
            prop_assert_eq!(mint(id, a) == mint(id, b), a == b);
        }
    }

    #[test]
    fn what_is_not_of_the_form_is_no_token() {
        let good = mint(TokenId::from_random([7; 8]), [9; 32]);
        let good = good.expose();
        for bad in
            ["", "kiln_", "kiln__", &good[1..], &good[..good.len() - 1], &format!("{good}0"), &good.to_uppercase(), &good.replace('k', "u")]
        {
            assert_eq!(Presented::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn only_the_right_secret_of_a_live_token_is_accepted() {
        let id = TokenId::from_random([7; 8]);
        let (right, wrong) = (mint(id, [1; 32]), mint(id, [2; 32]));
        let (right, wrong) = (Presented::parse(right.expose()).unwrap(), Presented::parse(wrong.expose()).unwrap());
        let row = row(&mint(id, [1; 32]));
        assert_eq!(row.accept(&right, 99), Ok(()));
        assert_eq!(row.accept(&wrong, 99), Err(Invalid::Unknown));
        assert_eq!(row.accept(&right, 100), Err(Invalid::Expired));
        let revoked = TokenRow { revoked_ms: Some(5), ..row };
        assert_eq!(revoked.accept(&right, 9), Err(Invalid::Revoked));
        assert_eq!(revoked.accept(&wrong, 9), Err(Invalid::Unknown), "whether a token was revoked is told only to who holds it");
    }
}
