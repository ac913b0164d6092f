//! `.mtsp`, `.mti`, `.mtnc` and `.mtm` of a surface, read in runs of texels.

use super::{Payload, ReadAt, ReadError, Run, Shape, Trust};
use crate::{
    codec::pwl::{Kept, Sample},
    format::{Kind, surface::check_headers},
};

/// `.mtsp`: where each texel's samples begin, and so which texels hold any.
#[derive(Debug)]
pub struct Starts<R> {
    payload: Payload<R>,
    directions: u32,
}

impl<R: ReadAt> Starts<R> {
    /// Opens the file.
    ///
    /// # Errors
    /// A file that is damaged or of another surface.
    pub fn open(file: R, shape: Shape, trust: Trust) -> Result<Self, ReadError> {
        let (payload, _) = Payload::open(file, Kind::Mtsp, shape, trust)?;
        Ok(Self { payload, directions: shape.directions })
    }

    /// The starting points of a run's texels and the end of the last: one more than texels. A texel without samples begins where the next
    /// one does.
    ///
    /// # Errors
    /// A file that cannot be read, and starting points that go down or leave a texel more samples than there are directions: what is read
    /// on their word stays as small as the run.
    pub fn read(&self, run: Run) -> Result<Vec<u32>, ReadError> {
        let bytes = self.payload.read(run.first * 4, (run.count + 1) * 4)?;
        let starts: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|s| u32::from_le_bytes(*s)).collect();
        if starts.windows(2).any(|w| w[0] > w[1] || w[1] - w[0] > self.directions) {
            return Err(ReadError::Damaged(format!(
                "{}: from texel {} on, the starting points go down or leave a texel more samples than directions",
                self.payload.file.name(),
                run.first
            )));
        }
        Ok(starts)
    }
}

/// The encoded samples of a surface.
#[derive(Debug)]
pub struct CodedFiles<R> {
    surface: String,
    starts: Starts<R>,
    depths: Payload<R>,
    colours: Payload<R>,
    /// `None` where colours are direct.
    map: Option<Vec<Sample>>,
    samples: u64,
}

/// The kept samples of the texels of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptTexels {
    starts: Vec<u32>,
    kept: Vec<Kept>,
}

impl KeptTexels {
    /// The kept samples of the run's `k`-th texel: none where no chart lies.
    ///
    /// # Panics
    /// Beyond the run.
    #[must_use]
    pub fn get(&self, k: usize) -> &[Kept] {
        let at = |k: usize| (self.starts[k] - self.starts[0]) as usize;
        &self.kept[at(k)..at(k + 1)]
    }

    /// The kept samples of each texel, in order.
    pub fn iter(&self) -> impl Iterator<Item = &[Kept]> {
        (0..self.starts.len() - 1).map(|k| self.get(k))
    }
}

impl<R: ReadAt> CodedFiles<R> {
    /// Opens the four files of `surface`, which `open` finds by their kind, and reads the colour map.
    ///
    /// # Errors
    /// Files that are missing, damaged, or do not belong together.
    pub fn open<E: From<ReadError>>(surface: &str, shape: Shape, trust: Trust, open: impl Fn(Kind) -> Result<R, E>) -> Result<Self, E> {
        let payload = |kind| Ok::<_, E>(Payload::open(open(kind)?, kind, shape, trust)?);
        let ((starts, mtsp), (depths, mti), (colours, mtnc), (map, mtm)) =
            (payload(Kind::Mtsp)?, payload(Kind::Mti)?, payload(Kind::Mtnc)?, payload(Kind::Mtm)?);
        check_headers(&mtsp, &mti, &mtnc, &mtm).map_err(|source| ReadError::Surface { surface: surface.to_owned(), source })?;
        let bytes = map.read(0, mtm.payload_bytes())?;
        let map = (mtnc.bits == 16).then(|| bytes.as_chunks::<3>().0.to_vec());
        let starts = Starts { payload: starts, directions: shape.directions };
        Ok(Self { surface: surface.to_owned(), starts, depths, colours, map, samples: mti.count })
    }

    /// Kept samples in all.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Colours in the map, and bits of a colour.
    #[must_use]
    pub fn colour_map(&self) -> (u32, u16) {
        self.map.as_ref().map_or((0, 24), |m| (m.len() as u32, 16))
    }

    /// Whether the colour map is ascending, each colour once; direct colours have no map to be wrong.
    #[must_use]
    pub fn map_ascends(&self) -> bool {
        self.map.as_ref().is_none_or(|map| map.windows(2).all(|w| w[0] < w[1]))
    }

    /// The kept samples of the texels of a run. Memory: 8 bytes a kept sample, gaps between those wanted included.
    ///
    /// # Errors
    /// Files that cannot be read or are damaged.
    pub fn read(&self, run: Run) -> Result<KeptTexels, ReadError> {
        let starts = self.starts.read(run)?;
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        if u64::from(last) > self.samples {
            return Err(self.damaged(&format!("the starting points from texel {} on go beyond the samples", run.first)));
        }
        let count = u64::from(last - first);
        let depths = self.depths.read(u64::from(first) * 2, count * 2)?;
        let colours = match &self.map {
            None => self.colours.read(u64::from(first) * 3, count * 3)?.as_chunks().0.to_vec(),
            Some(map) => self.colours_of(map, &self.colours.read(u64::from(first) * 2, count * 2)?)?,
        };
        let kept = depths.as_chunks().0.iter().zip(colours).map(|(d, rgb)| Kept { depth: u16::from_le_bytes(*d), rgb }).collect();
        Ok(KeptTexels { starts, kept })
    }

    fn colours_of(&self, map: &[Sample], indices: &[u8]) -> Result<Vec<Sample>, ReadError> {
        let colour = |c: &[u8; 2]| map.get(usize::from(u16::from_le_bytes(*c))).copied();
        let found: Option<Vec<Sample>> = indices.as_chunks().0.iter().map(colour).collect();
        found.ok_or_else(|| self.damaged("a colour index is beyond the colour map"))
    }

    fn damaged(&self, what: &str) -> ReadError {
        ReadError::Damaged(format!("surface `{}`: {what}", self.surface))
    }
}
