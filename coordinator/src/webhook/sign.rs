//! Signatures as Standard Webhooks has them: HMAC-SHA256 over `id.timestamp.body`.

use base64::{Engine, engine::general_purpose::STANDARD};
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use std::{fmt, io, path::Path};

/// What secrets begin with; those without it are read just so.
const PREFIX: &str = "whsec_";

/// A key.
pub(super) struct Secret(Vec<u8>);

/// A secret that cannot be used. Nothing of it is told.
#[derive(Debug, thiserror::Error)]
pub(super) enum BadSecret {
    #[error("{0} cannot be read: {1}")]
    Read(String, io::Error),
    #[error("expected `whsec_` and 24 to 64 bytes in base64, as printf 'whsec_%s' \"$(openssl rand -base64 32)\" makes it")]
    Shape,
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

impl Secret {
    /// The secret in a file.
    pub(super) fn read(path: &Path) -> Result<Self, BadSecret> {
        let text = std::fs::read_to_string(path).map_err(|error| BadSecret::Read(path.display().to_string(), error))?;
        Self::parse(text.trim())
    }

    /// The secret in a text.
    pub(super) fn parse(text: &str) -> Result<Self, BadSecret> {
        let key = STANDARD.decode(text.strip_prefix(PREFIX).unwrap_or(text)).map_err(|_| BadSecret::Shape)?;
        if (24..=64).contains(&key.len()) { Ok(Self(key)) } else { Err(BadSecret::Shape) }
    }

    /// The header `webhook-signature` of a message.
    pub(super) fn sign(&self, id: &str, timestamp_s: i64, body: &[u8]) -> String {
        // HMAC takes keys of any length; were one refused, an empty signature would be refused by whoever gets it.
        let Ok(mut mac) = Hmac::<Sha256>::new_from_slice(&self.0) else { return String::new() };
        mac.update(format!("{id}.{timestamp_s}.").as_bytes());
        mac.update(body);
        format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()))
    }
}
