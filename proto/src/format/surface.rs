//! The small reader: one surface's files in memory, decoded texel by texel.
//!
//! It holds whole files, which tools for large packages do not (they share its checks of headers); it is all that a small reader needs, and
//! what the tests of assembly read packages with.

use super::header::{BYTES, Header, HeaderError, Kind};
use crate::codec::pwl::{self, BadRow, Kept, Order, Sample};

/// The files of a surface without its raw samples, checked.
#[derive(Debug, Clone)]
pub struct SurfaceFiles<'a> {
    header: Header,
    starts: &'a [[u8; 4]],
    depths: &'a [[u8; 2]],
    colours: &'a [u8],
    direct: bool,
    map: &'a [[u8; 3]],
}

/// Why files are not a surface.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// One file is damaged or of another kind.
    #[error(".{extension}", extension = kind.extension())]
    Header {
        /// Which file.
        kind: Kind,
        /// What is wrong with it.
        #[source]
        source: HeaderError,
    },
    /// The files are each whole but do not belong together.
    #[error(".{extension} does not fit the other files: {reason}", extension = kind.extension())]
    Mismatch {
        /// The file that does not fit.
        kind: Kind,
        /// Why.
        reason: &'static str,
    },
    /// A texel whose kept samples are none.
    #[error("texel {texel}")]
    Row {
        /// Its number: column + width x row.
        texel: u64,
        /// What is wrong.
        #[source]
        source: BadRow,
    },
}

/// Checks that starting points rise from 0 to the number of samples, no texel having more than `depth`.
///
/// # Errors
/// What does not fit, as a sentence.
pub fn check_starts(starts: impl IntoIterator<Item = u32>, samples: u64, depth: u32) -> Result<(), &'static str> {
    let mut last = None;
    for start in starts {
        match last {
            None if start != 0 => return Err("the first starting point is not 0"),
            Some(before) if start < before => return Err("starting points go down"),
            Some(before) if start - before > depth => return Err("a texel has more samples than directions"),
            _ => last = Some(start),
        }
    }
    if last.map(u64::from) == Some(samples) { Ok(()) } else { Err("the terminator is not the number of samples") }
}

/// Checks that the headers of `.mti`, `.mtnc` and `.mtm` speak of the surface that `.mtsp` does.
///
/// # Errors
/// The file that does not fit.
pub fn check_headers(mtsp: &Header, mti: &Header, mtnc: &Header, mtm: &Header) -> Result<(), SurfaceError> {
    for other in [mti, mtnc, mtm] {
        if (other.size, other.depth) != (mtsp.size, mtsp.depth) {
            return Err(SurfaceError::Mismatch { kind: other.kind, reason: "its texture size or depth differs" });
        }
    }
    if mti.count != mtnc.count {
        return Err(SurfaceError::Mismatch { kind: Kind::Mtnc, reason: "it has another number of samples than .mti" });
    }
    if (mtnc.bits == 24 || mtnc.count == 0) != (mtm.count == 0) {
        return Err(SurfaceError::Mismatch { kind: Kind::Mtm, reason: "it is empty exactly when colours are direct" });
    }
    Ok(())
}

impl<'a> SurfaceFiles<'a> {
    /// Reads the four files.
    ///
    /// # Errors
    /// Files that are damaged or do not belong together.
    pub fn parse(mtsp: &'a [u8], mti: &'a [u8], mtnc: &'a [u8], mtm: &'a [u8]) -> Result<Self, SurfaceError> {
        let (header, starts) = open(mtsp, Kind::Mtsp)?;
        let (mti, depths) = open(mti, Kind::Mti)?;
        let (mtnc, colours) = open(mtnc, Kind::Mtnc)?;
        let (mtm, map) = open(mtm, Kind::Mtm)?;
        check_headers(&header, &mti, &mtnc, &mtm)?;
        let out = Self {
            header,
            starts: starts.as_chunks().0,
            depths: depths.as_chunks().0,
            colours,
            direct: mtnc.bits == 24,
            map: map.as_chunks().0,
        };
        check_starts(out.starts.iter().map(|s| u32::from_le_bytes(*s)), mti.count, header.depth)
            .map_err(|reason| SurfaceError::Mismatch { kind: Kind::Mtsp, reason })?;
        let in_map = |c: &[u8; 2]| usize::from(u16::from_le_bytes(*c)) < out.map.len();
        if !out.direct && !colours.as_chunks().0.iter().all(in_map) {
            return Err(SurfaceError::Mismatch { kind: Kind::Mtnc, reason: "a colour index is beyond the colour map" });
        }
        Ok(out)
    }

