//! Webhooks: who asked to be told of the end of a job is told, where the configuration allows it, with a signature.
//!
//! What may be asked is decided when a job is submitted and again before anything is sent, by the host and port of the address as the URL
//! parser reads it: the coordinator stands inside a network, and must not be sent to whatever a client names there (SSRF). Redirects are not
//! followed for the same reason. Messages and signatures are those of Standard Webhooks (github.com/standard-webhooks/standard-webhooks),
//! for which receivers find libraries.

mod config;
mod place;
mod send;
mod sign;

#[cfg(test)]
mod tests;

pub use config::WebhookConfig;
pub(crate) use send::Undelivered;

use crate::records::Problem;
use place::Place;
use reqwest::Url;
use sign::Secret;

/// Bytes of an address.
const URL_BYTES: usize = 2_000;

/// An address that nothing may be sent to.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BadWebhook {
    /// The service sends none.
    #[error(
        "this service sends no webhooks; whoever runs it can allow them with --webhook-allow HOST[:PORT] and --webhook-secret-file FILE"
    )]
    Off,
    /// The text is no address.
    #[error("the webhook is not a URL such as https://ci.example/kiln: {0}")]
    NoUrl(String),
    /// The address is of another kind, or has a user or password.
    #[error("the webhook {0}; expected an address such as https://ci.example/kiln")]
    Kind(&'static str),
    /// The configuration does not name its host and port.
    #[error("webhooks may not go to {0}; whoever runs this service can allow it with --webhook-allow {0}")]
    NotAllowed(String),
}

/// Where webhooks may go, and what they are signed with.
pub(crate) struct Webhooks {
    allow: Vec<Place>,
    secret: Option<Secret>,
}

impl Webhooks {
    /// What the configuration says; reads the file with the secret.
    ///
    /// # Errors
    /// A place that is none, a secret that cannot be read or used.
    pub(crate) fn open(config: &WebhookConfig) -> Result<Self, Problem> {
        let allow = config.allow.iter().map(|text| text.parse()).collect::<Result<_, _>>().map_err(|bad| Problem::new(format!("{bad}")))?;
        let secret = config.secret_file.as_deref().map(Secret::read).transpose();
        Ok(Self { allow, secret: secret.map_err(|bad| Problem::new(format!("webhooks.secret_file: {bad}")))? })
    }

    /// Whether any can be sent.
    pub(crate) fn are_on(&self) -> bool {
        self.secret.is_some() && !self.allow.is_empty()
    }

    /// The address that `text` is.
    ///
    /// # Errors
    /// One that nothing may be sent to.
    pub(crate) fn check(&self, text: &str) -> Result<Url, BadWebhook> {
        self.ready(text).map(|(url, _)| url)
    }

    /// The address and the secret to sign with.
    fn ready(&self, text: &str) -> Result<(Url, &Secret), BadWebhook> {
        let secret = self.secret.as_ref().filter(|_| !self.allow.is_empty()).ok_or(BadWebhook::Off)?;
        if text.len() > URL_BYTES {
            return Err(BadWebhook::Kind("is longer than 2000 bytes"));
        }
        let url = Url::parse(text).map_err(|bad| BadWebhook::NoUrl(bad.to_string()))?;
        if !matches!(url.scheme(), "http" | "https") {
            return Err(BadWebhook::Kind("is neither http nor https"));
        }
        if !url.username().is_empty() || url.password().is_some() {
            return Err(BadWebhook::Kind("has a user or a password in it"));
        }
        if self.allow.iter().any(|place| place.holds(&url)) { Ok((url, secret)) } else { Err(BadWebhook::NotAllowed(place::of(&url))) }
    }
}
