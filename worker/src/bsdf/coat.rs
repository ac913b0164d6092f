//! glTF 2.0's metallic-roughness model (appendix B) with KHR_materials_ior, _specular and _transmission (thin): microfacets over a base.
//!
//! Microfacets have the GGX distribution (Walter et al. 2007, eq. 33) and shadow each other by Smith's function in the separable form
//! G1(wi) G1(wo), as the appendix has it; each reflects by Schlick's approximation, F = f0 + (f90 - f0)(1 - v·h)^5. The form for correlated
//! heights (Heitz 2014, eq. 99) is nearer to the truth, up to a half brighter at roughness 1, and another model than the format's. All of
//! the appendix is linear in the fifth power, so one point of a material is a few numbers, whatever its metalness:
//!
//! ```text
//! f = D V (normal + rise p) + (diffuse/pi + through D' V') (kept - lost p),    p = (1 - v·h)^5
//! ```
//!
//! D' and V' belong to the light's mirror image on the viewer's side: the thin-walled transmission of KHR_materials_transmission. Densities
//! are those of visible normals (Heitz 2018), drawn by spherical caps (Dupuy and Benyoub 2023). As in the appendix, light that facets pass
//! on to each other is lost, so rough metals are dark; and because the base gets 1 - F(v·h) of the light, not what the facets leave of it,
//! a bright smooth dielectric reflects up to half more than it gets at grazing angles (the appendix says so under "Coupling Diffuse and
//! Specular Reflection"). Over all angles it loses light, so paths stay bounded.

use crate::sampling::warp::INV_PI;
use glam::Vec3;
use kiln_proto::{math, scene::fifth, units::Rgb};

/// Everything but the diffuse base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coat {
    /// Width of the distribution of facets: roughness squared, at least [`LEAST_ALPHA`](kiln_proto::scene::LEAST_ALPHA); 0 for a perfect
    /// mirror.
    pub alpha: f32,
    /// Reflectance of a facet that is looked at straight on.
    pub normal: Rgb,
    /// What is added to it toward grazing angles.
    pub rise: Rgb,
    /// The share of light that reaches the base under a facet that is looked at straight on.
    pub kept: f32,
    /// What is lost of it toward grazing angles.
    pub lost: f32,
    /// Transmittance of the base for light that facets scatter; black for a perfect mirror, through which light goes straight on.
    pub through: Rgb,
}

/// D of GGX for facets halfway between two directions whose sum is `sum`, 1/sr; `alpha` > 0, the normal is z.
#[inline]
fn distribution(alpha: f32, sum: Vec3) -> f32 {
    let (a2, length) = (alpha * alpha, sum.length_squared());
    // tan² form without a difference of nearly equal numbers: (h_x² + h_y²) + alpha² h_z², times the squared length.
    let spread = sum.x * sum.x + sum.y * sum.y + a2 * sum.z * sum.z;
    let ratio = length / spread;
    a2 * INV_PI * ratio * ratio
}

/// V1 of appendix B: Smith's G1 over twice the cosine.
#[must_use]
#[inline(always)]
pub fn smith(cos: f32, alpha2: f32) -> f32 {
    1.0 / (cos + (cos * cos * (1.0 - alpha2) + alpha2).sqrt())
}

impl Coat {
    /// (D V, (1 - v·h)^5) for directions on one side; D V = 0 for a perfect mirror.
    #[inline]
    fn facet(&self, wi: Vec3, wo: Vec3) -> (f32, f32) {
        let sum = wi + wo;
        let grazing = fifth(0.5 * sum.length());
        if self.alpha <= 0.0 {
            return (0.0, grazing);
        }
        let a2 = self.alpha * self.alpha;
        let visible = smith(wi.z, a2) * smith(wo.z, a2);
        (distribution(self.alpha, sum) * visible, grazing)
    }

    /// Value with a base of reflectance `diffuse`, 1/sr; both directions above the horizon.
    #[must_use]
    #[inline]
    pub fn reflected(&self, diffuse: Rgb, wi: Vec3, wo: Vec3) -> Rgb {
        let (spread, p) = self.facet(wi, wo);
        (self.normal + self.rise * p) * spread + diffuse * (INV_PI * self.base_share(p))
    }

    /// Value of transmission for light from below, 1/sr; `wi` is the mirror image of its direction, above the horizon.
    #[must_use]
    #[inline]
    pub fn transmitted(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let (spread, p) = self.facet(wi, wo);
        self.through * (spread * self.base_share(p))
    }

    /// Reflectance of a perfect mirror toward a direction of this cosine.
    #[must_use]
    #[inline]
    pub fn mirrored(&self, cos: f32) -> Rgb {
        self.normal + self.rise * fifth(cos)
    }

    /// The share of light that reaches the base, at this power of v·h.
    #[must_use]
    #[inline]
    pub fn base_share(&self, p: f32) -> f32 {
        (self.kept - self.lost * p).max(0.0)
    }

    /// The density of [`Coat::sample`], 1/sr, both directions above the horizon: G1 D / (4 cos).
    #[must_use]
    #[inline]
    pub fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        distribution(self.alpha, wi + wo) * visible_norm(wo.z, self.alpha * self.alpha)
    }

    /// A direction reflected by a facet that is seen from `wo`, which may lie below the horizon.
    #[must_use]
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        visible_lobe(self.alpha, wo, u)
    }
}

/// What D is multiplied with for the density of a lobe seen from cosine `cos`: G1/(4 cos).
#[must_use]
#[inline(always)]
pub fn visible_norm(cos: f32, alpha2: f32) -> f32 {
    0.5 * smith(cos, alpha2)
}

/// A direction reflected by a facet visible from `wo` (Dupuy and Benyoub 2023, listing 3); z is the normal.
#[must_use]
#[inline]
pub fn visible_lobe(alpha: f32, wo: Vec3, u: [f32; 2]) -> Vec3 {
    let stretched = Vec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = math::sin_cos_turns(u[1]);
    let h = Vec3::new(r * cos, r * sin, z) + stretched;
    let facet = Vec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize_or(Vec3::Z);
    (facet * (2.0 * facet.dot(wo)) - wo).normalize()
}
