//! The Bake phase: a tile's texels, whose light each of them shows, and that light.
//!
//! Most covered texels show their own. A hidden one is moved out where a way out is near, or shows that of the nearest visible texel of its
//! chart within the gutter's reach, captured at that texel's place, in its frame and with its samples, so that both hold the same values
//! whichever tile they lie in; smooth frames turn little over two texels. Deeper ones stay as they are. A gutter texel behind which the
//! surface goes on over a seam has a place of its own there, others show the light of their source. All of this is decided by whichever
//! tile needs it, from the scene and the plan alone. A bake of points (`--footprint point`) is one of texels' places as they are: nothing
//! is moved, filled or carried over.

use super::{
    Capture, CaptureError, Points, TileRadiance,
    clearance::{self, Lookout, Push},
    hemisphere::{self, Budget, Scratch},
    site::Site,
};
use crate::accel::RayCount;
use kiln_proto::{
    settings::Footprint,
    texel::{Row, Texel},
    tile::TileIndex,
    units::Rgb,
};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Row and column of a texel.
type Key = (u32, u32);

/// A texel with what its points are moved out of.
type Place = (Texel, Option<Push>);

fn key(texel: &Texel) -> Key {
    (texel.y, texel.x)
}

impl Capture {
    /// Captures a tile of the Bake phase on the current thread pool. Texels that show the light of others are copies of it, captured here
    /// even where the others lie in another tile.
    ///
    /// # Errors
    /// [`CaptureError::NoSuchTile`].
    pub fn bake_tile(&self, tile: TileIndex) -> Result<TileRadiance, CaptureError> {
        let (surface, planned) = self.plan.locate(tile).ok_or(CaptureError::NoSuchTile { tile })?;
        let rows = self.rasters[surface].tile(planned.cell);
        let asked: Vec<Option<Texel>> = rows.par_iter().map(|row| self.asked(surface, *row)).collect();
        let distinct: BTreeMap<Key, &Texel> = asked.iter().flatten().map(|t| (key(t), t)).collect();
        let shown: Vec<(Key, Place, u64)> = distinct.into_par_iter().map(|(key, texel)| self.shown(surface, key, texel)).collect();
        let looked: u64 = shown.iter().map(|(_, _, rays)| rays).sum();
        let whose: BTreeMap<Key, Key> = shown.iter().map(|(asked, place, _)| (*asked, key(&place.0))).collect();
        let places: BTreeMap<Key, Place> = shown.into_iter().map(|(_, place, _)| (key(&place.0), place)).collect();
        let places: Vec<Place> = places.into_values().collect();
        let depth = self.directions.len();
        let mut light = vec![Rgb::BLACK; places.len() * depth];
        let rays: u64 = light
            .par_chunks_mut(depth)
            .zip(&places)
            .map_init(Scratch::default, |scratch, (out, (texel, push))| {
                self.capture_texel(surface, (texel, *push), self.budget(), scratch, out)
            })
            .sum();
        let mut radiance = Vec::with_capacity(rows.len() * depth * 3);
        for asked in &asked {
            // Every row names a texel, and every texel was resolved above.
            let at = asked.as_ref().and_then(|t| whose.get(&key(t))).and_then(|k| places.binary_search_by_key(k, |p| key(&p.0)).ok());
            let at = at.unwrap_or_default();
            radiance.extend(light[at * depth..(at + 1) * depth].iter().flat_map(|l| l.to_array()));
        }
        Ok(TileRadiance { rows, radiance, rays: rays + looked })
    }

    fn budget(&self) -> Budget {
        Budget { samples: self.plan.settings.samples, max_depth: self.plan.settings.max_depth }
    }

    /// The texel whose light a row asks for.
    fn asked(&self, surface: usize, row: Row) -> Option<Texel> {
        let raster = &self.rasters[surface];
        raster.beyond(row).or_else(|| raster.texel(row.source.0, row.source.1))
    }

    /// The texel that is captured for a texel that was asked for, and the rays that this took to know.
    fn shown(&self, surface: usize, asked: Key, texel: &Texel) -> (Key, Place, u64) {
        // Without reflection there is nothing to be hidden from.
        if self.plan.settings.footprint == Footprint::Point || self.plan.settings.max_depth < 2 {
            return (asked, (texel.clone(), None), 0);
        }
        let lookout = Lookout { scene: &self.scene, surface, raster: &self.rasters[surface] };
        let mut rays = RayCount::default();
        // Where a texel's points are moved to, if it is seen there.
        let mut visible = |texel: &Texel, push: Option<Push>| {
            let hidden = lookout.is_hidden(texel, push.as_ref(), self.key(surface, texel), &mut rays);
            (!hidden).then(|| (texel.clone(), push))
        };
        let mut looks = RayCount::default();
        let mut way_out = |texel: &Texel, reaches: f32| lookout.push(texel, reaches, self.key(surface, texel), &mut looks);
        let push = way_out(texel, 1.0);
        let place = visible(texel, push).or_else(|| {
            // A face that was found nearby is the nearest from afar, too.
            let far = if push.is_none() { way_out(texel, clearance::FAR) } else { None };
            far.and_then(|far| visible(texel, Some(far)))
        });
        let place = place.or_else(|| {
            lookout.raster.neighbours(texel).find_map(|near| {
                let push = way_out(&near, 1.0);
                visible(&near, push)
            })
        });
        (asked, place.unwrap_or_else(|| (texel.clone(), push)), rays.0 + looks.0)
    }

    /// One texel toward all directions; returns the rays traced.
    pub(super) fn capture_texel(
        &self,
        surface: usize,
        (texel, push): (&Texel, Option<Push>),
        budget: Budget,
        scratch: &mut Scratch,
        out: &mut [Rgb],
    ) -> u64 {
        let raster = &self.rasters[surface];
        let points = match self.plan.settings.footprint {
            Footprint::Area => Points::Area { raster, texel, push },
            Footprint::Point => Points::Fixed(raster.centre(texel)),
        };
        let site = Site { surface, frame: texel.frame, points, key: self.key(surface, texel) };
        hemisphere::capture(&self.scene, &site, budget, &self.views, scratch, out)
    }
}
