//! The header of every `.mt*` file, 32 bytes, little-endian:
//!
//! ```text
//! offset  size
//!      0     4  magic: "MTEX", "MTSP", "MTI ", "MTNC" or "MTM "
//!      4     2  version
//!      6     2  bits per component
//!      8    12  width, height, depth: texels along u, texels along v, directions
//!     20     8  elements in the payload
//!     28     4  CRC32C of the payload
//! ```
//! Changing it is a new version, never an edit of this one. The number of elements is redundant in some files; it is there so that the
//! length of a file can be checked without reading another.

use crate::{limits, settings::TextureSize};

/// Version 1: the first.
pub const VERSION: u16 = 1;
/// Bytes before the payload.
pub const BYTES: usize = 32;

/// The five files of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Uncompressed samples, texel-major, then depth; optional.
    Mtex,
    /// Where each texel begins in the sample streams, and where the last one ends.
    Mtsp,
    /// Depth of each kept sample.
    Mti,
    /// Colour of each kept sample: an index into the colour map, or the colour itself.
    Mtnc,
    /// The colour map.
    Mtm,
}

impl Kind {
    /// All kinds, in the order that files are listed in.
    pub const ALL: [Kind; 5] = [Kind::Mtex, Kind::Mtsp, Kind::Mti, Kind::Mtnc, Kind::Mtm];

    /// The file name's extension.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Kind::Mtex => "mtex",
            Kind::Mtsp => "mtsp",
            Kind::Mti => "mti",
            Kind::Mtnc => "mtnc",
            Kind::Mtm => "mtm",
        }
    }

    /// The path of a surface's file within its package.
    #[must_use]
    pub fn path(self, file_stem: &str) -> String {
        format!("surfaces/{file_stem}.{}", self.extension())
    }

    fn magic(self) -> [u8; 4] {
        match self {
            Kind::Mtex => *b"MTEX",
            Kind::Mtsp => *b"MTSP",
            Kind::Mti => *b"MTI ",
            Kind::Mtnc => *b"MTNC",
            Kind::Mtm => *b"MTM ",
        }
    }

    /// Bytes of one element of so many bits per component, or `None` for bits that this kind does not have.
    fn element_bytes(self, bits: u16) -> Option<u64> {
        match (self, bits) {
            (Kind::Mtex, 8) | (Kind::Mtm, 8) | (Kind::Mtnc, 24) => Some(3),
            (Kind::Mtex, 32) => Some(12),
            (Kind::Mtsp, 32) => Some(4),
            (Kind::Mti, 16) | (Kind::Mtnc, 16) => Some(2),
            _ => None,
        }
    }
}

/// What a header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Which file of the set.
    pub kind: Kind,
    /// Bits per component: 8 or 32 in `.mtex`, 32 in `.mtsp`, 16 in `.mti`, 16 (indices) or 24 (direct colours) in `.mtnc`, 8 in `.mtm`.
    pub bits: u16,
    /// The surface's texture.
    pub size: TextureSize,
    /// D.
    pub depth: u32,
    /// Elements in the payload.
    pub count: u64,
    /// CRC32C of the payload.
    pub crc: u32,
}

/// Why a file is not what its name says.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HeaderError {
    /// Shorter than a header.
    #[error("the file has {found} bytes; its header alone takes {BYTES}")]
    TooShort {
        /// Bytes found.
        found: u64,
    },
    /// Another kind of file.
    #[error("the file begins with {found:?}; a .{extension} file begins with {expected:?}", extension = kind.extension())]
    Magic {
        /// The kind expected.
        kind: Kind,
        /// The first four bytes, as text.
        found: String,
        /// What they should be.
        expected: String,
    },
    /// Another version.
    #[error("the file has version {found}; this program reads version {VERSION}")]
    Version {
        /// The version found.
        found: u16,
    },
    /// A field with a value that it cannot have.
    #[error("the header's {field} is {found}; expected {expected}")]
    Field {
        /// Which field.
        field: &'static str,
        /// What it says.
        found: u64,
        /// What it may say.
        expected: String,
    },
    /// The file is shorter or longer than its header says.
    #[error("the file has {found} bytes; its header promises {expected}")]
    Length {
        /// Bytes found.
        found: u64,
        /// Bytes promised.
        expected: u64,
    },
    /// Damaged.
    #[error("the header's checksum is {found:08x}; the payload gives {expected:08x}")]
    Checksum {
        /// In the header.
        found: u32,
        /// Of the payload.
        expected: u32,
    },
}

