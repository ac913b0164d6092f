//! `kiln fetch`: a finished package into a folder, every file checked against the manifest.

use crate::{api::Api, error::CommandError, output, viewer, watch::ServerArgs};
use clap::Args;
use kiln_coordinator::http::view::PACKAGE_FOLDER;
use kiln_proto::{
    format::manifest::{self, Manifest},
    ids::JobId,
};
use sha2::{Digest, Sha256};
use std::{
    io::{ErrorKind, Read},
    path::{Path, PathBuf},
};
use tempfile::TempDir;

/// Download the package of a finished job
#[derive(Debug, Args)]
pub struct FetchArgs {
    /// The job
    id: JobId,
    /// Folder for the package
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    content: Content,
    #[command(flatten)]
    server: ServerArgs,
}

/// What a folder for results gets.
#[derive(Debug, Clone, Copy, Args)]
pub struct Content {
    /// Put the viewer beside the package, so that any web server can show it: DIR then holds index.html, and the package in DIR/package
    #[arg(long)]
    pub with_viewer: bool,
}

impl Content {
    /// Refuses what this build cannot write.
    pub fn check(self) -> Result<(), CommandError> {
        if self.with_viewer { viewer::require() } else { Ok(()) }
    }

    /// Where within `folder` the package lies.
    pub fn package_in(self, folder: &Path) -> PathBuf {
        if self.with_viewer { folder.join(PACKAGE_FOLDER) } else { folder.to_owned() }
    }

    /// Tells, on stderr, what a folder with the viewer wants: browsers load no module from `file://`, and show an empty page.
    pub fn explain(self, folder: &Path) {
        if self.with_viewer {
            let folder = folder.display();
            eprintln!("to look at it, put {folder} on a web server or run `kiln view {folder}`; opened as a file, index.html stays empty");
        }
    }

    /// The file that is moved into place last: where it is, everything is.
    fn last(self) -> &'static str {
        if self.with_viewer { "index.html" } else { manifest::PATH }
    }
}

/// Fetches a package.
pub async fn run(args: &FetchArgs, json: bool) -> Result<(), CommandError> {
    check_target(&args.output)?;
    args.content.check()?;
    deliver(&args.server.api()?, args.id, args.content, &args.output).await?;
    if json {
        return output::json(&serde_json::json!({"package": args.content.package_in(&args.output)}));
    }
    output::line(&args.output.display().to_string())?;
    args.content.explain(&args.output);
    Ok(())
}

/// A folder that exists must be empty: files of two packages never mix.
pub fn check_target(target: &Path) -> Result<(), CommandError> {
    match std::fs::read_dir(target).map(|mut entries| entries.next().is_some()) {
        Ok(true) => Err(CommandError::usage(format!("{} is not empty; choose a folder that is empty or does not exist", target.display()))),
        Ok(false) => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        Err(e) if e.kind() == ErrorKind::NotADirectory => {
            Err(CommandError::usage(format!("{} is, or lies below, a file; the output needs a folder", target.display())))
        }
        Err(e) => Err(CommandError::work(format!("{}: {e}", target.display()))),
    }
}

/// A folder for results: created when missing, and removed again when nothing was put into it. A folder that exists is used as it is, so
/// that it may be a mount point.
pub struct OutputFolder<'a> {
    path: &'a Path,
    created: bool,
}

impl<'a> OutputFolder<'a> {
    /// Makes sure that the folder is there.
    pub fn create(path: &'a Path) -> Result<Self, CommandError> {
        let created = !path.exists();
        std::fs::create_dir_all(path).map_err(|e| CommandError::work(format!("cannot create the folder {}: {e}", path.display())))?;
        Ok(Self { path, created })
    }

    /// A folder inside it that goes when its guard does: on the disk that the user chose for results.
    pub fn scratch(&self, prefix: &str) -> Result<TempDir, CommandError> {
        let made = tempfile::Builder::new().prefix(prefix).tempdir_in(self.path);
        made.map_err(|e| CommandError::work(format!("cannot write to {}: {e}", self.path.display())))
    }
}

impl Drop for OutputFolder<'_> {
    fn drop(&mut self) {
        if self.created {
            // Fails, as it should, where there is something in it.
            std::fs::remove_dir(self.path).ok();
        }
    }
}

/// Puts everything into a hidden folder inside `target` first and moves it into place when every file is there and checked, the manifest or
/// the viewer's page last: a folder with it is whole.
pub async fn deliver(api: &Api, id: JobId, content: Content, target: &Path) -> Result<(), CommandError> {
    let folder = OutputFolder::create(target)?;
    let staging = folder.scratch(".kiln-fetch-")?;
    if content.with_viewer {
        viewer::write(staging.path())?;
    }
    download(api, id, &content.package_in(staging.path())).await?;
    publish(staging.path(), target, content.last())
}

