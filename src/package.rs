//! A package on disk, read a few texels at a time: no command that works on one holds more of it than it looks at.
//!
//! Reads are positioned (`pread`), so that threads share a file without a lock. Whoever makes something new of a file has its checksum
//! compared first ([`Trust::Checksum`]), which costs one more read of it: damaged light with fresh hashes would pass for whole for ever.

#[cfg(test)]
pub(crate) mod fixture;

use crate::error::CommandError;
use kiln_coordinator::assemble::AssembleError;
use kiln_proto::{
    codec::pwl::{BadRow, Kept, Order, Sample},
    format::{
        Header, HeaderError, Kind, Manifest,
        container::{self, ContainerError},
        header,
        manifest::{self, ManifestError},
        surface::{SurfaceError, check_headers},
    },
    plan::Plan,
    scene::Scene,
    settings::{BadSetting, RawFormat},
    texel::{Row, SurfaceRaster},
    units::radiance_to_byte,
};
use kiln_worker::encode::EncodeError;
use std::{
    fs::{self, File},
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

/// Why a command on a package failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ToolError {
    /// A file or folder cannot be read or written.
    #[error("{}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The report cannot be written.
    #[error("the output cannot be written")]
    Output(#[from] io::Error),
    /// `manifest.json` is not usable.
    #[error("{}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: ManifestError,
    },
    /// `scene.kiln` is not usable.
    #[error("{}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: ContainerError,
    },
    /// A surface's file is not usable.
    #[error("{}", path.display())]
    Header {
        /// The file.
        path: PathBuf,
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
    /// Something in the package contradicts something else.
    #[error("{0}")]
    Damaged(String),
    /// A verification that found differences.
    #[error("the package does not hold what it claims: {count} difference(s), the first: {first}")]
    Unverified {
        /// How many.
        count: usize,
        /// The first of them.
        first: String,
    },
    /// The uncompressed radiance that a command needs was not kept.
    #[error("{} keeps no raw radiance; bake with --raw u8 or --raw f32 to encode or decode from it", path.display())]
    NoRaw {
        /// The package.
        path: PathBuf,
    },
    /// Arguments that contradict each other or the package.
    #[error("{0}")]
    Usage(String),
    /// The folder for the output is of no use.
    #[error(transparent)]
    OutputFolder(#[from] CommandError),
    /// A setting out of its range.
    #[error(transparent)]
    Setting(#[from] BadSetting),
    /// Encoding failed.
    #[error("encoding failed")]
    Encode(#[from] EncodeError),
    /// Assembly failed.
    #[error("assembly failed")]
    Assemble(#[from] AssembleError),
    /// The table cannot be written.
    #[error("the CSV cannot be written")]
    Csv(#[from] csv::Error),
}

impl ToolError {
    /// Whether the arguments are at fault, not the package.
    pub(crate) fn is_usage(&self) -> bool {
        match self {
            ToolError::Usage(_) | ToolError::Setting(_) => true,
            ToolError::OutputFolder(error) => error.is_usage(),
            _ => false,
        }
    }
}

/// An I/O error of `path`.
pub(crate) fn io_fault(path: &Path) -> impl Fn(io::Error) -> ToolError + '_ {
    move |source| ToolError::Io { path: path.to_owned(), source }
}

/// What is known of a file's payload before it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trust {
    /// Nothing: it is read once for its checksum when it is opened.
    Checksum,
    /// The whole file was compared with the hash in the manifest a moment ago.
    Hashed,
}

/// A package that was opened.
pub(crate) struct Package {
    /// Its folder.
    pub(crate) dir: PathBuf,
    /// What it claims.
    pub(crate) manifest: Manifest,
    /// The bytes of `manifest.json`.
    pub(crate) manifest_bytes: Vec<u8>,
    /// The scene.
    pub(crate) scene: Scene,
    /// How the scene was laid out and with which settings.
    pub(crate) plan: Plan,
    /// The canonical bytes of the scene.
    pub(crate) scene_bytes: Vec<u8>,
}

impl Package {
    /// Reads the manifest and `scene.kiln` and checks that they belong together.
    pub(crate) fn open(dir: &Path) -> Result<Self, ToolError> {
        let path = dir.join(manifest::PATH);
        let size = fs::metadata(&path).map_err(io_fault(&path))?.len();
        if size > manifest::MAX_BYTES {
            return Err(ToolError::Damaged(format!("{} has {size} bytes, which no manifest has", path.display())));
        }
        let manifest_bytes = fs::read(&path).map_err(io_fault(&path))?;
        let manifest = Manifest::from_bytes(&manifest_bytes).map_err(|source| ToolError::Manifest { path, source })?;
        let path = dir.join(container::PATH);
        let bytes = fs::read(&path).map_err(io_fault(&path))?;
        let fault = |source| ToolError::Scene { path: path.clone(), source };
        let (scene, plan) = container::parse(&bytes).map_err(fault)?;
        let scene_bytes = container::split(&bytes).map_err(fault)?.0.to_vec();
        let named = manifest.surfaces.iter().map(|s| (&s.name, &s.file_stem)).eq(scene.surfaces.iter().map(|s| (&s.name, &s.file_stem)));
        let walks = plan.probe.as_ref().map(|p| p.walks.len());
        if !named || manifest.scene != plan.scene || walks != Some(scene.surfaces.len()) {
            return Err(ToolError::Damaged(format!("{}: manifest.json and scene.kiln do not belong together", dir.display())));
        }
        Ok(Self { dir: dir.to_owned(), manifest, manifest_bytes, scene, plan, scene_bytes })
    }

    /// The raster of a surface.
    pub(crate) fn raster(&self, surface: usize) -> SurfaceRaster {
        SurfaceRaster::new(&self.scene, &self.scene.surfaces[surface], &self.plan.surfaces[surface], self.plan.settings.frame)
    }

    /// The walk of a surface over the package's grid.
    pub(crate) fn order(&self, surface: usize) -> Order {
        let walk = self.plan.probe.as_ref().and_then(|p| p.walks.get(surface)).copied().unwrap_or_default();
        Order::new(self.plan.settings.directions, walk)
    }

    /// The factor on radiance before it is coded to 8 bits.
    pub(crate) fn exposure_factor(&self) -> f32 {
        self.plan.probe.as_ref().map(|p| p.exposure).unwrap_or_default().factor()
    }

    /// The encoded samples of a surface.
    pub(crate) fn coded(&self, surface: usize, trust: Trust) -> Result<CodedFiles, ToolError> {
        let open = |kind| self.file(surface, kind, &[8, 16, 24, 32], trust);
        let ((starts, mtsp), (depths, mti), (colours, mtnc), (map, mtm)) =
            (open(Kind::Mtsp)?, open(Kind::Mti)?, open(Kind::Mtnc)?, open(Kind::Mtm)?);
        let name = self.scene.surfaces[surface].name.clone();
        check_headers(&mtsp, &mti, &mtnc, &mtm).map_err(|source| ToolError::Surface { surface: name.clone(), source })?;
        let bytes = map.read(0, mtm.payload_bytes())?;
        let map = (mtnc.bits == 16).then(|| bytes.as_chunks::<3>().0.to_vec());
        Ok(CodedFiles { name, starts, depths, colours, map, samples: mti.count })
    }

    /// The uncompressed samples of a surface.
    pub(crate) fn raw(&self, surface: usize, trust: Trust) -> Result<RawFiles, ToolError> {
        let bits: &[u16] = match self.plan.settings.raw {
            None => return Err(ToolError::NoRaw { path: self.dir.clone() }),
            Some(RawFormat::U8) => &[8],
            Some(RawFormat::F32) => &[32],
        };
        let (file, header) = self.file(surface, Kind::Mtex, bits, trust)?;
        Ok(RawFiles { file, bits: header.bits, values: u64::from(header.depth) * 3, exposure: self.exposure_factor() })
    }

    fn file(&self, surface: usize, kind: Kind, bits: &[u16], trust: Trust) -> Result<(Payload, Header), ToolError> {
        let path = self.dir.join(kind.path(&self.scene.surfaces[surface].file_stem));
        let file = File::open(&path).map_err(io_fault(&path))?;
        let length = file.metadata().map_err(io_fault(&path))?.len();
        let mut head = [0; header::BYTES];
        file.read_exact_at(&mut head, 0).map_err(io_fault(&path))?;
        let header = Header::parse(&head, kind, length).map_err(|source| ToolError::Header { path: path.clone(), source })?;
        let expected = (self.plan.surfaces[surface].size, self.plan.settings.directions.len());
        if (header.size, header.depth) != expected || !bits.contains(&header.bits) {
            return Err(ToolError::Damaged(format!("{}: its header is not that of the package's plan", path.display())));
        }
        let payload = Payload { path, file };
        if trust == Trust::Checksum {
            let crc = payload.crc(header.payload_bytes())?;
            header.check_crc(crc).map_err(|source| ToolError::Header { path: payload.path.clone(), source })?;
        }
        Ok((payload, header))
    }
}

/// Bytes read at once when a payload's checksum is computed.
const BLOCK: u64 = 1 << 18;

/// The part of a file behind its header.
struct Payload {
    path: PathBuf,
    file: File,
}

impl Payload {
    fn read(&self, at: u64, bytes: u64) -> Result<Vec<u8>, ToolError> {
        let mut out = vec![0; bytes as usize];
        self.file.read_exact_at(&mut out, header::BYTES as u64 + at).map_err(io_fault(&self.path))?;
        Ok(out)
    }

    /// CRC32C of the whole payload.
    fn crc(&self, bytes: u64) -> Result<u32, ToolError> {
        let mut blocks = (0..bytes.div_ceil(BLOCK)).map(|k| (k * BLOCK, BLOCK.min(bytes - k * BLOCK)));
        blocks.try_fold(0, |crc, (at, length)| Ok(crc32c::crc32c_append(crc, &self.read(at, length)?)))
    }
}

/// Texels next to each other in one texel row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Number of the first: column + width x row.
    pub(crate) first: u64,
    /// How many.
    pub(crate) count: u64,
}

/// Groups a tile's rows, which come row by row, into runs.
pub(crate) fn runs(rows: &[Row], width: u32) -> Vec<Run> {
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

/// `.mtsp`, `.mti`, `.mtnc` and `.mtm` of a surface.
pub(crate) struct CodedFiles {
    name: String,
    starts: Payload,
    depths: Payload,
    colours: Payload,
    /// `None` where colours are direct.
    map: Option<Vec<Sample>>,
    /// Kept samples in all.
    pub(crate) samples: u64,
}

impl CodedFiles {
    /// Colours in the map, and bits of a colour.
    pub(crate) fn colour_map(&self) -> (u32, u16) {
        self.map.as_ref().map_or((0, 24), |m| (m.len() as u32, 16))
    }

    /// Whether the colour map is ascending, each colour once; direct colours have no map to be wrong.
    pub(crate) fn map_ascends(&self) -> bool {
        self.map.as_ref().is_none_or(|map| map.windows(2).all(|w| w[0] < w[1]))
    }

    /// The kept samples of each texel of a run.
    pub(crate) fn read(&self, run: Run) -> Result<Vec<Vec<Kept>>, ToolError> {
        let bytes = self.starts.read(run.first * 4, (run.count + 1) * 4)?;
        let starts: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|s| u32::from_le_bytes(*s)).collect();
        let (first, last) = (starts[0], starts[starts.len() - 1]);
        if starts.windows(2).any(|w| w[0] > w[1]) || u64::from(last) > self.samples {
            return Err(self.damaged(&format!("the starting points from texel {} on go down or beyond the samples", run.first)));
        }
        let count = u64::from(last - first);
        let depths = self.depths.read(u64::from(first) * 2, count * 2)?;
        let colours = match &self.map {
            None => self.colours.read(u64::from(first) * 3, count * 3)?.as_chunks().0.to_vec(),
            Some(map) => self.colours_of(map, &self.colours.read(u64::from(first) * 2, count * 2)?)?,
        };
        let kept: Vec<Kept> =
            depths.as_chunks().0.iter().zip(colours).map(|(d, rgb)| Kept { depth: u16::from_le_bytes(*d), rgb }).collect();
        Ok(starts.windows(2).map(|w| kept[(w[0] - first) as usize..(w[1] - first) as usize].to_vec()).collect())
    }

    fn colours_of(&self, map: &[Sample], indices: &[u8]) -> Result<Vec<Sample>, ToolError> {
        let colour = |c: &[u8; 2]| map.get(usize::from(u16::from_le_bytes(*c))).copied();
        let found: Option<Vec<Sample>> = indices.as_chunks().0.iter().map(colour).collect();
        found.ok_or_else(|| self.damaged("a colour index is beyond the colour map"))
    }

    fn damaged(&self, what: &str) -> ToolError {
        ToolError::Damaged(format!("surface `{}`: {what}", self.name))
    }
}

/// `.mtex` of a surface.
pub(crate) struct RawFiles {
    file: Payload,
    bits: u16,
    /// Values of a texel: 3 D.
    values: u64,
    exposure: f32,
}

/// Uncompressed samples of some texels, three channels each.
#[derive(PartialEq)]
pub(crate) enum RawTexels {
    /// Coded to 8 bits.
    Coded(Vec<Sample>),
    /// Linear radiance, W/(sr m²).
    Linear(Vec<f32>),
}

impl RawFiles {
    /// The samples of several runs, one after another.
    pub(crate) fn read(&self, runs: &[Run]) -> Result<RawTexels, ToolError> {
        let bytes = self.values * u64::from(self.bits / 8);
        let mut all = Vec::new();
        for run in runs {
            all.extend(self.file.read(run.first * bytes, run.count * bytes)?);
        }
        Ok(match self.bits {
            8 => RawTexels::Coded(all.as_chunks().0.to_vec()),
            _ => RawTexels::Linear(all.as_chunks().0.iter().map(|v| f32::from_le_bytes(*v)).collect()),
        })
    }

    /// The samples of several runs coded to 8 bits, as the encoder saw them.
    pub(crate) fn read_coded(&self, runs: &[Run]) -> Result<Vec<Sample>, ToolError> {
        Ok(match self.read(runs)? {
            RawTexels::Coded(samples) => samples,
            RawTexels::Linear(values) => values.as_chunks::<3>().0.iter().map(|v| v.map(|c| radiance_to_byte(c, self.exposure))).collect(),
        })
    }
}
