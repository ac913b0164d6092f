//! Direction grids: the D directions of a texel's hemisphere at which its outgoing radiance is stored.
//!
//! `spherical` is the thesis's grid with cell centres in inclination: theta_i = (i + 1/2) · 90°/n_theta, phi_j = j · 360°/n_phi, depth =
//! i · n_phi + j. The thesis puts a ring on the pole itself, where n_phi samples store one direction; cell centres waste none. Directions
//! are local: x along the tangent, y along the bitangent, z along the normal, and point away from the surface.

use crate::{limits, math};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// The thesis's grid of inclinations and azimuths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct SphericalGrid {
    n_theta: u32,
    n_phi: u32,
}

/// Why a direction grid was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("directions `{text}`: expected INCLINATIONSxAZIMUTHS such as 20x20, each from 1 to {max}, azimuths even", max = limits::GRID_SIDE)]
pub struct BadGrid {
    text: String,
}

/// Up to four grid directions with their bilinear weights; the weights sum to one.
pub type Stencil = [(u32, f32); 4];

impl SphericalGrid {
    /// A grid of `n_theta` inclinations and `n_phi` azimuths; `n_phi` is even, so that every azimuth has an opposite across the pole.
    ///
    /// # Errors
    /// Sizes of zero or above [`limits::GRID_SIDE`], and odd `n_phi`.
    pub fn new(n_theta: u32, n_phi: u32) -> Result<Self, BadGrid> {
        let side = 1..=limits::GRID_SIDE;
        if side.contains(&n_theta) && side.contains(&n_phi) && n_phi.is_multiple_of(2) {
            Ok(Self { n_theta, n_phi })
        } else {
            Err(BadGrid { text: format!("{n_theta}x{n_phi}") })
        }
    }

    /// Inclinations.
    #[must_use]
    pub fn n_theta(self) -> u32 {
        self.n_theta
    }

    /// Azimuths.
    #[must_use]
    pub fn n_phi(self) -> u32 {
        self.n_phi
    }

    /// D, the number of directions.
    #[must_use]
    pub fn len(self) -> u32 {
        self.n_theta * self.n_phi
    }

    /// Never: a grid has at least two directions.
    #[must_use]
    pub fn is_empty(self) -> bool {
        false
    }

    /// The local unit direction at `depth` = i · n_phi + j.
    #[must_use]
    pub fn direction(self, depth: u32) -> Vec3 {
        let (i, j) = (depth / self.n_phi, depth % self.n_phi);
        let (sin_theta, cos_theta) = math::sin_cos_degrees((f64::from(i) + 0.5) * 90.0 / f64::from(self.n_theta));
        let (sin_phi, cos_phi) = math::sin_cos_degrees(f64::from(j) * 360.0 / f64::from(self.n_phi));
        Vec3::new((sin_theta * cos_phi) as f32, (sin_theta * sin_phi) as f32, cos_theta as f32)
    }

    /// All directions in depth order.
    #[must_use]
    pub fn directions(self) -> Vec<Vec3> {
        (0..self.len()).map(|depth| self.direction(depth)).collect()
    }

    /// The bilinear stencil of a local direction: phi wraps, above the first ring it interpolates with the same ring at phi + 180°, below
    /// the last ring (and below the horizon) it clamps.
    #[must_use]
    pub fn stencil(self, direction: Vec3) -> Stencil {
        let n = f64::from(self.n_theta);
        let theta = math::acos(f64::from(direction.z)).to_degrees();
        let phi = azimuth_turns(f64::from(direction.x), f64::from(direction.y));
        let v = theta * n / 90.0 - 0.5;
        let u = phi * f64::from(self.n_phi);
        let (j0, fu) = (u.floor(), (u - u.floor()) as f32);
        let j = j0 as u32 % self.n_phi;
        let across = |j: u32| (j + self.n_phi / 2) % self.n_phi;
        let next = (j + 1) % self.n_phi;
        let at = |i: u32, j: u32| i * self.n_phi + j;
        let (top, bottom, fv) = if v < 0.0 {
            // Between the first ring and itself on the other side of the pole.
            ((0, true), (0, false), (v + 0.5) as f32 + 0.5)
        } else if v >= n - 1.0 {
            ((self.n_theta - 1, false), (self.n_theta - 1, false), 0.0)
        } else {
            ((v as u32, false), (v as u32 + 1, false), (v - v.floor()) as f32)
        };
        let ring = |(i, over): (u32, bool), j: u32| if over { at(i, across(j)) } else { at(i, j) };
        [
            (ring(top, j), (1.0 - fu) * (1.0 - fv)),
            (ring(top, next), fu * (1.0 - fv)),
            (ring(bottom, j), (1.0 - fu) * fv),
            (ring(bottom, next), fu * fv),
        ]
    }
}

