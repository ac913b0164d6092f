//! Blobs in object stores: real servers behind proxies that misbehave, and a bake that must not notice.

use crate::{
    fault_proxy::{Fault, FaultProxy, TcpFaults},
    harness::{Server, assert_same_package, bake_room, fail, kiln, runtime},
    servers::{AZURE_ACCOUNT, AZURE_KEY, Azure, S3, s3_environment},
};
use axum::http::{Method, Uri};
// What the suite below sees of the crate that it is a part of.
use kiln_coordinator::blob::{BlobError, BlobName, Blobs, RemoteBlobs};
use object_store::{BackoffConfig, ObjectStore, RetryConfig, aws::AmazonS3Builder, azure::MicrosoftAzureBuilder, prefix::PrefixStore};
use std::{io::Write, net::SocketAddr, sync::Arc, time::Duration};
use tempfile::{NamedTempFile, TempDir};

#[path = "../../coordinator/src/blob/conformance.rs"]
mod conformance;

/// One request in twenty, in turn: an error, a plea to slow down, half of a blob, a pause.
pub(crate) fn one_in_twenty(number: u64, method: &Method, uri: &Uri) -> Option<Fault> {
    let is_blob = method == Method::GET && uri.path().contains("/blake3/");
    let half = if is_blob { Fault::Half } else { Fault::Status(500) };
    let faults = [Fault::Status(500), Fault::Status(503), half, Fault::Late(Duration::from_millis(300))];
    (number.is_multiple_of(20)).then(|| faults[(number / 20) as usize % faults.len()])
}

/// Two proxies before a server: one breaks connections, the other requests.
struct Weather {
    outer: FaultProxy,
    inner: FaultProxy,
}

impl Weather {
    /// A connection is cut after `first_cut` bytes, and later again. Behind a part or a chunk of 8 MiB there is room for a little more.
    fn before(server: SocketAddr, first_cut: u64) -> Self {
        let inner = FaultProxy::http(server, one_in_twenty);
        let faults = TcpFaults { delay: Duration::from_millis(5), first_cut, cut_every: (8 << 20) + (256 << 10) };
        Self { outer: FaultProxy::tcp(inner.address, faults), inner }
    }

    fn assert_bad(&self) {
        assert!(self.inner.faults() > 2 && self.outer.faults() > 0, "{} and {} faults", self.inner.faults(), self.outer.faults());
    }
}

fn quick_retry() -> RetryConfig {
    let backoff = BackoffConfig { init_backoff: Duration::from_millis(10), max_backoff: Duration::from_millis(200), base: 2.0 };
    RetryConfig { backoff, max_retries: 8, ..RetryConfig::default() }
}

fn s3(endpoint: &str) -> AmazonS3Builder {
    let builder = AmazonS3Builder::new().with_endpoint(endpoint).with_allow_http(true).with_bucket_name("kiln");
    builder.with_access_key_id("key").with_secret_access_key("secret").with_retry(quick_retry()).with_disable_bulk_delete(true)
}

fn conforms(store: impl ObjectStore) {
    let dir = TempDir::new().unwrap();
    let blobs = RemoteBlobs::new(Arc::new(PrefixStore::new(store, "some/prefix")));
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(conformance::all(&blobs, dir.path()));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing stays staged");
}

#[test]
fn s3_does_what_every_store_of_blobs_must_through_faults() {
    let server = S3::start();
    let weather = Weather::before(server.address, 1 << 20);
    conforms(s3(&weather.outer.url()).build().unwrap());
    weather.assert_bad();
}

#[test]
fn azure_does_what_every_store_of_blobs_must_through_faults() {
    let server = Azure::start();
    let weather = Weather::before(server.address, 1 << 20);
    let builder = MicrosoftAzureBuilder::new().with_endpoint(format!("{}/{AZURE_ACCOUNT}", weather.outer.url())).with_allow_http(true);
    let builder = builder.with_account(AZURE_ACCOUNT).with_access_key(AZURE_KEY).with_container_name("kiln").with_retry(quick_retry());
    conforms(builder.build().unwrap());
    weather.assert_bad();
}

#[test]
fn an_upload_that_fails_leaves_no_parts() {
    let server = S3::start();
    let proxy = FaultProxy::http(server.address, |_, method, uri| {
        let second = method == Method::PUT && uri.query().is_some_and(|query| query.contains("partNumber=2"));
        second.then_some(Fault::Status(403))
    });
    let blobs = RemoteBlobs::new(Arc::new(s3(&proxy.url()).build().unwrap()));
    let bytes = vec![7; 20 << 20];
    let (name, mut file) = (BlobName::of(&bytes), NamedTempFile::new().unwrap());
    file.write_all(&bytes).unwrap();
    let error = runtime().block_on(blobs.put_file(name, file.into_temp_path())).unwrap_err();
    assert!(matches!(error, BlobError::Denied { .. }), "{error:?}");
    let uploads = server.get("kiln?uploads");
    assert!(uploads.contains("ListMultipartUploadsResult") && !uploads.contains("<Upload>"), "{uploads}");
    assert!(!server.get("kiln?list-type=2").contains("<Key>"));
}

