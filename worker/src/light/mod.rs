//! Lights: emissive triangles, chosen by power, sampled uniformly over their area.
//!
//! Power is area times the mean luminance of Ke (times the mean of its texture). Sampling the solid angle of each triangle instead would
//! lower the noise close to large lights, but a density that depends on the shading point must be evaluated again for every hit of MIS.

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

/// A point on a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPoint {
    /// The primitive it lies on.
    pub prim: u32,
    /// Barycentric weights of the second and third corner.
    pub bary: [f32; 2],
    /// The density with which it was chosen, 1/m².
    pub pdf_area: f32,
}

/// All lights of a scene.
#[derive(Debug, Default)]
pub struct Lights {
    emitters: Vec<Emitter>,
    /// Probability that an emitter before or at this one is chosen; the last is 1.
    cumulative: Vec<f32>,
}

impl Lights {
    /// The lights among these emitters: those without power, or too small to have a density, are left out.
    #[must_use]
    pub fn new(emitters: impl IntoIterator<Item = Emitter>) -> Self {
        let power = |e: &Emitter| f64::from(e.area) * f64::from(e.radiance);
        let emitters: Vec<Emitter> = emitters.into_iter().filter(|e| power(e) > 0.0 && (1.0 / e.area).is_finite()).collect();
        let total: f64 = emitters.iter().map(power).sum();
        let mut below = 0.0;
        let mut cumulative: Vec<f32> = emitters
            .iter()
            .map(|e| {
                below += power(e);
                (below / total) as f32
            })
            .collect();
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        Self { emitters, cumulative }
    }

    /// The emitters that have power, in the order of their primitives.
    #[must_use]
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// A point on a light, or `None` where there is no light.
    #[must_use]
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<LightPoint> {
        let chosen = self.cumulative.partition_point(|c| *c <= u[0]);
        let emitter = self.emitters.get(chosen)?;
        let below = if chosen == 0 { 0.0 } else { self.cumulative[chosen - 1] };
        let stretched = ((u[0] - below) / self.chance(chosen)).min(1.0);
        Some(LightPoint { prim: emitter.prim, bary: warp::triangle([stretched, u[1]]), pdf_area: self.chance(chosen) / emitter.area })
    }

    /// The density with which points of the `index`-th emitter are chosen, 1/m².
    #[must_use]
    pub fn pdf_area(&self, index: usize) -> f32 {
        self.chance(index) / self.emitters[index].area
    }

    fn chance(&self, index: usize) -> f32 {
        if index == 0 { self.cumulative[0] } else { self.cumulative[index] - self.cumulative[index - 1] }
    }
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
        let lights = Lights::new([emitter(4, 1.0, 3.0), emitter(5, 1.0, 0.0), emitter(9, 2.0, 0.5)]);
        assert_eq!(lights.emitters().len(), 2, "a dark triangle is no light");
        let n = 4000;
        let mut first = 0;
        for i in 0..n {
            let point = lights.sample([i as f32 / n as f32, 0.3]).unwrap();
            let index = lights.emitters().iter().position(|e| e.prim == point.prim).unwrap();
            assert_eq!(point.pdf_area, lights.pdf_area(index));
            first += u32::from(point.prim == 4);
        }
        assert_eq!(first, 3 * n / 4);
        let total: f32 = (0..2).map(|i| lights.pdf_area(i) * lights.emitters()[i].area).sum();
        assert!((total - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_dark_scene_has_no_lights() {
        assert_eq!(Lights::new([]).sample([0.5, 0.5]), None);
    }
}
