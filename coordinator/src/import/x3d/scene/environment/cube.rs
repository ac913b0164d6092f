//! The six faces of a cube around the scene, each seen from within and upright (ISO/IEC 19775-1: 34).
//!
//! They lie as those of a Background do (24.4.1), and as the engine of the shadow extension's author has them: front toward -Z, right
//! toward +X, top toward +Y with its lower edge at the front's upper one. X_ITE has the front toward +Z, which is half a turn away.

use super::{map::between, picture::Pixels};
use glam::DVec3;
use kiln_proto::units::Rgb;
use std::sync::Arc;

/// The faces in the order of [`Cube`], as their fields are called.
pub(super) const NAMES: [&str; 6] = ["front", "back", "left", "right", "top", "bottom"];

/// Of each face where it looks and where the right of its picture lies; up is what is orthogonal to both.
const AXES: [(DVec3, DVec3); 6] = [
    (DVec3::NEG_Z, DVec3::X),
    (DVec3::Z, DVec3::NEG_X),
    (DVec3::NEG_X, DVec3::NEG_Z),
    (DVec3::X, DVec3::Z),
    (DVec3::Y, DVec3::X),
    (DVec3::NEG_Y, DVec3::X),
];

/// A square of a picture.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) pixels: Arc<Pixels>,
    /// Its left lower corner.
    pub(super) corner: [usize; 2],
    /// Whether it stands on its head.
    pub(super) turned: bool,
}

/// Six faces of one size; one that is missing is black.
#[derive(Debug)]
pub(super) struct Cube {
    faces: [Option<Face>; 6],
    side: u32,
}

impl Cube {
    /// Faces with so many pixels a side.
    pub(super) fn new(faces: [Option<Face>; 6], side: u32) -> Self {
        Self { faces, side }
    }

    /// The faces of a cross that lies, four wide and three high (left, front, right, back; top and bottom at the front), or stands, three
    /// wide and four high (the back at the bottom, on its head); `None` for other shapes.
    pub(super) fn of_cross(pixels: &Arc<Pixels>) -> Option<Self> {
        let [width, height] = pixels.size();
        let lies = 3 * width == 4 * height;
        if !lies && 4 * width != 3 * height {
            return None;
        }
        let side = if lies { width / 4 } else { width / 3 };
        // Columns from the left and rows from the top, in the order of `NAMES`.
        let places: [[usize; 2]; 6] = [[1, 1], if lies { [3, 1] } else { [1, 3] }, [0, 1], [2, 1], [1, 0], [1, 2]];
        let rows = height / side;
        let mut faces = places.map(|[column, row]| {
            Some(Face { pixels: Arc::clone(pixels), corner: [column * side, (rows - 1 - row) * side], turned: false })
        });
        if let (false, Some(back)) = (lies, &mut faces[1]) {
            back.turned = true;
        }
        Some(Self::new(faces, side as u32))
    }

    /// Pixels along a side of a face.
    pub(super) fn side(&self) -> u32 {
        self.side
    }

    /// Radiance toward a direction: bilinear within a face, constant beyond the centres of its outer pixels.
    pub(super) fn at(&self, d: DVec3) -> Rgb {
        let (x, y, z) = (d.x.abs(), d.y.abs(), d.z.abs());
        let pick = |positive: f64, if_positive: usize, if_negative: usize| if positive > 0.0 { if_positive } else { if_negative };
        let index = if y >= x && y >= z {
            pick(d.y, 4, 5)
        } else if x >= z {
            pick(d.x, 3, 2)
        } else {
            pick(d.z, 1, 0)
        };
        let Some(face) = &self.faces[index] else { return Rgb::BLACK };
        let (forward, right) = AXES[index];
        let depth = d.dot(forward);
        if depth <= 0.0 {
            return Rgb::BLACK;
        }
        let up = right.cross(forward);
        let place = |axis: DVec3| 0.5 + 0.5 * d.dot(axis) / depth;
        face.at([place(right), place(up)], self.side as usize)
    }
}

impl Face {
    /// At a place from its left lower corner, in [0, 1].
    fn at(&self, place: [f64; 2], side: usize) -> Rgb {
        let last = side - 1;
        let [across, up] = place.map(|p| {
            let p = if self.turned { 1.0 - p } else { p };
            (p * side as f64 - 0.5).clamp(0.0, last as f64)
        });
        let (column, row) = (across as usize, up as usize);
        let texel = |c: usize, r: usize| self.pixels.at(self.corner[0] + c.min(last), self.corner[1] + r.min(last));
        let along = (across - column as f64) as f32;
        let [lower, upper] = [row, row + 1].map(|r| between(texel(column, r), texel(column + 1, r), along));
        between(lower, upper, (up - row as f64) as f32)
    }
}
