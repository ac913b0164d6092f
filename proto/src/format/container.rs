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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plan::{ChartSource, PLAN_VERSION, SurfacePlan},
        scene::{Material, Surface, Triangle},
        settings::{SettingsPatch, TextureSize},
        units::Rgb,
    };
    use proptest::prelude::*;

    fn parts() -> (Vec<u8>, Plan) {
        let triangle = Triangle { corners: [0, 1, 2], polygon: 0 };
        let scene = Scene {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            surfaces: vec![Surface::plain("s", 0, vec![(triangle, None)])],
            materials: vec![Material::matt("m", Rgb::splat(0.5))],
            ..Scene::empty()
        };
        let layout = SurfacePlan {
            size: TextureSize::new(4, 4).unwrap(),
            source: ChartSource::Author,
            uv: vec![[[0.0; 2], [1.0, 0.0], [0.0, 1.0]]],
            charts: vec![0],
            covered: 0,
            tiles: vec![],
        };
        let scene = scene.to_bytes().unwrap();
        let plan = Plan {
            version: PLAN_VERSION,
            bake_version: 1,
            scene: Scene::hash_of(&scene),
            settings: SettingsPatch::default().resolve().unwrap(),
            surfaces: vec![layout],
            probe: None,
        };
        (scene, plan)
    }

    fn file(scene: &[u8], plan: &Plan) -> Vec<u8> {
        let plan = plan.to_bytes().unwrap();
        [&header(scene, &plan)[..], scene, &plan].concat()
    }

    #[test]
    fn the_header_of_version_1_never_changes() {
        // The check value of CRC-32C: "123456789" gives e3069283.
        let bytes = *b"KLNS\x01\0\0\0\x04\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0\x83\x92\x06\xe3\0\0\0\0";
        assert_eq!(header(b"1234", b"56789"), bytes);
        let whole = [&bytes[..], b"123456789"].concat();
        assert_eq!(split(&whole).unwrap(), (&b"1234"[..], &b"56789"[..]));
    }

    #[test]
    fn a_file_gives_back_scene_and_plan() {
        let (scene, plan) = parts();
        let parsed = parse(&file(&scene, &plan)).unwrap();
        assert_eq!(parsed, (Scene::from_bytes(&scene).unwrap(), plan));
    }

    #[test]
    fn every_shorter_file_and_a_longer_one_are_refused() {
        let (scene, plan) = parts();
        let mut bytes = file(&scene, &plan);
        for length in 0..bytes.len() {
            assert!(matches!(split(&bytes[..length]), Err(ContainerError::Length { found, .. }) if found == length as u64), "{length}");
        }
        bytes.push(0);
        assert!(matches!(split(&bytes), Err(ContainerError::Length { .. })));
    }

    #[test]
    fn lengths_above_the_limit_are_refused_before_they_are_used() {
        let most = limits::SCENE_BYTES as u64;
        for (at, what) in [(8, "scene"), (16, "plan")] {
            for length in [most + 1, u64::MAX] {
                let mut bytes = header(b"", b"");
                bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
                assert!(matches!(split(&bytes), Err(ContainerError::TooLarge { what: w, found }) if w == what && found == length));
            }
        }
    }

    #[test]
    fn a_scene_and_a_plan_of_others_are_refused() {
        let (scene, plan) = parts();
        let refused = |change: &dyn Fn(&mut Plan)| {
            let mut plan = plan.clone();
            change(&mut plan);
            matches!(parse(&file(&scene, &plan)), Err(ContainerError::Mismatch))
        };
        assert!(refused(&|p| p.scene = Scene::hash_of(b"another")));
        assert!(refused(&|p| p.surfaces.clear()));
        assert!(refused(&|p| p.surfaces[0].uv.clear()));
        assert!(refused(&|p| p.surfaces[0].charts.push(0)));
    }

    proptest! {
        #[test]
        fn every_flipped_bit_is_an_error(at in any::<prop::sample::Index>(), bit in 0u8..8) {
            let (scene, plan) = parts();
            let mut bytes = file(&scene, &plan);
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
            prop_assert!(split(&bytes).is_err());
        }
    }
}
