//! Disjoint sets of numbers: which triangles belong together, as edge after edge joins two of them (Tarjan 1975, path halving).

/// Sets of the numbers from 0, at first one each.
#[derive(Debug, Clone)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// `count` sets of one number.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The lowest number of the set that `at` is in.
    pub fn first(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            self.parent[at as usize] = self.parent[self.parent[at as usize] as usize];
            at = self.parent[at as usize];
        }
        at
    }

    /// Makes one set of the two that `a` and `b` are in.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        // The lower number becomes the root, so that a set is named by its first member whatever the order of joins.
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Numbers the sets from 0 in the order of their first members.
    #[must_use]
    pub fn numbers(mut self) -> Vec<u32> {
        let mut numbers = vec![u32::MAX; self.parent.len()];
        let mut next = 0;
        (0..self.parent.len() as u32)
            .map(|at| {
                let first = self.first(at) as usize;
                if numbers[first] == u32::MAX {
                    numbers[first] = next;
                    next += 1;
                }
                numbers[first]
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_numbers_share_their_lowest() {
        let mut sets = DisjointSets::new(6);
        for (a, b) in [(5, 4), (4, 1), (0, 3)] {
            sets.join(a, b);
        }
        assert_eq!((0..6).map(|k| sets.first(k)).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 1]);
        assert_eq!(sets.numbers(), [0, 1, 2, 0, 1, 1]);
    }
}
