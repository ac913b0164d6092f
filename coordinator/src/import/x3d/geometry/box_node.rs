//! Box (X3D 3.3, 13.3.1).

use super::{
    Geometry,
    error::{GeometryError, Repairs, at_least_zero},
    patch::{Patch, Point},
};
use glam::{DVec2, DVec3};

/// The fields of a Box; the name `Box` belongs to Rust.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BoxNode {
    /// Sides along X, Y, Z.
    pub(crate) size: [f32; 3],
    /// Only the outside is seen.
    pub(crate) solid: bool,
}

impl Default for BoxNode {
    fn default() -> Self {
        Self { size: [2.0; 3], solid: true }
    }
}

/// Each face: where it looks, which way its texture's S and T run. The top is seen with -Z up, the bottom with +Z up.
const FACES: [[DVec3; 3]; 6] = [
    [DVec3::Z, DVec3::X, DVec3::Y],
    [DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y],
    [DVec3::X, DVec3::NEG_Z, DVec3::Y],
    [DVec3::NEG_X, DVec3::Z, DVec3::Y],
    [DVec3::Y, DVec3::X, DVec3::NEG_Z],
    [DVec3::NEG_Y, DVec3::X, DVec3::Z],
];

impl BoxNode {
    /// Six quads, each with the whole texture.
    ///
    /// # Errors
    /// Sides that are negative or no numbers, and a box with no side of any area. Of a box with one side of zero, which the
    /// specification forbids and browsers draw, the two faces that have an area are kept.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let mut half = DVec3::ZERO;
        for axis in 0..3 {
            half[axis] = at_least_zero("size", self.size[axis])? / 2.0;
        }
        let mut repairs = Repairs::default();
        if (0..3).filter(|axis| half[*axis] == 0.0).count() > 1 {
            return Err(GeometryError::Empty { why: "two of its sides are 0" });
        }
        if let Some(axis) = (0..3).find(|axis| half[*axis] == 0.0) {
            repairs.note("sides of 0 leave only the two faces beside them", "size", axis);
        }
        let mut patch = Patch::default();
        for [normal, s, t] in FACES.into_iter().filter(|[_, s, t]| (*s * half).length() > 0.0 && (*t * half).length() > 0.0) {
            let corner =
                |u: f64, v: f64| Point { place: (normal + s * (2.0 * u - 1.0) + t * (2.0 * v - 1.0)) * half, normal, uv: DVec2::new(u, v) };
            patch.face(&[corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
        }
        Ok(patch.finish(self.solid, repairs))
    }
}
