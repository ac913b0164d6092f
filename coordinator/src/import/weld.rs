//! One vertex for equal positions, one triangle for equal corners: what every importer does to the triangles of a whole scene.
//!
//! Equality is that of bits after -0.0 became 0.0, never nearness: a distance below which points are one depends on the author's units.
//! Cost: a hash look-up per corner; the tables are looked up and never iterated, so their order reaches nothing.

use super::mesh::has_no_area;
use glam::Vec3;
use std::collections::{HashMap, HashSet};

/// The vertices and triangles of a scene so far.
#[derive(Debug, Default)]
pub(super) struct Weld {
    /// Positions in order of first use.
    pub(super) positions: Pool<3>,
    /// Unit normals in order of first use.
    pub(super) normals: Pool<3>,
    /// Unit tangents and the sides of their bitangents in order of first use.
    pub(super) tangents: Pool<4>,
    /// Colours in order of first use.
    pub(super) colors: Pool<4>,
    seen: HashSet<[u32; 3]>,
}

/// Values in order of first use, each once.
#[derive(Debug)]
pub(super) struct Pool<const N: usize> {
    ids: HashMap<[u32; N], u32>,
    /// The values.
    pub(super) values: Vec<[f32; N]>,
}

/// Why a triangle is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Left {
    /// Its corners lie on a line.
    NoArea,
    /// The same triangle was there before.
    Repeated,
}

impl<const N: usize> Default for Pool<N> {
    fn default() -> Self {
        Self { ids: HashMap::new(), values: vec![] }
    }
}

impl<const N: usize> Pool<N> {
    /// The index of a value.
    pub(super) fn id(&mut self, value: [f32; N]) -> u32 {
        // Adding zero turns -0.0 into 0.0: the same value has one name.
        let value = value.map(|v| v + 0.0);
        let next = self.values.len() as u32;
        let id = *self.ids.entry(value.map(f32::to_bits)).or_insert(next);
        if id == next {
            self.values.push(value);
        }
        id
    }
}

impl Left {
    /// What to say of them, counted.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::NoArea => "triangles without area were dropped",
            Self::Repeated => "triangles that repeat another one exactly were dropped",
        }
    }
}

impl Weld {
    /// Whether a triangle of these positions belongs into the scene; it does only the first time.
    pub(super) fn triangle(&mut self, corners: [u32; 3]) -> Result<(), Left> {
        let world = corners.map(|c| Vec3::from_array(self.positions.values[c as usize]).as_dvec3());
        if has_no_area(world) {
            return Err(Left::NoArea);
        }
        if self.seen.insert(least_first(corners)) { Ok(()) } else { Err(Left::Repeated) }
    }
}

/// The same triangle begun at its lowest corner: rotations are equal, mirror images are not.
fn least_first(corners: [u32; 3]) -> [u32; 3] {
    let [a, b, c] = corners;
    if a <= b && a <= c {
        [a, b, c]
    } else if b <= c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_places_and_triangles_are_one() {
        let mut weld = Weld::default();
        let ids = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, -0.0], [2.0, 0.0, 0.0]].map(|p| weld.positions.id(p));
        assert_eq!((ids, weld.positions.values.len()), ([0, 1, 2, 0, 3], 4));
        assert_eq!(weld.triangle([0, 1, 2]), Ok(()));
        assert_eq!(weld.triangle([1, 2, 0]), Err(Left::Repeated));
        assert_eq!(weld.triangle([0, 2, 1]), Ok(()), "the back of a triangle is no duplicate");
        assert_eq!(weld.triangle([0, 1, 3]), Err(Left::NoArea));
    }
}
