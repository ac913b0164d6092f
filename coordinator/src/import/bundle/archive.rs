//! Bundles as ZIP archives: unpacked with every promise of the archive checked by counting.
//!
//! A ZIP's directory may claim anything: a million entries, names with `..`, links, sizes that inflate a thousandfold. Entries are
//! counted before the directory is parsed, each is inflated through a reader that stops at what is left of the budget, and nothing is
//! written under a name from the archive.

use super::{Bundle, BundlePath, Content, plain, problem};
use crate::records::Problem;
use kiln_proto::limits;
use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};
use zip::{ZipArchive, read::ZipFile, result::ZipError};

/// Bytes behind which the end-of-directory record of a ZIP cannot begin: 22 of its own and a comment of 65,535.
const END_SPAN: u64 = 22 + 65_535;

impl Bundle {
    /// A bundle from a ZIP, unpacked into a folder inside `scratch` that lives as long as the bundle. Expands at most
    /// [`limits::BUNDLE_BYTES`], whatever the archive says of itself.
    ///
    /// # Errors
    /// Broken archives, and those that hold links, encrypted entries, unsafe or duplicate paths, too many files or bytes, or no scene.
    pub fn from_zip(mut reader: impl Read + Seek, choice: Option<&str>, scratch: &Path) -> Result<Self, Problem> {
        check_entry_count(&mut reader)?;
        let mut archive = ZipArchive::new(reader).map_err(|e| broken(&e))?;
        if archive.has_duplicate_names() {
            return Err(plain("the ZIP has two entries of the same name".to_owned()));
        }
        let folder = tempfile::tempdir_in(scratch).map_err(|e| plain(format!("no scratch folder for the ZIP: {e}")))?;
        let mut files = BTreeMap::new();
        let mut budget = limits::BUNDLE_BYTES;
        for index in 0..archive.len() {
            let mut entry = archive.by_index(index).map_err(|e| broken(&e))?;
            let Some(path) = entry_path(&entry)? else { continue };
            let local = folder.path().join(format!("{index}"));
            budget -= inflate(&mut entry, &local, budget).map_err(|e| inflate_problem(&path, &e))?;
            if files.insert(path.clone(), Content::File(local)).is_some() {
                return Err(problem(path.as_str(), "the ZIP has two entries of this name"));
            }
        }
        Self::new(files, choice, Some(folder))
    }
}

/// The path of an entry to unpack; `None` for folders and what operating systems scatter about.
fn entry_path<R: Read>(entry: &ZipFile<'_, R>) -> Result<Option<BundlePath>, Problem> {
    let name = entry.name().map_err(|e| broken(&e))?;
    if entry.is_symlink() {
        return Err(problem(&name, "the ZIP entry is a link; only plain files are allowed"));
    }
    if entry.encrypted() {
        return Err(problem(&name, "the ZIP entry is encrypted"));
    }
    let path = BundlePath::parse(&name).map_err(|e| problem(&name, e.to_string()))?;
    let litter = path.as_str().starts_with("__MACOSX/") || matches!(path.file_name(), ".DS_Store" | "Thumbs.db" | "desktop.ini");
    Ok((!entry.is_dir() && !litter).then_some(path))
}

/// Why an entry did not unpack.
#[derive(Debug)]
pub(super) enum InflateError {
    Budget,
    Io(io::Error),
}

/// Writes the entry to a fresh file and returns its size, which is at most `budget`.
pub(super) fn inflate(entry: &mut impl Read, local: &Path, budget: u64) -> Result<u64, InflateError> {
    let mut file = File::create_new(local).map_err(InflateError::Io)?;
    let written = io::copy(&mut entry.take(budget + 1), &mut file).map_err(InflateError::Io)?;
    if written > budget { Err(InflateError::Budget) } else { Ok(written) }
}

fn inflate_problem(path: &BundlePath, error: &InflateError) -> Problem {
    match error {
        InflateError::Budget => problem(
            path.as_str(),
            format!("the ZIP expands to more than {} bytes, which is the most a bundle may have", limits::BUNDLE_BYTES),
        ),
        InflateError::Io(e) => problem(path.as_str(), format!("the ZIP entry cannot be unpacked: {e}")),
    }
}

/// Refuses archives with more entries than a bundle may have files, before the directory is read into memory.
fn check_entry_count(reader: &mut (impl Read + Seek)) -> Result<(), Problem> {
    let io_problem = |e: io::Error| plain(format!("the ZIP cannot be read: {e}"));
    let length = reader.seek(SeekFrom::End(0)).map_err(io_problem)?;
    reader.seek(SeekFrom::Start(length.saturating_sub(END_SPAN))).map_err(io_problem)?;
    let mut tail = vec![];
    reader.take(END_SPAN).read_to_end(&mut tail).map_err(io_problem)?;
    reader.rewind().map_err(io_problem)?;
    // Every record that might be taken for the last one has to agree: an archive may hide a second in its comment.
    for record in tail.windows(22).filter(|w| w.starts_with(b"PK\x05\x06")) {
        let entries = usize::from(u16::from_le_bytes([record[10], record[11]]));
        if entries > limits::BUNDLE_FILES {
            // 65,535 also stands for "see the 64-bit record", which no bundle within the limits needs.
            return Err(plain(format!("the ZIP has {entries} or more entries; at most {} are allowed", limits::BUNDLE_FILES)));
        }
    }
    Ok(())
}

fn broken(error: &ZipError) -> Problem {
    plain(format!("the ZIP is broken or incomplete: {error}"))
}
