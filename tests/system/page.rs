//! The viewer in a browser: what it draws from a package, how it is handled, and what it says when it cannot.

use crate::{
    browser::{GPUS, Script},
    harness::{View, bake_room},
};
use std::{
    fs,
    process::{Command, Stdio},
};
use tempfile::TempDir;

/// A small package with raw radiance, and a server for it.
fn room(dir: &TempDir) -> View {
    let package = dir.path().join("room");
    bake_room(&package, &[]);
    View::start(&package)
}

#[test]
fn page_viewer_does_what_it_should_on_swiftshader() {
    let dir = TempDir::new().unwrap();
    Script::start("viewer.mjs", [&room(&dir).url, GPUS[0]]).finish();
}

#[test]
fn page_viewer_does_what_it_should_on_llvmpipe() {
    let dir = TempDir::new().unwrap();
    Script::start("viewer.mjs", [&room(&dir).url, GPUS[1]]).finish();
}

/// The Khronos reference compiler takes every shader, as text out of the bundle that is served.
#[test]
fn page_shaders_are_valid() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("shaders");
    fs::create_dir(&out).unwrap();
    let said = Script::start("shaders.mjs", [&room(&dir).url, out.to_str().unwrap()]).finish();
    let files: Vec<_> = fs::read_dir(&out).unwrap().map(|f| f.unwrap().path()).collect();
    assert_eq!(said[0]["count"], files.len());
    for file in files {
        let checked = Command::new("glslangValidator").arg(&file).stdin(Stdio::null()).output();
        let checked = checked.expect("this test needs glslangValidator: apt-get install glslang-tools");
        assert!(checked.status.success(), "{}: {}", file.display(), String::from_utf8_lossy(&checked.stdout));
    }
}
