//! Browser scripts as child processes: `tests/browser/*.mjs` drive Chromium, Rust starts and kills the servers around them.
//!
//! A script says where it is with lines of JSON (`{"at": "watching"}`); the test acts then. What happens in the page is judged in the
//! script, what needs the reference renderer is judged here.

use crate::harness::{PATIENCE, Process};
use serde_json::Value;
use std::{
    ffi::OsStr,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread::JoinHandle,
    time::Instant,
};

/// The software GPUs.
pub(crate) const GPUS: [&str; 2] = ["swiftshader", "llvmpipe"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser")
}

/// A running script. It and its browser are killed with it.
pub(crate) struct Script {
    process: Process,
    lines: Receiver<String>,
    errors: Option<JoinHandle<String>>,
}

impl Script {
    /// Starts `tests/browser/NAME` with arguments.
    pub(crate) fn start<S: AsRef<OsStr>>(name: &str, args: impl IntoIterator<Item = S>) -> Self {
        let folder = folder();
        assert!(
            folder.join("node_modules/playwright-core").exists(),
            "the browser tests need their packages: run `npm ci` in tests/browser (`make test` does)"
        );
        let mut command = Command::new("node");
        command.arg(folder.join(name)).args(args);
        // A process group of its own, so that the browser goes when the script is killed.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut child = spawned.expect("the browser tests need node 20.19 or newer");
        let (send, lines) = channel();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        let mut stderr = child.stderr.take().unwrap();
        let errors = std::thread::spawn(move || {
            let mut text = String::new();
            stderr.read_to_string(&mut text).ok();
            text
        });
        Self { process: Process(child), lines, errors: Some(errors) }
    }

    /// Waits for the line `{"at": at, …}`; its value.
    pub(crate) fn wait_for(&mut self, at: &str) -> Value {
        let start = Instant::now();
        loop {
            let left = PATIENCE.saturating_sub(start.elapsed());
            let Ok(line) = self.lines.recv_timeout(left) else { panic!("the script did not come to `{at}`: {}", self.stop()) };
            let said: Value = serde_json::from_str(&line).unwrap_or_else(|_| panic!("the script said: {line}"));
            if said["at"] == at {
                return said;
            }
        }
    }

    /// Waits for its end, which must be a good one; everything that it said and nobody has waited for. A script that draws many pictures on
    /// a busy machine takes long and says something now and then: patience is lost with one that is silent.
    pub(crate) fn finish(mut self) -> Vec<Value> {
        let mut said = vec![];
        loop {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(line) => said.push(serde_json::from_str(&line).unwrap_or_else(|_| panic!("the script said: {line}"))),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => panic!("the script was silent for {PATIENCE:?} after {said:?}: {}", self.stop()),
            }
        }
        let status = self.process.wait();
        assert!(status.success(), "{}", self.stop());
        said
    }

    /// Kills it; what it had to say about its failure.
    fn stop(&mut self) -> String {
        self.kill();
        self.errors.take().and_then(|errors| errors.join().ok()).unwrap_or_default()
    }

    fn kill(&mut self) {
        let group = rustix::process::Pid::from_child(&self.process.0);
        rustix::process::kill_process_group(group, rustix::process::Signal::KILL).ok();
        self.process.kill();
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        self.kill();
    }
}
