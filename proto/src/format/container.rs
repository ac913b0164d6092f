//! `scene.kiln`: the canonical scene and the plan of a package in one file, so that a package can be read, measured and encoded again
//! without the farm that made it.
//!
//! ```text
//! offset  size
//!      0     4  magic "KLNS"
//!      4     2  version
//!      6     2  zero
//!      8     8  bytes of the scene
//!     16     8  bytes of the plan
//!     24     4  CRC32C of scene and plan
//!     28     4  zero
//!     32        scene (its BLAKE3 hash is the scene hash), then plan
//! ```

use crate::{
    limits,
    plan::{Plan, PlanError},
    scene::{Scene, SceneError},
};

/// Version 1: the first.
pub const VERSION: u16 = 1;
/// Bytes before the scene.
pub const HEADER_BYTES: usize = 32;
/// The file's path within its package.
pub const PATH: &str = "scene.kiln";
const MAGIC: [u8; 4] = *b"KLNS";

/// Why bytes are not a usable `scene.kiln`.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    /// Shorter or longer than its header says, or than a header.
    #[error("the file has {found} bytes; {expected} expected")]
    Length {
        /// Bytes found.
        found: u64,
        /// Bytes expected.
        expected: u64,
    },
    /// Something else.
    #[error("the file does not begin as a scene.kiln of version {VERSION} does")]
    Magic,
    /// More than a limit.
    #[error("the {what} has {found} bytes; at most {max} are allowed", max = limits::SCENE_BYTES)]
    TooLarge {
        /// Scene or plan.
        what: &'static str,
        /// Bytes claimed.
        found: u64,
    },
    /// Damaged.
    #[error("the checksum is {found:08x}; the content gives {expected:08x}")]
    Checksum {
        /// In the header.
        found: u32,
        /// Of the content.
        expected: u32,
    },
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The plan cannot be used.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Scene and plan do not belong together.
    #[error("the plan is made for another scene")]
    Mismatch,
}

/// The header in front of `scene` and `plan`.
#[must_use]
pub fn header(scene: &[u8], plan: &[u8]) -> [u8; HEADER_BYTES] {
    let mut out = [0; HEADER_BYTES];
    out[..4].copy_from_slice(&MAGIC);
    out[4..6].copy_from_slice(&VERSION.to_le_bytes());
    out[8..16].copy_from_slice(&(scene.len() as u64).to_le_bytes());
    out[16..24].copy_from_slice(&(plan.len() as u64).to_le_bytes());
    out[24..28].copy_from_slice(&crc32c::crc32c_append(crc32c::crc32c(scene), plan).to_le_bytes());
    out
}

/// The canonical bytes of scene and plan, cut out of a whole file and checked against its header.
///
/// # Errors
/// Files that are not whole and undamaged.
pub fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), ContainerError> {
    let short = ContainerError::Length { found: bytes.len() as u64, expected: HEADER_BYTES as u64 };
    let (header, content) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or(short)?;
    if header[..4] != MAGIC || header[4..6] != VERSION.to_le_bytes() || header[6..8] != [0; 2] || header[28..] != [0; 4] {
        return Err(ContainerError::Magic);
    }
    let length = |at: usize| header[at..at + 8].iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
    let (scene, plan) = (length(8), length(16));
    for (what, found) in [("scene", scene), ("plan", plan)] {
        if found > limits::SCENE_BYTES as u64 {
            return Err(ContainerError::TooLarge { what, found });
        }
    }
    if scene + plan != content.len() as u64 {
        return Err(ContainerError::Length { found: bytes.len() as u64, expected: HEADER_BYTES as u64 + scene + plan });
    }
    let (found, expected) = (length(24) as u32, crc32c::crc32c(content));
    if found != expected {
        return Err(ContainerError::Checksum { found, expected });
    }
    Ok(content.split_at(scene as usize))
}

/// The scene and the plan of a whole file, decoded and checked against each other: every surface has its layout, every triangle its
/// corners.
///
/// # Errors
/// See [`ContainerError`].
pub fn parse(bytes: &[u8]) -> Result<(Scene, Plan), ContainerError> {
    let (scene_bytes, plan_bytes) = split(bytes)?;
    let (scene, plan) = (Scene::from_bytes(scene_bytes)?, Plan::from_bytes(plan_bytes)?);
    let fits = scene.surfaces.len() == plan.surfaces.len()
        && scene.surfaces.iter().zip(&plan.surfaces).all(|(s, p)| s.triangles.len() == p.uv.len() && p.uv.len() == p.charts.len());
    if fits && Scene::hash_of(scene_bytes) == plan.scene { Ok((scene, plan)) } else { Err(ContainerError::Mismatch) }
}
