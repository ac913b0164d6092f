//! Real servers of others, installed by their package managers below the build folder, once, and started on free ports.
//!
//! A server that cannot be installed fails the test with what to install: a test that is skipped proves nothing and says so to nobody.

use crate::harness::{Process, runtime};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use hmac::{Hmac, KeyInit, Mac};
use kiln_test_servers::free_port;
use sha2::Sha256;
use std::{
    fs::File,
    io::{BufRead, BufReader},
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{ChildStderr, Command, Stdio},
};

const MOTO: &str = "5.2.5";
const AZURITE: &str = "3.35.0";

/// The account and the key that every Azurite has; they are in its manual.
pub(crate) const AZURE_ACCOUNT: &str = "devstoreaccount1";
pub(crate) const AZURE_KEY: &str = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw==";

/// S3 by moto, with an empty bucket `kiln`.
pub(crate) struct S3 {
    _process: Process,
    pub(crate) address: SocketAddr,
}

impl S3 {
    pub(crate) fn start() -> Self {
        let program = moto();
        // It takes no port of the system's choosing; another test may take the free one that is found here before it does.
        let (process, address) = (0..20).find_map(|_| moto_on(&program, free_port())).expect("a port that stays free");
        let server = Self { _process: process, address };
        let status = runtime().block_on(async { reqwest::Client::new().put(server.url("kiln")).send().await.unwrap().status() });
        assert!(status.is_success(), "the bucket is made: {status}");
        server
    }

    fn url(&self, path: &str) -> String {
        format!("http://{}/{path}", self.address)
    }

    /// What it answers to GET.
    pub(crate) fn get(&self, path: &str) -> String {
        runtime().block_on(async { reqwest::get(self.url(path)).await.unwrap().text().await.unwrap() })
    }
}

/// How `kiln serve` finds the S3 at `endpoint` by its environment.
pub(crate) fn s3_environment(endpoint: &str) -> Vec<(&'static str, String)> {
    let all = [
        ("AWS_ENDPOINT_URL", endpoint),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_ACCESS_KEY_ID", "key"),
        ("AWS_SECRET_ACCESS_KEY", "secret"),
        ("AWS_REGION", "us-east-1"),
    ];
    all.map(|(name, value)| (name, value.to_owned())).into()
}

/// Azure's blobs by Azurite, with an empty container `kiln`.
pub(crate) struct Azure {
    _process: Process,
    pub(crate) address: SocketAddr,
}

