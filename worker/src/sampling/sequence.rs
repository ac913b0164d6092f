//! Owen-scrambled Sobol' points by hashing (Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020).
//!
//! Every decision of a path takes a pair of dimensions of its own: the same two-dimensional sequence, its index shuffled and its values
//! scrambled anew from a hash of (seed, surface, texel, dimension). So any sample can be computed from its number alone, in any order, on
//! any thread. A single sequence of many dimensions lost: its high dimensions pair badly, and its tables do not fit the first-level cache.

/// Which decision a pair of numbers is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dimension(pub u32);

impl Dimension {
    /// Where the systematic choice of lobes begins.
    pub const LOBE_SHIFT: Dimension = Dimension(0);
    /// A direction about the normal.
    pub const COSINE: Dimension = Dimension(1);
    /// A direction about the mirror image of a grid direction.
    pub const LOBE: Dimension = Dimension(2);
    /// A point on a light, shared by all directions.
    pub const LIGHT: Dimension = Dimension(3);
    /// Which of many lights without area.
    pub const PUNCTUAL: Dimension = Dimension(4);

    /// A point of the footprint of an incident sample; `attempt` counts misses.
    #[must_use]
    pub fn footprint(attempt: u32) -> Dimension {
        Dimension(16 + attempt)
    }

    /// A point of the footprint of a light sample; `attempt` counts misses.
    #[must_use]
    pub fn light_footprint(attempt: u32) -> Dimension {
        Dimension(32 + attempt)
    }

    /// A point of the footprint that lights without area shine on; `attempt` counts misses.
    #[must_use]
    pub fn punctual_footprint(attempt: u32) -> Dimension {
        Dimension(48 + attempt)
    }

    /// Which light without area, seen from the vertex whose light arrives at `depth`.
    #[must_use]
    pub fn punctual(depth: u32) -> Dimension {
        Dimension(256 + depth)
    }

    /// A point on a light, seen from the vertex whose light arrives at `depth`.
    #[must_use]
    pub fn next_event(depth: u32) -> Dimension {
        Dimension(64 + 2 * depth)
    }

    /// The direction in which a path goes on from that vertex.
    #[must_use]
    pub fn bounce(depth: u32) -> Dimension {
        Dimension(65 + 2 * depth)
    }
}

/// The root of all sample sequences of one texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TexelKey(u64);

impl TexelKey {
    /// The key of texel number `texel` (or any other 64-bit name of a point) of a surface.
    #[must_use]
    pub fn new(seed: u64, surface: u32, texel: u64) -> Self {
        Self(mix(mix(mix(seed) ^ u64::from(surface)) ^ texel))
    }

    /// A 64-bit name of the ray that leaves the vertex at `depth` of the `index`-th path.
    #[must_use]
    #[inline]
    pub fn salt(self, index: u32, depth: u32) -> u64 {
        mix(self.0 ^ (u64::from(depth) << 32 | u64::from(index)))
    }

    /// The `index`-th point of the sequence of a dimension, in [0, 1)².
    #[must_use]
    #[inline]
    pub fn pair(self, dimension: Dimension, index: u32) -> [f32; 2] {
        let hash = mix(self.0 ^ u64::from(dimension.0).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let other = hash.wrapping_mul(0xd6e8_feb8_6659_fd93);
        let shuffled = scramble(index.reverse_bits(), hash as u32).reverse_bits();
        // Both Sobol' dimensions are bit reversals of an integer, and scrambling works on reversed bits: one reversal each is left.
        let x = scramble(shuffled, (hash >> 32) as u32).reverse_bits();
        let y = scramble(pascal(shuffled), (other >> 32) as u32).reverse_bits();
        [unit(x), unit(y)]
    }
}

/// The 24 upper bits as a number in [0, 1).
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A hash in which a bit depends on lower bits only (Laine and Karras 2011, with the constants of Vegdahl's search): Owen scrambling of a
/// number whose bits are reversed.
#[inline]
fn scramble(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The second Sobol' dimension before its bits are reversed: bit j is the sum over i of binomial(i, j) times bit i, modulo 2. By Lucas's
/// theorem binomial(i, j) is odd when the bits of j are a subset of those of i, so five steps do what 32 matrix rows would.
#[inline]
fn pascal(mut x: u32) -> u32 {
    x ^= (x >> 16) & 0x0000_ffff;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 2) & 0x3333_3333;
    x ^ ((x >> 1) & 0x5555_5555)
}

/// The finalizer of splitmix64 (Steele et al. 2014).
#[inline]
pub(crate) fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_of_a_power_of_two_is_a_net() {
        // A (0, m, 2)-net: every elementary rectangle of area 2^-m holds exactly one point of each block.
        for (seed, m) in [(1, 4u32), (2, 8), (99, 10)] {
            let (key, n) = (TexelKey::new(seed, 3, 17), 1u32 << m);
            for block in [0, 5] {
                for k in 0..=m {
                    let mut seen = vec![false; n as usize];
                    for i in 0..n {
                        let [x, y] = key.pair(Dimension::LIGHT, block * n + i);
                        let cell = ((x * (1 << k) as f32) as u32) << (m - k) | (y * (1 << (m - k)) as f32) as u32;
                        assert!(!std::mem::replace(&mut seen[cell as usize], true), "seed {seed}, m {m}, k {k}");
                    }
                }
            }
        }
    }

    #[test]
    fn pascal_is_the_binomial_triangle_modulo_two() {
        let odd = |i: u32, j: u32| i & j == j;
        for i in 0..32 {
            let expected = (0..32).filter(|j| odd(i, *j)).fold(0u32, |acc, j| acc | 1 << j);
            assert_eq!(pascal(1 << i), expected);
        }
    }

    #[test]
    fn texels_surfaces_seeds_and_dimensions_are_independent() {
        let mean = |f: &dyn Fn(u32) -> f32| (0..4096).map(f).map(f64::from).sum::<f64>() / 4096.0;
        // First points over many keys are uniform and uncorrelated between the coordinates.
        let first = |k: u32| TexelKey::new(u64::from(k % 16), k / 16 % 16, u64::from(k / 256)).pair(Dimension(k % 3), 0);
        let (x, y) = (mean(&|k| first(k)[0]), mean(&|k| first(k)[1]));
        let xy = mean(&|k| (first(k)[0] - 0.5) * (first(k)[1] - 0.5));
        assert!((x - 0.5).abs() < 0.02 && (y - 0.5).abs() < 0.02 && xy.abs() < 0.006, "{x} {y} {xy}");
        let key = TexelKey::new(1, 2, 3);
        let across = mean(&|k| (key.pair(Dimension::COSINE, k)[0] - 0.5) * (key.pair(Dimension::LIGHT, k)[0] - 0.5));
        assert!(across.abs() < 0.006, "{across}");
    }
}
