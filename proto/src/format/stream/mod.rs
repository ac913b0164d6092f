//! Readers of a surface's files by position: a few texels at a time, whatever the files' size and wherever they lie.
//!
//! A package may be a folder, a set of blobs, or bytes in a test; all that the readers ask of a file is [`ReadAt`], which takes `&self` so
//! that threads share a file without a lock. Whoever makes something new of a file has its checksum compared first ([`Trust::Checksum`]),
//! which costs one more read of it: damaged light with fresh hashes would pass for whole for ever. Its error is boxed: a type parameter for
//! it would run through every signature of every caller, to end in the same printed line.

mod coded;
mod raw;

pub use coded::{CodedFiles, KeptTexels, Starts};
pub use raw::{RawFiles, RawTexels};

use super::{
    header::{self, Header, HeaderError, Kind},
    surface::SurfaceError,
};
use crate::{codec::pwl::BadRow, settings::TextureSize, texel::Row};
use std::error::Error;

/// Why bytes could not be read: an I/O error, an object store's, ….
pub type Fault = Box<dyn Error + Send + Sync>;

/// A file that can be read at any position.
pub trait ReadAt: Send + Sync {
    /// What messages call it.
    fn name(&self) -> &str;

    /// Bytes in all.
    fn length(&self) -> u64;

    /// Fills `out` with the bytes from `at` on.
    ///
    /// # Errors
    /// Bytes that cannot be had, the end of the file among the reasons.
    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault>;
}

impl<R: ReadAt + ?Sized> ReadAt for Box<R> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn length(&self) -> u64 {
        (**self).length()
    }

    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault> {
        (**self).read_exact_at(at, out)
    }
}

/// A file that is in memory as a whole.
#[derive(Debug, Clone)]
pub struct InMemory {
    /// What messages call it.
    pub name: String,
    /// All of it.
    pub bytes: Vec<u8>,
}

impl ReadAt for InMemory {
    fn name(&self) -> &str {
        &self.name
    }

    fn length(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault> {
        let part = usize::try_from(at).ok().and_then(|at| self.bytes.get(at..)?.get(..out.len()));
        out.copy_from_slice(part.ok_or("beyond the end")?);
        Ok(())
    }
}

/// Why a surface's light could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// A file cannot be opened or read.
    #[error("{name}")]
    Io {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: Fault,
    },
    /// A file is not usable.
    #[error("{name}")]
    Header {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: HeaderError,
    },
    /// A surface's files do not belong together.
    #[error("surface `{surface}`")]
    Surface {
        /// Its name.
        surface: String,
        /// Why.
        #[source]
        source: SurfaceError,
    },
    /// A texel cannot be decoded.
    #[error("surface `{surface}`, texel ({x}, {y})")]
    Texel {
        /// The surface's name.
        surface: String,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Why.
        #[source]
        source: BadRow,
    },
    /// Something contradicts something else.
    #[error("{0}")]
    Damaged(String),
}

/// What is known of a file's payload before it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Nothing: it is read once for its checksum when it is opened.
    Checksum,
    /// The whole file was compared with its hash: a moment ago, or when a store took it in.
    Hashed,
}

/// What the plan of a package says of a surface's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// The surface's texture.
    pub size: TextureSize,
    /// D.
    pub directions: u32,
}

/// Texels next to each other: in one texel row, or on into the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// Number of the first: column + width x row.
    pub first: u64,
    /// How many.
    pub count: u64,
}

/// Groups a tile's rows, which come row by row, into runs.
#[must_use]
pub fn runs(rows: &[Row], width: u32) -> Vec<Run> {
    let mut out: Vec<Run> = vec![];
    for row in rows {
        let number = u64::from(row.y) * u64::from(width) + u64::from(row.x);
        match out.last_mut() {
            Some(run) if run.first + run.count == number && row.x > 0 => run.count += 1,
            _ => out.push(Run { first: number, count: 1 }),
        }
    }
    out
}

/// Bytes read at once when a payload's checksum is computed.
const BLOCK: u64 = 1 << 18;

/// The part of a file behind its header.
#[derive(Debug)]
struct Payload<R> {
    file: R,
}

impl<R: ReadAt> Payload<R> {
    /// Reads the header and holds it against the plan; what is not known of the payload is checked, too.
    fn open(file: R, kind: Kind, shape: Shape, trust: Trust) -> Result<(Self, Header), ReadError> {
        let payload = Self { file };
        let mut head = [0; header::BYTES];
        if payload.file.length() >= header::BYTES as u64 {
            payload.fill(0, &mut head)?;
        }
        let fault = |source| ReadError::Header { name: payload.file.name().to_owned(), source };
        let header = Header::parse(&head, kind, payload.file.length()).map_err(fault)?;
        if (header.size, header.depth) != (shape.size, shape.directions) {
            return Err(ReadError::Damaged(format!("{}: its header is not that of the package's plan", payload.file.name())));
        }
        if trust == Trust::Checksum {
            header.check_crc(payload.crc(header.payload_bytes())?).map_err(fault)?;
        }
        Ok((payload, header))
    }

    fn read(&self, at: u64, bytes: u64) -> Result<Vec<u8>, ReadError> {
        let mut out = vec![0; bytes as usize];
        self.fill(header::BYTES as u64 + at, &mut out)?;
        Ok(out)
    }

    fn fill(&self, at: u64, out: &mut [u8]) -> Result<(), ReadError> {
        self.file.read_exact_at(at, out).map_err(|source| ReadError::Io { name: self.file.name().to_owned(), source })
    }

    /// CRC32C of the whole payload.
    fn crc(&self, bytes: u64) -> Result<u32, ReadError> {
        let mut blocks = (0..bytes.div_ceil(BLOCK)).map(|k| (k * BLOCK, BLOCK.min(bytes - k * BLOCK)));
        blocks.try_fold(0, |crc, (at, length)| Ok(crc32c::crc32c_append(crc, &self.read(at, length)?)))
    }
}

#[cfg(test)]
mod tests;
