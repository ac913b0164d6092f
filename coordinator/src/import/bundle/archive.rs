//! Bundles as ZIP archives: unpacked with every promise of the archive checked by counting.
//!
//! A ZIP's directory may claim anything: a million entries, names with `..`, links, sizes that inflate a thousandfold. Entries are
//! counted before the directory is parsed, each is inflated through a reader that stops at what is left of the budget, whatever size it
//! states, and nothing is written under a name from the archive.

use super::{Bundle, BundlePath, Content, Paths, problem, refuse_archive};
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
/// Bits of a Unix mode that say what a file is, and their values for files and folders.
const KIND: u32 = 0o170_000;
const PLAIN: [u32; 3] = [0, 0o100_000, 0o040_000];

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
            return Err(Problem::new("the ZIP has two entries of the same name"));
        }
        let folder = tempfile::tempdir_in(scratch).map_err(|e| Problem::new(format!("no scratch folder for the ZIP: {e}")))?;
        let (mut files, mut paths) = (BTreeMap::new(), Paths::default());
        let mut budget = limits::BUNDLE_BYTES;
        for index in 0..archive.len() {
            // Raw, because one that is encrypted cannot be opened otherwise, not even to say so.
            let Some(path) = entry_path(&archive.by_index_raw(index).map_err(|e| broken(&e))?, &mut paths)? else { continue };
            let mut entry = archive.by_index(index).map_err(|e| problem(path.as_str(), broken(&e).message))?;
            let local = folder.path().join(format!("{index}"));
            budget -= inflate(&mut entry, &local, budget).map_err(|e| inflate_problem(&path, &e))?;
            let mut head = vec![];
            File::open(&local).and_then(|f| f.take(64).read_to_end(&mut head)).map_err(|e| inflate_problem(&path, &InflateError::Io(e)))?;
            refuse_archive(&path, &head)?;
            files.insert(path, Content::File(local));
        }
        Self::new(files, choice, Some(folder))
    }
}

/// The path of an entry to unpack; `None` for folders and what operating systems scatter about.
fn entry_path<R: Read>(entry: &ZipFile<'_, R>, paths: &mut Paths) -> Result<Option<BundlePath>, Problem> {
    let name = entry.name().map_err(|e| broken(&e))?;
    if entry.is_symlink() {
        return Err(problem(&name, "the ZIP entry is a link; only plain files are allowed"));
    }
    if entry.unix_mode().is_some_and(|mode| !PLAIN.contains(&(mode & KIND))) {
        return Err(problem(&name, "the ZIP entry is a device, a pipe or a socket; only plain files are allowed"));
    }
    if entry.encrypted() {
        return Err(problem(&name, "the ZIP entry is encrypted; send the files without a password"));
    }
    let path = BundlePath::parse(&name).map_err(|e| problem(&name, e.to_string()))?;
    let litter = path.as_str().starts_with("__MACOSX/") || matches!(path.file_name(), ".DS_Store" | "Thumbs.db" | "desktop.ini");
    if entry.is_dir() || litter {
        return Ok(None);
    }
    paths.take(&name).map(Some).map_err(|e| problem(&name, e.to_string()))
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
    let io_problem = |e: io::Error| Problem::new(format!("the ZIP cannot be read: {e}"));
    let length = reader.seek(SeekFrom::End(0)).map_err(io_problem)?;
    reader.seek(SeekFrom::Start(length.saturating_sub(END_SPAN))).map_err(io_problem)?;
    let mut tail = vec![];
    reader.by_ref().take(END_SPAN).read_to_end(&mut tail).map_err(io_problem)?;
    // Every record that might be taken for the last one has to agree: an archive may hide a second in its comment.
    for (at, record) in tail.windows(22).enumerate().filter(|(_, w)| w.starts_with(b"PK\x05\x06")) {
        let stated = u16::from_le_bytes([record[10], record[11]]);
        let entries = if stated == u16::MAX { wide_count(reader, &tail[..at]).map_err(io_problem)? } else { u64::from(stated) };
        if entries > limits::BUNDLE_FILES as u64 {
            return Err(Problem::new(format!("the ZIP has {entries} or more entries; at most {} are allowed", limits::BUNDLE_FILES)));
        }
    }
    reader.rewind().map_err(io_problem)
}

/// The number of entries in the 64-bit record (APPNOTE 4.3.14) that the locator (4.3.15) at the end of `before` leads to. Where there is
/// none, the 16-bit number, 65,535, is meant as it stands.
fn wide_count(reader: &mut (impl Read + Seek), before: &[u8]) -> io::Result<u64> {
    let stated = u64::from(u16::MAX);
    let number = |bytes: &[u8]| bytes.first_chunk().map_or(u64::MAX, |b| u64::from_le_bytes(*b));
    let Some(locator) = before.last_chunk::<20>().filter(|l| l.starts_with(b"PK\x06\x07")) else { return Ok(stated) };
    let mut record = vec![];
    reader.seek(SeekFrom::Start(number(&locator[8..])))?;
    reader.take(56).read_to_end(&mut record)?;
    Ok(if record.len() == 56 && record.starts_with(b"PK\x06\x06") { number(&record[32..]) } else { stated })
}

fn broken(error: &ZipError) -> Problem {
    Problem::new(format!("the ZIP is broken or incomplete: {error}"))
}
