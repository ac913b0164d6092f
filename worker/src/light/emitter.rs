//! Emissive triangles, chosen by power, sampled uniformly over their area.
//!
//! Power is area times the mean luminance of the emission (times the mean of its texture). Sampling the solid angle of each triangle
//! instead would lower the noise close to large lights, but a density that depends on the shading point must be evaluated again for every
//! hit of MIS.

use crate::sampling::warp;

/// One emissive triangle as the list of lights sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitter {
    /// The primitive.
    pub prim: u32,
    /// Its area, m².
    pub area: f32,
    /// Mean emitted radiance over channels and texture, W/(sr m²).
    pub radiance: f32,
}

/// The emissive triangles of a scene.
#[derive(Debug, Default)]
pub struct Emitters {
    list: Vec<Emitter>,
    /// Probability that an emitter before or at this one is chosen; the last is 1.
    cumulative: Vec<f32>,
    power: f64,
}

impl Emitters {
    /// The lights among these emitters: those without power, or too small to have a density, are left out.
    #[must_use]
    pub fn new(emitters: impl IntoIterator<Item = Emitter>) -> Self {
        let power = |e: &Emitter| f64::from(e.area) * f64::from(e.radiance);
        let list: Vec<Emitter> = emitters.into_iter().filter(|e| power(e) > 0.0 && (1.0 / e.area).is_finite()).collect();
        let total: f64 = list.iter().map(power).sum();
        let cumulative = cumulative(list.iter().map(power), total);
        Self { list, cumulative, power: total }
    }

    /// The emitters that have power, in the order of their primitives.
    #[must_use]
    pub fn list(&self) -> &[Emitter] {
        &self.list
    }

    /// Their power: area times radiance, W/sr.
    #[must_use]
    pub fn power(&self) -> f64 {
        self.power
    }

    /// An emitter and the weights of the second and third corner of a point on it, or `None` where there is none.
    #[must_use]
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<(usize, [f32; 2])> {
        let (chosen, stretched) = choose(&self.cumulative, u[0])?;
        Some((chosen, warp::triangle([stretched, u[1]])))
    }

    /// The density with which points of the `index`-th emitter are chosen, 1/m².
    #[must_use]
    #[inline]
    pub fn pdf_area(&self, index: usize) -> f32 {
        chance(&self.cumulative, index) / self.list[index].area
    }
}

/// Sums of weights up to and including each, as shares of their total; the last is 1.
pub(super) fn cumulative(weights: impl Iterator<Item = f64>, total: f64) -> Vec<f32> {
    let mut below = 0.0;
    let mut sums: Vec<f32> = weights
        .map(|w| {
            below += w;
            (below / total) as f32
        })
        .collect();
    if let Some(last) = sums.last_mut() {
        *last = 1.0;
    }
    sums
}

/// The interval of a cumulative distribution that holds u, and where in it, [0, 1].
#[inline]
pub(super) fn choose(cumulative: &[f32], u: f32) -> Option<(usize, f32)> {
    let chosen = cumulative.partition_point(|c| *c <= u);
    let (low, high) = (if chosen == 0 { 0.0 } else { cumulative[chosen - 1] }, *cumulative.get(chosen)?);
    Some((chosen, ((u - low) / (high - low)).min(1.0)))
}

/// The probability of one interval.
#[inline]
pub(super) fn chance(cumulative: &[f32], index: usize) -> f32 {
    if index == 0 { cumulative[0] } else { cumulative[index] - cumulative[index - 1] }
}

/// A density over area (1/m²) as one over solid angle (1/sr), seen from `distance_squared` (m²) away at cosine `cos` to the light's normal.
#[must_use]
#[inline]
pub fn to_solid_angle(pdf_area: f32, distance_squared: f32, cos: f32) -> f32 {
    pdf_area * distance_squared / cos
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_chosen_by_power_and_densities_agree() {
        let emitter = |prim, area, radiance| Emitter { prim, area, radiance };
        let lights = Emitters::new([emitter(4, 1.0, 3.0), emitter(5, 1.0, 0.0), emitter(9, 2.0, 0.5)]);
        assert_eq!(lights.list().len(), 2, "a dark triangle is no light");
        let n = 4000;
        let first = (0..n).filter(|i| lights.sample([*i as f32 / n as f32, 0.3]).unwrap().0 == 0).count();
        assert_eq!(first, 3 * n / 4);
        let total: f32 = (0..2).map(|i| lights.pdf_area(i) * lights.list()[i].area).sum();
        assert!((total - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_dark_scene_has_no_lights() {
        assert_eq!(Emitters::new([]).sample([0.5, 0.5]), None);
    }
}
