//! PostgreSQL from the system's packages, in a folder of its own.
//!
//! It refuses to run as root: then it runs as the user `postgres`, which its package makes. Tests stop it without warning and
//! ask what it remembers: that needs no flush of the disk, which would cost most of their time.

use crate::free_port;
use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
    os::unix::{fs::PermissionsExt, process::CommandExt},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::atomic::{AtomicU32, Ordering},
    thread::sleep,
    time::Duration,
};
use tempfile::TempDir;

/// How long a server may take to start, in steps of [`STEP`].
const STEPS: u32 = 600;
const STEP: Duration = Duration::from_millis(50);

/// A running server.
pub struct Postgres {
    folder: TempDir,
    programs: PathBuf,
    user: Option<(u32, u32)>,
    port: u16,
    child: Option<Child>,
    databases: AtomicU32,
}

impl Postgres {
    /// Makes a cluster and starts it.
    ///
    /// # Panics
    /// Where PostgreSQL is not installed, or does not start.
    #[must_use]
    pub fn start() -> Self {
        let programs = programs().expect("PostgreSQL is needed by this test: on Debian, 'sudo apt-get install postgresql'");
        let folder = tempfile::Builder::new().prefix("kiln-postgres-").tempdir().expect("a temporary folder");
        let user = rustix::process::geteuid().is_root().then(postgres_user);
        // Its own user must reach it.
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).expect("permissions");
        let mut server = Self { folder, programs, user, port: free_port(), child: None, databases: AtomicU32::new(0) };
        let data = server.data();
        let mut initdb = server.command("initdb");
        initdb.args(["-U", "postgres", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8", "--no-sync", "-D"]).arg(&data);
        let made = initdb.output().expect("initdb");
        assert!(made.status.success(), "initdb: {}", String::from_utf8_lossy(&made.stderr));
        server.run();
        server
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(self.programs.join(program));
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        if let Some((user, group)) = self.user {
            command.uid(user).gid(group);
        }
        command
    }

    /// Starts the server on its cluster.
    ///
    /// # Panics
    /// Where it does not begin to listen.
    pub fn run(&mut self) {
        let log = fs::File::create(self.folder.path().join("log")).expect("a log");
        let mut server = self.command("postgres");
        server.arg("-D").arg(self.data()).args(["-p", &self.port.to_string(), "-c", "listen_addresses=127.0.0.1"]);
        server.args(["-c", &format!("unix_socket_directories={}", self.folder.path().display()), "-c", "max_connections=60"]);
        // What is committed is the system's from then on, and outlives any end of this process; only a power cut would need the flush.
        server.args(["-c", "fsync=off"]);
        server.stdout(Stdio::null()).stderr(log);
        self.child = Some(server.spawn().expect("postgres"));
        for _ in 0..STEPS {
            if self.answers() {
                return;
            }
            if let Some(ended) = self.child.as_mut().and_then(|child| child.try_wait().expect("a child")) {
                panic!("postgres ended with {ended}: {}", self.log());
            }
            sleep(STEP);
        }
        panic!("postgres did not start: {}", self.log());
    }

    fn log(&self) -> String {
        fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }

    /// Whether it takes connections: it answers a request for encryption with a letter.
    fn answers(&self) -> bool {
        let Ok(mut stream) = TcpStream::connect(("127.0.0.1", self.port)) else { return false };
        let mut answer = [0];
        stream.set_read_timeout(Some(Duration::from_secs(5))).is_ok()
            && stream.write_all(&[0, 0, 0, 8, 4, 210, 22, 47]).is_ok()
            && stream.read_exact(&mut answer).is_ok()
    }

    /// Stops it at once, as a power cut does for all that it knows: what is committed must be there when it [runs](Self::run) again.
    pub fn stop_immediately(&mut self) {
        if let Some(mut child) = self.child.take() {
            let pid = rustix::process::Pid::from_child(&child);
            // SIGQUIT is PostgreSQL's immediate shutdown.
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::QUIT);
            let _ = child.wait();
        }
    }

    /// The URL of a new database.
    ///
    /// # Panics
    /// Where it cannot be made.
    #[must_use]
    pub fn database(&self) -> String {
        let name = format!("kiln{}", self.databases.fetch_add(1, Ordering::Relaxed));
        let create = format!("CREATE DATABASE {name}");
        // It takes connections a moment before it has started up, and says so to whoever is that quick.
        for step in 0..STEPS {
            let made = self.command("psql").args(self.reach()).args(["-d", "postgres", "-c", &create]).output().expect("psql");
            let said = String::from_utf8_lossy(&made.stderr);
            if made.status.success() {
                break;
            }
            assert!(said.contains("starting up") && step + 1 < STEPS, "psql: {said}");
            sleep(STEP);
        }
        format!("postgres://postgres@127.0.0.1:{}/{name}", self.port)
    }

    fn reach(&self) -> [String; 7] {
        ["-h", "127.0.0.1", "-p", &self.port.to_string(), "-U", "postgres", "-q"].map(str::to_owned)
    }

    /// The port on which it listens.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.port
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        self.stop_immediately();
    }
}

/// The folder of the newest installed server.
fn programs() -> Option<PathBuf> {
    let versions = fs::read_dir("/usr/lib/postgresql").ok()?;
    let number = |path: &Path| path.file_name()?.to_str()?.parse::<u32>().ok();
    let newest =
        versions.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.join("bin/initdb").exists()).max_by_key(|p| number(p));
    newest.map(|path| path.join("bin"))
}

/// The ids of the user and the group `postgres`.
fn postgres_user() -> (u32, u32) {
    let users = fs::read_to_string("/etc/passwd").expect("/etc/passwd");
    let fields = users.lines().map(|line| line.split(':').collect::<Vec<_>>()).find(|fields| fields[0] == "postgres");
    let fields = fields.expect("the user `postgres`, which the package postgresql makes");
    (fields[2].parse().expect("a user id"), fields[3].parse().expect("a group id"))
}
