//! Bounds that are checked before memory is allocated or work begins. One place, so that an error can name the limit it ran into.

/// Bytes of one uploaded bundle after unpacking.
pub const BUNDLE_BYTES: u64 = 2 << 30;
/// Files in one uploaded bundle.
pub const BUNDLE_FILES: usize = 4_096;
/// Bytes of one OBJ or MTL text.
pub const TEXT_BYTES: u64 = 1 << 30;
/// Pixels of one material texture.
pub const TEXTURE_PIXELS: u64 = 16_384 * 16_384;
/// Triangles of one scene.
pub const TRIANGLES: usize = 50_000_000;
/// Quads of one swept surface, whose number is the product of two lists' lengths and so grows faster than the file.
pub const SWEPT_QUADS: usize = 500_000;
/// Surfaces of one scene.
pub const SURFACES: usize = 65_535;
/// Lights, cameras or projectors of one scene.
pub const LIGHTS: usize = 16_384;
/// Texture coordinate sets of one surface.
pub const UV_SETS: usize = 8;
/// Pixels of an environment map.
pub const ENVIRONMENT_PIXELS: u64 = 16_384 * 8_192;
/// The largest number of an emission or environment, W/(sr m²), of a light's intensity, W/sr or W/m², of its ambient term, and of the
/// factor on an environment: as radiance a million times that of the sun. The product of two of them, summed over all that a scene may
/// have, is still a number in f32.
pub const BRIGHTEST: f32 = 1e13;
/// Bytes of a name (surface, material, label).
pub const NAME_BYTES: usize = 1_024;
/// Texels along one side of a surface's texture.
pub const TEXTURE_SIDE: u32 = 8_192;
/// Texels of one job, covered or not.
pub const JOB_TEXELS: u64 = 1_000_000_000;
/// Directions along one side of a direction grid.
pub const GRID_SIDE: u32 = 64;
/// Shared incident samples per texel.
pub const SAMPLES: u32 = 1 << 20;
/// Longest light path.
pub const MAX_DEPTH: u32 = 64;
/// Bytes of one frame of the worker protocol, decompressed.
pub const FRAME_BYTES: usize = 64 << 20;
/// Bytes of one canonical scene or plan.
pub const SCENE_BYTES: usize = 4 << 30;
/// Bytes of one segment, decompressed: 1,024 texels of 4,096 directions, raw in f32 beside the kept samples.
pub const SEGMENT_BYTES: usize = 128 << 20;
/// Bytes of one chunk of segments as uploaded.
pub const CHUNK_BYTES: u64 = 256 << 20;
/// Segments in one chunk.
pub const CHUNK_SEGMENTS: usize = 4_096;
/// Tiles in one lease.
pub const LEASE_TILES: u64 = 4_096;
