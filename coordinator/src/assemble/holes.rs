//! Tiles that nobody could bake, and what lies there instead.
//!
//! A hole is filled as a gutter is: each of its texels, on a chart or beside one, takes the samples of the nearest covered texel that was
//! baked, of its own chart where one of the tiles around has such a texel. What was baked stays as it is, and no reader needs to know of
//! holes: every texel of the plan holds samples. Leaving them empty, the alternative, is a black square in each picture and a texel in the
//! gutter of its neighbours that the bilinear look-up has to step over. A surface without any tile is black.
//!
//! Memory: one more segment, and the texels of the tiles around one hole.

use super::AssembleError;
use kiln_proto::{
    codec::pwl::{ErrorStats, Kept},
    plan::{Plan, SurfacePlan},
    scene::Scene,
    segment::{Raw, Rows, TexelMask, TileSegment},
    settings::RawFormat,
    texel::{Row, SurfaceRaster},
    tile::{Cell, TILE_SIDE, TileIndex},
};
use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
};

/// Tiles around a hole whose texels it may borrow: as many as touch it where none of them is missing or empty.
const AROUND: usize = 8;

/// Column and row of a texel.
type Place = (u32, u32);

/// Gives the segment of a tile of the surface.
type Read<'r> = dyn FnMut(usize) -> Result<Box<TileSegment>, AssembleError> + 'r;

/// A tile that nobody could bake.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hole {
    /// Its number among the planned tiles of its surface.
    pub tile: usize,
    /// How it failed: a predicate without a full stop.
    pub reason: String,
}

/// The holes of a surface.
pub struct Holes<'a> {
    pub(super) plan: &'a Plan,
    pub(super) surface: usize,
    pub(super) list: Vec<Hole>,
    layout: &'a SurfacePlan,
    raster: SurfaceRaster,
    missing: BTreeSet<usize>,
    tiles: BTreeMap<Cell, usize>,
}

/// A texel of a hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patch {
    /// Which.
    pub row: Row,
    /// The covered texel whose samples it takes; nothing where the surface has none, and the texel is black.
    pub from: Option<(u32, u32)>,
}

impl<'a> Holes<'a> {
    /// The holes of the surface with index `surface`.
    ///
    /// # Errors
    /// Holes that are no tiles of the surface, and a surface that scene or plan do not have.
    pub fn new(scene: &Scene, plan: &'a Plan, surface: usize, mut list: Vec<Hole>) -> Result<Self, AssembleError> {
        let (Some(of_scene), Some(layout)) = (scene.surfaces.get(surface), plan.surfaces.get(surface)) else {
            return Err(AssembleError::Mismatch { reason: format!("there is no surface {surface}") });
        };
        list.sort_by_key(|hole| hole.tile);
        let missing: BTreeSet<usize> = list.iter().map(|hole| hole.tile).collect();
        if missing.len() != list.len() || missing.last().is_some_and(|tile| *tile >= layout.tiles.len()) {
            return Err(AssembleError::Mismatch { reason: format!("surface {surface} has holes that are none of its tiles") });
        }
        let raster = SurfaceRaster::new(scene, of_scene, layout, plan.settings.frame);
        let tiles = layout.tiles.iter().enumerate().map(|(index, tile)| (tile.cell, index)).collect();
        Ok(Self { plan, surface, list, layout, raster, missing, tiles })
    }

    /// Whether the surface's `tile`-th planned tile is a hole.
    #[must_use]
    pub fn contains(&self, tile: usize) -> bool {
        self.missing.contains(&tile)
    }

    /// Whether the texel at (x, y) lies in a hole.
    #[must_use]
    pub fn hides(&self, (x, y): Place) -> bool {
        self.tile_of((x, y)).is_some_and(|tile| self.contains(tile))
    }

    fn tile_of(&self, (x, y): Place) -> Option<usize> {
        let cell = Cell { x: (x / TILE_SIDE) as u16, y: (y / TILE_SIDE) as u16 }; // textures have at most 8,192 texels along a side
        self.tiles.get(&cell).copied()
    }

    /// The texels of a hole, in the order of a segment's rows, and where each takes its samples.
    #[must_use]
    pub fn patches(&self, tile: usize) -> Vec<Patch> {
        let Some(planned) = self.layout.tiles.get(tile) else { return vec![] };
        let mut charts: BTreeMap<Option<u32>, Vec<Place>> = BTreeMap::new();
        for beside in self.around(planned.cell) {
            for row in self.raster.tile(self.layout.tiles[beside].cell).into_iter().filter(|row| row.is_covered()) {
                charts.entry(self.raster.chart(row.x, row.y)).or_default().push((row.x, row.y));
            }
        }
        let from = |row: &Row| {
            let own = charts.get(&self.raster.chart(row.source.0, row.source.1));
            own.map_or_else(|| nearest(row, charts.values().flatten()), |own| nearest(row, own.iter()))
        };
        self.raster.tile(planned.cell).into_iter().map(|row| Patch { row, from: from(&row) }).collect()
    }

