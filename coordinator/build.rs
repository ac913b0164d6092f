//! Builds the page (`web/`) with npm and Vite and writes the code that embeds it, so that `cargo build` alone makes the whole binary.
//!
//! Everything happens in a copy of the sources under OUT_DIR: a build script must not write into the source tree, and `node_modules` beside
//! the sources stays the business of whoever edits them. Packages are installed only when package-lock.json has changed; the build itself
//! takes about a second. Committing the built page instead lost: nobody can review it, and it goes stale unseen. Two ways around node:
//! `KILN_WEB_DIST=<dir>` embeds a page that was built elsewhere, `--no-default-features` leaves the page out.
#![allow(clippy::print_stdout)] // This is how a build script talks to cargo.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::Command,
};

/// What `engines` in package.json says, which npm itself would only warn about.
const NODE: (u32, u32) = (20, 19);
/// What the page is built from, beside its HTML files and `src`.
const CONFIGURATION: [&str; 4] = ["package.json", "package-lock.json", "tsconfig.json", "vite.config.ts"];
/// Files without which a folder is no built page.
const ENTRIES: [&str; 4] = ["index.html", "job.html", "viewer.html", "kiln-viewer.js"];
const WAYS_AROUND: &str = "or set KILN_WEB_DIST to a folder with the built page, or build with --no-default-features to leave the page out";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=KILN_WEB_DIST");
    if env::var_os("CARGO_FEATURE_PAGE").is_none() {
        return;
    }
    if let Err(problem) = embed() {
        // Ends the build with these lines; a status of failure would bury them under everything that this script said.
        problem.lines().for_each(|line| println!("cargo::error={line}"));
    }
}

/// Finds or builds the page and writes `page.rs`.
fn embed() -> Result<(), String> {
    let out = folder("OUT_DIR")?;
    let dist = match env::var_os("KILN_WEB_DIST") {
        Some(dist) => given(PathBuf::from(dist))?,
        None => build(&folder("CARGO_MANIFEST_DIR")?, &out.join("page"))?,
    };
    if let Some(missing) = ENTRIES.iter().find(|entry| !dist.join(entry).is_file()) {
        return Err(format!("{} is no built page: {missing} is missing in it", dist.display()));
    }
    let code = format!("#[derive(rust_embed::RustEmbed)]\n#[folder = {:?}]\nstruct Dist;\n", dist.display().to_string());
    let file = out.join("page.rs");
    fs::write(&file, code).map_err(|e| at(&file, &e))
}

fn given(dist: PathBuf) -> Result<PathBuf, String> {
    if !dist.is_absolute() {
        return Err(format!("KILN_WEB_DIST is `{}`; it must be an absolute path", dist.display()));
    }
    watch(&dist);
    Ok(dist)
}

/// Builds the page in `work`, laid out as the repository is, since the page's sources name shaders by relative paths.
fn build(coordinator: &Path, work: &Path) -> Result<PathBuf, String> {
    let (sources, web) = (coordinator.join("web"), work.join("coordinator/web"));
    node_is_there()?;
    mirror(&coordinator.join("../shaders"), &work.join("shaders"))?;
    mirror(&sources.join("src"), &web.join("src"))?;
    forget_pages(&web)?;
    for name in CONFIGURATION.iter().map(|name| (*name).to_owned()).chain(pages(&sources)?) {
        watch(&sources.join(&name));
        copy(&sources.join(&name), &web.join(&name))?;
    }
    install(&web)?;
    npm(&web, &["run", "build"])?;
    Ok(web.join("dist"))
}

/// Installs the packages that package-lock.json names, unless they are the ones that are there.
fn install(web: &Path) -> Result<(), String> {
    let lock = web.join("package-lock.json");
    let wanted = fs::read(&lock).map_err(|e| at(&lock, &e))?;
    // Within the folder that `npm ci` removes first: an installation that was cut off leaves no stamp.
    let stamp = web.join("node_modules/.installed");
    if fs::read(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(());
    }
    // NODE_ENV=production would leave out Vite.
    npm(web, &["ci", "--include=dev", "--no-audit", "--no-fund", "--ignore-scripts", "--loglevel=error"])?;
    fs::write(&stamp, wanted).map_err(|e| at(&stamp, &e))
}

fn npm(web: &Path, arguments: &[&str]) -> Result<(), String> {
    let call = format!("npm {}", arguments.join(" "));
    let output = Command::new("npm").args(arguments).current_dir(web).output();
    let output = output.map_err(|e| format!("`{call}` cannot be run ({e}): install npm, {WAYS_AROUND}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    Err(format!("`{call}` for the page failed ({}):\n{}", output.status, String::from_utf8_lossy(&said)))
}

fn node_is_there() -> Result<(), String> {
    let output = Command::new("node").arg("--version").output();
    let said = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned()).unwrap_or_default();
    if version(&said).is_some_and(|found| found >= NODE) {
        return Ok(());
    }
    let found = if said.is_empty() { "none was found".to_owned() } else { format!("found {said}") };
    let (major, minor) = NODE;
    Err(format!("the page of the coordinator is built with node {major}.{minor} or newer ({found}): install it with npm, {WAYS_AROUND}"))
}

/// Major and minor of `v20.19.4`.
fn version(said: &str) -> Option<(u32, u32)> {
    let mut parts = said.strip_prefix('v')?.split('.').map(|part| part.parse().ok());
    Some((parts.next()??, parts.next()??))
}

/// The names of the HTML files in `folder`. One more file needs an entry in vite.config.ts, which is watched.
fn pages(folder: &Path) -> Result<Vec<String>, String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| at(folder, &e))? {
        let name = entry.map_err(|e| at(folder, &e))?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".html") {
            names.push(name);
        }
    }
    Ok(names)
}

/// Pages that an earlier build copied and that may be gone from the sources.
fn forget_pages(web: &Path) -> Result<(), String> {
    pages(web)?.iter().map(|name| web.join(name)).try_for_each(|page| fs::remove_file(&page).map_err(|e| at(&page, &e)))
}

/// Makes `to` a copy of the folder `from` and watches the latter.
fn mirror(from: &Path, to: &Path) -> Result<(), String> {
    watch(from);
    match fs::remove_dir_all(to) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(at(to, &e)),
        _ => copy_folder(from, to),
    }
}

fn copy_folder(from: &Path, to: &Path) -> Result<(), String> {
    fs::create_dir_all(to).map_err(|e| at(to, &e))?;
    for entry in fs::read_dir(from).map_err(|e| at(from, &e))? {
        let entry = entry.map_err(|e| at(from, &e))?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() { copy_folder(&path, &target)? } else { copy(&path, &target)? }
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    fs::copy(from, to).map(drop).map_err(|e| at(from, &e))
}

/// Cargo looks at a whole folder by the times of its files.
fn watch(path: &Path) {
    println!("cargo::rerun-if-changed={}", path.display());
}

fn folder(name: &str) -> Result<PathBuf, String> {
    env::var_os(name).map(PathBuf::from).ok_or_else(|| format!("{name} is not set; this script is run by cargo"))
}

fn at(path: &Path, error: &io::Error) -> String {
    format!("{}: {error}", path.display())
}
