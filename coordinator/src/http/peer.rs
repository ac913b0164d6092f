//! Who is at the other end of a connection.

use super::tls::TlsListener;
use axum::{extract::connect_info::Connected, serve::IncomingStream};
use std::net::SocketAddr;
use tokio::net::TcpListener;

/// The other end of a connection.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer {
    /// Its address; behind a proxy, the proxy's.
    pub address: SocketAddr,
    /// Whether it came over TLS.
    pub tls: bool,
}

impl Connected<IncomingStream<'_, TcpListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, TcpListener>) -> Self {
        Self { address: *stream.remote_addr(), tls: false }
    }
}

impl Connected<IncomingStream<'_, TlsListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, TlsListener>) -> Self {
        Self { address: *stream.remote_addr(), tls: true }
    }
}