    /// The tiles nearest to a cell that were baked and have covered texels.
    fn around(&self, cell: Cell) -> Vec<usize> {
        let far = |other: Cell| {
            let (dx, dy) = (u64::from(other.x.abs_diff(cell.x)), u64::from(other.y.abs_diff(cell.y)));
            dx * dx + dy * dy
        };
        let there = self.layout.tiles.iter().enumerate().filter(|(index, tile)| !self.contains(*index) && tile.covered > 0);
        let mut near: Vec<(u64, usize)> = there.map(|(index, tile)| (far(tile.cell), index)).collect();
        if near.len() > AROUND {
            near.select_nth_unstable(AROUND);
            near.truncate(AROUND);
        }
        near.into_iter().map(|(_, index)| index).collect()
    }

    /// What is written in the place of a hole's segment. `read` gives the segments of tiles that were baked.
    pub(super) fn segment(&self, tile: usize, read: &mut Read<'_>) -> Result<Box<TileSegment>, AssembleError> {
        let (plan, patches) = (self.plan, self.patches(tile));
        let (kept, raw) = self.borrowed(&patches, read)?;
        let (mut mask, mut rows) = (TexelMask::default(), Rows::default());
        patches.iter().for_each(|patch| mask.insert(patch.row.x % TILE_SIDE, patch.row.y % TILE_SIDE, patch.row.is_covered()));
        kept.iter().for_each(|kept| rows.push(kept));
        Ok(Box::new(TileSegment {
            tile: TileIndex(plan.first_tile(self.surface).0 + tile as u64),
            surface: self.surface as u32,
            cell: self.layout.tiles[tile].cell,
            grid: plan.settings.directions,
            walk: plan.walk(self.surface),
            mask,
            // Nothing was measured, so that errors count no sample of it.
            errors: ErrorStats::default(),
            rows,
            raw,
        }))
    }

    /// What each texel of a hole takes from where, kept and raw. Every segment that lends is read once.
    fn borrowed(&self, patches: &[Patch], read: &mut Read<'_>) -> Result<(Vec<Vec<Kept>>, Raw), AssembleError> {
        let order = self.plan.order(self.surface);
        let black = [0, order.len() - 1].map(|step| Kept { depth: order.depth(step), rgb: [0; 3] });
        let (values, mut kept) = (order.len() * 3, vec![black.to_vec(); patches.len()]);
        let mut raw = empty(self.plan.settings.raw, patches.len() * values);
        let mut wanted: BTreeMap<usize, Vec<(usize, Place)>> = BTreeMap::new();
        for (at, from) in patches.iter().enumerate().filter_map(|(at, patch)| Some((at, patch.from?))) {
            if let Some(beside) = self.tile_of(from) {
                wanted.entry(beside).or_default().push((at, from));
            }
        }
        for (beside, texels) in wanted {
            let segment = read(beside)?;
            let rows: BTreeMap<Place, usize> = segment.mask.texels().enumerate().map(|(row, t)| ((t.x, t.y), row)).collect();
            for (at, (x, y)) in texels {
                if let Some(row) = rows.get(&(x % TILE_SIDE, y % TILE_SIDE)) {
                    kept[at] = segment.rows.row(*row).to_vec();
                    copy(&segment.raw, row * values..(row + 1) * values, &mut raw, at * values);
                }
            }
        }
        Ok((kept, raw))
    }
}

/// The nearest by Euclid, of several the one of the lowest row, then of the lowest column.
fn nearest<'t>(row: &Row, texels: impl Iterator<Item = &'t Place>) -> Option<Place> {
    let far = |(x, y): Place| {
        let (dx, dy) = (u64::from(x.abs_diff(row.x)), u64::from(y.abs_diff(row.y)));
        dx * dx + dy * dy
    };
    texels.copied().min_by_key(|(x, y)| (far((*x, *y)), *y, *x))
}

fn empty(format: Option<RawFormat>, values: usize) -> Raw {
    match format {
        None => Raw::None,
        Some(RawFormat::U8) => Raw::U8(vec![0; values]),
        Some(RawFormat::F32) => Raw::F32(vec![0.0; values]),
    }
}

fn copy(from: &Raw, part: Range<usize>, to: &mut Raw, at: usize) {
    match (from, to) {
        (Raw::U8(from), Raw::U8(to)) => to[at..at + part.len()].copy_from_slice(&from[part]),
        (Raw::F32(from), Raw::F32(to)) => to[at..at + part.len()].copy_from_slice(&from[part]),
        // A segment is opened against the plan, so that both keep raw samples of the same form.
        _ => {}
    }
}

#[cfg(test)]
mod tests;
