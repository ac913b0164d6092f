//! Files of a package: headers, the manifest, the hash, and a reference reader for surfaces in memory.
//!
//! A package is a folder: `manifest.json`, `scene.kiln` and the thesis's file set of every surface under `surfaces/`. Readers that stream
//! (the command line, the page) use [`header`] and the layouts here; [`surface`] is the oracle that they are tested against.

pub mod container;
pub mod header;
pub mod manifest;
pub mod surface;

pub use header::{Header, HeaderError, Kind};
pub use manifest::{FileRecord, Manifest, PackageHash, Sha256Hex, package_hash};
