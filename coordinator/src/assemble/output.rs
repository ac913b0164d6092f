//! Files whose header is known last: the checksum and the element count are patched in when everything is written.

use super::AssembleError;
use kiln_proto::{
    format::{FileRecord, Header, Kind, Sha256Hex, header},
    segment::{Raw, TileSegment},
    tile::TILE_SIDE,
};
use sha2::{Digest as _, Sha256};
use std::{
    fs::File,
    io::{self, BufWriter, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// What the packages' binary files are served as.
pub(super) const BINARY: &str = "application/octet-stream";
/// Bytes read at once when a file is hashed.
const BLOCK: usize = 1 << 18;

/// An error of `path`.
pub(super) fn io_fault(path: &Path) -> impl Fn(io::Error) -> AssembleError + '_ {
    move |source| AssembleError::Io { path: path.to_owned(), source }
}

/// A file that is written from front to back.
pub(super) struct StreamFile {
    name: String,
    path: PathBuf,
    file: BufWriter<File>,
    crc: u32,
}

impl StreamFile {
    /// Creates `dir/surfaces/STEM.EXTENSION` with room for its header.
    pub(super) fn create(dir: &Path, stem: &str, kind: Kind) -> Result<Self, AssembleError> {
        let (name, path, file) = create(dir, stem, kind)?;
        let mut file = BufWriter::with_capacity(1 << 16, file);
        file.write_all(&[0; header::BYTES]).map_err(io_fault(&path))?;
        Ok(Self { name, path, file, crc: 0 })
    }

    /// Appends to the payload.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), AssembleError> {
        self.crc = crc32c::crc32c_append(self.crc, bytes);
        self.file.write_all(bytes).map_err(io_fault(&self.path))
    }

    /// Patches the header in and hashes the file.
    pub(super) fn finish(self, header: Header) -> Result<FileRecord, AssembleError> {
        let mut file = self.file.into_inner().map_err(|e| io_fault(&self.path)(e.into_error()))?;
        seal(&mut file, Header { crc: self.crc, ..header }, self.name).map_err(io_fault(&self.path))
    }
}

/// The `.mtex` of a surface, written tile by tile: texels that no tile holds stay zero, which costs no disk where files may have holes.
pub(super) struct RawFile {
    name: String,
    path: PathBuf,
    file: File,
    header: Header,
}

impl RawFile {
    pub(super) fn create(dir: &Path, stem: &str, header: Header) -> Result<Self, AssembleError> {
        let (name, path, file) = create(dir, stem, Kind::Mtex)?;
        file.set_len(header::BYTES as u64 + header.payload_bytes()).map_err(io_fault(&path))?;
        Ok(Self { name, path, file, header })
    }

    /// Puts the raw samples of a tile in their places.
    pub(super) fn write(&mut self, segment: &TileSegment) -> Result<(), AssembleError> {
        let texel_bytes = self.header.payload_bytes() / self.header.size.texels();
        let (x0, y0) = (u32::from(segment.cell.x) * TILE_SIDE, u32::from(segment.cell.y) * TILE_SIDE);
        let values = self.header.depth as usize * 3;
        for (row, texel) in segment.mask.texels().enumerate() {
            let part = row * values..(row + 1) * values;
            let number = u64::from(y0 + texel.y) * u64::from(self.header.size.width) + u64::from(x0 + texel.x);
            let at = header::BYTES as u64 + number * texel_bytes;
            match &segment.raw {
                Raw::None => {}
                Raw::U8(bytes) => self.put(at, &bytes[part])?,
                Raw::F32(floats) => self.put(at, &floats[part].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?,
            }
        }
        Ok(())
    }

    fn put(&mut self, at: u64, bytes: &[u8]) -> Result<(), AssembleError> {
        let written = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.write_all(bytes));
        written.map_err(io_fault(&self.path))
    }

    /// Reads the payload once for its checksum, which tiles in any order cannot give.
    pub(super) fn finish(mut self) -> Result<FileRecord, AssembleError> {
        let mut crc = 0;
        let read = self.file.seek(SeekFrom::Start(header::BYTES as u64));
        let read = read.and_then(|_| each_block(&mut self.file, |block| crc = crc32c::crc32c_append(crc, block)));
        read.and_then(|_| seal(&mut self.file, Header { crc, ..self.header }, self.name)).map_err(io_fault(&self.path))
    }
}

fn create(dir: &Path, stem: &str, kind: Kind) -> Result<(String, PathBuf, File), AssembleError> {
    let name = kind.path(stem);
    let path = dir.join(&name);
    let file = File::options().read(true).write(true).create(true).truncate(true).open(&path).map_err(io_fault(&path))?;
    Ok((name, path, file))
}

/// Writes the header and hashes the whole file.
fn seal(file: &mut File, header: Header, path: String) -> io::Result<FileRecord> {
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&header.to_bytes())?;
    file.seek(SeekFrom::Start(0))?;
    let mut hash = Sha256::new();
    let bytes = each_block(file, |block| hash.update(block))?;
    Ok(FileRecord { path, media_type: BINARY.into(), bytes, sha256: Sha256Hex(hash.finalize().into()) })
}

fn each_block(file: &mut File, mut see: impl FnMut(&[u8])) -> io::Result<u64> {
    let mut block = vec![0; BLOCK];
    let mut total = 0;
    loop {
        match file.read(&mut block)? {
            0 => return Ok(total),
            n => {
                see(&block[..n]);
                total += n as u64;
            }
        }
    }
}
