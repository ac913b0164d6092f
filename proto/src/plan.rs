//! The plan of a job: how a scene's surfaces are laid out in texture space and cut into tiles.
//!
//! `tile(i)` follows from the plan alone, so a job of a billion texels is one row in the store beside this blob. The plan is what
//! `prepare` makes from scene and settings; the barrier behind the Probe phase adds its results ([`PhaseResults`]) and so makes a new plan
//! with a new digest, which is how they reach every worker.

use crate::{
    codec::pwl::Order,
    format::stream::Shape,
    grid::Walk,
    ids::{Digest, SceneHash},
    limits,
    settings::{BakeSettings, TextureSize},
    tile::{Cell, TileIndex},
    units::Exposure,
    wire::{self, DecodeError, message::Phase},
};
use serde::{Deserialize, Serialize};

/// The version of the plan's form.
pub const PLAN_VERSION: u32 = 2;

/// Everything a worker needs beside the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// [`PLAN_VERSION`] when it was written.
    pub version: u32,
    /// [`BAKE_VERSION`](crate::BAKE_VERSION) that the job is pinned to.
    pub bake_version: u32,
    /// The scene.
    pub scene: SceneHash,
    /// The settings.
    #[serde(with = "as_json")]
    pub settings: BakeSettings,
    /// One layout per surface of the scene, in its order.
    pub surfaces: Vec<SurfacePlan>,
    /// What the Probe phase found; `None` before its barrier.
    pub probe: Option<PhaseResults>,
}

/// Where the triangles of one surface lie in its texture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfacePlan {
    /// Size of the texture, `texel_scale` applied.
    pub size: TextureSize,
    /// Where the charts came from.
    pub source: ChartSource,
    /// Texture coordinates of each triangle's corners, in [0, 1], non-overlapping.
    pub uv: Vec<[[f32; 2]; 3]>,
    /// The chart of each triangle.
    pub charts: Vec<u32>,
    /// Texels whose centre lies on a triangle.
    pub covered: u64,
    /// The non-empty tiles in Morton order.
    pub tiles: Vec<PlannedTile>,
}

/// Where the charts of a surface came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChartSource {
    /// The author's charts, where the author has them or packed anew.
    Author,
    /// A chart for each plane of neighbouring polygons, packed.
    Polygons,
    /// Charts of neighbouring triangles, flattened and packed.
    Atlas,
    /// Each part laid out by itself, then packed together.
    Parts,
    /// The layout of the front, mirrored: what the back of a two-sided surface has.
    Front,
}

/// A tile with what it costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedTile {
    /// Which cell.
    pub cell: Cell,
    /// Covered texels in it.
    pub covered: u16,
    /// Gutter texels in it.
    pub gutter: u16,
}

/// What the barrier behind Probe adds to the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhaseResults {
    /// The job's exposure.
    pub exposure: Exposure,
    /// The walk of each surface.
    pub walks: Vec<Walk>,
    /// Share of probed values above 1.0 at that exposure, parts per million.
    pub clipped_ppm: u32,
}

/// Texels probed in all, at most.
pub const PROBE_TEXELS: u64 = 4_096;
/// Texels in one tile of the Probe phase.
pub const PROBE_TILE_TEXELS: u64 = 64;

impl Plan {
    /// The surface and the tile behind an index of the Bake phase.
    #[must_use]
    pub fn locate(&self, tile: TileIndex) -> Option<(usize, PlannedTile)> {
        let mut left = tile.0;
        for (index, surface) in self.surfaces.iter().enumerate() {
            let count = surface.tiles.len() as u64;
            if left < count {
                return Some((index, surface.tiles[left as usize]));
            }
            left -= count;
        }
        None
    }

    /// The index of the first tile of a surface in the Bake phase.
    #[must_use]
    pub fn first_tile(&self, surface: usize) -> TileIndex {
        TileIndex(self.surfaces[..surface].iter().map(|s| s.tiles.len() as u64).sum())
    }

    /// Covered texels over all surfaces.
    #[must_use]
    pub fn covered(&self) -> u64 {
        self.surfaces.iter().map(|s| s.covered).sum()
    }

    /// The order in which a surface's samples are walked: by azimuth before the Probe phase has chosen.
    #[must_use]
    pub fn order(&self, surface: usize) -> Order {
        Order::new(self.settings.directions, self.walk(surface))
    }

    /// The walk of that order.
    #[must_use]
    pub fn walk(&self, surface: usize) -> Walk {
        self.probe.as_ref().and_then(|p| p.walks.get(surface)).copied().unwrap_or_default()
    }

    /// The exposure of the 8-bit coding: none before the Probe phase has found it.
    #[must_use]
    pub fn exposure(&self) -> Exposure {
        self.probe.as_ref().map(|p| p.exposure).unwrap_or_default()
    }

    /// What a surface's files say in their headers.
    #[must_use]
    pub fn shape(&self, surface: usize) -> Shape {
        Shape { size: self.surfaces[surface].size, directions: self.settings.directions.len() }
    }

