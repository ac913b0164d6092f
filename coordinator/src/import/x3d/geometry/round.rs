//! Sphere, Cone and Cylinder (X3D 3.3, 13.3.2, 13.3.3, 13.3.7) with exact normals.
//!
//! The subdivision is fixed so that no outline is off by more than 0.5 % of the radius: [`AROUND`] segments of a circle leave
//! 1 - cos(pi / 32) = 0.48 %; a sphere is flattened along both its angles and takes 48 by 24, which leave 0.43 % together. Each flat piece
//! is one polygon: a cap is one, and so is each facet. A true sphere in the ray tracer would be exact, but has no texture to bake into.

use super::{
    Geometry,
    error::{GeometryError, Repairs, at_least_zero, positive},
    patch::{Patch, Point},
};
use glam::{DVec2, DVec3};
use kiln_proto::math::sin_cos_degrees;

/// Segments of a circle.
pub(super) const AROUND: u32 = 32;
/// Segments of a sphere's equator.
const SPHERE_AROUND: u32 = 48;
/// Bands of a sphere from pole to pole.
const SPHERE_BANDS: u32 = 24;

/// The fields of a Sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sphere {
    /// Its radius.
    pub(crate) radius: f32,
    /// Only the outside is seen.
    pub(crate) solid: bool,
}

/// The fields of a Cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cylinder {
    /// Its radius.
    pub(crate) radius: f32,
    /// Its height along Y.
    pub(crate) height: f32,
    /// Whether it has a mantle.
    pub(crate) side: bool,
    /// Whether it has a lid.
    pub(crate) top: bool,
    /// Whether it has a floor.
    pub(crate) bottom: bool,
    /// Only the outside is seen.
    pub(crate) solid: bool,
}

/// The fields of a Cone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cone {
    /// Radius of its floor.
    pub(crate) bottom_radius: f32,
    /// Its height along Y.
    pub(crate) height: f32,
    /// Whether it has a mantle.
    pub(crate) side: bool,
    /// Whether it has a floor.
    pub(crate) bottom: bool,
    /// Only the outside is seen.
    pub(crate) solid: bool,
}

impl Default for Sphere {
    fn default() -> Self {
        Self { radius: 1.0, solid: true }
    }
}

impl Default for Cylinder {
    fn default() -> Self {
        Self { radius: 1.0, height: 2.0, side: true, top: true, bottom: true, solid: true }
    }
}

impl Default for Cone {
    fn default() -> Self {
        Self { bottom_radius: 1.0, height: 2.0, side: true, bottom: true, solid: true }
    }
}

/// The direction at a share of the way around, counter-clockwise seen from above, from the back (-Z), where textures have their seam.
fn around(share: f64) -> DVec3 {
    let (sin, cos) = sin_cos_degrees(360.0 * share);
    DVec3::new(-sin, 0.0, -cos)
}

/// Shares of the way around at which facets begin and end, and the one halfway.
fn facets(n: u32) -> impl Iterator<Item = [f64; 3]> {
    let n = f64::from(n);
    (0..n as u32).map(move |i| [f64::from(i) / n, (f64::from(i) + 0.5) / n, (f64::from(i) + 1.0) / n])
}

impl Sphere {
    /// Bands of quads between two caps of triangles; S runs around from the back, T from the south pole to the north pole.
    ///
    /// # Errors
    /// A radius that is not a positive number.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let radius = positive("radius", self.radius)?;
        let point = |s: f64, along: f64, t: f64| {
            let (sin, cos) = sin_cos_degrees(180.0 * t - 90.0);
            let normal = around(along) * cos + DVec3::Y * sin;
            Point { place: normal * radius, normal, uv: DVec2::new(s, t) }
        };
        let mut patch = Patch::default();
        for band in 0..SPHERE_BANDS {
            let [low, high] = [band, band + 1].map(|b| f64::from(b) / f64::from(SPHERE_BANDS));
            for [from, middle, to] in facets(SPHERE_AROUND) {
                // At a pole all facets meet in one vertex, which each of them sees in the middle of its piece of texture.
                if band == 0 {
                    patch.face(&[point(middle, middle, low), point(to, to, high), point(from, from, high)]);
                } else if band + 1 == SPHERE_BANDS {
                    patch.face(&[point(from, from, low), point(to, to, low), point(middle, middle, high)]);
                } else {
                    patch.face(&[point(from, from, low), point(to, to, low), point(to, to, high), point(from, from, high)]);
                }
            }
        }
        Ok(patch.finish(self.solid, Repairs::default()))
    }
}

