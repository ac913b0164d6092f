//! Files of a package: headers, the manifest, the hash, and a small reader for surfaces in memory.
//!
//! A package is a folder: `manifest.json`, `scene.kiln` and the thesis's file set of every surface under `surfaces/`. [`stream`] reads
//! files of any size a few texels at a time (the command line, the preview); [`surface`] reads whole ones in memory, for small tools and
//! tests.

pub mod container;
pub mod header;
pub mod manifest;
pub mod stream;
pub mod surface;

pub use header::{Header, HeaderError, Kind};
pub use manifest::{FileRecord, Manifest, PackageHash, Sha256Hex, package_hash};
