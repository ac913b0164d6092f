//! Tokens and TLS as users meet them: real processes, real certificates, nothing taken on trust.

use crate::harness::{PATIENCE, Process, Server, announced, fail, kiln, nominal, quick, room, succeed};
use serde_json::Value;
use std::{
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::Instant,
};
use tempfile::TempDir;

/// Makes a token; its id and its text.
fn token(data: &Path, roles: &[&str]) -> (String, String) {
    let mut args = vec!["--json", "token", "create", "--name", "test", "--data", data.to_str().unwrap()];
    args.extend(roles.iter().flat_map(|role| ["--role", *role]));
    let said: Value = serde_json::from_str(&succeed(args)).unwrap();
    let text = |field: &str| said[field].as_str().unwrap().to_owned();
    (text("id"), text("token"))
}

/// A command of someone with a token, for the service at `url`.
fn as_holder(token: &str, url: &str, args: &[&str]) -> Command {
    let mut command = kiln(args);
    command.env("KILN_TOKEN", token).env("KILN_SERVER", url);
    command
}

fn said(output: Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a command that must fail says.
fn refused(mut command: Command) -> String {
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    text
}

/// Submits the room and waits for its end; the job's id.
fn bake(token: &str, url: &str, more: &[&str]) -> String {
    let room = room().display().to_string();
    let mut args = vec!["--json".to_owned(), "submit".into(), room, "--wait".into()];
    args.extend(nominal());
    args.extend(quick(more));
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let line: Value = serde_json::from_str(&said(as_holder(token, url, &args).output().unwrap())).unwrap();
    line["id"].as_str().unwrap().to_owned()
}

#[test]
fn a_farm_with_tokens_serves_each_what_is_theirs() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    let (_, worker) = token(&data, &["worker"]);
    let ((ann_id, ann), (_, bob), (_, reader)) = (token(&data, &["submit"]), token(&data, &["submit"]), token(&data, &["read"]));
    // An address that others reach: with tokens, there is nothing to refuse.
    let server = Server::start(&data, "0.0.0.0:0", &[]);
    let url = format!("http://127.0.0.1:{}", server.port);
    fail(1, &["access token", "--token", "KILN_TOKEN"], ["jobs", "--server", &url]);
    let without = kiln(["work", "--threads", "1", "--join", &url]);
    assert!(refused(without).contains("role worker"));
    let other_role = as_holder(&ann, &url, &["work", "--threads", "1"]);
    assert!(refused(other_role).contains("role worker"));
    let mut hands = as_holder(&worker, &url, &["work", "--threads", "1"]);
    let _hands = Process(hands.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    let job = bake(&ann, &url, &[]);
    let package = dir.path().join("package");
    said(as_holder(&ann, &url, &["fetch", &job, "-o", package.to_str().unwrap()]).output().unwrap());
    assert!(package.join("manifest.json").exists());
    assert!(refused(as_holder(&bob, &url, &["cancel", &job])).contains("there is no job"));
    assert!(!said(as_holder(&bob, &url, &["jobs"]).output().unwrap()).contains(&job));
    assert!(said(as_holder(&reader, &url, &["jobs"]).output().unwrap()).contains(&job));
    assert!(refused(as_holder(&reader, &url, &["cancel", &job])).contains("submit or admin"));
    // Taken back beside the running service.
    succeed(["token", "revoke", &ann_id, "--data", data.to_str().unwrap()]);
    let start = Instant::now();
    while as_holder(&ann, &url, &["jobs"]).output().unwrap().status.success() {
        assert!(start.elapsed() < PATIENCE, "a revoked token is still accepted");
    }
    assert!(refused(as_holder(&ann, &url, &["jobs"])).contains("revoked"));
    let list = succeed(["token", "list", "--data", data.to_str().unwrap()]);
    let line = list.lines().find(|line| line.contains(&ann_id)).unwrap();
    assert!(line.contains("submit") && line.ends_with("revoked"), "{list}");
    assert!(![&ann, &bob, &worker].iter().any(|text| list.contains(text.as_str())), "a list holds no secrets");
}

/// A certificate for this machine and its key, in files.
fn certificate(dir: &Path) -> (PathBuf, PathBuf) {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned(), "127.0.0.1".to_owned()]).unwrap();
    let (certificate, key) = (dir.join("cert.pem"), dir.join("key.pem"));
    std::fs::write(&certificate, made.cert.pem()).unwrap();
    std::fs::write(&key, made.signing_key.serialize_pem()).unwrap();
    (certificate, key)
}