impl Cylinder {
    /// Quads around, S from the back and T from the floor up, and two polygons with a circle cut out of the texture.
    ///
    /// # Errors
    /// A radius that is not positive, a negative height, and no part to see. A height of 0, which the specification forbids and browsers
    /// draw, leaves the lid and the floor.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let radius = positive("radius", self.radius)?;
        let half = at_least_zero("height", self.height)? / 2.0;
        let mut repairs = Repairs::default();
        let side = self.side && half > 0.0;
        if self.side && !side {
            repairs.note("a height of 0 leaves no side", "height", 0);
        }
        if !(side || self.top || self.bottom) {
            return Err(GeometryError::Empty { why: "side, top and bottom are all missing" });
        }
        let mut patch = Patch::default();
        let point = |s: f64, t: f64| Point {
            place: around(s) * radius + DVec3::Y * (half * (2.0 * t - 1.0)),
            normal: around(s),
            uv: DVec2::new(s, t),
        };
        for [from, _, to] in facets(AROUND).filter(|_| side) {
            patch.face(&[point(from, 0.0), point(to, 0.0), point(to, 1.0), point(from, 1.0)]);
        }
        if self.top {
            cap(&mut patch, radius, half, true);
        }
        if self.bottom {
            cap(&mut patch, radius, -half, false);
        }
        Ok(patch.finish(self.solid, repairs))
    }
}

impl Cone {
    /// Triangles around, S from the back and T from the floor to the tip, and a floor with a circle cut out of the texture. At the tip,
    /// which has no normal, each triangle has the one of its middle.
    ///
    /// # Errors
    /// A radius that is not positive, a negative height, and no part to see.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let radius = positive("bottomRadius", self.bottom_radius)?;
        let height = at_least_zero("height", self.height)?;
        if !(self.side || self.bottom) {
            return Err(GeometryError::Empty { why: "side and bottom are both missing" });
        }
        let mut patch = Patch::default();
        let point = |s: f64, t: f64| Point {
            place: around(s) * (radius * (1.0 - t)) + DVec3::Y * (height * (t - 0.5)),
            normal: (around(s) * height + DVec3::Y * radius).normalize(),
            uv: DVec2::new(s, t),
        };
        for [from, middle, to] in facets(AROUND).filter(|_| self.side) {
            patch.face(&[point(from, 0.0), point(to, 0.0), point(middle, 1.0)]);
        }
        if self.bottom {
            cap(&mut patch, radius, -height / 2.0, false);
        }
        Ok(patch.finish(self.solid, Repairs::default()))
    }
}

/// A disc across Y. The lid's texture is upright when the top is tilted toward +Z, the floor's when it is tilted toward -Z.
fn cap(patch: &mut Patch, radius: f64, y: f64, lid: bool) {
    let up = if lid { -1.0 } else { 1.0 };
    let mut rim: Vec<Point> = facets(AROUND)
        .map(|[from, ..]| around(from))
        .map(|d| Point { place: d * radius + DVec3::Y * y, normal: DVec3::Y * -up, uv: DVec2::new(0.5 + 0.5 * d.x, 0.5 + 0.5 * up * d.z) })
        .collect();
    if !lid {
        rim.reverse();
    }
    patch.face(&rim);
}
