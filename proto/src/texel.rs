//! From texels to points: which texels of a surface's texture its charts cover, where they lie in the world, and whose light a gutter
//! texel borrows.
//!
//! A texel is *covered* when its centre lies on a triangle (the lowest-numbered one where edges touch). The tips of narrow charts may pass
//! between all centres: a texel whose square meets a triangle, and that has no centre on one among the texels within its gutter's reach, is
//! covered too, and shows the point of its square on a triangle that is nearest to its centre. So around each point of a chart lies a texel
//! that holds light. An uncovered texel within two texels of a covered one is *gutter* and takes the row of the nearest covered texel, ties
//! to the lowest row, then column. All of it follows from the plan alone, so coordinator, worker and package reader agree without sending
//! masks about. Coordinates are f64 here: a texel centre on a shared edge must fall on the same side on every machine. The alternative,
//! conservative coverage of every texel that a chart touches, would capture half the gutter for what a border leaves of its texels.
//!
//! A raster that was told of its seams ([`SurfaceRaster::with_seams`]) lets texels reach over edges of charts behind which the surface goes
//! on: the coordinator and readers, which only ask what is covered, do without.

mod bins;
mod cover;
mod flat;
mod raster;
mod seam;

pub use raster::SurfaceRaster;

use crate::frame::Frame;
use glam::{DVec2, Vec3};

/// Texels around a chart that borrow its light.
pub const GUTTER: i64 = 2;

/// A covered texel, or one beside a chart that takes its light from across a seam.
#[derive(Debug, Clone, PartialEq)]
pub struct Texel {
    /// Column.
    pub x: u32,
    /// Row; row 0 holds v = 0.
    pub y: u32,
    /// The triangle under its centre, or the one that its square holds a point of, counted within the surface.
    pub triangle: u32,
    /// The world position of its centre, or of that point, metres.
    pub position: Vec3,
    /// Its frame: that of this place, turned as its own chart has it.
    pub frame: Frame,
    /// The weights of the second and third corner of `triangle` there.
    bary: DVec2,
    /// The triangle of its own chart whose plane its square is laid out in.
    start: u32,
    /// Triangles of the same chart that its square touches and that go on flat or smoothly from its own, which is the first.
    near: Vec<u32>,
}

/// A point on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The triangle, counted within the surface.
    pub triangle: u32,
    /// Barycentric weights of its second and third corner.
    pub bary: [f32; 2],
    /// World position, metres.
    pub position: Vec3,
}

/// What a texel of a tile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// Column in the texture.
    pub x: u32,
    /// Row in the texture.
    pub y: u32,
    /// The covered texel whose light this is: itself, unless it is gutter.
    pub source: (u32, u32),
}

impl Row {
    /// Whether the texel itself is on a chart.
    #[must_use]
    pub fn is_covered(self) -> bool {
        self.source == (self.x, self.y)
    }
}

#[cfg(test)]
mod tests;
