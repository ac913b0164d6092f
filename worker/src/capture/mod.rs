//! Capture: the outgoing radiance of texels toward every direction of the grid.
//!
//! A [`Capture`] joins a traced scene with a job's plan. Texels are independent: each is a function of (scene, settings, surface, texel),
//! so tiles run on any number of threads, and a gutter texel is computed by whoever needs it.
//!
//! What a texel holds is what its surface emits, reflects and scatters through, never multiplied by its opacity: a viewer covers what lies
//! behind by that. Light that passes straight through, a blended surface or clear glass, is not in it; light that rough glass scatters is.

mod bake;
pub(crate) mod clearance;
mod directions;
mod draw;
mod facets;
pub(crate) mod footprint;
mod gather;
pub(crate) mod hemisphere;
mod probe;
mod punctual;
pub(crate) mod site;

#[cfg(test)]
mod edge_tests;
#[cfg(test)]
mod material_tests;
#[cfg(test)]
mod proof_tests;
#[cfg(test)]
mod reference_tests;
#[cfg(test)]
mod smooth_tests;
#[cfg(test)]
mod tests;

use crate::{sampling::TexelKey, scene::BakeScene};
pub(crate) use footprint::Points;
use glam::Vec3;
use hemisphere::{Budget, Scratch, Views};
use kiln_proto::{
    plan::Plan,
    settings::{BakeSettings, Footprint},
    texel::{Row, SurfaceRaster, Texel},
    tile::TileIndex,
    units::Rgb,
};
use site::Site;
use std::sync::Arc;

/// A job ready to be captured.
pub struct Capture {
    scene: Arc<BakeScene>,
    plan: Arc<Plan>,
    rasters: Vec<SurfaceRaster>,
    views: Views,
    directions: Vec<Vec3>,
}

/// The radiance of one tile.
#[derive(Debug, Clone, PartialEq)]
pub struct TileRadiance {
    /// Its texels that hold light, gutter included, row by row.
    pub rows: Vec<Row>,
    /// Texel-major, then depth, then channel: rows x D x 3 values, W/(sr m²).
    pub radiance: Vec<f32>,
    /// Rays traced for it.
    pub rays: u64,
}

/// Why a scene and a plan cannot be captured together, or a tile not be found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CaptureError {
    /// The plan belongs to another scene.
    #[error("the plan does not fit the scene: {reason}")]
    Mismatch {
        /// What differs.
        reason: String,
    },
    /// The phase has no such tile.
    #[error("tile {tile} is beyond the end of the phase")]
    NoSuchTile {
        /// The tile asked for.
        tile: TileIndex,
    },
}

impl Capture {
    /// Joins a scene with a plan of it: lays out every surface's texture. Cost: linear in triangles and cells.
    ///
    /// # Errors
    /// [`CaptureError::Mismatch`] where the plan has other surfaces or triangles than the scene.
    pub fn new(scene: Arc<BakeScene>, plan: Arc<Plan>) -> Result<Self, CaptureError> {
        let surfaces = &scene.scene().surfaces;
        if surfaces.len() != plan.surfaces.len() {
            return Err(CaptureError::Mismatch { reason: format!("{} surfaces in {} layouts", surfaces.len(), plan.surfaces.len()) });
        }
        for (surface, layout) in surfaces.iter().zip(&plan.surfaces) {
            let (triangles, laid_out) = (surface.triangles.len(), layout.uv.len());
            if triangles != laid_out || triangles != layout.charts.len() {
                return Err(CaptureError::Mismatch { reason: format!("`{}`: {laid_out} of {triangles} triangles", surface.name) });
            }
        }
        let lay_out = |(s, p)| {
            let raster = SurfaceRaster::new(scene.scene(), s, p, plan.settings.frame);
            // Squares and gutters reach over seams where texels have squares.
            if plan.settings.footprint == Footprint::Area { raster.with_seams(scene.scene(), s, p) } else { raster }
        };
        let rasters = surfaces.iter().zip(&plan.surfaces).map(lay_out).collect();
        let directions = plan.settings.directions.directions();
        Ok(Self { views: Views::grid(&directions), directions, rasters, scene, plan })
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<BakeScene> {
        &self.scene
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    fn key(&self, surface: usize, texel: &Texel) -> TexelKey {
        let number = u64::from(texel.y) * u64::from(self.plan.surfaces[surface].size.width) + u64::from(texel.x);
        TexelKey::new(self.plan.settings.seed, surface as u32, number)
    }
}

/// One independent path per direction and sample at a texel's centre, as a camera renderer does it: radiance toward every direction of the
/// settings' grid, W/(sr m²), and the rays traced. It exists to be compared with.
#[must_use]
pub fn per_direction(capture: &Capture, surface: usize, texel: (u32, u32), settings: &BakeSettings) -> Option<(Vec<Rgb>, u64)> {
    let (site, mut out) = centre_site(capture, surface, texel, settings.seed)?;
    let budget = Budget { samples: settings.samples, max_depth: settings.max_depth };
    let rays = hemisphere::capture_each(&capture.scene, &site, budget, &capture.views, &mut out);
    Some((out, rays))
}

/// The shared gather at a texel's centre: the counterpart of [`per_direction`].
#[must_use]
pub fn shared(capture: &Capture, surface: usize, texel: (u32, u32), settings: &BakeSettings) -> Option<(Vec<Rgb>, u64)> {
    let (site, mut out) = centre_site(capture, surface, texel, settings.seed)?;
    let budget = Budget { samples: settings.samples, max_depth: settings.max_depth };
    let rays = hemisphere::capture(&capture.scene, &site, budget, &capture.views, &mut Scratch::default(), &mut out);
    Some((out, rays))
}

fn centre_site(capture: &Capture, surface: usize, (x, y): (u32, u32), seed: u64) -> Option<(Site<'_>, Vec<Rgb>)> {
    let raster = capture.rasters.get(surface)?;
    let texel = raster.texel(x, y)?;
    let width = u64::from(capture.plan.surfaces[surface].size.width);
    let key = TexelKey::new(seed, surface as u32, u64::from(y) * width + u64::from(x));
    let site = Site { surface, frame: texel.frame, points: Points::Fixed(raster.centre(&texel)), key };
    Some((site, vec![Rgb::BLACK; capture.directions.len()]))
}
