//! Where a picture's light comes from: the files of a package, opened one surface at a time.
//!
//! A scene may have more surfaces than a process may have files open, so that no surface stays open beside the next.

use kiln_proto::{
    codec::pwl::{BadRow, Kept, Order, Sample, check_row, decode_row, sample_at},
    format::{
        Kind,
        stream::{CodedFiles, KeptTexels, RawFiles, RawTexels, ReadAt, ReadError, Run, Starts, Trust},
    },
    plan::Plan,
    scene::{Scene, Surface},
    units::{Rgb, byte_to_radiance},
};
use serde::{Deserialize, Serialize};

/// The files of a package, wherever they lie.
pub trait PackageFiles: Sync {
    /// Opens a file by its path within the package.
    ///
    /// # Errors
    /// Files that are not there or cannot be read.
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError>;
}

/// Where radiance comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The encoded files: `.mtsp`, `.mti`, `.mtnc`, `.mtm`.
    #[default]
    Codec,
    /// The kept uncompressed samples: `.mtex`.
    Raw,
}

/// The light of a package.
pub struct Light<'a> {
    files: &'a dyn PackageFiles,
    scene: &'a Scene,
    plan: &'a Plan,
    origin: Origin,
    /// What is known of each surface's files.
    trust: Vec<Trust>,
    /// Linear radiance of each byte.
    levels: [f32; 256],
}

impl<'a> Light<'a> {
    /// The light that `files` hold. With [`Trust::Checksum`] the files of each surface that is seen are read through once.
    #[must_use]
    pub fn new(files: &'a dyn PackageFiles, scene: &'a Scene, plan: &'a Plan, origin: Origin, trust: Trust) -> Self {
        let factor = plan.exposure().factor();
        let levels = std::array::from_fn(|byte| byte_to_radiance(byte as u8, factor));
        Self { files, scene, plan, origin, trust: vec![trust; scene.surfaces.len()], levels }
    }

    /// Opens the files of one surface.
    pub(super) fn surface(&mut self, surface: usize) -> Result<SurfaceLight<'_>, ReadError> {
        let Surface { name, file_stem, .. } = &self.scene.surfaces[surface];
        let (shape, trust) = (self.plan.shape(surface), self.trust[surface]);
        let open = |kind: Kind| self.files.open(&kind.path(file_stem));
        let source = match self.origin {
            Origin::Codec => Source::Coded(CodedFiles::open(name, shape, trust, open)?, self.plan.order(surface)),
            Origin::Raw => {
                let none = || ReadError::Damaged("the package keeps no raw radiance".into());
                let format = self.plan.settings.raw.ok_or_else(none)?;
                let raw = RawFiles::open(open(Kind::Mtex)?, shape, trust, format, self.plan.exposure())?;
                Source::Raw(raw, Starts::open(open(Kind::Mtsp)?, shape, trust)?)
            }
        };
        self.trust[surface] = Trust::Hashed;
        Ok(SurfaceLight { name, width: shape.size.width, directions: shape.directions, source, levels: &self.levels })
    }
}

enum Source {
    Coded(CodedFiles<Box<dyn ReadAt>>, Order),
    /// Raw samples, and the starting points that say which texels have any.
    Raw(RawFiles<Box<dyn ReadAt>>, Starts<Box<dyn ReadAt>>),
}

/// The light of one surface.
pub(super) struct SurfaceLight<'a> {
    name: &'a str,
    width: u32,
    directions: u32,
    source: Source,
    levels: &'a [f32; 256],
}

impl SurfaceLight<'_> {
    /// Bytes that a texel may take in the files, at most.
    pub(super) fn texel_bytes(&self) -> u64 {
        let sample = match self.source {
            Source::Coded(..) => 5,
            Source::Raw(..) => 12,
        };
        u64::from(self.directions) * sample
    }

    /// Reads the texels of a run.
    pub(super) fn read(&self, run: Run) -> Result<Block<'_>, ReadError> {
        let samples = match &self.source {
            Source::Coded(files, order) => Samples::Coded(files.read(run)?, order),
            Source::Raw(files, starts) => Samples::Raw(files.read(&[run])?, starts.read(run)?),
        };
        Ok(Block { light: self, first: run.first, samples })
    }

    fn damaged(&self, texel: u64, source: BadRow) -> ReadError {
        let width = u64::from(self.width);
        ReadError::Texel { surface: self.name.to_owned(), x: (texel % width) as u32, y: (texel / width) as u32, source }
    }
}

enum Samples<'a> {
    Coded(KeptTexels, &'a Order),
    Raw(RawTexels, Vec<u32>),
}

/// The texels of a run.
pub(super) struct Block<'a> {
    light: &'a SurfaceLight<'a>,
    first: u64,
    samples: Samples<'a>,
}

impl Block<'_> {
    /// The run's `k`-th texel, or `None` where it holds no samples.
    pub(super) fn texel(&self, k: usize) -> Result<Option<TexelLight<'_>>, ReadError> {
        let (levels, directions) = (self.light.levels, self.light.directions as usize);
        Ok(match &self.samples {
            Samples::Coded(texels, order) => {
                let kept = texels.get(k);
                if kept.is_empty() {
                    return Ok(None);
                }
                check_row(kept, order).map_err(|e| self.light.damaged(self.first + k as u64, e))?;
                Some(TexelLight::Kept { kept, order, levels })
            }
            Samples::Raw(_, starts) if starts[k] == starts[k + 1] => None,
            Samples::Raw(RawTexels::Coded(samples), _) => {
                Some(TexelLight::Bytes { samples: &samples[k * directions..(k + 1) * directions], levels })
            }
            Samples::Raw(RawTexels::Linear(values), _) => {
                Some(TexelLight::Linear(&values.as_chunks().0[k * directions..(k + 1) * directions]))
            }
        })
    }
}

/// The samples of one texel.
pub(super) enum TexelLight<'a> {
    /// Those that the codec kept, checked.
    Kept { kept: &'a [Kept], order: &'a Order, levels: &'a [f32; 256] },
    /// All, 8 bits a channel.
    Bytes { samples: &'a [Sample], levels: &'a [f32; 256] },
    /// All, linear.
    Linear(&'a [[f32; 3]]),
}

impl TexelLight<'_> {
    /// Linear radiance at a depth of the grid.
    pub(super) fn sample(&self, depth: u32) -> Rgb {
        match self {
            // A checked row has a value at every depth.
            Self::Kept { kept, order, levels } => linear(levels, sample_at(kept, order, depth as u16).unwrap_or_default()),
            Self::Bytes { samples, levels } => linear(levels, samples[depth as usize]),
            Self::Linear(values) => values[depth as usize].into(),
        }
    }

    /// Linear radiance at every depth, in order.
    pub(super) fn all(&self) -> Vec<Rgb> {
        match self {
            Self::Kept { kept, order, levels } => {
                let mut samples = vec![Sample::default(); order.len()];
                // The row was checked when the texel was read; it decodes.
                decode_row(kept, order, &mut samples).unwrap_or_default();
                samples.iter().map(|s| linear(levels, *s)).collect()
            }
            Self::Bytes { samples, levels } => samples.iter().map(|s| linear(levels, *s)).collect(),
            Self::Linear(values) => values.iter().map(|v| Rgb::from(*v)).collect(),
        }
    }
}

fn linear(levels: &[f32; 256], sample: Sample) -> Rgb {
    Rgb::from(sample.map(|byte| levels[usize::from(byte)]))
}
