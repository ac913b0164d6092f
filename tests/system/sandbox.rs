//! Scenes that take too much: refused with the reason, and the coordinator goes on.

use crate::harness::{Server, fail, scene};
use image::{Rgb, RgbImage};
use std::{fmt::Write, fs, path::Path};
use tempfile::TempDir;

fn server(dir: &Path, sandbox: &str) -> Server {
    let config = dir.join("kiln.toml");
    fs::write(&config, format!("[sandbox]\n{sandbox}\n")).unwrap();
    Server::start(&dir.join("data"), "127.0.0.1:0", &["--config", config.to_str().unwrap()])
}

/// A picture that is small as a file and large as pixels.
fn large_picture(dir: &Path) -> std::path::PathBuf {
    RgbImage::from_pixel(12_000, 12_000, Rgb([200, 100, 50])).save(dir.join("large.png")).unwrap();
    fs::write(dir.join("large.mtl"), "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd large.png\n").unwrap();
    let main = dir.join("large.obj");
    fs::write(&main, "mtllib large.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n").unwrap();
    main
}

/// A surface of many triangles without texture coordinates, which take a while to unwrap.
fn rough_ground(dir: &Path, side: usize) -> std::path::PathBuf {
    let mut text = String::new();
    for k in 0..side * side {
        let (x, z) = (k % side, k / side);
        writeln!(text, "v {x} {} {z}", (k * 7_919 % 101) as f64 / 40.0).unwrap();
    }
    for k in (0..side * (side - 1)).filter(|k| k % side != side - 1) {
        writeln!(text, "f {} {} {} {}", k + 1, k + 2, k + side + 2, k + side + 1).unwrap();
    }
    let main = dir.join("ground.obj");
    fs::write(&main, text).unwrap();
    main
}

#[test]
fn a_scene_that_takes_too_much_memory_is_refused_and_the_next_one_is_not() {
    let dir = TempDir::new().unwrap();
    let server = server(dir.path(), "memory_bytes = 536870912");
    let large = large_picture(dir.path());
    let send = |path: &Path| ["submit".to_owned(), path.display().to_string(), "--server".into(), server.url.clone()];
    fail(1, &["importing the scene took more than 536870912 bytes of memory", "sandbox.memory_bytes"], send(&large));
    assert_eq!(server.text("/healthz").trim(), "ok");
    crate::harness::succeed(send(&scene("cornell-room/cornell.obj")));
}

#[test]
fn a_scene_that_takes_too_long_fails_its_job_with_the_reason() {
    let dir = TempDir::new().unwrap();
    let server = server(dir.path(), "cpu_seconds = 1");
    let ground = rough_ground(dir.path(), 400);
    let output = crate::harness::run(["submit", ground.to_str().unwrap(), "--server", &server.url, "--wait"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("took more than 1 s of processor time (sandbox.cpu_seconds)"), "{said}");
    assert_eq!(server.text("/healthz").trim(), "ok");
}
