//! Starting, asking and killing real `kiln` processes. Nothing here uses a fixed port, and every process and folder goes with its guard.

use serde_json::Value;
use std::{
    collections::BTreeMap,
    ffi::{OsStr, OsString},
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    time::{Duration, Instant},
};

/// A job that never ends is a failed test, not a hanging one.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// A file of the project's own scenes.
pub(crate) fn scene(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes").join(path)
}

/// The room of the thesis.
pub(crate) fn room() -> PathBuf {
    scene("thesis-room/thesis.obj")
}

/// Flags that bake the room in a second or two, some thirty tiles, and whatever the test adds or gives another value.
pub(crate) fn quick(more: &[&str]) -> Vec<String> {
    let flags = [["--texel-scale", "0.2"], ["--directions", "6x8"], ["--raw", "u8"], ["--samples", "16"]];
    flags.iter().filter(|f| !more.contains(&f[0])).flatten().chain(more).map(|s| (*s).to_owned()).collect()
}

/// Flags for much to assemble and little to trace: some sixty megabytes of raw radiance, thirty-five of them in one file.
pub(crate) const LARGE: &[&str] = &["--samples", "2", "--max-depth", "2", "--directions", "12x16", "--texel-scale", "0.25", "--raw", "f32"];

/// The room's nominal sizes, as flags.
pub(crate) fn nominal() -> Vec<String> {
    vec!["--settings".into(), scene("thesis-room/nominal.json").display().to_string()]
}

/// A command of the program under test.
pub(crate) fn kiln<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kiln"));
    command.args(args);
    forget_settings(&mut command);
    command
}

/// What the caller's environment says of Kiln is nothing to a test.
fn forget_settings(command: &mut Command) {
    command.stdin(Stdio::null());
    let ours = ["KILN_SERVER", "KILN_CONFIG", "KILN_DATA", "KILN_STORE", "KILN_BLOBS", "KILN_LISTEN", "KILN_LOG", "KILN_SIMD"];
    for name in ours.into_iter().chain(["KILN_TOKEN", "KILN_CA", "KILN_TLS_CERT", "KILN_TLS_KEY"]) {
        command.env_remove(name);
    }
    let of_clouds = |name: &OsString| ["AWS_", "AZURE_", "GOOGLE_"].iter().any(|p| name.to_string_lossy().starts_with(p));
    for (name, _) in std::env::vars_os().filter(|(name, _)| of_clouds(name)) {
        command.env_remove(name);
    }
    // Workers that are killed leave their spool behind, but not in the home of whoever runs the tests.
    command.env("KILN_SPOOL", Path::new(env!("CARGO_TARGET_TMPDIR")).join("spool"));
}

/// Runs a command to its end.
pub(crate) fn run<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Output {
    kiln(args).output().unwrap()
}

/// Runs a command that must succeed; its stdout.
pub(crate) fn succeed<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> String {
    let output = run(args);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs a command that must fail with `code` and say `words` on stderr.
pub(crate) fn fail<S: AsRef<OsStr>>(code: i32, words: &[&str], args: impl IntoIterator<Item = S>) {
    let output = run(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(words.iter().all(|w| said.contains(w)), "expected {words:?} in: {said}");
    assert!(!said.contains("panicked"), "{said}");
}

/// Bakes the room quickly into `dir`, with more flags.
pub(crate) fn bake_room(dir: &Path, more: &[&str]) {
    let mut args: Vec<String> = vec!["bake".into(), room().display().to_string(), "-o".into(), dir.display().to_string()];
    args.extend(nominal());
    args.extend(quick(more));
    succeed(args);
}

/// Every file of a package but `report.json`, by path.
pub(crate) fn package(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(dir).unwrap().display().to_string();
                if name != "report.json" {
                    files.insert(name, std::fs::read(&path).unwrap());
                }
            }
        }
    }
    files
}

/// Fails naming the first file that differs.
pub(crate) fn assert_same_package(a: &Path, b: &Path) {
    let (a, b) = (package(a), package(b));
    assert!(a.keys().eq(b.keys()), "{:?} against {:?}", a.keys(), b.keys());
    assert!(a.len() > 5, "a package has more than {} files", a.len());
    for (name, bytes) in &a {
        assert!(*bytes == b[name], "{name} differs");
    }
}

/// A process that is killed when its guard goes.
pub(crate) struct Process(pub(crate) Child);

impl Process {
    /// SIGKILL, and wait until it is gone.
    pub(crate) fn kill(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }

    /// SIGTERM.
    pub(crate) fn terminate(&self) {
        let sent = Command::new("kill").arg(self.0.id().to_string()).status().unwrap();
        assert!(sent.success());
    }

