//! How surfaces reflect: Lambert plus a normalised Phong lobe or a perfect mirror, as MTL materials mean it.
//!
//! Directions are unit, local (z the normal) and point away from the surface. `eval` is in 1/sr and leaves the cosine to the caller. Only
//! the front side reflects: a direction below the horizon has value and density zero, and a sample that lands there counts as zero.

pub mod power;
pub mod texture;

#[cfg(test)]
mod tests;

use crate::sampling::warp::{self, INV_PI};
use glam::Vec3;
use kiln_proto::units::Rgb;
use power::Exponent;

/// What the specular part of a material is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Specular {
    /// There is none.
    None,
    /// Normalised modified Phong (Lewis 1994): Ks (n + 2)/(2 pi) max(0, r·wo)^n, r the mirror image of wi about the normal.
    Phong {
        /// Ks.
        ks: Rgb,
        /// n.
        exponent: Exponent,
    },
    /// A delta lobe about the mirror direction.
    Mirror {
        /// Ks.
        ks: Rgb,
    },
}

/// A material at one point, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bsdf {
    /// Kd.
    pub diffuse: Rgb,
    /// The specular part.
    pub specular: Specular,
}

/// A direction chosen by [`Bsdf::sample`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// Where the path goes on to (local).
    pub wi: Vec3,
    /// Value times cosine over density.
    pub weight: Rgb,
    /// The density, 1/sr; `None` for a delta lobe, which no other technique can sample.
    pub pdf: Option<f32>,
}

/// The mirror image of a local direction about the normal.
#[must_use]
#[inline]
pub fn mirror(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

impl Bsdf {
    /// Whether it reflects nothing at all.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.diffuse.is_black() && self.ks().is_black()
    }

    /// Whether some of it can be evaluated toward a given direction (all but a pure mirror).
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        !self.diffuse.is_black() || matches!(self.specular, Specular::Phong { .. })
    }

    /// Value toward `wo` of light from `wi`, 1/sr, without delta lobes.
    #[must_use]
    #[inline]
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Rgb::BLACK;
        }
        let diffuse = self.diffuse * INV_PI;
        match self.specular {
            Specular::Phong { ks, exponent } => diffuse + ks * (exponent.eval_norm() * exponent.raise(mirror(wi).dot(wo))),
            Specular::None | Specular::Mirror { .. } => diffuse,
        }
    }

    /// The density with which [`Bsdf::sample`] chooses `wi`, 1/sr, without delta lobes.
    #[must_use]
    #[inline]
    pub fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let share = self.specular_share();
        let diffuse = (1.0 - share) * INV_PI * wi.z;
        match self.specular {
            Specular::Phong { exponent, .. } => diffuse + share * exponent.pdf_norm() * exponent.raise(mirror(wo).dot(wi)),
            Specular::None | Specular::Mirror { .. } => diffuse,
        }
    }

    /// A direction for light that leaves toward `wo`; `None` where the sample counts as zero.
    #[must_use]
    #[inline]
    pub fn sample(&self, wo: Vec3, mut u: [f32; 2]) -> Option<Bounce> {
        if wo.z <= 0.0 {
            return None;
        }
        // One number decides which part is sampled and is stretched to serve again.
        let share = self.specular_share();
        let wi = if u[0] < share {
            u[0] /= share;
            match self.specular {
                Specular::Mirror { ks } => return Some(Bounce { wi: mirror(wo), weight: ks * (1.0 / share), pdf: None }),
                Specular::Phong { exponent, .. } => warp::power_lobe(mirror(wo), exponent.value(), u),
                Specular::None => return None,
            }
        } else {
            u[0] = (u[0] - share) / (1.0 - share);
            warp::cosine_hemisphere(u)
        };
        let pdf = self.pdf(wi, wo);
        (pdf > 0.0).then(|| Bounce { wi, weight: self.eval(wi, wo) * (wi.z / pdf), pdf: Some(pdf) })
    }

    /// The share of a unit of light from the normal that is reflected: Kd + Ks exactly, by the lobe's normalisation. Toward grazing
    /// directions a Phong lobe reflects less, never more.
    #[must_use]
    pub fn albedo(&self) -> Rgb {
        self.diffuse + self.ks()
    }

    fn ks(&self) -> Rgb {
        match self.specular {
            Specular::None => Rgb::BLACK,
            Specular::Phong { ks, .. } | Specular::Mirror { ks } => ks,
        }
    }

    /// The probability of sampling the specular part: its share of the reflectance.
    #[inline]
    fn specular_share(&self) -> f32 {
        let (ks, kd) = (self.ks().mean(), self.diffuse.mean());
        if ks > 0.0 { ks / (ks + kd) } else { 0.0 }
    }
}
