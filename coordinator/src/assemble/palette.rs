//! The colour map: which of 2^24 colours occur, and the rank of each among them.
//!
//! A bitmap of 2 MiB notes what occurs while colours go to a scratch file as they are. At the end ranks come from counting bits: a running
//! count per 64-bit word (1 MiB) plus the bits below within the word. The map is sorted by colour, so it does not depend on the order in
//! which tiles were baked. A hash map would be smaller for flat surfaces and twenty times larger for glossy ones.

use super::{
    AssembleError,
    output::{StreamFile, io_fault},
};
use kiln_proto::format::{FileRecord, Header, Kind};
use std::{
    fs::File,
    io::{BufWriter, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Colours that 16-bit indices can name.
const MAX_COLOURS: u32 = 1 << 16;
/// Bytes read from the scratch file at once: whole colours.
const BLOCK: usize = 3 << 16;

/// Collects the colours of a surface's kept samples.
pub(super) struct Palette {
    folder: PathBuf,
    seen: Vec<u64>,
    scratch: BufWriter<File>,
    samples: u64,
}

/// What became of the colours.
pub(super) struct Coded {
    /// `.mtnc` and `.mtm`.
    pub(super) files: [FileRecord; 2],
    /// Entries of the colour map; 0 where colours are direct.
    pub(super) colours: u32,
    /// 16 or 24.
    pub(super) bits: u16,
}

impl Palette {
    pub(super) fn new(folder: &Path) -> Result<Self, AssembleError> {
        let scratch = tempfile::tempfile_in(folder).map_err(io_fault(folder))?;
        Ok(Self { folder: folder.to_owned(), seen: vec![0; 1 << 18], scratch: BufWriter::with_capacity(1 << 16, scratch), samples: 0 })
    }

    /// Adds colours, three bytes each.
    pub(super) fn write(&mut self, colours: &[u8]) -> Result<(), AssembleError> {
        for rgb in colours.as_chunks::<3>().0 {
            let code = code(*rgb);
            self.seen[(code >> 6) as usize] |= 1 << (code & 63);
        }
        self.samples += colours.len() as u64 / 3;
        self.scratch.write_all(colours).map_err(io_fault(&self.folder))
    }

    /// Writes `.mtnc` and `.mtm`.
    pub(super) fn finish(self, dir: &Path, stem: &str, header: Header) -> Result<Coded, AssembleError> {
        let found: u32 = self.seen.iter().map(|w| w.count_ones()).sum();
        let direct = found > MAX_COLOURS;
        let mut scratch = self.scratch.into_inner().map_err(|e| io_fault(&self.folder)(e.into_error()))?;
        scratch.seek(SeekFrom::Start(0)).map_err(io_fault(&self.folder))?;
        let ranks = Ranks::new(self.seen);
        let mut mtnc = StreamFile::create(dir, stem, Kind::Mtnc)?;
        let mut left = self.samples * 3;
        let (mut block, mut indices) = (vec![0; BLOCK], Vec::new());
        while left > 0 {
            let part = &mut block[..left.min(BLOCK as u64) as usize];
            scratch.read_exact(part).map_err(io_fault(&self.folder))?;
            left -= part.len() as u64;
            if direct {
                mtnc.write(part)?;
            } else {
                indices.clear();
                indices.extend(part.as_chunks::<3>().0.iter().flat_map(|rgb| (ranks.of(*rgb) as u16).to_le_bytes()));
                mtnc.write(&indices)?;
            }
        }
        let (bits, colours) = if direct { (24, 0) } else { (16, found) };
        let mut mtm = StreamFile::create(dir, stem, Kind::Mtm)?;
        if !direct {
            ranks.colours().try_for_each(|rgb| mtm.write(&rgb))?;
        }
        let mtnc = mtnc.finish(Header { kind: Kind::Mtnc, bits, count: self.samples, ..header })?;
        let mtm = mtm.finish(Header { kind: Kind::Mtm, bits: 8, count: colours.into(), ..header })?;
        Ok(Coded { files: [mtm, mtnc], colours, bits })
    }
}

/// Colours that occur, in order.
struct Ranks {
    seen: Vec<u64>,
    /// Colours before each word.
    before: Vec<u32>,
}

impl Ranks {
    fn new(seen: Vec<u64>) -> Self {
        let mut total = 0;
        let count = |word: &u64| {
            let before = total;
            total += word.count_ones();
            before
        };
        let before = seen.iter().map(count).collect();
        Self { seen, before }
    }

    fn of(&self, rgb: [u8; 3]) -> u32 {
        let code = code(rgb);
        let word = (code >> 6) as usize;
        let below = self.seen[word] & ((1 << (code & 63)) - 1);
        self.before[word] + below.count_ones()
    }

    fn colours(&self) -> impl Iterator<Item = [u8; 3]> + '_ {
        let of_word = |(word, bits): (usize, &u64)| {
            let bits = *bits;
            (0..64).filter(move |b| bits >> b & 1 == 1).map(move |b| (word as u32) << 6 | b)
        };
        self.seen.iter().enumerate().filter(|(_, bits)| **bits != 0).flat_map(of_word).map(|c| [(c >> 16) as u8, (c >> 8) as u8, c as u8])
    }
}

fn code(rgb: [u8; 3]) -> u32 {
    u32::from_be_bytes([0, rgb[0], rgb[1], rgb[2]])
}
