//! TLS on the listener, by rustls: for those who have a certificate and no proxy.
//!
//! Handshakes run beside the accepting of connections and have a time limit, so that a client that connects and says nothing holds nobody
//! up. Certificates are read once; after a renewal the service is restarted, which workers and clients sit out.

use axum::serve::Listener;
use rustls::{
    ServerConfig,
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject},
};
use std::{
    io,
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};
use tokio::{
    net::{TcpListener, TcpStream},
    task::JoinSet,
    time::timeout,
};
use tokio_rustls::{TlsAcceptor, server::TlsStream};

/// How long a handshake may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// Handshakes under way at most; further connections wait in the system's queue.
const HANDSHAKES: usize = 256;

/// Why TLS cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file that is missing, or not what it should be.
    #[error("the {what} {} cannot be used", path.display())]
    File {
        /// Certificate or key.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: rustls::pki_types::pem::Error,
    },
    /// A certificate file without a certificate.
    #[error("{} holds no certificate; expected PEM, the server's certificate first, then those that signed it", .0.display())]
    Empty(PathBuf),
    /// Certificate and key that are not a pair, or of an unknown kind.
    #[error("the certificate {} and the key {} cannot be used together", certificate.display(), key.display())]
    Pair {
        /// The certificate's file.
        certificate: PathBuf,
        /// The key's file.
        key: PathBuf,
        /// Why.
        #[source]
        source: rustls::Error,
    },
}

/// What TLS is served with.
#[derive(Clone)]
pub struct TlsIdentity(Arc<ServerConfig>);

impl TlsIdentity {
    /// Reads a certificate with its chain, and its key, both PEM.
    ///
    /// # Errors
    /// Files that cannot be read, are not PEM, or are not a pair.
    pub fn read(certificate: &Path, key: &Path) -> Result<Self, TlsError> {
        let bad = |what, path: &Path| {
            let path = path.to_owned();
            move |source| TlsError::File { what, path, source }
        };
        let chain = CertificateDer::pem_file_iter(certificate).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let chain = chain.map_err(bad("TLS certificate", certificate))?;
        if chain.is_empty() {
            return Err(TlsError::Empty(certificate.to_owned()));
        }
        let secret = PrivateKeyDer::from_pem_file(key).map_err(bad("TLS key", key))?;
        let pair = |source| TlsError::Pair { certificate: certificate.to_owned(), key: key.to_owned(), source };
        let builder = ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()));
        let builder = builder.with_safe_default_protocol_versions().map_err(pair)?;
        let mut config = builder.with_no_client_auth().with_single_cert(chain, secret).map_err(pair)?;
        config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
        Ok(Self(Arc::new(config)))
    }
}

/// A listener whose connections have completed their handshake.
pub struct TlsListener {
    tcp: TcpListener,
    acceptor: TlsAcceptor,
    handshakes: JoinSet<Option<(TlsStream<TcpStream>, SocketAddr)>>,
}

impl TlsListener {
    /// TLS over the connections of `tcp`.
    #[must_use]
    pub fn new(tcp: TcpListener, identity: TlsIdentity) -> Self {
        Self { tcp, acceptor: TlsAcceptor::from(identity.0), handshakes: JoinSet::new() }
    }
}

impl Listener for TlsListener {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let room = self.handshakes.len() < HANDSHAKES;
            tokio::select! {
                // axum's own accepting waits where the system is out of descriptors.
                (stream, address) = Listener::accept(&mut self.tcp), if room => {
                    let handshake = self.acceptor.accept(stream);
                    self.handshakes.spawn(async move {
                        match timeout(PATIENCE, handshake).await {
                            Ok(Ok(stream)) => Some((stream, address)),
                            Ok(Err(error)) => {
                                tracing::debug!(%error, %address, "a TLS handshake failed");
                                None
                            }
                            Err(_) => None,
                        }
                    });
                }
                Some(done) = self.handshakes.join_next() => {
                    if let Ok(Some(connection)) = done {
                        return connection;
                    }
                }
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.tcp.local_addr()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn refused(certificate: &Path, key: &Path) -> String {
        let error = TlsIdentity::read(certificate, key).err().expect("a refusal");
        kiln_proto::chain(&error)
    }

    #[test]
    fn files_that_cannot_be_used_are_named_with_the_reason() {
        let dir = TempDir::new().unwrap();
        let pair = |name: &str| {
            let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
            let (certificate, key) = (dir.path().join(format!("{name}.pem")), dir.path().join(format!("{name}.key")));
            std::fs::write(&certificate, made.cert.pem()).unwrap();
            std::fs::write(&key, made.signing_key.serialize_pem()).unwrap();
            (certificate, key)
        };
        let ((one, one_key), (_, other_key)) = (pair("one"), pair("other"));
        assert!(TlsIdentity::read(&one, &one_key).is_ok());
        let missing = dir.path().join("missing.pem");
        let text = refused(&missing, &one_key);
        assert!(text.contains("missing.pem") && text.contains("No such file"), "{text}");
        let text = refused(&one_key, &one_key);
        assert!(text.contains("one.key") && text.contains("no certificate"), "{text}");
        let text = refused(&one, &one);
        assert!(text.contains("TLS key") && text.contains("one.pem"), "{text}");
        let text = refused(&one, &other_key);
        assert!(text.contains("one.pem") && text.contains("other.key"), "{text}");
    }
}
