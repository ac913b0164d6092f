//! Stage, fsync, rename: the one way in which a file appears in the data folder.

use std::{fs::File, io, path::Path};
use tempfile::TempPath;

/// Moves a finished temporary file to `to`, on the same file system. When this returns, the bytes and the name survive a power cut; at no
/// moment does `to` exist with fewer bytes. An older file of that name is replaced.
///
/// # Errors
/// What the file system says; the temporary file is removed then.
pub fn publish(staged: TempPath, to: &Path) -> io::Result<()> {
    File::open(&staged)?.sync_all()?;
    let folder = to.parent().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "a file needs a folder"))?;
    // A bare name has an empty parent, which no system call takes for the working folder.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    std::fs::create_dir_all(folder)?;
    staged.persist(to).map_err(|e| e.error)?;
    File::open(folder)?.sync_all()
}