/// The azimuth of (x, y) in turns, [0, 1).
fn azimuth_turns(x: f64, y: f64) -> f64 {
    let r = (x * x + y * y).sqrt();
    if r == 0.0 {
        return 0.0;
    }
    let half = math::acos(x / r) / std::f64::consts::TAU;
    let turns = if y < 0.0 { 1.0 - half } else { half };
    if turns >= 1.0 { 0.0 } else { turns }
}

impl Default for SphericalGrid {
    fn default() -> Self {
        Self { n_theta: 20, n_phi: 20 }
    }
}

impl fmt::Display for SphericalGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.n_theta, self.n_phi)
    }
}

impl FromStr for SphericalGrid {
    type Err = BadGrid;
    fn from_str(text: &str) -> Result<Self, BadGrid> {
        let bad = || BadGrid { text: text.chars().take(40).collect() };
        let (t, p) = text.split_once('x').ok_or_else(bad)?;
        Self::new(t.parse().map_err(|_| bad())?, p.parse().map_err(|_| bad())?)
    }
}

crate::written_as_text!(SphericalGrid);

/// The order in which `pwl` walks a texel's directions; the files still name each sample by its depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Walk {
    /// Azimuth fastest: the order of depth itself.
    #[default]
    Phi,
    /// Inclination fastest.
    Theta,
}

impl Walk {
    /// The depth of the `step`-th direction of the walk.
    #[must_use]
    pub fn depth(self, grid: SphericalGrid, step: u32) -> u32 {
        match self {
            Walk::Phi => step,
            Walk::Theta => (step % grid.n_theta) * grid.n_phi + step / grid.n_theta,
        }
    }

    /// The inverse of [`Walk::depth`].
    #[must_use]
    pub fn step(self, grid: SphericalGrid, depth: u32) -> u32 {
        match self {
            Walk::Phi => depth,
            Walk::Theta => (depth % grid.n_phi) * grid.n_theta + depth / grid.n_phi,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_grid_is_the_reference_grid() {
        let grid = SphericalGrid::default();
        assert_eq!(grid.len(), 400);
        // Row 1 of the thesis-room reference: i = 0, j = 10 has z = cos(2.25 degrees).
        let d = grid.direction(10);
        assert!((d.z - 0.999_229).abs() < 1e-6 && (d.x + 0.039_259_8).abs() < 1e-6 && d.y.abs() < 1e-7, "{d}");
    }

    #[test]
    fn the_stencil_of_a_grid_direction_is_that_direction_and_weights_sum_to_one() {
        let grid = SphericalGrid::new(7, 12).unwrap();
        for depth in 0..grid.len() {
            let hit: f32 = grid.stencil(grid.direction(depth)).iter().filter(|(d, _)| *d == depth).map(|(_, w)| w).sum();
            assert!(hit > 0.999, "depth {depth}: {hit}");
        }
        for k in 0..500 {
            let (s, c) = math::sin_cos_turns(k as f32 * 0.137);
            let z = k as f32 / 500.0;
            let r = (1.0 - z * z).sqrt();
            let stencil = grid.stencil(Vec3::new(r * c, r * s, z));
            let sum: f32 = stencil.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-5 && stencil.iter().all(|(d, w)| *d < grid.len() && *w >= -1e-6));
        }
    }

    #[test]
    fn interpolation_is_continuous_across_the_pole() {
        let grid = SphericalGrid::default();
        let field: Vec<f32> = grid.directions().iter().map(|d| d.x + 0.3 * d.y).collect();
        let read = |d: Vec3| grid.stencil(d).iter().map(|(k, w)| field[*k as usize] * w).sum::<f32>();
        let (a, b) = (read(Vec3::new(1e-4, 0.0, 1.0).normalize()), read(Vec3::new(-1e-4, 0.0, 1.0).normalize()));
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }

    #[test]
    fn both_walks_visit_every_depth_once_and_invert() {
        let grid = SphericalGrid::new(5, 8).unwrap();
        for walk in [Walk::Phi, Walk::Theta] {
            let mut seen: Vec<u32> = (0..grid.len()).map(|s| walk.depth(grid, s)).collect();
            assert!((0..grid.len()).all(|s| walk.step(grid, walk.depth(grid, s)) == s));
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..grid.len()));
        }
    }

    #[test]
    fn bad_grids_are_refused_with_the_reason() {
        for bad in ["", "20", "0x20", "20x19", "65x20", "x", "-1x2", "20x20x20"] {
            let error = bad.parse::<SphericalGrid>().unwrap_err().to_string();
            assert!(error.contains("azimuths even"), "{error}");
        }
    }
}