impl Header {
    /// The 32 bytes of the header.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; BYTES] {
        let mut out = [0; BYTES];
        out[..4].copy_from_slice(&self.kind.magic());
        out[4..6].copy_from_slice(&VERSION.to_le_bytes());
        out[6..8].copy_from_slice(&self.bits.to_le_bytes());
        out[8..12].copy_from_slice(&self.size.width.to_le_bytes());
        out[12..16].copy_from_slice(&self.size.height.to_le_bytes());
        out[16..20].copy_from_slice(&self.depth.to_le_bytes());
        out[20..28].copy_from_slice(&self.count.to_le_bytes());
        out[28..].copy_from_slice(&self.crc.to_le_bytes());
        out
    }

    /// Bytes behind the header.
    #[must_use]
    pub fn payload_bytes(&self) -> u64 {
        self.count.saturating_mul(self.kind.element_bytes(self.bits).unwrap_or(0))
    }

    /// Reads the header of a file of `file_bytes` bytes in all: nothing is allocated on the word of a header.
    ///
    /// # Errors
    /// Another kind or version, values beyond the limits, a count that contradicts the size, and a file of another length.
    pub fn parse(bytes: &[u8; BYTES], kind: Kind, file_bytes: u64) -> Result<Self, HeaderError> {
        if file_bytes < BYTES as u64 {
            return Err(HeaderError::TooShort { found: file_bytes });
        }
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let u32_at = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let text = |bytes: &[u8]| bytes.escape_ascii().to_string();
        if bytes[..4] != kind.magic() {
            return Err(HeaderError::Magic { kind, found: text(&bytes[..4]), expected: text(&kind.magic()) });
        }
        if u16_at(4) != VERSION {
            return Err(HeaderError::Version { found: u16_at(4) });
        }
        let (width, height, depth) = (u32_at(8), u32_at(12), u32_at(16));
        let size = TextureSize::new(width, height).map_err(|e| HeaderError::Field {
            field: "size",
            found: u64::from(width.max(height)),
            expected: e.to_string(),
        })?;
        let count = u64::from(u32_at(20)) | u64::from(u32_at(24)) << 32;
        let header = Self { kind, bits: u16_at(6), size, depth, count, crc: u32_at(28) };
        header.check(file_bytes)?;
        Ok(header)
    }

    fn check(&self, file_bytes: u64) -> Result<(), HeaderError> {
        let fault = |field, found, expected: String| Err(HeaderError::Field { field, found, expected });
        let Some(element) = self.kind.element_bytes(self.bits) else {
            return fault("bits per component", self.bits.into(), format!("bits that .{} files have", self.kind.extension()));
        };
        let most = limits::GRID_SIDE * limits::GRID_SIDE;
        if !(2..=most).contains(&self.depth) {
            return fault("depth", self.depth.into(), format!("2 to {most} directions"));
        }
        let (texels, samples) = (self.size.texels(), self.size.texels() * u64::from(self.depth));
        let allowed = match self.kind {
            Kind::Mtex => samples..=samples,
            Kind::Mtsp => texels + 1..=texels + 1,
            Kind::Mti | Kind::Mtnc => 0..=samples.min(u32::MAX.into()),
            Kind::Mtm => 0..=65_536,
        };
        if !allowed.contains(&self.count) {
            return fault("element count", self.count, format!("{} to {}", allowed.start(), allowed.end()));
        }
        let expected = BYTES as u64 + self.count * element; // at most 8,192² x 4,096 x 12 < 2^42
        if file_bytes == expected { Ok(()) } else { Err(HeaderError::Length { found: file_bytes, expected }) }
    }

    /// Compares the checksum of the payload with the header's.
    ///
    /// # Errors
    /// [`HeaderError::Checksum`].
    pub fn check_crc(&self, payload_crc: u32) -> Result<(), HeaderError> {
        if self.crc == payload_crc { Ok(()) } else { Err(HeaderError::Checksum { found: self.crc, expected: payload_crc }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn header() -> Header {
        Header { kind: Kind::Mtsp, bits: 32, size: TextureSize::new(200, 100).unwrap(), depth: 400, count: 20_001, crc: 0x0403_0201 }
    }

    #[test]
    fn the_bytes_of_version_1_never_change() {
        let bytes = *b"MTSP\x01\0\x20\0\xc8\0\0\0\x64\0\0\0\x90\x01\0\0\x21\x4e\0\0\0\0\0\0\x01\x02\x03\x04";
        assert_eq!(header().to_bytes(), bytes);
        assert_eq!(Header::parse(&bytes, Kind::Mtsp, 32 + 4 * 20_001), Ok(header()));
    }

    #[test]
    fn each_kind_has_its_magic_and_its_bits() {
        for (kind, magic, bits, count, payload) in [
            (Kind::Mtex, b"MTEX", 8, 8_000_000, 24_000_000),
            (Kind::Mtex, b"MTEX", 32, 8_000_000, 96_000_000),
            (Kind::Mti, b"MTI ", 16, 7, 14),
            (Kind::Mtnc, b"MTNC", 16, 7, 14),
            (Kind::Mtnc, b"MTNC", 24, 7, 21),
            (Kind::Mtm, b"MTM ", 8, 65_536, 196_608),
        ] {
            let h = Header { kind, bits, count, ..header() };
            assert_eq!((&h.to_bytes()[..4], h.payload_bytes()), (&magic[..], payload));
            assert_eq!(Header::parse(&h.to_bytes(), kind, 32 + payload), Ok(h));
        }
    }

    #[test]
    fn wrong_headers_are_refused_by_field() {
        let refusal = |at: usize, value: u8| {
            let mut bytes = header().to_bytes();
            bytes[at] = value;
            Header::parse(&bytes, Kind::Mtsp, 32 + 4 * 20_001).unwrap_err().to_string()
        };
        assert!(refusal(3, b'X').contains("MTSX"));
        assert!(refusal(4, 2).contains("version 2"));
        assert!(refusal(6, 16).contains("bits per component is 16"));
        assert!(refusal(8, 0).contains("size"));
        assert!(refusal(11, 1).contains("size"));
        assert!(refusal(18, 1).contains("depth"));
        assert!(refusal(27, 1).contains("element count"));
        assert!(Header::parse(&header().to_bytes(), Kind::Mtsp, 80_035).unwrap_err().to_string().contains("promises 80036"));
        assert!(Header::parse(&header().to_bytes(), Kind::Mtsp, 31).is_err());
        assert!(header().check_crc(1).unwrap_err().to_string().contains("checksum"));
        let many = Header { kind: Kind::Mtm, bits: 8, count: 65_537, ..header() };
        assert!(Header::parse(&many.to_bytes(), Kind::Mtm, 32 + many.payload_bytes()).is_err());
    }

    proptest! {
        #[test]
        fn noise_never_panics_and_accepted_headers_survive(bytes in any::<[u8; 32]>(), length in any::<u64>()) {
            for kind in Kind::ALL {
                let mut bytes = bytes;
                bytes[..6].copy_from_slice(&[&kind.magic()[..], &[1, 0]].concat());
                if let Ok(h) = Header::parse(&bytes, kind, length) {
                    prop_assert_eq!(h.to_bytes(), bytes);
                }
            }
        }
    }
}
