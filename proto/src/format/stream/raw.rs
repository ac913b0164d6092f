//! `.mtex` of a surface, read in runs of texels.

use super::{Payload, ReadAt, ReadError, Run, Shape, Trust};
use crate::{
    codec::pwl::Sample,
    format::Kind,
    settings::RawFormat,
    units::{Exposure, radiance_to_byte},
};

/// The uncompressed samples of a surface.
#[derive(Debug)]
pub struct RawFiles<R> {
    payload: Payload<R>,
    format: RawFormat,
    /// Bytes of a texel.
    texel: u64,
    exposure: f32,
}

/// Uncompressed samples of some texels in depth order, three channels each.
#[derive(Debug, Clone, PartialEq)]
pub enum RawTexels {
    /// Coded to 8 bits.
    Coded(Vec<Sample>),
    /// Linear radiance, W/(sr m²).
    Linear(Vec<f32>),
}

impl<R: ReadAt> RawFiles<R> {
    /// Opens the file of a package that kept raw radiance in `format` under `exposure`.
    ///
    /// # Errors
    /// A file that is damaged, of another surface, or in another format.
    pub fn open(file: R, shape: Shape, trust: Trust, format: RawFormat, exposure: Exposure) -> Result<Self, ReadError> {
        let (payload, header) = Payload::open(file, Kind::Mtex, shape, trust)?;
        let bits = match format {
            RawFormat::U8 => 8,
            RawFormat::F32 => 32,
        };
        if header.bits != bits {
            return Err(ReadError::Damaged(format!("{}: its header is not that of the package's plan", payload.file.name())));
        }
        let texel = u64::from(shape.directions) * 3 * u64::from(bits / 8);
        Ok(Self { payload, format, texel, exposure: exposure.factor() })
    }

    /// The samples of several runs, one after another; zeros where no chart lies.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(&self, runs: &[Run]) -> Result<RawTexels, ReadError> {
        let mut all = Vec::new();
        for run in runs {
            all.extend(self.payload.read(run.first * self.texel, run.count * self.texel)?);
        }
        Ok(match self.format {
            RawFormat::U8 => RawTexels::Coded(all.as_chunks().0.to_vec()),
            RawFormat::F32 => RawTexels::Linear(all.as_chunks().0.iter().map(|v| f32::from_le_bytes(*v)).collect()),
        })
    }

    /// The samples of several runs coded to 8 bits, as the encoder saw them.
    ///
    /// # Errors
    /// As [`RawFiles::read`].
    pub fn read_coded(&self, runs: &[Run]) -> Result<Vec<Sample>, ReadError> {
        Ok(match self.read(runs)? {
            RawTexels::Coded(samples) => samples,
            RawTexels::Linear(values) => values.as_chunks::<3>().0.iter().map(|v| v.map(|c| radiance_to_byte(c, self.exposure))).collect(),
        })
    }
}
