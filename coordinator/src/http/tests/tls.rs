//! The service over TLS, with a certificate made for the test.

use super::*;
use crate::http::{Door, TlsIdentity, serve};
use tokio::net::{TcpListener, TcpStream};

#[tokio::test]
async fn it_is_served_over_tls_however_many_clients_say_nothing() {
    rustls::crypto::ring::default_provider().install_default().ok();
    let bench = Bench::new().await;
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let (certificate, key) = (bench.folder.path().join("cert.pem"), bench.folder.path().join("key.pem"));
    std::fs::write(&certificate, made.cert.pem()).unwrap();
    std::fs::write(&key, made.signing_key.serialize_pem()).unwrap();
    let identity = TlsIdentity::read(&certificate, &key).unwrap();
    let (tcp, plain) = (TcpListener::bind("127.0.0.1:0").await.unwrap(), TcpListener::bind("127.0.0.1:0").await.unwrap());
    let (address, inside, shutdown) = (tcp.local_addr().unwrap(), plain.local_addr().unwrap(), CancellationToken::new());
    let doors = vec![Door::new(tcp, Some(identity)), Door::new(plain, None)];
    let engine = Arc::clone(&bench.engine);
    let serving = tokio::spawn({
        let shutdown = shutdown.clone();
        async move { serve(doors, engine, None, shutdown).await }
    });
    let mut silent = Vec::new();
    for _ in 0..20 {
        silent.push(TcpStream::connect(address).await.unwrap());
    }
    let root = reqwest::Certificate::from_pem(made.cert.pem().as_bytes()).unwrap();
    let client = reqwest::Client::builder().tls_certs_only([root]).build().unwrap();
    let url = format!("https://localhost:{}", address.port());
    assert_eq!(client.get(format!("{url}/healthz")).send().await.unwrap().text().await.unwrap(), "ok\n");
    let stranger = reqwest::Client::builder().tls_certs_only([]).build().unwrap();
    assert!(stranger.get(format!("{url}/healthz")).send().await.is_err(), "a certificate that nobody vouches for");
    let plainly = client.get(format!("http://{inside}/healthz")).send().await.unwrap();
    assert_eq!(plainly.status().as_u16(), 200, "the other door");
    shutdown.cancel();
    serving.await.unwrap().unwrap();
}
