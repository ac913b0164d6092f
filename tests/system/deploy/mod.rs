//! The files of `deploy/`, as far as they can be checked without a cluster: schemas, references between files, and whether every flag,
//! variable and metric that they name is the program's own. What only a cluster would show is listed in docs/operations.md as not run.

mod commands;
mod figures;
mod kubernetes;
mod tools;

use crate::harness::succeed;
use serde_json::Value;
use std::{
    fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::{Command, Output},
};
use tempfile::TempDir;
use tools::{succeeds, tool, yaml};

/// A file of the repository.
fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn text(path: &str) -> String {
    fs::read_to_string(file(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Everything below `deploy/`, by its path from the repository's root.
fn deployed() -> Vec<String> {
    let (mut folders, mut files) = (vec!["deploy".to_owned()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(file(&folder)).unwrap() {
            let entry = entry.unwrap();
            let path = format!("{folder}/{}", entry.file_name().to_str().unwrap());
            if entry.file_type().unwrap().is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    // A person's secrets, which git ignores.
    files.retain(|path| path != "deploy/.env");
    files.sort();
    files
}

/// Seconds of a duration such as `40s`.
fn seconds(text: &str) -> u64 {
    text.strip_suffix('s').and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("`{text}` is no number of seconds"))
}

/// Seconds that a worker takes to drain, by the program's own default.
fn drain() -> u64 {
    let help = succeed(["work", "--help"]);
    let (_, after) = help.split_once("--drain-timeout").unwrap();
    let (_, after) = after.split_once("[default: ").unwrap();
    after.split_once(']').unwrap().0.parse().unwrap()
}

#[test]
fn deploy_configurations_are_sound() {
    for path in ["deploy/kiln.example.toml", "deploy/docker/kiln.toml", "deploy/kubernetes/kiln.toml"] {
        succeed(["config", "check", "--config", file(path).to_str().unwrap()]);
    }
}

#[test]
fn deploy_compose_file_fits_the_specification() {
    let path = file("deploy/compose.yaml");
    succeeds(tool("check-jsonschema").args(["--builtin-schema", "vendor.compose-spec"]).arg(&path));
    let compose = &yaml(&["deploy/compose.yaml"])[0];
    let services = compose["services"].as_object().unwrap();
    for (name, service) in services {
        for needed in names(&service["depends_on"]) {
            assert!(services.contains_key(&needed), "{name} depends on {needed}");
        }
    }
    for name in ["coordinator-a", "coordinator-b", "worker"] {
        let grace = seconds(services[name]["stop_grace_period"].as_str().unwrap());
        assert!(grace > drain(), "{name} is killed after {grace} s");
        assert_eq!(services[name]["read_only"], true, "{name}");
        let target = services[name]["build"]["target"].as_str().unwrap();
        assert!(text("deploy/docker/Dockerfile").contains(&format!(" AS {target}\n")), "{target}");
    }
    // Each variable that has no default is in the example, and none there is unused.
    let (source, example) = (text("deploy/compose.yaml"), text("deploy/compose.env.example"));
    for line in example.lines() {
        let Some((variable, _)) = line.trim_start_matches("# ").split_once('=') else { continue };
        assert!(source.contains(&format!("${{{variable}:")), "compose.env.example sets {variable}, which compose.yaml does not use");
    }
    for variable in source.split("${").skip(1).filter_map(|rest| rest.split_once(":?")).map(|(name, _)| name) {
        assert!(variable.contains('}') || example.contains(&format!("\n{variable}=")), "{variable}");
    }
}

/// The names in a `depends_on`, which may be a list or a map.
fn names(value: &Value) -> Vec<String> {
    let listed = value.as_array().into_iter().flatten().map(|name| name.as_str().unwrap().to_owned());
    listed.chain(value.as_object().into_iter().flat_map(|map| map.keys().cloned())).collect()
}

#[test]
fn deploy_balancer_knows_both_coordinators() {
    let caddy = text("deploy/Caddyfile");
    let compose = &yaml(&["deploy/compose.yaml"])[0];
    let upstreams = caddy.lines().find_map(|line| line.trim().strip_prefix("reverse_proxy ")).unwrap();
    let upstreams: Vec<&str> = upstreams.trim_end_matches('{').split_whitespace().collect();
    assert_eq!(upstreams.len(), 2);
    for upstream in upstreams {
        let (service, port) = upstream.split_once(':').unwrap();
        assert!(compose["services"][service].is_object(), "{service}");
        assert!(text("deploy/docker/Dockerfile").contains(&format!("\nEXPOSE {port}\n")));
    }
    assert!(caddy.contains("health_uri /readyz") && caddy.contains("flush_interval -1"));
}

/// What the image is built from exists, is not kept back from the build, and is a whole workspace.
#[test]
fn deploy_image_is_built_from_what_is_there() {
    let (dockerfile, ignore) = (text("deploy/docker/Dockerfile"), text(".dockerignore"));
    let allowed: Vec<&str> = ignore.lines().filter_map(|line| line.strip_prefix('!')).collect();
    let (context, mut stage) = (TempDir::new().unwrap(), "");
    for line in dockerfile.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["FROM", _, "AS", name] => stage = name,
            ["COPY", first, ..] if !first.starts_with("--") => {
                for source in &words[1..words.len() - 1] {
                    assert!(file(source).exists(), "the Dockerfile copies {source}, which does not exist");
                    let fits =
                        |name: &str| Path::new(source).starts_with(name) || source.starts_with(name.strip_suffix('*').unwrap_or("/"));
                    assert!(allowed.iter().any(|name| fits(name)), ".dockerignore keeps {source} back");
                    if stage == "build" {
                        let target = context.path().join(source);
                        fs::create_dir_all(target.parent().unwrap()).unwrap();
                        symlink(file(source), target).unwrap();
                    }
                }
            }
            _ => {}
        }
    }
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--no-deps", "--locked", "--offline", "--format-version", "1"]).current_dir(context.path());
    let metadata: Value = serde_json::from_slice(&succeeds(&mut cargo).stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let kiln = packages.iter().find(|package| package["name"] == "kiln").expect("the workspace has the program");
    let is_binary = |target: &Value| target["kind"][0] == "bin" && target["name"] == "kiln";
    assert!(kiln["targets"].as_array().unwrap().iter().any(is_binary));
    assert!(dockerfile.contains("FROM rust:1.95.0-") && text("rust-toolchain.toml").contains("\"1.95.0\""), "one toolchain everywhere");
}

#[test]
fn deploy_scripts_are_sound() {
    let scripts: Vec<String> = deployed().into_iter().filter(|path| path.ends_with(".sbatch")).collect();
    assert!(!scripts.is_empty());
    for script in &scripts {
        succeeds(Command::new("bash").arg("-n").arg(file(script)));
        succeeds(tool("shellcheck").arg(file(script)));
        let source = text(script);
        let warning = source.lines().find_map(|line| line.strip_prefix("#SBATCH --signal=B:TERM@")).unwrap();
        assert!(warning.parse::<u64>().unwrap() > drain(), "{script}: the signal comes {warning} s before the end");
    }
}

#[test]
fn deploy_units_are_sound() {
    let folder = TempDir::new().unwrap();
    for (source, unit) in [("kiln-coordinator.service", "kiln-coordinator.service"), ("kiln-worker@.service", "kiln-worker@1.service")] {
        let lines = text(&format!("deploy/systemd/{source}"));
        assert!(lines.contains("/usr/local/bin/kiln "), "{source}");
        // A program that exists, since systemd looks for it.
        let installed = lines.replace("/usr/local/bin/kiln", env!("CARGO_BIN_EXE_kiln"));
        let path = folder.path().join(unit);
        fs::write(&path, installed).unwrap();
        let said = systemd(&["verify", path.to_str().unwrap()]);
        let said = String::from_utf8_lossy(&said.stderr).into_owned();
        // Units of the machine itself may have faults, too.
        assert!(!said.lines().any(|line| line.contains("kiln")), "{said}");
        let exposure = systemd(&["security", "--offline=true", "--no-pager", "--threshold=20", path.to_str().unwrap()]);
        assert!(exposure.status.success(), "{unit} is exposed above 2.0:\n{}", String::from_utf8_lossy(&exposure.stdout));
        let stop = lines.lines().find_map(|line| line.strip_prefix("TimeoutStopSec=")).unwrap();
        assert!(stop.parse::<u64>().unwrap() > drain(), "{unit}");
    }
}

fn systemd(args: &[&str]) -> Output {
    let output = Command::new("systemd-analyze").args(args).output();
    output.expect("this test needs systemd-analyze: on Debian, 'sudo apt-get install systemd'")
}