    /// Waits for its end.
    pub(crate) fn wait(&mut self) -> std::process::ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status;
            }
            assert!(start.elapsed() < PATIENCE, "the process does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A coordinator in a process of its own.
pub(crate) struct Server {
    pub(crate) process: Process,
    pub(crate) url: String,
    pub(crate) port: u16,
}

impl Server {
    /// Starts `kiln serve` on `listen` (`127.0.0.1:0` for any free port) without workers of its own.
    pub(crate) fn start(data: &Path, listen: &str, more: &[&str]) -> Self {
        let mut command = kiln(["--json", "serve", "--listen", listen, "--workers", "0", "--data"]);
        command.arg(data).args(more);
        Self::spawn(command)
    }

    /// Starts `kiln serve` with more of an environment.
    pub(crate) fn start_with(environment: &[(&str, String)], data: &Path, more: &[&str]) -> Self {
        let mut command = kiln(["--json", "serve", "--listen", "127.0.0.1:0", "--workers", "0", "--data"]);
        command.arg(data).args(more).envs(environment.iter().map(|(name, value)| (name, value)));
        Self::spawn(command)
    }

    /// Starts `kiln serve` through a `wrapper`, a command that limits what it runs in its place: the process stays the same.
    pub(crate) fn start_through(wrapper: &[&str], data: &Path, more: &[&str]) -> Self {
        let mut command = Command::new(wrapper[0]);
        command.args(&wrapper[1..]).arg(env!("CARGO_BIN_EXE_kiln"));
        command.args(["--json", "serve", "--listen", "127.0.0.1:0", "--workers", "0", "--data"]).arg(data).args(more);
        forget_settings(&mut command);
        Self::spawn(command)
    }

    pub(crate) fn spawn(command: Command) -> Self {
        let (process, said) = announced(command);
        let port = u16::try_from(said["port"].as_u64().unwrap()).unwrap();
        Self { process, url: said["url"].as_str().unwrap().to_owned(), port }
    }

    /// A coordinator whose leases are short, so that a silent worker is noticed in a test's time.
    pub(crate) fn impatient(folder: &Path, listen: &str) -> Self {
        let config = folder.join("kiln.toml");
        std::fs::write(&config, "[lease]\nttl_ms = 1500\nheartbeat_ms = 300\ntarget_ms = 600\n\n[chunks]\nage_ms = 150\n").unwrap();
        Self::start(&folder.join("data"), listen, &["--config", config.to_str().unwrap()])
    }

    /// Starts a worker for it.
    pub(crate) fn worker(&self, more: &[&str]) -> Process {
        let mut command = kiln(["work", "--threads", "1", "--join", &self.url]);
        Process(command.args(more).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }

    /// Submits the room; the job's id.
    pub(crate) fn submit_room(&self, more: &[&str]) -> String {
        let mut args: Vec<String> = ["--json", "submit", "--server", &self.url].map(str::to_owned).to_vec();
        args.push(room().display().to_string());
        args.extend(nominal());
        args.extend(quick(more));
        let said: Value = serde_json::from_str(&succeed(args)).unwrap();
        said["id"].as_str().unwrap().to_owned()
    }

    /// GET a JSON document with the HTTP client of the test's own runtime.
    pub(crate) fn get(&self, path: &str) -> Value {
        let url = format!("{}{path}", self.url);
        runtime().block_on(async { reqwest::get(url).await.unwrap().json().await.unwrap() })
    }

    /// GET a text.
    pub(crate) fn text(&self, path: &str) -> String {
        let url = format!("{}{path}", self.url);
        runtime().block_on(async { reqwest::get(url).await.unwrap().text().await.unwrap() })
    }

    /// Waits until the job's record satisfies `is`; the record.
    pub(crate) fn wait_for(&self, job: &str, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let record = self.get(&format!("/v1/jobs/{job}"));
            if is(&record) {
                return record;
            }
            assert!(record["state"] != "failed", "{record}");
            assert!(start.elapsed() < PATIENCE, "waiting for {what}: {record}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until some of the Bake phase is accepted, but not all.
    pub(crate) fn wait_until_halfway(&self, job: &str) -> Value {
        self.wait_for(job, "half of the tiles", |r| {
            assert!(r["state"] != "done", "the job was too quick to be disturbed");
            r["phase"] == "bake" && r["progress"]["tiles_done"].as_u64() > Some(4)
        })
    }

    /// Waits for the end and fetches the package into `dir`.
    pub(crate) fn fetch_when_done(&self, job: &str, dir: &Path) {
        self.wait_for(job, "the end", |r| r["state"] == "done");
        succeed(["fetch", job, "--server", &self.url, "-o", dir.to_str().unwrap()]);
    }
}

/// A package in `kiln view`.
pub(crate) struct View {
    _process: Process,
    pub(crate) url: String,
}

impl View {
    /// Serves a package on a free port.
    pub(crate) fn start(package: &Path) -> Self {
        let mut command = kiln(["--json", "view"]);
        command.arg(package);
        let (process, said) = announced(command);
        Self { _process: process, url: said["url"].as_str().unwrap().to_owned() }
    }
}

/// Starts a command that serves until it is stopped, and reads the line of JSON with which it says where.
pub(crate) fn announced(mut command: Command) -> (Process, Value) {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    let Ok(said) = serde_json::from_str::<Value>(&first) else {
        let mut error = String::new();
        child.stderr.take().unwrap().read_to_string(&mut error).ok();
        panic!("kiln did not start to serve: {error}");
    };
    // Nobody reads its log from here on; a full pipe must not stop it.
    let mut log = child.stderr.take().unwrap();
    std::thread::spawn(move || std::io::copy(&mut log, &mut std::io::sink()));
    (Process(child), said)
}

/// A runtime for one request.
pub(crate) fn runtime() -> tokio::runtime::Runtime {
    kiln_coordinator::crypto::choose();
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap()
}
