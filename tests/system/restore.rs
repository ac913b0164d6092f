//! A backup is what can be restored: the commands of docs/operations.md, as they are printed, on a farm that works meanwhile.

use crate::harness::{Server, assert_same_package};
use std::{
    path::Path,
    process::{Command, Stdio},
};
use tempfile::TempDir;

/// The shell block that follows `words` in the section on backups.
fn block(words: &str) -> String {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/operations.md")).unwrap();
    let (_, section) = page.split_once("## Backup and restore").expect("the page has its section");
    let (_, rest) = section.split_once(words).unwrap_or_else(|| panic!("the section says `{words}`"));
    let (_, block) = rest.split_once("```sh\n").expect("a block follows");
    block.split_once("\n```").unwrap().0.to_owned()
}

/// Runs a block with the folders of this test in the place of those that it names.
fn follow(block: &str, data: &Path, backup: &Path) {
    assert!(block.contains("/var/lib/kiln") && block.contains("/backup"), "{block}");
    let script = block.replace("/var/lib/kiln", data.to_str().unwrap()).replace("/backup", backup.to_str().unwrap());
    let output = Command::new("bash").args(["-eu", "-o", "pipefail", "-c", &script]).output().unwrap();
    assert!(output.status.success(), "{script}\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_farm_is_restored_from_its_backup() {
    let sqlite = Command::new("sqlite3").arg("--version").stdout(Stdio::null()).status();
    assert!(sqlite.is_ok_and(|s| s.success()), "this test runs the page's commands and needs sqlite3: apt-get install sqlite3");
    let dir = TempDir::new().unwrap();
    let (data, backup) = (dir.path().join("data"), dir.path().join("backup"));
    std::fs::create_dir(&backup).unwrap();
    let mut server = Server::start(&data, "127.0.0.1:0", &[]);
    let mut worker = server.worker(&[]);
    let done = server.submit_room(&[]);
    server.fetch_when_done(&done, &dir.path().join("before"));
    // While it runs: one job is under way, and nobody will go on with it here.
    let under_way = server.submit_room(&["--seed", "7"]);
    server.wait_until_halfway(&under_way);
    follow(&block("While it runs:"), &data, &backup);
    worker.kill();
    server.process.kill();
    std::fs::remove_dir_all(&data).unwrap();

    follow(&block("To restore, stop every coordinator"), &data, &backup);
    let server = Server::start(&data, "127.0.0.1:0", &[]);
    server.fetch_when_done(&done, &dir.path().join("after"));
    assert_same_package(&dir.path().join("before"), &dir.path().join("after"));
    let _worker = server.worker(&[]);
    server.fetch_when_done(&under_way, &dir.path().join("went-on"));
    let anew = server.submit_room(&["--seed", "7"]);
    server.fetch_when_done(&anew, &dir.path().join("anew"));
    assert_same_package(&dir.path().join("went-on"), &dir.path().join("anew"));
}
