//! Finished chunks on disk until the coordinator has said what becomes of them.
//!
//! ```text
//! ROOT/FARM/WORKER.lock                   held by the worker that owns the folder beside it
//! ROOT/FARM/WORKER/TOKEN-N-DIGEST.chunk   a chunk as it will travel
//! ROOT/FARM/WORKER/….part                 one that is being written
//! ```
//! A file appears under its name whole or not at all: it is written beside and renamed. There is no fsync. A crash of the worker loses
//! nothing that was written, only a crash of the machine does, and then the digest in the name tells: what is damaged is not sent, and its
//! tiles are baked again. Waiting for the disk at every chunk would slow each bake for the sake of the rare one.
//!
//! Every worker has a folder of its own, and with it a lock that the system takes back when the process ends in whatever way. A worker that
//! starts takes over the folders of its farm that nobody holds. One folder for all workers would need an agreement on every file. The
//! alternative without files, chunks in memory, loses minutes of work when a worker restarts during an outage.
//!
//! A chunk costs one write, and one read from the system's cache before it is sent.

mod claim;

use bytes::Bytes;
use kiln_proto::ids::{Digest, Token};
use std::{
    fs::{self, DirBuilder, File, OpenOptions},
    io,
    os::unix::fs::{DirBuilderExt, MetadataExt},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, SystemTime},
};

/// What an earlier worker left is kept this long. A coordinator forgets who owed it what long before.
const OLDEST: Duration = Duration::from_secs(24 * 3600);
/// A folder that vanishes while it is being made is made again, this often: another worker has just tidied up.
const TRIES: usize = 16;
const CHUNK: &str = ".chunk";
const PART: &str = ".part";
const LOCK: &str = ".lock";

/// Why the spool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// The folder cannot be made or written to.
    #[error("the spool folder {} cannot be used: {doing} failed", path.display())]
    Folder {
        /// The folder or the file in it.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why it failed.
        #[source]
        source: io::Error,
    },
    /// Somebody else's folder under our name.
    #[error("the spool folder {} belongs to another user", path.display())]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// A chunk that cannot be read back.
    #[error("the spooled chunk {} cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// A chunk that is not what was written.
    #[error("the spooled chunk {} is damaged: {length} bytes that do not have the digest in its name", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Its length.
        length: usize,
    },
}

/// A chunk on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spooled {
    /// Whose it is.
    pub token: Token,
    /// Which of that attempt's.
    pub number: u32,
    digest: Digest,
    length: u64,
    path: PathBuf,
}

impl Spooled {
    fn name(token: Token, number: u32, digest: Digest) -> String {
        format!("{token}-{number}-{digest}{CHUNK}")
    }

    /// What a file is, by its name.
    fn parse(path: PathBuf, length: u64) -> Option<Self> {
        let mut parts = path.file_name()?.to_str()?.strip_suffix(CHUNK)?.rsplitn(3, '-');
        let digest = parts.next()?.parse().ok()?;
        let number = parts.next()?.parse().ok()?;
        let token = parts.next()?.parse().ok()?;
        Some(Self { token, number, digest, length, path })
    }
}

/// A worker's spool. Dropping it removes the folder if nothing waits in it, and leaves it to the next worker otherwise.
#[derive(Debug)]
pub struct Spool {
    folder: PathBuf,
    lock_path: PathBuf,
    limit: u64,
    used: AtomicU64,
    _lock: File,
}

impl Spool {
    /// Makes a folder for this worker under `root`, and takes over what earlier workers of the same farm left there, oldest first. At most
    /// `limit` bytes will be kept.
    ///
    /// # Errors
    /// Folders that cannot be made or written to. What others left and cannot be taken over is only logged.
    pub fn open(root: &Path, farm: &str, limit: u64, now: SystemTime) -> Result<(Self, Vec<Spooled>), SpoolError> {
        let home = root.join(farm);
        let (folder, lock_path, lock) = make_folder(&home)?;
        let spool = Self { folder, lock_path, limit, used: AtomicU64::new(0), _lock: lock };
        let inherited = claim::claim(root, &home, &spool.folder, now.checked_sub(OLDEST).unwrap_or(SystemTime::UNIX_EPOCH));
        let bytes = inherited.iter().map(|s| s.length).sum();
        // More than the limit where a predecessor had a larger one: then nothing is added until that much is delivered.
        spool.used.store(bytes, Ordering::Relaxed);
        Ok((spool, inherited))
    }

