//! `manifest.json`: what a package holds and what it claims. Written last; `kiln inspect --verify` measures every claim again.
//!
//! It has no timings, host names or counts of workers: those are in `report.json`, the one file that the package hash leaves out, so that
//! the same scene, settings and seed give the same hash on any farm.

use crate::{
    grid::{SphericalGrid, Walk},
    ids::SceneHash,
    plan::ChartSource,
    settings::{BakeSettings, Codec, Rule, TextureSize},
};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::{fmt, str::FromStr};

/// The version of the manifest's form.
pub const SCHEMA_VERSION: u32 = 2;
/// The manifest's path within its package.
pub const PATH: &str = "manifest.json";
/// The path of the file that the package hash leaves out.
pub const REPORT_PATH: &str = "report.json";
/// Bytes of a manifest that readers accept.
pub const MAX_BYTES: u64 = 256 << 20;

/// A SHA-256, as 64 hexadecimal digits in JSON.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Sha256Hex(pub [u8; 32]);

/// The hash of a package: see [`package_hash`].
pub type PackageHash = Sha256Hex;

impl Sha256Hex {
    /// The SHA-256 of `bytes`.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }
}

impl fmt::Display for Sha256Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

impl fmt::Debug for Sha256Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Sha256Hex({self})")
    }
}

/// A text that is not 64 hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a SHA-256 is 64 hexadecimal digits")]
pub struct BadSha256;

impl FromStr for Sha256Hex {
    type Err = BadSha256;
    fn from_str(text: &str) -> Result<Self, BadSha256> {
        // The same notation as the project's own hashes, whose parser is tested.
        text.parse::<crate::ids::Digest>().map(|d| Self(d.0)).map_err(|_| BadSha256)
    }
}

impl TryFrom<String> for Sha256Hex {
    type Error = BadSha256;
    fn try_from(text: String) -> Result<Self, BadSha256> {
        text.parse()
    }
}

impl From<Sha256Hex> for String {
    fn from(hash: Sha256Hex) -> String {
        hash.to_string()
    }
}

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

/// The hash of a package: the SHA-256 of one line `SHA256␣␣PATH` for every file but `report.json`, in byte order of the paths. It is what
/// `sha256sum` prints, so anyone can compute it without this program:
/// `find * -type f ! -path report.json | LC_ALL=C sort | xargs -d '\n' sha256sum | sha256sum`. Lengths need no place of their own in it:
/// files of different lengths have different hashes.
#[must_use]
pub fn package_hash<'a>(files: impl IntoIterator<Item = (&'a str, Sha256Hex)>) -> PackageHash {
    let mut files: Vec<_> = files.into_iter().filter(|(path, _)| *path != REPORT_PATH).collect();
    files.sort_unstable();
    let mut hash = Sha256::new();
    files.iter().for_each(|(path, sha)| hash.update(format!("{sha}  {path}\n")));
    Sha256Hex(hash.finalize().into())
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

/// One surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceRecord {
    /// The author's name.
    pub name: String,
    /// The name of its files without extension.
    pub file_stem: String,
    /// Texels of its texture.
    pub size: TextureSize,
    /// Where its charts came from.
    pub charts: ChartSource,
    /// Texels that lie on a chart.
    pub covered: u64,
    /// The index of the surface whose back this is.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub back_of: Option<u32>,
    /// What it consists of.
    pub parts: Vec<PartRecord>,
    /// Its direction grid.
    pub grid: SphericalGrid,
    /// Its codec.
    pub codec: Codec,
    /// How samples were picked.
    pub rule: Rule,
    /// The order that directions are walked in.
    pub walk: Walk,
    /// What the encoding costs and what it saves.
    pub encoding: Encoding,
}

/// Sizes and errors of an encoded surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Encoding {
    /// Kept samples, those of gutter texels included.
    pub kept_samples: u64,
    /// Colours in the colour map; 0 where colours are direct.
    pub colours: u32,
    /// Bits of a colour in `.mtnc`: 16 for an index, 24 for a direct colour.
    pub colour_bits: u16,
    /// 3 bytes x D x covered texels.
    pub raw_bytes: u64,
    /// Bytes of `.mtsp`, `.mti`, `.mtnc` and `.mtm`, headers included.
    pub coded_bytes: u64,
    /// `raw_bytes / coded_bytes`.
    pub ratio: f64,
    /// Whether the encoding is larger than the raw samples: noisy glossy data can grow.
    pub grew: bool,
    /// Errors over the covered texels.
    pub errors: ErrorSummary,
}

/// Errors of the decoded against the original 8-bit samples, in levels of 1/255. A sample is one direction of one covered texel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorSummary {
    /// Mean absolute error over all samples and channels.
    pub average: f64,
    /// The same over the samples that differ in some channel (thesis, eq. 2.16).
    pub average_differing: f64,
    /// 99.9 % of the samples have no channel with a larger error.
    pub p99_9: u8,
    /// The largest error of any channel.
    pub max: u8,
    /// Samples that differ in some channel.
    pub differing: u64,
}

impl From<&crate::codec::pwl::ErrorStats> for ErrorSummary {
    fn from(e: &crate::codec::pwl::ErrorStats) -> Self {
        Self { average: e.average(), average_differing: e.average_differing(), p99_9: e.p99_9(), max: e.max(), differing: e.differing() }
    }
}

/// A part of a surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartRecord {
    /// The author's name.
    pub name: String,
    /// Its triangles.
    pub triangles: u32,
    /// What it is made of.
    pub material: MaterialRecord,
}

/// What a part is made of, in brief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialRecord {
    /// The author's name.
    pub name: String,
    /// How it reflects.
    pub reflection: ReflectionRecord,
    /// The images that vary its colour.
    pub textures: Vec<String>,
    /// Ke, W/(sr m²).
    pub emission: [f32; 3],
    /// Whether light may pass through it.
    pub lets_through: bool,
}

/// A model of reflection with its main numbers, before textures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "model")]
pub enum ReflectionRecord {
    /// It only emits.
    None,
    /// Lambert plus a Phong lobe or a mirror.
    Phong {
        /// Kd.
        diffuse: [f32; 3],
        /// Ks.
        specular: [f32; 3],
        /// Ns; absent for a mirror.
        exponent: Option<f32>,
    },
    /// glTF's.
    MetallicRoughness {
        /// baseColorFactor.
        base_color: [f32; 3],
        /// metallicFactor.
        metallic: f32,
        /// roughnessFactor.
        roughness: f32,
        /// transmissionFactor.
        transmission: f32,
    },
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
    fn the_package_hash_is_what_sha256sum_says() {
        let files = [("surfaces/a.mti", Sha256Hex::of(b"x")), ("manifest.json", Sha256Hex::of(b"")), ("report.json", Sha256Hex::of(b"y"))];
        let text = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  manifest.json\n\
                    2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881  surfaces/a.mti\n";
        assert_eq!(package_hash(files), Sha256Hex::of(text.as_bytes()));
    }

    #[test]
    fn paths_stay_inside_the_package() {
        for bad in ["", "/etc/passwd", "../x", "a/../../x", "a//b", "c:\\x", "a\\b", "./x"] {
            assert!(!is_inside(bad), "{bad}");
        }
        assert!(is_inside("surfaces/wall_north~back.mtsp"));
    }
}