/// Downloads a package and checks every file against the manifest.
async fn download(api: &Api, id: JobId, dir: &Path) -> Result<(), CommandError> {
    let text = api.manifest(id).await?;
    let manifest = understand(&text)?;
    for file in &manifest.files {
        let to = dir.join(&file.path);
        if let Some(folder) = to.parent() {
            std::fs::create_dir_all(folder).map_err(|e| at(folder, &e))?;
        }
        api.asset(id, &file.path, &to).await?;
        let (bytes, hash) = sha256(&to).map_err(|e| at(&to, &e))?;
        if bytes != file.bytes || hash != file.sha256.to_string() {
            return Err(CommandError::work(format!("{} arrived damaged: {bytes} bytes, SHA-256 {hash}; fetch again", file.path)));
        }
    }
    api.asset(id, "report.json", &dir.join("report.json")).await?;
    let last = dir.join(manifest::PATH);
    std::fs::write(&last, &text).map_err(|e| at(&last, &e))
}

/// Reads a manifest that came over a network: of this version, and with no path that leads out of the package.
fn understand(text: &[u8]) -> Result<Manifest, CommandError> {
    Manifest::from_bytes(text).map_err(|e| CommandError::from_error("the package cannot be fetched", &e))
}

/// Moves what is in `staging` into `target`, the entry `last` at the end.
fn publish(staging: &Path, target: &Path, last: &str) -> Result<(), CommandError> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(staging).map_err(|e| at(staging, &e))? {
        names.push(entry.map_err(|e| at(staging, &e))?.file_name());
    }
    names.sort_by_key(|name| name == last);
    names.iter().try_for_each(|name| std::fs::rename(staging.join(name), target.join(name)).map_err(|e| at(&target.join(name), &e)))
}

fn at(path: &Path, e: &std::io::Error) -> CommandError {
    CommandError::work(format!("{}: {e}", path.display()))
}

fn sha256(path: &Path) -> std::io::Result<(u64, String)> {
    let mut file = std::fs::File::open(path)?;
    let (mut hasher, mut buffer, mut length) = (Sha256::new(), vec![0; 1 << 20], 0);
    loop {
        let n = file.read(&mut buffer)?;
        if n == 0 {
            break;
        }
        length += n as u64;
        hasher.update(&buffer[..n]);
    }
    Ok((length, hasher.finalize().iter().map(|b| format!("{b:02x}")).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::package::fixture;
    use kiln_proto::settings::Rule;

    #[test]
    fn manifests_of_another_version_or_with_paths_that_leave_the_folder_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 1 }, None));
        let good: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.path().join(manifest::PATH)).unwrap()).unwrap();
        assert!(understand(good.to_string().as_bytes()).is_ok());
        let refused = |pointer: &str, value: serde_json::Value| {
            let mut bad = good.clone();
            *bad.pointer_mut(pointer).unwrap() = value;
            understand(bad.to_string().as_bytes()).unwrap_err().to_string()
        };
        assert!(refused("/schema", 99.into()).contains("schema version 99"));
        for bad in ["", "/etc/passwd", "../x", "a/../../b", "./x"] {
            let error = refused("/files/0/path", bad.into());
            assert!(error.contains(&format!("`{bad}`")), "{error}");
        }
    }

    #[test]
    fn the_last_entry_waits_for_all_others() {
        let dir = tempfile::tempdir().unwrap();
        let (staging, target) = (dir.path().join("staging"), dir.path().join("target"));
        for folder in [&staging, &target] {
            std::fs::create_dir(folder).unwrap();
        }
        for name in ["a", "index.html", "z"] {
            std::fs::write(staging.join(name), name).unwrap();
        }
        // In the way of `z`: a folder that is not empty cannot be replaced.
        std::fs::create_dir_all(target.join("z/x")).unwrap();
        assert!(publish(&staging, &target, "index.html").is_err());
        assert!(!target.join("index.html").exists());
        std::fs::remove_dir_all(target.join("z")).unwrap();
        publish(&staging, &target, "index.html").unwrap();
        assert!(["a", "index.html", "z"].iter().all(|name| target.join(name).exists()));
    }

    #[test]
    fn the_package_lies_beside_the_viewer() {
        let (plain, viewed) = (Content { with_viewer: false }, Content { with_viewer: true });
        assert_eq!(plain.package_in(Path::new("out")), Path::new("out"));
        assert_eq!(viewed.package_in(Path::new("out")), Path::new("out/package"));
    }

    #[test]
    fn only_an_empty_or_absent_folder_is_a_target() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check_target(dir.path()).is_ok());
        assert!(check_target(&dir.path().join("new")).is_ok());
        let file = dir.path().join("x");
        std::fs::write(&file, "").unwrap();
        assert!(check_target(dir.path()).unwrap_err().to_string().contains("not empty"));
        assert!(check_target(&file).unwrap_err().to_string().contains("a file"));
        assert!(check_target(&file.join("y")).unwrap_err().to_string().contains("a file"));
    }

    #[test]
    fn an_output_folder_stays_only_where_something_is_in_it() {
        let dir = tempfile::tempdir().unwrap();
        let new = dir.path().join("new");
        drop(OutputFolder::create(&new).unwrap());
        assert!(!new.exists());
        let kept = OutputFolder::create(&new).unwrap();
        std::fs::write(new.join("x"), "").unwrap();
        drop(kept);
        assert!(new.join("x").exists());
    }
}
