//! The Probe phase: a few thousand texels at low quality, for the job's exposure and for the walk of each surface.

use super::{
    Capture, CaptureError,
    hemisphere::{Budget, Scratch},
};
use kiln_proto::{
    grid::Walk,
    plan::{PROBE_TILE_TEXELS, SurfacePlan},
    probe::ProbeSums,
    texel::SurfaceRaster,
    tile::TileIndex,
    units::Rgb,
    wire::message::Phase,
};
use rayon::prelude::*;

/// Incident samples of a probed texel.
const SAMPLES: u32 = 64;
/// Units of variation: 2^-16 of the square root of radiance.
const UNIT: f32 = 65_536.0;

impl Capture {
    /// Probes a tile of the Probe phase on the current thread pool; returns its sums and the rays traced.
    ///
    /// # Errors
    /// [`CaptureError::NoSuchTile`].
    pub fn probe_tile(&self, tile: TileIndex) -> Result<(ProbeSums, u64), CaptureError> {
        if tile.0 >= self.plan.tile_count(Phase::Probe) {
            return Err(CaptureError::NoSuchTile { tile });
        }
        let ordinals: Vec<u64> = self.plan.probe_ordinals(tile).collect();
        debug_assert!(ordinals.len() as u64 <= PROBE_TILE_TEXELS);
        let texels: Vec<(ProbeSums, u64)> =
            ordinals.par_iter().map_init(Scratch::default, |scratch, ordinal| self.probe_texel(*ordinal, scratch)).collect();
        let mut sums = ProbeSums::new(self.plan.surfaces.len());
        texels.iter().for_each(|(texel, _)| sums.add(texel));
        Ok((sums, texels.iter().map(|(_, rays)| rays).sum()))
    }

    fn probe_texel(&self, ordinal: u64, scratch: &mut Scratch) -> (ProbeSums, u64) {
        let mut sums = ProbeSums::new(self.plan.surfaces.len());
        let Some((surface, texel)) = self.locate_covered(ordinal) else { return (sums, 0) };
        let mut light = vec![Rgb::BLACK; self.directions.len()];
        let budget = Budget { samples: SAMPLES.min(self.plan.settings.samples), max_depth: self.plan.settings.max_depth };
        let rays = self.capture_texel(surface, (&texel, None), budget, scratch, &mut light);
        if !self.scene.material_of(self.scene.prim_of(surface, texel.triangle)).is_emissive() {
            light.iter().for_each(|l| sums.count(l.max_channel()));
        }
        sums.variation[surface] = (self.variation(Walk::Phi, &light), self.variation(Walk::Theta, &light));
        (sums, rays)
    }

    /// The covered texel of this number: surfaces in order, their tiles in order, rows in order.
    fn locate_covered(&self, mut ordinal: u64) -> Option<(usize, kiln_proto::texel::Texel)> {
        for (surface, (layout, raster)) in self.plan.surfaces.iter().zip(&self.rasters).enumerate() {
            if ordinal < layout.covered {
                return nth_covered(layout, raster, ordinal).map(|texel| (surface, texel));
            }
            ordinal -= layout.covered;
        }
        None
    }

    /// How much the square root of radiance changes from step to step of a walk, summed over channels.
    fn variation(&self, walk: Walk, light: &[Rgb]) -> u64 {
        let grid = self.plan.settings.directions;
        let at = |step: u32| light[walk.depth(grid, step) as usize].to_array().map(|v| v.max(0.0).sqrt() * UNIT);
        let change = |step: u32| {
            let (a, b) = (at(step - 1), at(step));
            (0..3).map(|c| (a[c] - b[c]).abs() as u64).fold(0, u64::saturating_add)
        };
        (1..grid.len()).map(change).fold(0, u64::saturating_add)
    }
}

fn nth_covered(layout: &SurfacePlan, raster: &SurfaceRaster, mut ordinal: u64) -> Option<kiln_proto::texel::Texel> {
    for tile in &layout.tiles {
        if ordinal < u64::from(tile.covered) {
            let row = raster.tile(tile.cell).into_iter().filter(|r| r.is_covered()).nth(ordinal as usize)?;
            return raster.texel(row.x, row.y);
        }
        ordinal -= u64::from(tile.covered);
    }
    None
}