    /// Number of tiles of a phase.
    #[must_use]
    pub fn tile_count(&self, phase: Phase) -> u64 {
        match phase {
            Phase::Probe => self.covered().min(PROBE_TEXELS).div_ceil(PROBE_TILE_TEXELS),
            Phase::Bake => self.surfaces.iter().map(|s| s.tiles.len() as u64).sum(),
        }
    }

    /// Texels that a tile of a phase bakes, gutters included: what a lease is costed by.
    #[must_use]
    pub fn tile_cost(&self, phase: Phase, tile: TileIndex) -> u64 {
        match phase {
            Phase::Probe => PROBE_TILE_TEXELS,
            Phase::Bake => self.locate(tile).map_or(0, |(_, t)| u64::from(t.covered) + u64::from(t.gutter)),
        }
    }

    /// The ordinals (over all covered texels, surfaces in order) that a tile of the Probe phase looks at: spread evenly.
    pub fn probe_ordinals(&self, tile: TileIndex) -> impl Iterator<Item = u64> {
        let (all, probed) = (self.covered(), self.covered().min(PROBE_TEXELS));
        let first = tile.0 * PROBE_TILE_TEXELS;
        (first..(first + PROBE_TILE_TEXELS).min(probed)).map(move |k| (2 * k + 1) * all / (2 * probed))
    }

    /// The bytes that are hashed, stored and sent.
    ///
    /// # Errors
    /// Plans above [`limits::SCENE_BYTES`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, DecodeError> {
        wire::encode(self, limits::SCENE_BYTES)
    }

    /// Reads [`Plan::to_bytes`] back.
    ///
    /// # Errors
    /// Bytes that are not a plan of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PlanError> {
        let plan: Plan = wire::decode(bytes, limits::SCENE_BYTES)?;
        if plan.version != PLAN_VERSION {
            return Err(PlanError::Version { found: plan.version });
        }
        Ok(plan)
    }

    /// The name of these bytes.
    #[must_use]
    pub fn digest_of(bytes: &[u8]) -> Digest {
        Digest::of(bytes)
    }
}

/// Why bytes are not a usable plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Not a plan.
    #[error("the plan cannot be decoded")]
    Decode(#[from] DecodeError),
    /// Another version.
    #[error("plan version {found}; this program reads version {PLAN_VERSION}")]
    Version {
        /// What it says.
        found: u32,
    },
}

/// Settings are written for people (tagged, self-describing), which bincode cannot read back; inside a plan they travel as JSON text.
mod as_json {
    use super::BakeSettings;
    use serde::{Deserialize, Deserializer, Serializer, de::Error as _, ser::Error as _};

    pub(super) fn serialize<S: Serializer>(settings: &BakeSettings, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_str(&serde_json::to_string(settings).map_err(S::Error::custom)?)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<BakeSettings, D::Error> {
        serde_json::from_str(&String::deserialize(d)?).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::SettingsPatch;

    fn plan() -> Plan {
        let surface = |tiles: u16, covered| SurfacePlan {
            size: TextureSize { width: 64, height: 32 },
            source: ChartSource::Author,
            uv: vec![],
            charts: vec![],
            covered,
            tiles: (0..tiles).map(|x| PlannedTile { cell: Cell { x, y: 0 }, covered: 10, gutter: 2 }).collect(),
        };
        Plan {
            version: PLAN_VERSION,
            bake_version: 1,
            scene: SceneHash::of(b""),
            settings: SettingsPatch::default().resolve().unwrap(),
            surfaces: vec![surface(2, 20), surface(0, 0), surface(3, 100_000)],
            probe: None,
        }
    }

    #[test]
    fn tile_numbers_run_through_the_surfaces() {
        let plan = plan();
        let at = |i| plan.locate(TileIndex(i)).map(|(s, t)| (s, t.cell.x));
        assert_eq!([at(0), at(1), at(2), at(4), at(5)], [Some((0, 0)), Some((0, 1)), Some((2, 0)), Some((2, 2)), None]);
        assert_eq!((plan.first_tile(2), plan.tile_count(Phase::Bake), plan.tile_cost(Phase::Bake, TileIndex(0))), (TileIndex(2), 5, 12));
    }

    /// A change of the plan's form is a new `PLAN_VERSION`.
    #[test]
    fn the_bytes_of_a_plan_never_change() {
        assert_eq!(
            Plan::digest_of(&plan().to_bytes().unwrap()).to_string(),
            "43576acce6a37d4969bb2e157a642ca8d56b663cb1b465021adfad8bbf9f85ea"
        );
    }

    #[test]
    fn a_plan_survives_its_bytes() {
        let bytes = plan().to_bytes().unwrap();
        assert_eq!(Plan::from_bytes(&bytes).unwrap(), plan());
    }

    #[test]
    fn probes_are_spread_and_distinct() {
        let plan = plan();
        assert_eq!(plan.tile_count(Phase::Probe), 64);
        let all: Vec<u64> = (0..64).flat_map(|t| plan.probe_ordinals(TileIndex(t))).collect();
        assert_eq!(all.len(), 4_096);
        assert!(all.windows(2).all(|w| w[0] < w[1]) && *all.last().unwrap() < plan.covered());
    }
}
