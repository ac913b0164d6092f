//! Split: a job's plan, with every surface cut into tiles and each tile costed; and what the plan will cost, for dry runs.
//!
//! A tile is a cell of the 32-texel grid that holds light, covered texels or gutter. Which do follows from the layout through
//! `SurfaceRaster::tile`, the very function that workers and assembly use, so the counts cannot disagree with what is baked. Cost: about
//! 1,600 texel look-ups a cell; a million texels take a fraction of a second, shared among threads.

use crate::{
    records::Problem,
    unwrap::{self, Layout},
};
use kiln_proto::{
    BAKE_VERSION,
    ids::SceneHash,
    limits,
    plan::{PLAN_VERSION, Plan, PlannedTile, SurfacePlan},
    scene::{Scene, Surface},
    settings::{BakeSettings, Rule},
    texel::SurfaceRaster,
    tile::{Cell, TILE_SIDE},
};

/// Cells that are worth a thread.
const CELLS_PER_THREAD: usize = 64;

/// The plan of a job before its Probe phase, and what the user should know of it. `scene_hash` is the hash of the scene's canonical bytes.
///
/// # Errors
/// What [`unwrap::lay_out`] refuses, layouts that cover no texel at all, and lossless glossy surfaces with more samples than a file addresses.
pub fn make_plan(scene: &Scene, scene_hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
    let Layout { mut surfaces, mut warnings } = unwrap::lay_out(scene, settings)?;
    for (surface, plan) in scene.surfaces.iter().zip(&mut surfaces) {
        plan.tiles = tiles(scene, surface, plan, settings);
        plan.covered = plan.tiles.iter().map(|t| u64::from(t.covered)).sum();
        if plan.covered == 0 {
            let message = format!("surface `{}` covers no texel of its {} texture: it gets no light field", surface.name, plan.size);
            warnings.push(Problem::new(message));
        }
        warnings.extend(check_samples(scene, surface, plan, settings)?);
    }
    let plan =
        Plan { version: PLAN_VERSION, bake_version: BAKE_VERSION, scene: scene_hash, settings: settings.clone(), surfaces, probe: None };
    if plan.covered() == 0 {
        let message = "no surface covers a single texel: raise texel_scale, texels_per_metre or texture_sizes".to_owned();
        return Err(Problem::new(message));
    }
    Ok((plan, warnings))
}

/// Whether `.mtsp`, whose starting points have 32 bits, could address every sample of a surface. Else assembly may fail after hours of
/// baking, so it is said now: a warning where the rule may drop samples, a refusal where it is lossless, since sampled gloss has no two
/// segments alike. Light without gloss is the same toward every direction and keeps two samples a texel, which always fit.
fn check_samples(scene: &Scene, surface: &Surface, plan: &SurfacePlan, settings: &BakeSettings) -> Result<Option<Problem>, Problem> {
    let texels: u64 = plan.tiles.iter().map(|t| u64::from(t.covered) + u64::from(t.gutter)).sum();
    let most = texels * u64::from(settings.directions.len());
    if most <= u64::from(u32::MAX) || !scene.is_view_dependent(surface) {
        return Ok(None);
    }
    let (name, size, directions) = (&surface.name, plan.size, settings.directions);
    let lossless = matches!(settings.rule, Rule::Bounded { eps: 0 } | Rule::Thesis { threshold: 0 } | Rule::Cumulative { threshold: 0 });
    let outcome = if lossless { "and a lossless rule drops few" } else { "and the bake fails at its end if so many are kept" };
    let message = format!(
        "surface `{name}`: its {size} texture with {directions} directions has up to {most} samples, of which .mtsp can address {}, {outcome}; \
         lower its texture size or the number of directions, or allow a larger error",
        u32::MAX
    );
    let problem = Problem::new(message);
    if lossless { Err(problem) } else { Ok(Some(problem)) }
}

/// The non-empty tiles of a surface in Morton order.
fn tiles(scene: &Scene, surface: &Surface, plan: &SurfacePlan, settings: &BakeSettings) -> Vec<PlannedTile> {
    const { assert!(limits::TEXTURE_SIDE / TILE_SIDE <= u16::MAX as u32) };
    let raster = SurfaceRaster::new(scene, surface, plan, settings.frame);
    let columns = raster.columns() as u16;
    let mut cells: Vec<Cell> = (0..raster.rows() as u16).flat_map(|y| (0..columns).map(move |x| Cell { x, y })).collect();
    cells.sort_unstable_by_key(|c| c.morton());
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(cells.len().div_ceil(CELLS_PER_THREAD));
    let share = cells.len().div_ceil(threads.max(1)).max(1);
    std::thread::scope(|scope| {
        let raster = &raster;
        let workers: Vec<_> = cells.chunks(share).map(|part| scope.spawn(move || count_all(raster, part))).collect();
        // Joined in the order of the cells, so threads do not show in the result; a panic inside is passed on.
        workers.into_iter().flat_map(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

fn count_all(raster: &SurfaceRaster, cells: &[Cell]) -> Vec<PlannedTile> {
    cells.iter().filter_map(|cell| count(raster, *cell)).collect()
}

/// What a cell holds; `None` for an empty one.
fn count(raster: &SurfaceRaster, cell: Cell) -> Option<PlannedTile> {
    let rows = raster.tile(cell);
    // A cell has 1,024 texels, so both counts fit.
    let covered = rows.iter().filter(|r| r.is_covered()).count() as u16;
    (!rows.is_empty()).then(|| PlannedTile { cell, covered, gutter: rows.len() as u16 - covered })
}

#[cfg(test)]
mod tests;
