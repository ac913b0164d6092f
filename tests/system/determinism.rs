//! The bytes of a package depend on scene, settings and seed, and on nothing else.

use crate::harness::{Server, assert_same_package, bake_room, kiln, nominal, package, quick, room};
use std::path::Path;
use tempfile::TempDir;

fn reference(dir: &TempDir) -> std::path::PathBuf {
    let path = dir.path().join("reference");
    bake_room(&path, &["--threads", "1"]);
    path
}

#[test]
fn threads_workers_and_vector_width_leave_no_trace() {
    let dir = TempDir::new().unwrap();
    let reference = reference(&dir);
    for (name, more) in [("threads", &["--threads", "3"][..]), ("workers", &["--workers", "4", "--threads", "4"])] {
        let other = dir.path().join(name);
        bake_room(&other, more);
        assert_same_package(&reference, &other);
    }
    let portable = dir.path().join("portable");
    let mut command = kiln(["bake"]);
    command.arg(room()).arg("-o").arg(&portable).args(nominal()).args(quick(&[])).env("KILN_SIMD", "portable");
    assert!(command.output().unwrap().status.success());
    assert_same_package(&reference, &portable);
}

#[test]
fn the_order_of_leases_and_tiles_leaves_no_trace() {
    let dir = TempDir::new().unwrap();
    let reference = reference(&dir);
    let config = dir.path().join("kiln.toml");
    std::fs::write(&config, "[lease]\norder = \"reverse\"\ntarget_ms = 200\n").unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &["--config", config.to_str().unwrap()]);
    let _worker = server.worker(&["--tile-order", "reverse"]);
    let job = server.submit_room(&[]);
    let reversed = dir.path().join("reversed");
    server.fetch_when_done(&job, &reversed);
    assert_same_package(&reference, &reversed);
}

#[test]
fn the_seed_leaves_a_trace_and_files_name_what_they_depend_on() {
    let dir = TempDir::new().unwrap();
    let reference = reference(&dir);
    let other = dir.path().join("seed");
    bake_room(&other, &["--seed", "1"]);
    let (a, b) = (package(&reference), package(&other));
    let differs = |name: &str| a[name] != b[name];
    assert!(differs("surfaces/floor.mtex") && differs("manifest.json"));
    assert!(Path::new(&reference).join("report.json").exists());
}
