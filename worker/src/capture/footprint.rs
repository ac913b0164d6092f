//! Where on a texel samples arrive: jittered over the part of its square that the chart covers or goes on over from there, or at one point.

use super::clearance::Push;
use crate::sampling::{Dimension, TexelKey};
use kiln_proto::{
    frame::Frame,
    texel::{SurfacePoint, SurfaceRaster, Texel},
};

/// Jitters tried before a sample falls back to the point that the texel shows. A texel that the chart covers by a tenth is missed by all
/// with chance 0.43; its centre then counts a little more than its share. One that shows the tip of a chart is missed nearly always: what
/// it holds is the light at that tip.
const ATTEMPTS: u32 = 8;

/// The points of a site.
pub(crate) enum Points<'a> {
    /// One point.
    Fixed(SurfacePoint),
    /// The covered part of a texel.
    Area {
        /// The surface.
        raster: &'a SurfaceRaster,
        /// The texel.
        texel: &'a Texel,
        /// What its points are moved out of.
        push: Option<Push>,
    },
}

impl Points<'_> {
    /// The triangle of the point that the texel shows.
    pub(crate) fn triangle(&self) -> u32 {
        match self {
            Points::Fixed(point) => point.triangle,
            Points::Area { texel, .. } => texel.triangle,
        }
    }

    /// The point that the texel shows, which is always covered.
    pub(crate) fn centre(&self) -> SurfacePoint {
        match self {
            Points::Fixed(point) => *point,
            Points::Area { raster, texel, push } => pushed(push.as_ref(), raster.centre(texel)),
        }
    }

    /// The surface's frame at a point, where it differs from that of the point that the texel shows.
    pub(crate) fn frame(&self, point: &SurfacePoint) -> Option<Frame> {
        match self {
            Points::Fixed(_) => None,
            Points::Area { raster, texel, .. } => raster.frame_within(texel, point),
        }
    }

    /// The point of the `index`-th sample; `dimension` numbers the attempts.
    pub(crate) fn at(&self, key: TexelKey, index: u32, dimension: fn(u32) -> Dimension) -> SurfacePoint {
        match self {
            Points::Fixed(point) => *point,
            Points::Area { raster, texel, push } => {
                let jittered = |attempt| {
                    let [dx, dy] = key.pair(dimension(attempt), index);
                    raster.footprint(texel, dx, dy)
                };
                pushed(push.as_ref(), (0..ATTEMPTS).find_map(jittered).unwrap_or_else(|| raster.centre(texel)))
            }
        }
    }
}

/// A point where rays may start; its material stays that of the place it comes from.
fn pushed(push: Option<&Push>, point: SurfacePoint) -> SurfacePoint {
    SurfacePoint { position: push.map_or(point.position, |p| p.out(point.position)), ..point }
}