#[test]
fn a_farm_over_tls_bakes_with_its_own_worker_and_another() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data");
    let ((_, admin), (_, worker)) = (token(&data, &["admin"]), token(&data, &["worker"]));
    let (certificate, key) = certificate(dir.path());
    let (certificate, key) = (certificate.to_str().unwrap(), key.to_str().unwrap());
    let mut serve = kiln(["--json", "serve", "--listen", "127.0.0.1:0", "--threads", "1", "--tls-cert", certificate, "--tls-key", key]);
    serve.arg("--data").arg(&data);
    let (_server, announced) = announced(serve);
    let url = announced["url"].as_str().unwrap();
    assert!(url.starts_with("https://127.0.0.1:"), "{url}");
    let doubted = refused(as_holder(&admin, url, &["jobs"]));
    assert!(doubted.contains("certificate"), "nobody vouches for it: {doubted}");
    // The service's own worker, which no certificate names, does the work.
    let job = bake(&admin, url, &["--ca", certificate]);
    let mut jobs = as_holder(&admin, url, &["jobs", "--state", "done"]);
    assert!(said(jobs.env("KILN_CA", certificate).output().unwrap()).contains(&job));
    let mut hands = as_holder(&worker, url, &["work", "--threads", "1", "--name", "visitor", "--ca", certificate]);
    let _hands = Process(hands.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    let start = Instant::now();
    let runtime = crate::harness::runtime();
    let visitor = || {
        let root = reqwest::Certificate::from_pem(&std::fs::read(certificate).unwrap()).unwrap();
        let client = reqwest::Client::builder().tls_certs_only([root]).build().unwrap();
        let asked = client.get(format!("{url}/v1/workers")).bearer_auth(&admin);
        let workers: Value = runtime.block_on(async { asked.send().await.unwrap().json().await.unwrap() });
        workers.to_string().contains("visitor")
    };
    while !visitor() {
        assert!(start.elapsed() < PATIENCE, "the worker does not arrive over TLS");
    }
}

#[test]
fn what_serve_cannot_serve_safely_it_refuses_to_serve() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data").display().to_string();
    let open = ["serve", "--listen", "0.0.0.0:0", "--workers", "0", "--data", &data];
    fail(2, &["kiln token create", &data, "--insecure-no-auth"], open);
    let (certificate, key) = certificate(dir.path());
    let (certificate, key) = (certificate.display().to_string(), key.display().to_string());
    let tls = |cert: &str, key: &str| {
        ["serve", "--listen", "127.0.0.1:0", "--data", &data, "--tls-cert", cert, "--tls-key", key].map(str::to_owned)
    };
    fail(2, &["TLS certificate", "nowhere.pem", "No such file"], tls("nowhere.pem", &key));
    fail(2, &["TLS key", "cert.pem"], tls(&certificate, &certificate));
    fail(2, &["--tls-key"], ["serve", "--tls-cert", &certificate]);
}

#[test]
fn token_commands_say_what_is_wrong() {
    let dir = TempDir::new().unwrap();
    let data = dir.path().join("data").display().to_string();
    let create = |more: &[&str]| {
        [&["token", "create", "--data", &data, "--name", "x"][..], more].concat().iter().map(|s| (*s).to_owned()).collect::<Vec<_>>()
    };
    fail(2, &["--role"], create(&[]));
    fail(2, &["root", "submit, read, worker"], create(&["--role", "root"]));
    fail(2, &["30d"], create(&["--role", "read", "--expires", "soon"]));
    fail(1, &["0000000000"], ["token", "revoke", "0000000000", "--data", &data]);
    // A whole token in the place of its id is not repeated where others may read it.
    let (id, text) = token(Path::new(&data), &["read", "worker"]);
    let output = kiln(["token", "revoke", &text, "--data", &data]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("kiln token list") && !said.contains(&text), "{said}");
    let rotated = succeed(["token", "rotate", &id, "--data", &data]);
    assert!(rotated.starts_with(&format!("kiln_{id}_")) && rotated.trim() != text, "{rotated}");
    assert!(succeed(["token", "list", "--data", &data]).contains("read,worker"));
}
