//! The one implementation of TLS's cryptography, chosen once for the process.

/// Makes `ring` the process's choice, unless one was made already. Every client that may speak TLS, also one that then speaks plain HTTP,
/// asks for the choice when it is built and panics where there is none: programs call this first.
pub fn choose() {
    // An error says that a choice was made before, which stays.
    let _ = rustls::crypto::ring::default_provider().install_default();
}