#[test]
fn a_bake_into_s3_through_faults_gives_the_same_package() {
    let dir = TempDir::new().unwrap();
    let expected = dir.path().join("expected");
    bake_room(&expected, &[]);
    let server = S3::start();
    let weather = Weather::before(server.address, 512 << 10);
    let data = dir.path().join("data");
    let farm = Server::start_with(&s3_environment(&weather.outer.url()), &data, &["--blobs", "s3://kiln/farm"]);
    let _worker = farm.worker(&[]);
    let package = dir.path().join("package");
    farm.fetch_when_done(&farm.submit_room(&[]), &package);
    assert_same_package(&expected, &package);
    weather.assert_bad();
    assert!(!data.join("blobs").exists(), "no blob lies in the data folder");
    let listed = server.get("kiln?list-type=2");
    assert!(listed.contains("<Key>farm/blake3/") && !listed.contains("/probe/"), "{listed}");
}

#[test]
fn a_bake_outlives_an_outage_of_its_object_store() {
    let dir = TempDir::new().unwrap();
    let expected = dir.path().join("expected");
    bake_room(&expected, &[]);
    let server = S3::start();
    // Long enough that tasks and chunks are put off, not only requests repeated.
    let outage = FaultProxy::http(server.address, |number, _, _| (20..60).contains(&number).then_some(Fault::Status(503)));
    let farm = Server::start_with(&s3_environment(&outage.url()), &dir.path().join("data"), &["--blobs", "s3://kiln"]);
    let _worker = farm.worker(&[]);
    let package = dir.path().join("package");
    farm.fetch_when_done(&farm.submit_room(&[]), &package);
    assert_same_package(&expected, &package);
    assert_eq!(outage.faults(), 40);
}

#[test]
fn places_that_cannot_be_used_are_told_at_the_start() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data").display().to_string();
    let serve = ["serve", "--listen", "127.0.0.1:0", "--workers", "0", "--data", &data, "--blobs"];
    let said = |environment: Vec<(&str, String)>, place: &str| {
        let output = kiln(serve.iter().chain(&[place])).envs(environment).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    let server = S3::start();
    let endpoint = format!("http://{}", server.address);
    let missing = said(s3_environment(&endpoint), "s3://nowhere/farm");
    assert!(["s3://nowhere/farm", &endpoint, "exists", "storing"].iter().all(|w| missing.contains(w)), "{missing}");

    let guarded = FaultProxy::http(server.address, |_, _, _| Some(Fault::Status(403)));
    let denied = said(s3_environment(&guarded.url()), "s3://kiln/farm");
    assert!(["s3://kiln/farm", &guarded.url(), "AWS_ACCESS_KEY_ID"].iter().all(|w| denied.contains(w)), "{denied}");

    let plain = vec![("AWS_ENDPOINT_URL", endpoint), ("AWS_ACCESS_KEY_ID", "key".into()), ("AWS_SECRET_ACCESS_KEY", "secret".into())];
    let plain = said(plain, "s3://kiln/farm");
    assert!(plain.contains("AWS_ALLOW_HTTP"), "{plain}");

    let no_account = said(vec![], "az://kiln");
    assert!(no_account.contains("AZURE_STORAGE_ACCOUNT_NAME"), "{no_account}");

    let config = dir.path().join("kiln.toml");
    std::fs::write(&config, "blobs = \"ftp://host/x\"\n").unwrap();
    fail(2, &["blobs", "s3://BUCKET/PREFIX"], ["config", "check", "--config", config.to_str().unwrap()]);
    fail(2, &["--blobs", "user or password"], serve.iter().chain(&["s3://key:secret@bucket"]));
}

#[test]
fn a_folder_elsewhere_holds_the_blobs() {
    let dir = TempDir::new().unwrap();
    let (data, blobs) = (dir.path().join("data"), dir.path().join("elsewhere"));
    let farm = Server::start(&data, "127.0.0.1:0", &["--blobs", &format!("file://{}", blobs.display())]);
    let _worker = farm.worker(&[]);
    farm.fetch_when_done(&farm.submit_room(&[]), &dir.path().join("package"));
    assert!(blobs.join("blake3").exists() && !data.join("blobs").exists());
}
