//! `kiln fetch`: a finished package into a folder, every file checked against the manifest.

use crate::{api::Api, error::CommandError, output, watch::ServerArgs};
use clap::Args;
use kiln_proto::{format::manifest::Manifest, ids::JobId};
use sha2::{Digest, Sha256};
use std::{
    io::Read,
    path::{Path, PathBuf},
};

/// Download the package of a finished job
#[derive(Debug, Args)]
pub struct FetchArgs {
    /// The job
    id: JobId,
    /// Folder for the package
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    server: ServerArgs,
}

/// Fetches a package.
pub async fn run(args: &FetchArgs, json: bool) -> Result<(), CommandError> {
    check_target(&args.output)?;
    package(&args.server.api()?, args.id, &args.output).await?;
    if json { output::json(&serde_json::json!({"package": args.output})) } else { output::line(&args.output.display().to_string()) }
}

/// A folder that exists must be empty: files of two packages never mix.
pub fn check_target(target: &Path) -> Result<(), CommandError> {
    match std::fs::read_dir(target).map(|mut entries| entries.next().is_some()) {
        Ok(true) => Err(CommandError::usage(format!("{} is not empty; choose a folder that is empty or does not exist", target.display()))),
        Ok(false) => Ok(()),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(CommandError::work(format!("{}: {e}", target.display()))),
    }
}

/// Downloads into a folder beside `target` and renames it when every file is there and checked, so that `target` is whole or absent.
pub async fn package(api: &Api, id: JobId, target: &Path) -> Result<(), CommandError> {
    let text = api.manifest(id).await?;
    let manifest: Manifest = serde_json::from_slice(&text).map_err(|e| CommandError::from_error("the manifest cannot be read", &e))?;
    let parent = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let at = |path: &Path, e: &std::io::Error| CommandError::work(format!("{}: {e}", path.display()));
    std::fs::create_dir_all(parent).map_err(|e| at(parent, &e))?;
    let staging = tempfile::Builder::new().prefix(".kiln-fetch-").tempdir_in(parent).map_err(|e| at(parent, &e))?;
    for file in &manifest.files {
        let to = staging.path().join(safe(&file.path)?);
        if let Some(folder) = to.parent() {
            std::fs::create_dir_all(folder).map_err(|e| at(folder, &e))?;
        }
        api.asset(id, &file.path, &to).await?;
        let (bytes, hash) = sha256(&to).map_err(|e| at(&to, &e))?;
        if bytes != file.bytes || hash != file.sha256.to_string() {
            return Err(CommandError::work(format!("{} arrived damaged: {bytes} bytes, SHA-256 {hash}; fetch again", file.path)));
        }
    }
    api.asset(id, "report.json", &staging.path().join("report.json")).await?;
    let manifest_path = staging.path().join("manifest.json");
    std::fs::write(&manifest_path, &text).map_err(|e| at(&manifest_path, &e))?;
    std::fs::remove_dir(target).or_else(|e| if e.kind() == std::io::ErrorKind::NotFound { Ok(()) } else { Err(at(target, &e)) })?;
    // `keep` gives up the automatic removal: from here on the folder belongs to the user.
    let kept = staging.keep();
    std::fs::rename(&kept, target).map_err(|e| at(target, &e))
}

/// A path of a manifest, which came over a network, stays inside the folder.
fn safe(path: &str) -> Result<&Path, CommandError> {
    let inside = !path.is_empty() && Path::new(path).components().all(|c| matches!(c, std::path::Component::Normal(_)));
    if inside {
        Ok(Path::new(path))
    } else {
        Err(CommandError::work(format!("the manifest names the file `{path}`, which lies outside the package")))
    }
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

    #[test]
    fn paths_that_leave_the_folder_are_refused() {
        assert!(safe("surfaces/floor.mti").is_ok());
        for bad in ["", "/etc/passwd", "../x", "a/../../b", "./x"] {
            assert!(safe(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn only_an_empty_or_absent_folder_is_a_target() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check_target(dir.path()).is_ok());
        assert!(check_target(&dir.path().join("new")).is_ok());
        std::fs::write(dir.path().join("x"), "").unwrap();
        assert!(check_target(dir.path()).unwrap_err().to_string().contains("not empty"));
    }
}
