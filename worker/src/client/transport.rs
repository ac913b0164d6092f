//! An HTTP client that speaks to one coordinator: with a token, and with the roots that its address needs.
//!
//! Plain addresses get no root certificates at all: a machine without any, as in a slim container, could not even speak HTTP otherwise.
//!
//! A session sends through a [`Carrier`], so that a simulated network can carry the real client's calls. It costs one box per call.

use crate::config::Access;
use reqwest::{
    Certificate, ClientBuilder,
    header::{AUTHORIZATION, HeaderMap, HeaderValue},
};
use std::{error::Error, path::PathBuf, pin::Pin, time::Duration};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Why a request was not answered.
pub type Cause = Box<dyn Error + Send + Sync>;

/// An answer on its way.
pub type Carried<'a> = Pin<Box<dyn Future<Output = Result<reqwest::Response, Cause>> + Send + 'a>>;

/// What brings a request to the coordinator and its answer back, within the time that the request gives.
pub trait Carrier: Send + Sync {
    /// Carries one request.
    fn carry(&self, request: reqwest::Request) -> Carried<'_>;
}

impl Carrier for reqwest::Client {
    fn carry(&self, request: reqwest::Request) -> Carried<'_> {
        let sent = self.execute(request);
        Box::pin(async { Ok(sent.await?) })
    }
}

/// Why no client can be made of what the user gave.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// An address of another kind.
    #[error("`{0}` is not an address that can be asked; expected one such as http://127.0.0.1:8080 or https://bake.example")]
    Address(String),
    /// A token that cannot be sent.
    #[error("the access token holds characters that no token has; give the line that `kiln token create` printed")]
    Token,
    /// A certificate file that cannot be read.
    #[error("the certificate {} cannot be read", path.display())]
    ReadCa {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A certificate file that holds none.
    #[error("{} holds no certificate; expected PEM", .0.display())]
    NoCa(PathBuf),
    /// A certificate file that holds something else.
    #[error("the certificate {} cannot be used", path.display())]
    Ca {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: reqwest::Error,
    },
}

/// A client of the coordinator at `base`, not built yet.
///
/// # Errors
/// An address that is neither `http://` nor `https://`, a token or a certificate that cannot be used.
pub fn builder(base: &str, access: &Access) -> Result<ClientBuilder, TransportError> {
    let mut client = reqwest::Client::builder().connect_timeout(CONNECT_TIMEOUT);
    if let Some(token) = &access.token {
        let mut value = HeaderValue::try_from(format!("Bearer {}", token.expose())).map_err(|_| TransportError::Token)?;
        value.set_sensitive(true);
        client = client.default_headers(HeaderMap::from_iter([(AUTHORIZATION, value)]));
    }
    if base.starts_with("http://") {
        return Ok(client.tls_certs_only([]));
    }
    if !base.starts_with("https://") {
        return Err(TransportError::Address(base.to_owned()));
    }
    let Some(path) = &access.ca else { return Ok(client) };
    let pem = std::fs::read(path).map_err(|source| TransportError::ReadCa { path: path.clone(), source })?;
    let roots = Certificate::from_pem_bundle(&pem).map_err(|source| TransportError::Ca { path: path.clone(), source })?;
    if roots.is_empty() {
        return Err(TransportError::NoCa(path.clone()));
    }
    Ok(client.tls_certs_merge(roots))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::secret::Secret;

    fn refusal(base: &str, access: &Access) -> String {
        builder(base, access).expect_err("a refusal").to_string()
    }

    #[test]
    fn what_cannot_be_used_is_refused_without_telling_the_token() {
        assert!(refusal("ftp://x", &Access::default()).contains("ftp://x"));
        let odd = Access { token: Some(Secret::new("sec\nret")), ca: None };
        let said = refusal("http://x", &odd);
        assert!(said.contains("characters") && !said.contains("sec"), "{said}");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ca.pem");
        let with_ca = Access { token: None, ca: Some(path.clone()) };
        assert!(refusal("https://x", &with_ca).contains("ca.pem"));
        std::fs::write(&path, "no certificate").unwrap();
        assert!(refusal("https://x", &with_ca).contains("holds no certificate"));
        assert!(builder("http://x", &with_ca).is_ok(), "a plain address needs no roots");
    }
}
