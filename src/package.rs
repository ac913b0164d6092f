//! A package on disk, read a few texels at a time: no command that works on one holds more of it than it looks at.
//!
//! Here is what concerns folders and files; the readers of a surface's files are [`kiln_proto::format::stream`]'s, which the coordinator
//! uses on blobs. Reads are positioned (`pread`), so that threads share a file without a lock.

#[cfg(test)]
pub(crate) mod fixture;

use crate::error::CommandError;
use kiln_coordinator::{
    assemble::{AssembleError, Hole, Holes},
    preview::{PackageFiles, RenderError},
};
use kiln_proto::{
    codec::pwl::Order,
    format::{
        Kind, Manifest,
        container::{self, ContainerError},
        manifest::{self, ManifestError},
        stream::{CodedFiles, Fault, RawFiles, ReadAt, ReadError, Trust},
    },
    plan::Plan,
    scene::{Scene, Surface},
    settings::BadSetting,
    texel::SurfaceRaster,
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
    /// A surface's files cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// There is no picture.
    #[error(transparent)]
    Render(#[from] RenderError),
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

    /// The holes of a surface laid out by `plan`; nothing where it is whole.
    pub(crate) fn holes<'a>(&self, plan: &'a Plan, surface: usize) -> Result<Option<Holes<'a>>, ToolError> {
        let claims = &self.manifest.surfaces[surface].holes;
        let list = claims.iter().map(|hole| Hole { tile: hole.tile as usize, reason: hole.reason.clone() }).collect();
        let holes = (!claims.is_empty()).then(|| Holes::new(&self.scene, plan, surface, list)).transpose();
        holes.map_err(|error| ToolError::Damaged(format!("{}: {error}", self.dir.join(manifest::PATH).display())))
    }

    /// The walk of a surface over the package's grid.
    pub(crate) fn order(&self, surface: usize) -> Order {
        self.plan.order(surface)
    }

    /// The encoded samples of a surface.
    pub(crate) fn coded(&self, surface: usize, trust: Trust) -> Result<Coded, ToolError> {
        let Surface { name, file_stem, .. } = &self.scene.surfaces[surface];
        CodedFiles::open(name, self.plan.shape(surface), trust, |kind| Ok(self.open_file(&kind.path(file_stem))?))
    }

    /// The uncompressed samples of a surface.
    pub(crate) fn raw(&self, surface: usize, trust: Trust) -> Result<Raw, ToolError> {
        let format = self.plan.settings.raw.ok_or_else(|| ToolError::NoRaw { path: self.dir.clone() })?;
        let file = self.open_file(&Kind::Mtex.path(&self.scene.surfaces[surface].file_stem))?;
        Ok(RawFiles::open(file, self.plan.shape(surface), trust, format, self.plan.exposure())?)
    }

    fn open_file(&self, path: &str) -> Result<DiskFile, ReadError> {
        let path = self.dir.join(path);
        DiskFile::open(&path).map_err(|e| ReadError::Io { name: path.display().to_string(), source: e.into() })
    }
}

impl PackageFiles for Package {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        Ok(Box::new(self.open_file(path)?))
    }
}

/// The encoded samples of a surface on disk.
pub(crate) type Coded = CodedFiles<DiskFile>;
/// The uncompressed samples of a surface on disk.
pub(crate) type Raw = RawFiles<DiskFile>;

/// A file of a package, read by position.
#[derive(Debug)]
pub(crate) struct DiskFile {
    name: String,
    file: File,
    length: u64,
}

impl DiskFile {
    fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { name: path.display().to_string(), file, length })
    }
}

impl ReadAt for DiskFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn length(&self) -> u64 {
        self.length
    }

    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault> {
        Ok(self.file.read_exact_at(out, at)?)
    }
}
