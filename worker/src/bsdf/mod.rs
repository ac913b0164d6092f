//! How surfaces reflect: Lambert plus a normalised Phong lobe or a perfect mirror, as MTL materials mean it, or glTF's metallic-roughness.
//!
//! Directions are unit, local (z the normal that reflection sees) and point away from the surface. `eval` is in 1/sr and leaves the cosine
//! to the caller. `wo` is above the horizon. Light from below has value and density zero but for transmission, and a sample that goes where
//! there is no value counts as zero.

pub mod coat;
pub mod power;

#[cfg(test)]
mod tests;

use crate::sampling::warp::{self, INV_PI};
use coat::Coat;
use glam::Vec3;
use kiln_proto::units::Rgb;
use power::Exponent;

/// What lies over the diffuse base of a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Specular {
    /// Nothing.
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
    /// Microfacets, which also decide how much light the base gets.
    Coat(Coat),
}

/// A material at one point, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bsdf {
    /// Kd, or the diffuse reflectance under a coat.
    pub diffuse: Rgb,
    /// What lies over it.
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

/// The mirror image of a local direction behind the surface.
#[must_use]
#[inline]
pub fn behind(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

/// Probabilities of sampling the parts of a material.
#[derive(Clone, Copy)]
struct Shares {
    specular: f32,
    through: f32,
}

impl Bsdf {
    /// Reflects nothing.
    pub const BLACK: Bsdf = Bsdf { diffuse: Rgb::BLACK, specular: Specular::None };

    /// Whether it reflects nothing at all.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.diffuse.is_black()
            && match self.specular {
                Specular::None => true,
                Specular::Phong { ks, .. } | Specular::Mirror { ks } => ks.is_black(),
                Specular::Coat(c) => c.normal.is_black() && c.rise.is_black() && c.through.is_black(),
            }
    }

    /// Whether some of it can be evaluated toward a given direction (all but a pure mirror).
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        let lobe = match self.specular {
            Specular::Phong { .. } => true,
            Specular::Coat(c) => c.alpha > 0.0,
            Specular::None | Specular::Mirror { .. } => false,
        };
        lobe || !self.diffuse.is_black()
    }

    /// Whether light from behind the surface counts.
    #[must_use]
    pub fn is_translucent(&self) -> bool {
        matches!(self.specular, Specular::Coat(c) if c.alpha > 0.0 && !c.through.is_black())
    }

    /// Value toward `wo` of light from `wi`, 1/sr, without delta lobes.
    #[must_use]
    #[inline]
    pub fn eval(&self, wi: Vec3, wo: Vec3) -> Rgb {
        if wo.z <= 0.0 {
            return Rgb::BLACK;
        }
        if wi.z <= 0.0 {
            return match self.specular {
                Specular::Coat(coat) if wi.z < 0.0 && self.is_translucent() => coat.transmitted(behind(wi), wo),
                _ => Rgb::BLACK,
            };
        }
        let diffuse = self.diffuse * INV_PI;
        match self.specular {
            Specular::Phong { ks, exponent } => diffuse + ks * (exponent.eval_norm() * exponent.raise(mirror(wi).dot(wo))),
            Specular::None | Specular::Mirror { .. } => diffuse,
            Specular::Coat(coat) => coat.reflected(self.diffuse, wi, wo),
        }
    }

    /// The density with which [`Bsdf::sample`] chooses `wi`, 1/sr, without delta lobes.
    #[must_use]
    #[inline]
    pub fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        if wo.z <= 0.0 {
            return 0.0;
        }
        let shares = self.shares(wo.z);
        if wi.z <= 0.0 {
            return match self.specular {
                Specular::Coat(coat) if wi.z < 0.0 && shares.through > 0.0 => shares.through * coat.pdf(behind(wi), wo),
                _ => 0.0,
            };
        }
        let diffuse = (1.0 - shares.specular - shares.through) * INV_PI * wi.z;
        match self.specular {
            Specular::Phong { exponent, .. } => diffuse + shares.specular * exponent.pdf_norm() * exponent.raise(mirror(wo).dot(wi)),
            Specular::Coat(coat) if coat.alpha > 0.0 => diffuse + shares.specular * coat.pdf(wi, wo),
            Specular::None | Specular::Mirror { .. } | Specular::Coat(_) => diffuse,
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
        let shares = self.shares(wo.z);
        let passed = shares.specular + shares.through;
        if u[0] < shares.specular {
            u[0] /= shares.specular;
            let delta = |f: Rgb| Some(Bounce { wi: mirror(wo), weight: f * (1.0 / shares.specular), pdf: None });
            match self.specular {
                Specular::Mirror { ks } => delta(ks),
                Specular::Coat(coat) if coat.alpha <= 0.0 => delta(coat.mirrored(wo.z)),
                Specular::Phong { exponent, .. } => self.bounce(above(warp::power_lobe(mirror(wo), exponent.value(), u))?, wo),
                Specular::Coat(coat) => self.bounce(above(coat.sample(wo, u))?, wo),
                Specular::None => None,
            }
        } else if u[0] < passed {
            u[0] = (u[0] - shares.specular) / shares.through;
            let Specular::Coat(coat) = self.specular else { return None };
            self.bounce(behind(above(coat.sample(wo, u))?), wo)
        } else {
            u[0] = (u[0] - passed) / (1.0 - passed);
            self.bounce(warp::cosine_hemisphere(u), wo)
        }
    }

    fn bounce(&self, wi: Vec3, wo: Vec3) -> Option<Bounce> {
        let pdf = self.pdf(wi, wo);
        (pdf > 0.0).then(|| Bounce { wi, weight: self.eval(wi, wo) * (wi.z.abs() / pdf), pdf: Some(pdf) })
    }

    /// Each part is sampled with its share of the reflectance, the specular one of a coat with what it has toward this cosine. The base
    /// keeps the share that it has from above: light from the side reaches it also where the viewer sees little but reflections.
    #[inline]
    fn shares(&self, cos: f32) -> Shares {
        let (ks, through, kd) = match self.specular {
            Specular::None => (0.0, 0.0, self.diffuse.mean()),
            Specular::Phong { ks, .. } | Specular::Mirror { ks } => (ks.mean(), 0.0, self.diffuse.mean()),
            Specular::Coat(coat) => {
                let through = if coat.alpha > 0.0 { coat.through.mean() * coat.kept } else { 0.0 };
                (coat.mirrored(cos).mean(), through, self.diffuse.mean() * coat.kept)
            }
        };
        let all = ks + through + kd;
        if ks + through > 0.0 { Shares { specular: ks / all, through: through / all } } else { Shares { specular: 0.0, through: 0.0 } }
    }

    /// The share of a unit of light from the normal that is reflected or let through. Phong: Kd + Ks exactly, by the lobe's normalisation;
    /// a coat: what perfectly smooth facets would reflect, which rough ones only fall short of. Toward grazing directions a Phong lobe
    /// reflects less, never more.
    #[must_use]
    pub fn albedo(&self) -> Rgb {
        self.diffuse + self.ks()
    }

    fn ks(&self) -> Rgb {
        match self.specular {
            Specular::None => Rgb::BLACK,
            Specular::Phong { ks, .. } | Specular::Mirror { ks } => ks,
            Specular::Coat(coat) => coat.normal,
        }
    }
}

/// A sampled direction, unless it lies below the horizon.
#[inline]
fn above(w: Vec3) -> Option<Vec3> {
    (w.z > 0.0).then_some(w)
}
