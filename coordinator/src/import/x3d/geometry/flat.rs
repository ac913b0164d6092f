//! The surfaces of the Geometry2D component (X3D 3.3, 14.3): in the plane z = 0, their front toward +Z.

use super::{
    Composed, Geometry,
    composed::{Lookups, assemble},
    error::{GeometryError, Repairs, at_least_zero, finite, positive},
    faces::Collector,
    patch::{Patch, Point},
    round::AROUND,
};
use crate::import::mesh::Smoothing;
use glam::{DVec2, DVec3};
use kiln_proto::math::sin_cos_degrees;

/// The fields of a Rectangle2D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rectangle2D {
    /// Sides along X and Y.
    pub(crate) size: [f32; 2],
    /// Only the front is seen.
    pub(crate) solid: bool,
}

/// The fields of a Disk2D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disk2D {
    /// Radius of the hole; 0 for none.
    pub(crate) inner_radius: f32,
    /// Radius of the disc.
    pub(crate) outer_radius: f32,
    /// Only the front is seen.
    pub(crate) solid: bool,
}

/// The fields of an ArcClose2D.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ArcClose2D {
    /// `PIE` (closed through the centre) or `CHORD` (closed by a line).
    pub(crate) closure_type: String,
    /// Where the arc begins, radians from +X toward +Y.
    pub(crate) start_angle: f32,
    /// Where it ends, going counter-clockwise.
    pub(crate) end_angle: f32,
    /// Radius of the circle.
    pub(crate) radius: f32,
    /// Only the front is seen.
    pub(crate) solid: bool,
}

/// The fields of a TriangleSet2D.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TriangleSet2D {
    /// Three for each triangle.
    pub(crate) vertices: Vec<[f32; 2]>,
    /// Only the front is seen.
    pub(crate) solid: bool,
}

impl Default for Rectangle2D {
    fn default() -> Self {
        Self { size: [2.0; 2], solid: false }
    }
}

impl Default for Disk2D {
    fn default() -> Self {
        Self { inner_radius: 0.0, outer_radius: 1.0, solid: false }
    }
}

impl Default for ArcClose2D {
    fn default() -> Self {
        let quarter = std::f32::consts::FRAC_PI_2;
        Self { closure_type: "PIE".into(), start_angle: 0.0, end_angle: quarter, radius: 1.0, solid: false }
    }
}

/// A point of a circle about the origin; the texture's square lies around a circle of radius `outer`.
fn on_circle(degrees: f64, radius: f64, outer: f64) -> Point {
    let (sin, cos) = sin_cos_degrees(degrees);
    let place = DVec2::new(cos, sin) * radius;
    Point { place: place.extend(0.0), normal: DVec3::Z, uv: place / (2.0 * outer) + 0.5 }
}

impl Rectangle2D {
    /// One quad with the whole texture.
    ///
    /// # Errors
    /// Sides that are not positive numbers.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let half = DVec2::new(positive("size", self.size[0])?, positive("size", self.size[1])?) / 2.0;
        let corner = |u: f64, v: f64| Point {
            place: (half * DVec2::new(2.0 * u - 1.0, 2.0 * v - 1.0)).extend(0.0),
            normal: DVec3::Z,
            uv: DVec2::new(u, v),
        };
        let mut patch = Patch::default();
        patch.face(&[corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
        Ok(patch.finish(self.solid, Repairs::default()))
    }
}

impl Disk2D {
    /// One polygon of as many segments as a cylinder has; a hole is reached by a bridge from the rim. The texture's square lies around
    /// the outer circle.
    ///
    /// # Errors
    /// An outer radius that is not positive, an inner one outside it, and equal radii, which are a line.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let outer = positive("outerRadius", self.outer_radius)?;
        let inner = at_least_zero("innerRadius", self.inner_radius)?;
        if inner > outer {
            return Err(GeometryError::OutOfRange { field: "innerRadius", value: inner, wanted: "at most outerRadius" });
        }
        if inner == outer {
            return Err(GeometryError::Empty { why: "innerRadius equals outerRadius, which is a line" });
        }
        let at = |i: u32, radius: f64| on_circle(360.0 * f64::from(i) / f64::from(AROUND), radius, outer);
        let points: Vec<Point> = if inner > 0.0 {
            (0..=AROUND).map(|i| at(i, outer)).chain((0..=AROUND).rev().map(|i| at(i, inner))).collect()
        } else {
            (0..AROUND).map(|i| at(i, outer)).collect()
        };
        let mut patch = Patch::default();
        patch.face(&points);
        Ok(patch.finish(self.solid, Repairs::default()))
    }
}

impl ArcClose2D {
    /// One polygon with the segments that a disc has in this sector; equal angles, or those a turn apart, are the whole disc.
    ///
    /// # Errors
    /// A radius that is not positive, and angles that are not numbers.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let radius = positive("radius", self.radius)?;
        finite("startAngle", &[[self.start_angle]])?;
        finite("endAngle", &[[self.end_angle]])?;
        let mut repairs = Repairs::default();
        if !matches!(self.closure_type.as_str(), "PIE" | "CHORD") {
            repairs.note("values other than PIE and CHORD were read as PIE", "closureType", 0);
        }
        let from = f64::from(self.start_angle).to_degrees();
        let apart = f64::from(self.end_angle).to_degrees() - from;
        let whole = apart == 0.0 || apart.abs() >= 360.0;
        let sweep = if whole { 360.0 } else { apart.rem_euclid(360.0) };
        // Rounding noise of a quarter turn in f32 must not add a segment.
        let segments = (f64::from(AROUND) * sweep / 360.0 - 1e-4).ceil().max(1.0) as u32;
        let arc = (0..=segments).map(|i| on_circle(from + sweep * f64::from(i) / f64::from(segments), radius, radius));
        let mut points: Vec<Point> = arc.collect();
        if whole {
            points.pop();
        } else if self.closure_type != "CHORD" {
            points.push(on_circle(0.0, 0.0, radius));
        }
        if points.len() < 3 {
            return Err(GeometryError::Empty { why: "its arc is a line" });
        }
        let mut patch = Patch::default();
        patch.face(&points);
        Ok(patch.finish(self.solid, repairs))
    }
}

impl TriangleSet2D {
    /// Triangles, those that run clockwise turned around (a plane's back has no other front), with automatic texture coordinates.
    ///
    /// # Errors
    /// No triangle, and coordinates that are not numbers.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        finite("vertices", &self.vertices)?;
        let coord: Vec<[f32; 3]> = self.vertices.iter().map(|v| [v[0], v[1], 0.0]).collect();
        let mut repairs = Repairs::default();
        let mut faces = Collector::new(&coord, "vertices", false, &mut repairs);
        for start in (0..self.vertices.len() / 3 * 3).step_by(3) {
            let [a, b, c] = [0, 1, 2].map(|k| DVec2::from_array(self.vertices[start + k].map(f64::from)));
            let order = if (b - a).perp_dot(c - a) < 0.0 { [0, 2, 1] } else { [0, 1, 2] };
            faces.face(0, order.map(|k| ((start + k) as i64, start + k)));
        }
        if !self.vertices.len().is_multiple_of(3) {
            faces.note("entries after the last whole face were left out", self.vertices.len() / 3 * 3);
        }
        let faces = faces.finish()?;
        let node = Composed { coord, solid: self.solid, ..Composed::default() };
        Ok(assemble(&node, &faces, Lookups::VERTEX, Smoothing::Flat, repairs))
    }
}
