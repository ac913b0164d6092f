//! `manifest.json`: what a package holds and what it claims. Written last; `kiln inspect --verify` measures every claim again.
//!
//! It has no timings, host names or counts of workers: those are in `report.json`, the one file that the package hash leaves out, so that
//! the same scene, settings and seed give the same hash on any farm.

mod hash;
mod surface;

pub use hash::{BadSha256, PackageHash, Sha256Hex, package_hash};
pub use surface::{Encoding, ErrorSummary, HoleRecord, MaterialRecord, PartRecord, ReflectionRecord, SurfaceRecord};

use crate::{ids::SceneHash, settings::BakeSettings};
use serde::{Deserialize, Serialize};

/// The version of the manifest's form.
pub const SCHEMA_VERSION: u32 = 2;
/// The manifest's path within its package.
pub const PATH: &str = "manifest.json";
/// The path of the file that the package hash leaves out.
pub const REPORT_PATH: &str = "report.json";
/// Bytes of a manifest that readers accept.
pub const MAX_BYTES: u64 = 256 << 20;

/// One file of a package.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Path within the package, `/` between its parts.
    pub path: String,
    /// Media type.
    pub media_type: String,
    /// Length.
    pub bytes: u64,
    /// SHA-256 of the whole file.
    pub sha256: Sha256Hex,
}

/// The whole manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`SCHEMA_VERSION`] when it was written.
    pub schema: u32,
    /// The scene that was baked: the BLAKE3 hash of its canonical bytes in `scene.kiln`.
    pub scene: SceneHash,
    /// The generation of estimator and codec that baked it.
    pub bake_version: u32,
    /// Settings with every value decided.
    pub settings: BakeSettings,
    /// Seed of every sample sequence.
    pub seed: u64,
    /// What the numbers mean.
    pub units: Units,
    /// The exposure of the 8-bit coding.
    pub exposure: ExposureRecord,
    /// The scene's bounding box, metres.
    pub bounds: Bounds,
    /// Sums over all surfaces.
    pub totals: Totals,
    /// One entry per surface, in the order of the scene.
    pub surfaces: Vec<SurfaceRecord>,
    /// Every file but `manifest.json` and `report.json`, in byte order of the paths.
    pub files: Vec<FileRecord>,
}

/// What the numbers of a package mean.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Units {
    /// Of positions.
    pub length: String,
    /// Of radiance.
    pub radiance: String,
    /// Of its channels.
    pub colour: String,
}

impl Default for Units {
    fn default() -> Self {
        Self { length: "m".into(), radiance: "W/(sr m^2)".into(), colour: "linear Rec. 709".into() }
    }
}

/// byte = round(255 · sRGB_OETF(clamp(L · 2^stops, 0, 1))).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExposureRecord {
    /// Stops, a multiple of 1/8.
    pub stops: f32,
    /// Share of the probed radiance above 1.0 at that exposure, parts per million.
    pub clipped_ppm: u32,
}

/// A box, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Lower corner.
    pub low: [f32; 3],
    /// Upper corner.
    pub high: [f32; 3],
}

/// Sums over all surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Totals {
    /// Texels, covered or not.
    pub texels: u64,
    /// Covered texels.
    pub covered: u64,
    /// 3 bytes x D x covered texels.
    pub raw_bytes: u64,
    /// Bytes of the compressed files, headers included.
    pub coded_bytes: u64,
    /// `raw_bytes / coded_bytes`.
    pub ratio: f64,
}

/// Why bytes are not a usable manifest.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// Not such JSON.
    #[error("the manifest cannot be read")]
    Json(#[from] serde_json::Error),
    /// Another version.
    #[error("the manifest has schema version {found}; this program reads {SCHEMA_VERSION}")]
    Version {
        /// The version found.
        found: u32,
    },
    /// A path that leads out of the package.
    #[error("the manifest lists `{path}`, which is no path within a package")]
    Path {
        /// The path.
        path: String,
    },
}

impl Manifest {
    /// The bytes of `manifest.json`.
    ///
    /// # Errors
    /// Only where serde_json fails.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ManifestError> {
        let mut bytes = serde_json::to_vec_pretty(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Reads `manifest.json`.
    ///
    /// # Errors
    /// Bytes that are no manifest of this version, and paths that lead out of the package.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ManifestError> {
        let manifest: Manifest = serde_json::from_slice(bytes)?;
        if manifest.schema != SCHEMA_VERSION {
            return Err(ManifestError::Version { found: manifest.schema });
        }
        let stems = manifest.surfaces.iter().map(|s| &s.file_stem);
        match manifest.files.iter().map(|f| &f.path).chain(stems).find(|path| !is_inside(path)) {
            Some(path) => Err(ManifestError::Path { path: path.clone() }),
            None => Ok(manifest),
        }
    }
}

fn is_inside(path: &str) -> bool {
    path.split('/').all(|part| !part.is_empty() && part != "." && part != "..") && !path.contains(['\\', ':', '\0', '\n'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_inside_the_package() {
        for bad in ["", "/etc/passwd", "../x", "a/../../x", "a//b", "c:\\x", "a\\b", "./x"] {
            assert!(!is_inside(bad), "{bad}");
        }
        assert!(is_inside("surfaces/wall_north~back.mtsp"));
    }
}
