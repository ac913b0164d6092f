//! One index for each place: positions that are equal bit for bit become one vertex.
//!
//! Nothing is rounded together: a tolerance joins what an author kept apart, and is no equivalence (a near b and b near c says nothing
//! of a and c), so that the result would depend on the order.

use std::collections::HashMap;

/// Collects positions.
#[derive(Debug, Default)]
pub struct Weld {
    /// Positions by their bits: looked up, never iterated.
    places: HashMap<[u32; 3], u32>,
    positions: Vec<[f32; 3]>,
}

impl Weld {
    /// The index of a place, new or known.
    pub fn id(&mut self, position: [f32; 3]) -> u32 {
        // Adding zero turns -0.0 into 0.0: the same place has one name.
        let position = position.map(|x| x + 0.0);
        let next = self.positions.len() as u32;
        let id = *self.places.entry(position.map(f32::to_bits)).or_insert(next);
        if id == next {
            self.positions.push(position);
        }
        id
    }

    /// The places so far, in order of first use.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The places, in order of first use.
    #[must_use]
    pub fn into_positions(self) -> Vec<[f32; 3]> {
        self.positions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_places_have_one_name_and_near_ones_two() {
        let mut weld = Weld::default();
        assert_eq!(weld.id([0.0, 1.0, 2.0]), 0);
        assert_eq!(weld.id([-0.0, 1.0, 2.0]), 0);
        assert_eq!(weld.id([f32::EPSILON, 1.0, 2.0]), 1);
        assert_eq!(weld.id([0.0, 1.0, 2.0]), 0);
        assert_eq!(weld.into_positions(), [[0.0, 1.0, 2.0], [f32::EPSILON, 1.0, 2.0]]);
    }
}
