//! Where webhooks may go: `HOST` or `HOST:PORT`.

use reqwest::Url;
use std::str::FromStr;

/// A host, as the URL parser writes it, and a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    host: String,
    /// The scheme's own where nothing was said: 80 or 443.
    port: Option<u16>,
}

/// A text that is no such place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("webhooks.allow: `{0}` is not HOST or HOST:PORT, such as ci.example or 10.0.0.5:9000; IPv6 addresses stand in brackets")]
pub(super) struct BadPlace(String);

impl FromStr for Place {
    type Err = BadPlace;
    fn from_str(text: &str) -> Result<Self, BadPlace> {
        let bad = || BadPlace(text.to_owned());
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) if !text.ends_with(']') => (host, Some(port.parse().map_err(|_| bad())?)),
            _ => (text, None),
        };
        // The parser of addresses decides how a host is written: lower case, punycode, shortened IPv6.
        let url = Url::parse(&format!("http://{host}/")).map_err(|_| bad())?;
        let only_a_host = url.path() == "/" && url.username().is_empty() && url.password().is_none() && url.port().is_none();
        let plain = only_a_host && url.query().is_none() && url.fragment().is_none() && !host.contains(['/', '@', '\\']);
        let host = url.host_str().filter(|_| plain).ok_or_else(bad)?;
        Ok(Self { host: host.to_owned(), port })
    }
}

impl Place {
    /// Whether an address leads there.
    pub(super) fn holds(&self, url: &Url) -> bool {
        let port = match self.port {
            Some(port) => url.port_or_known_default() == Some(port),
            None => url.port().is_none(),
        };
        port && url.host_str() == Some(&self.host)
    }
}

/// The place that an address leads to, as one would allow it.
pub(super) fn of(url: &Url) -> String {
    let host = url.host_str().unwrap_or_default();
    url.port().map_or_else(|| host.to_owned(), |port| format!("{host}:{port}"))
}
