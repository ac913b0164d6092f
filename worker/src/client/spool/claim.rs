//! Taking over what earlier workers left, and throwing away what is too old. Nothing here fails: what cannot be read or moved stays where it
//! is, for somebody else or for another day.

use super::{CHUNK, LOCK, PART, Spooled};
use std::{
    fs::{self, DirEntry, File, OpenOptions},
    io,
    path::{Path, PathBuf},
    time::SystemTime,
};

/// Moves the chunks of abandoned folders in `home` into `own`, oldest first; drops those last written before `oldest`, there and in the
/// folders of other farms under `root`, whose workers may never come back to do it.
pub(super) fn claim(root: &Path, home: &Path, own: &Path, oldest: SystemTime) -> Vec<Spooled> {
    let mut found: Vec<(SystemTime, Spooled)> = Vec::new();
    for farm in folders(root) {
        let ours = (farm == home).then_some(own);
        for folder in folders(&farm).filter(|folder| folder != own) {
            let Some(lock) = Abandoned::take(&folder) else { continue };
            sweep(&folder, ours, oldest, &mut found);
            lock.remove(&folder);
        }
        remove_stale_locks(&farm, oldest);
        // Only if it is empty.
        fs::remove_dir(&farm).ok();
    }
    found.sort_by_key(|(written, spooled)| (*written, spooled.number));
    found.into_iter().map(|(_, spooled)| spooled).collect()
}

fn entries(folder: &Path) -> impl Iterator<Item = DirEntry> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten()
}

fn folders(parent: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    entries(parent).filter(|e| e.file_type().is_ok_and(|t| t.is_dir())).map(|e| e.path())
}

/// The lock of a folder whose worker is gone.
struct Abandoned {
    path: PathBuf,
    _lock: File,
}

impl Abandoned {
    fn take(folder: &Path) -> Option<Self> {
        let mut name = folder.file_name()?.to_owned();
        name.push(LOCK);
        let path = folder.with_file_name(name);
        let lock = OpenOptions::new().create(true).truncate(false).write(true).open(&path).ok()?;
        lock.try_lock().ok()?;
        Some(Self { path, _lock: lock })
    }

    fn remove(self, folder: &Path) {
        match fs::remove_dir(folder) {
            Ok(()) => drop(fs::remove_file(&self.path)),
            // Its owner was quicker.
            Err(e) if e.kind() == io::ErrorKind::NotFound => drop(fs::remove_file(&self.path)),
            Err(_) => {}
        }
    }
}

/// One abandoned folder.
fn sweep(folder: &Path, ours: Option<&Path>, oldest: SystemTime, found: &mut Vec<(SystemTime, Spooled)>) {
    let mut dropped = 0;
    for entry in entries(folder) {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if name.ends_with(PART) {
            fs::remove_file(&path).ok();
            continue;
        }
        // What is not ours to understand is not ours to remove.
        let Some(meta) = entry.metadata().ok().filter(|_| name.ends_with(CHUNK)) else { continue };
        let written = meta.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        if written < oldest {
            dropped += u64::from(fs::remove_file(&path).is_ok());
        } else if let Some(own) = ours
            && let Some(spooled) = Spooled::parse(own.join(entry.file_name()), meta.len())
        {
            match fs::rename(&path, &spooled.path) {
                Ok(()) => found.push((written, spooled)),
                Err(error) => tracing::warn!(file = %path.display(), %error, "a chunk of an earlier worker cannot be taken over"),
            }
        }
    }
    if dropped > 0 {
        tracing::warn!(folder = %folder.display(), dropped, "chunks that nobody delivered for a day were dropped from the spool");
    }
}

/// Lock files whose folder is gone: their worker was killed between removing the two. Young ones may belong to a worker that is starting.
fn remove_stale_locks(farm: &Path, oldest: SystemTime) {
    for entry in entries(farm) {
        let path = entry.path();
        let old = entry.metadata().and_then(|m| m.modified()).is_ok_and(|written| written < oldest);
        if old && path.extension().is_some_and(|e| e == &LOCK[1..]) && !path.with_extension("").exists() {
            fs::remove_file(&path).ok();
        }
    }
}