    /// Where it is.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes a chunk; `None` where there is no room within the limit.
    ///
    /// # Errors
    /// A disk that is full or fails; nothing is left of the chunk then.
    pub fn store(&self, token: Token, number: u32, bytes: &[u8]) -> Result<Option<Spooled>, SpoolError> {
        let length = bytes.len() as u64;
        let room = |used: u64| used.checked_add(length).filter(|sum| *sum <= self.limit);
        if self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, room).is_err() {
            return Ok(None);
        }
        let digest = Digest::of(bytes);
        let path = self.folder.join(Spooled::name(token, number, digest));
        let part = path.with_extension(&PART[1..]);
        if let Err(source) = fs::write(&part, bytes).and_then(|()| fs::rename(&part, &path)) {
            fs::remove_file(&part).ok();
            self.used.fetch_sub(length, Ordering::Relaxed);
            return Err(SpoolError::Folder { path: part, doing: "writing a chunk", source });
        }
        Ok(Some(Spooled { token, number, digest, length, path }))
    }

    /// The bytes of a chunk.
    ///
    /// # Errors
    /// A chunk that cannot be read or is damaged.
    pub fn load(&self, spooled: &Spooled) -> Result<Bytes, SpoolError> {
        let bytes = fs::read(&spooled.path).map_err(|source| SpoolError::Read { path: spooled.path.clone(), source })?;
        if Digest::of(&bytes) != spooled.digest {
            return Err(SpoolError::Damaged { path: spooled.path.clone(), length: bytes.len() });
        }
        Ok(Bytes::from(bytes))
    }

    /// Forgets a chunk that has its verdict.
    pub fn remove(&self, spooled: &Spooled) {
        if let Err(error) = fs::remove_file(&spooled.path) {
            // Sent again by the next worker at worst, and a duplicate then.
            tracing::warn!(file = %spooled.path.display(), %error, "a delivered chunk cannot be removed from the spool");
        }
        self.used.fetch_sub(spooled.length, Ordering::Relaxed);
    }

    /// Bytes in it.
    #[must_use]
    pub fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        // Only an empty folder can be removed. The lock file goes after it: a folder without a lock would look abandoned.
        if fs::remove_dir(&self.folder).is_ok() {
            fs::remove_file(&self.lock_path).ok();
            if let Some(home) = self.folder.parent() {
                fs::remove_dir(home).ok();
            }
        }
    }
}

/// A fresh folder in `home` and its lock, which is there, and held, before the folder is.
fn make_folder(home: &Path) -> Result<(PathBuf, PathBuf, File), SpoolError> {
    let failed = |doing| move |source| SpoolError::Folder { path: home.to_owned(), doing, source };
    let mut builder = DirBuilder::new();
    builder.recursive(true).mode(0o700);
    let mut tries = TRIES;
    loop {
        builder.create(home).map_err(failed("creating it"))?;
        if fs::metadata(home).is_ok_and(|m| m.uid() != rustix::process::geteuid().as_raw()) {
            return Err(SpoolError::Foreign { path: home.to_owned() });
        }
        let name = Token::random().to_string();
        let (folder, lock_path) = (home.join(&name), home.join(name + LOCK));
        let made = OpenOptions::new().create_new(true).write(true).open(&lock_path).and_then(|lock| {
            lock.lock()?;
            DirBuilder::new().mode(0o700).create(&folder)?;
            Ok(lock)
        });
        match made {
            Ok(lock) => return Ok((folder, lock_path, lock)),
            Err(e) if e.kind() == io::ErrorKind::NotFound && tries > 0 => tries -= 1,
            Err(e) => {
                fs::remove_file(&lock_path).ok();
                return Err(failed("writing to it")(e));
            }
        }
    }
}

#[cfg(test)]
mod tests;
