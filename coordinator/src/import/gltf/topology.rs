//! How the corners of a primitive become triangles (glTF 2.0, section 3.7.2.1).

use super::{json::Json, report::Report};

/// How corners become triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topology {
    Triangles,
    Strip,
    Fan,
}

impl Topology {
    /// That of a primitive; `None` where it makes none.
    pub(super) fn of(json: Json<'_>, report: &mut Report<'_>) -> Option<Self> {
        match report.integer(json, "mode", 4) {
            4 => Some(Self::Triangles),
            5 => Some(Self::Strip),
            6 => Some(Self::Fan),
            0..=3 => {
                report.count(json, "primitives of points or lines were ignored, only triangles are surfaces");
                None
            }
            other => {
                report.error(json, format!("the mode {other} is none; modes go from 0 to 6"));
                None
            }
        }
    }

    /// How many triangles so many corners make.
    pub(super) fn triangle_count(self, corners: usize) -> usize {
        match self {
            Self::Triangles => corners / 3,
            Self::Strip | Self::Fan => corners.saturating_sub(2),
        }
    }

    /// Whether so many corners make a triangle, and all of them belong to one.
    pub(super) fn fits(self, corners: usize) -> bool {
        corners >= 3 && (self != Self::Triangles || corners.is_multiple_of(3))
    }

    /// The corners of a triangle, counter-clockwise from the front.
    pub(super) fn corners(self, triangle: usize) -> [usize; 3] {
        let i = triangle;
        match self {
            Self::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
            Self::Strip => [i, i + 1 + i % 2, i + 2 - i % 2],
            Self::Fan => [i + 1, i + 2, 0],
        }
    }
}
