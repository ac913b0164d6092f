//! What the OpenAPI document says against what the service does: schemathesis makes up requests, good and bad ones, for every operation, and
//! holds each answer against the document. Its own tests of the document are in `http::openapi`; what is asked for by name is in `http::tests`.
//!
//! Three runs over one service with tokens, with a scene and two jobs in it, one done and one that waits for workers. The first uses the names
//! of what is there, so that more is answered than 404; the second follows the finished job's events, since a stream of a job that goes on
//! would have no end; the third makes up everything. Bodies of the worker protocol are made up bytes: frames have fuzz targets of
//! their own. A fixed seed makes a failure come again. The alternative, checking by hand which statuses each handler may answer with, is
//! what the table of routes is, and this has found what was missing in it.

use crate::{
    harness::{Process, Server, kiln, succeed},
    servers::venv,
};
use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};
use tempfile::TempDir;

const SCHEMATHESIS: &str = "4.32.5";

/// What must hold of every answer. Which data is accepted is not in question here: unknown fields are refused on purpose, and a text that names
/// nothing is a 404. Nor is access, which `http::tests::access` asks of every route: whoever guesses tokens as fast as this is told 429.
const CHECKS: &str = "not_a_server_error,status_code_conformance,content_type_conformance,response_headers_conformance,\
    response_schema_conformance";

/// One surface, lit from above.
const OBJ: &str = "mtllib r.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 -1\nv 0 1 0\nv 1 1 0\nv 0 1 -1\nvt 0 0\nvt 1 0\nvt 0 1\n\
    o floor\nusemtl grey\nf 1/1 2/2 3/3\no lamp\nusemtl light\nf 4/1 6/3 5/2\n";
const MTL: &str = "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl light\nKd 0 0 0\nKe 5 5 5\n";

/// Sends bytes where no schema describes a body.
const HOOKS: &str = "import schemathesis

def as_bytes(context, value):
    return value if isinstance(value, bytes) else str(value).encode('utf-8', 'surrogatepass')

for media_type in ['application/vnd.kiln.frame', 'model/obj', 'application/zip']:
    schemathesis.serializer(media_type)(as_bytes)
";

/// A service with a token, a finished job and one that waits.
struct Subject {
    folder: TempDir,
    server: Server,
    token: String,
    scene: String,
    done: String,
    waiting: String,
}