impl Azure {
    pub(crate) fn start() -> Self {
        let mut command = Command::new(azurite());
        command.args(["--silent", "--skipApiVersionCheck", "--disableTelemetry", "--inMemoryPersistence"]);
        command.args(["--blobHost", "127.0.0.1", "--blobPort", "0"]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.stdin(Stdio::null()).spawn().unwrap();
        let out = child.stdout.take().unwrap();
        let process = Process(child);
        let address = announced(out, "successfully listens on http://").expect("Azurite says where it listens");
        make_container(address);
        Self { _process: process, address }
    }
}

/// Creates the container, signed as the protocol wants it (no client library here makes containers).
fn make_container(address: SocketAddr) {
    let (date, version) = ("Tue, 01 Dec 2026 12:00:00 GMT", "2021-12-02");
    let signed = format!(
        "PUT\n\n\n\n\n\n\n\n\n\n\n\nx-ms-date:{date}\nx-ms-version:{version}\n/{AZURE_ACCOUNT}/{AZURE_ACCOUNT}/kiln\nrestype:container"
    );
    let mut mac = Hmac::<Sha256>::new_from_slice(&BASE64_STANDARD.decode(AZURE_KEY).unwrap()).unwrap();
    mac.update(signed.as_bytes());
    let signature = BASE64_STANDARD.encode(mac.finalize().into_bytes());
    let url = format!("http://{address}/{AZURE_ACCOUNT}/kiln?restype=container");
    let request = |client: reqwest::Client| {
        let request = client.put(url).header("x-ms-date", date).header("x-ms-version", version).header("content-length", "0");
        request.header("authorization", format!("SharedKey {AZURE_ACCOUNT}:{signature}")).send()
    };
    let reply = runtime().block_on(async {
        let reply = request(reqwest::Client::new()).await.unwrap();
        (reply.status(), reply.text().await.unwrap())
    });
    assert!(reply.0.is_success(), "{reply:?}");
}

/// A moto on a port; nothing where the port was taken.
fn moto_on(program: &Path, port: u16) -> Option<(Process, SocketAddr)> {
    let mut command = Command::new(program);
    command.args(["-H", "127.0.0.1", "-p", &port.to_string()]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let log: ChildStderr = child.stderr.take().unwrap();
    let process = Process(child);
    announced(log, "Running on http://").map(|address| (process, address))
}

/// The address that a server's log says behind `words`; the rest of the log is read and forgotten.
fn announced(log: impl std::io::Read + Send + 'static, words: &str) -> Option<SocketAddr> {
    let mut log = BufReader::new(log);
    let mut lines = std::iter::from_fn(|| {
        let mut line = String::new();
        (log.read_line(&mut line).ok()? > 0).then_some(line)
    });
    let address = lines.find_map(|line| line.split_once(words).and_then(|(_, rest)| rest.trim().parse().ok()));
    std::thread::spawn(move || std::io::copy(&mut log, &mut std::io::sink()));
    address
}

fn moto() -> PathBuf {
    venv(&format!("moto-{MOTO}"), &[&format!("moto[server]=={MOTO}")]).join("bin/moto_server")
}

/// A virtual environment of Python with these packages; `name` changes with their versions.
pub(crate) fn venv(name: &str, packages: &[&str]) -> PathBuf {
    installed(name, |folder| {
        let made = Command::new("python3").args(["-m", "venv"]).arg(folder).output();
        let made = made.is_ok_and(|output| output.status.success());
        assert!(
            made,
            "this test needs Python 3.10 or newer with venv: on Debian, 'sudo apt-get install python3-venv' (or 'make test-tools')"
        );
        let mut pip = Command::new(folder.join("bin/pip"));
        let pip = pip.args(["install", "--quiet", "--disable-pip-version-check"]).args(packages).output().unwrap();
        let said = String::from_utf8_lossy(&pip.stderr);
        assert!(pip.status.success(), "this test needs the Python packages {packages:?}, which pip could not install: {said}");
    })
}

fn azurite() -> PathBuf {
    let folder = installed(&format!("azurite-{AZURITE}"), |folder| {
        std::fs::create_dir_all(folder).unwrap();
        let wanted = format!("azurite@{AZURITE}");
        let npm = Command::new("npm")
            .args(["install", "--no-audit", "--no-fund", "--loglevel=error", "--prefix"])
            .arg(folder)
            .arg(&wanted)
            .output();
        let npm = npm.expect("this test needs npm: install Node.js from https://nodejs.org");
        let said = String::from_utf8_lossy(&npm.stderr);
        assert!(npm.status.success(), "this test needs the npm package {wanted}, which could not be installed: {said}");
    });
    folder.join("node_modules/.bin/azurite-blob")
}

/// A folder below the build folder that `install` has filled, now or in an earlier run. One process at a time installs.
fn installed(name: &str, install: impl FnOnce(&Path)) -> PathBuf {
    let root = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::create_dir_all(root).unwrap();
    let lock = File::create(root.join(format!("{name}.lock"))).unwrap();
    lock.lock().unwrap();
    let (folder, done) = (root.join(name), root.join(format!("{name}.done")));
    if !done.exists() {
        std::fs::remove_dir_all(&folder).ok(); // What an interrupted installation left.
        install(&folder);
        File::create(done).unwrap();
    }
    folder
}