    /// What `.mtsp` says of the surface.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The kept samples of the texel `column + width x row`, which is below width x height: none where no chart lies.
    #[must_use]
    pub fn kept(&self, texel: usize) -> Vec<Kept> {
        let start = |t: usize| u32::from_le_bytes(self.starts[t]) as usize;
        let colour = |k: usize| -> Sample {
            if self.direct {
                self.colours.as_chunks().0[k]
            } else {
                self.map[usize::from(u16::from_le_bytes(self.colours.as_chunks().0[k]))]
            }
        };
        (start(texel)..start(texel + 1)).map(|k| Kept { depth: u16::from_le_bytes(self.depths[k]), rgb: colour(k) }).collect()
    }

    /// The D decoded samples of a texel in depth order, or `None` where no chart lies. `order` is the walk of the surface's manifest entry.
    ///
    /// # Errors
    /// A texel whose kept samples do not lead through the walk.
    pub fn decode(&self, texel: usize, order: &Order) -> Result<Option<Vec<Sample>>, SurfaceError> {
        let kept = self.kept(texel);
        if kept.is_empty() {
            return Ok(None);
        }
        let mut out = vec![Sample::default(); order.len()];
        pwl::decode_row(&kept, order, &mut out).map_err(|source| SurfaceError::Row { texel: texel as u64, source })?;
        Ok(Some(out))
    }
}

fn open(bytes: &[u8], kind: Kind) -> Result<(Header, &[u8]), SurfaceError> {
    let fault = |source| SurfaceError::Header { kind, source };
    let (head, payload) = bytes.split_first_chunk::<BYTES>().ok_or(fault(HeaderError::TooShort { found: bytes.len() as u64 }))?;
    let header = Header::parse(head, kind, bytes.len() as u64).map_err(fault)?;
    header.check_crc(crc32c::crc32c(payload)).map_err(fault)?;
    Ok((header, payload))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        grid::{SphericalGrid, Walk},
        settings::TextureSize,
    };

    fn file(kind: Kind, bits: u16, count: u64, payload: &[u8]) -> Vec<u8> {
        let size = TextureSize::new(2, 1).unwrap();
        let header = Header { kind, bits, size, depth: 4, count, crc: crc32c::crc32c(payload) };
        [&header.to_bytes()[..], payload].concat()
    }

    /// Two texels of 2 x 2 directions: the first without light, the second a line from black to (30, 60, 90).
    fn files() -> [Vec<u8>; 4] {
        [
            file(Kind::Mtsp, 32, 3, &[0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]),
            file(Kind::Mti, 16, 2, &[0, 0, 3, 0]),
            file(Kind::Mtnc, 16, 2, &[1, 0, 0, 0]),
            file(Kind::Mtm, 8, 2, &[30, 60, 90, 0, 0, 0]),
        ]
    }

    fn parse(files: &[Vec<u8>; 4]) -> Result<SurfaceFiles<'_>, SurfaceError> {
        SurfaceFiles::parse(&files[0], &files[1], &files[2], &files[3])
    }

    #[test]
    fn a_texel_is_decoded_along_its_walk() {
        let files = files();
        let surface = parse(&files).unwrap();
        let decode = |walk| surface.decode(1, &Order::new(SphericalGrid::new(2, 2).unwrap(), walk)).unwrap().unwrap();
        assert_eq!(decode(Walk::Phi), [[0, 0, 0], [10, 20, 30], [20, 40, 60], [30, 60, 90]]);
        assert_eq!(decode(Walk::Theta), [[0, 0, 0], [20, 40, 60], [10, 20, 30], [30, 60, 90]]);
        assert!(surface.decode(0, &Order::new(SphericalGrid::new(2, 2).unwrap(), Walk::Phi)).unwrap().is_none());
        let mut direct = files.clone();
        direct[2] = file(Kind::Mtnc, 24, 2, &[0, 0, 0, 30, 60, 90]);
        direct[3] = file(Kind::Mtm, 8, 0, &[]);
        assert_eq!(parse(&direct).unwrap().kept(1), surface.kept(1));
    }

    #[test]
    fn files_that_do_not_belong_together_are_refused() {
        let refusal = |which: usize, with: Vec<u8>| {
            let mut files = files();
            files[which] = with;
            parse(&files).unwrap_err().to_string()
        };
        assert!(refusal(1, file(Kind::Mti, 16, 1, &[0, 0])).contains(".mtnc does not fit"));
        assert!(refusal(2, file(Kind::Mtnc, 16, 2, &[1, 0, 2, 0])).contains("beyond the colour map"));
        assert!(refusal(3, file(Kind::Mtm, 8, 0, &[])).contains(".mtm"));
        assert!(refusal(0, file(Kind::Mtsp, 32, 3, &[1, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])).contains("not 0"));
        assert!(refusal(0, file(Kind::Mtsp, 32, 3, &[0, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0])).contains("go down"));
        assert!(refusal(0, file(Kind::Mtsp, 32, 3, &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])).contains("terminator"));
        let mut cut = files()[3].clone();
        cut.pop();
        assert!(refusal(3, cut).contains(".mtm"));
        let mut flipped = files()[1].clone();
        flipped[34] ^= 1;
        assert!(refusal(1, flipped).contains(".mti"));
    }
}