impl Subject {
    fn start() -> Self {
        let folder = TempDir::new().unwrap();
        let data = folder.path().join("data");
        let config = folder.path().join("kiln.toml");
        // As many requests as one machine can send, and long polls that are short.
        fs::write(&config, "reserve_bytes = 0\n[lease]\npoll_ms = 100\n[access]\nrequests_per_s = 100000\nburst = 100000\n").unwrap();
        fs::write(folder.path().join("r.obj"), OBJ).unwrap();
        fs::write(folder.path().join("r.mtl"), MTL).unwrap();
        let args = ["--json", "token", "create", "--name", "test", "--role", "admin", "--role", "worker", "--data"];
        let made: Value = serde_json::from_str(&succeed(args.into_iter().chain([data.to_str().unwrap()]))).unwrap();
        let server = Server::start(&data, "127.0.0.1:0", &["--config", config.to_str().unwrap()]);
        let token = made["token"].as_str().unwrap().to_owned();
        let mut subject = Self { folder, server, token, scene: String::new(), done: String::new(), waiting: String::new() };
        let mut worker = subject.command(&["work", "--threads", "1"]);
        let worker = Process(worker.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        subject.done = subject.submit(&["--wait"]);
        drop(worker);
        subject.waiting = subject.submit(&[]);
        let jobs: Value = serde_json::from_str(&subject.said(&["--json", "jobs"])).unwrap();
        let record = jobs.as_array().unwrap().iter().find(|job| job["id"] == *subject.done).unwrap();
        subject.scene = record["scene"].as_str().unwrap_or_else(|| panic!("{record}")).to_owned();
        subject
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = kiln(args);
        command.env("KILN_TOKEN", &self.token).env("KILN_SERVER", &self.server.url);
        command
    }

    fn said(&self, args: &[&str]) -> String {
        let output = self.command(args).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Submits the scene; the job's id.
    fn submit(&self, more: &[&str]) -> String {
        let scene = self.folder.path().join("r.obj");
        let mut args =
            vec!["--json", "submit", scene.to_str().unwrap(), "--samples", "4", "--directions", "6x8", "--texels-per-metre", "20"];
        args.extend(more);
        let said: Value = serde_json::from_str(&self.said(&args)).unwrap();
        said["id"].as_str().unwrap().to_owned()
    }

    /// Runs schemathesis with a configuration of names and more flags; what it says where it finds something.
    fn run(&self, name: &str, config: &str, examples: u32, more: &[&str]) -> Result<(), String> {
        let folder = self.folder.path().join(name);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("schemathesis.toml"), config).unwrap();
        fs::write(folder.join("hooks.py"), HOOKS).unwrap();
        let program = venv(&format!("schemathesis-{SCHEMATHESIS}"), &[&format!("schemathesis=={SCHEMATHESIS}")]).join("bin/st");
        let mut command = Command::new(program);
        command.arg("run").arg(format!("{}/openapi.json", self.server.url)).current_dir(&folder).env("SCHEMATHESIS_HOOKS", "hooks");
        command.args([
            "--header",
            &format!("Authorization: Bearer {}", self.token),
            "--checks",
            CHECKS,
            "--phases",
            "examples,coverage,fuzzing",
        ]);
        command.args(["--seed", "1", "--no-shrink", "--continue-on-failure", "--request-timeout", "20", "--warnings", "off"]);
        command.args(["--max-examples", &examples.to_string()]).args(more);
        let output = command.stdin(Stdio::null()).output().unwrap();
        if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stdout).into_owned()) }
    }

    /// The names of what is there, as values of parameters; `sometimes` of all requests use them.
    fn names(&self, sometimes: f32) -> String {
        let Self { scene, done, waiting, .. } = self;
        let files = assets(self.folder.path(), done, |args| self.said(args));
        format!(
            "[dictionaries.jobs]\nvalues = [\"{done}\", \"{done}\", \"{waiting}\"]\n[dictionaries.scenes]\nvalues = [\"{scene}\"]\n\
             [dictionaries.files]\nvalues = {files:?}\n[parameters]\n\"path.id\" = {{ dictionary = \"jobs\", probability = {sometimes} }}\n\
             \"path.scene\" = {{ dictionary = \"scenes\", probability = {sometimes} }}\n\
             \"path.hash\" = {{ dictionary = \"scenes\", probability = {sometimes} }}\n\
             \"path.path\" = {{ dictionary = \"files\", probability = {sometimes} }}\n"
        )
    }
}

/// The files of a job's package.
fn assets(folder: &Path, job: &str, said: impl Fn(&[&str]) -> String) -> Vec<String> {
    let package = folder.join("package");
    said(&["fetch", job, "-o", package.to_str().unwrap()]);
    crate::harness::package(&package).into_keys().collect()
}

#[test]
fn every_answer_is_one_that_the_openapi_document_describes() {
    let subject = Subject::start();
    let examples = if std::env::var_os("KILN_SOAK").is_some() { 200 } else { 8 };
    let follow = ["--exclude-operation-id", "followJob"];
    let keep = ["--exclude-operation-id", "deleteJob", "--exclude-operation-id", "cancelJob"];
    let named = subject.run("named", &subject.names(0.9), examples, &[&follow[..], &keep[..]].concat());
    let config = format!("[parameters]\n\"path.id\" = \"{}\"\n", subject.done);
    let followed = subject.run("followed", &config, examples, &["--include-operation-id", "followJob"]);
    // Last, since it finds the jobs by itself, and deletes them.
    let made_up = subject.run("made-up", "", examples, &follow);
    let found: Vec<String> = [named, followed, made_up].into_iter().filter_map(Result::err).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
