//! Triangle and quad sets (X3D 3.3, 11.4 and 32.4): by index or in order, single, in strips or in fans.
//!
//! In all of them colours, normals and texture coordinates go with the coordinates (`colorPerVertex` is ignored, as the specification
//! says), and `normalPerVertex` only decides how normals are generated: averaged at each vertex (within one strip or fan), or flat.

use super::{
    Composed, Geometry,
    composed::{Lookups, assemble, has_points},
    error::{GeometryError, Repairs},
    faces::Collector,
};
use crate::import::mesh::Smoothing;

/// How a run of vertices becomes faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// Every so many are a face.
    Single(usize),
    Strip,
    Fan,
}

macro_rules! indexed {
    ($(#[$doc:meta])* $name:ident, $shape:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub(crate) struct $name {
            /// The fields that all composed geometry has.
            pub(crate) composed: Composed,
            /// Indices into the coordinates.
            pub(crate) index: Vec<i32>,
        }

        impl $name {
            /// The faces as polygons.
            ///
            /// # Errors
            /// No points, no faces, or none that can be used.
            pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
                from_index(&self.composed, &self.index, $shape)
            }
        }
    };
}

macro_rules! counted {
    ($(#[$doc:meta])* $name:ident, $field:ident, $shape:expr, $label:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub(crate) struct $name {
            /// The fields that all composed geometry has.
            pub(crate) composed: Composed,
            /// Vertices of each run, at least 3.
            pub(crate) $field: Vec<i32>,
        }

        impl $name {
            /// The faces as polygons.
            ///
            /// # Errors
            /// No points, no faces, or none that can be used.
            pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
                from_counts(&self.composed, &self.$field, $shape, $label)
            }
        }
    };
}

indexed!(
    /// IndexedTriangleSet: every three indices are a triangle.
    IndexedTriangleSet,
    Shape::Single(3)
);
indexed!(
    /// IndexedQuadSet: every four indices are a quad.
    IndexedQuadSet,
    Shape::Single(4)
);
indexed!(
    /// IndexedTriangleStripSet: strips closed by -1.
    IndexedTriangleStripSet,
    Shape::Strip
);
indexed!(
    /// IndexedTriangleFanSet: fans closed by -1.
    IndexedTriangleFanSet,
    Shape::Fan
);
counted!(
    /// TriangleStripSet: strips of `stripCount` vertices.
    TriangleStripSet,
    strip_count,
    Shape::Strip,
    "stripCount"
);
counted!(
    /// TriangleFanSet: fans of `fanCount` vertices.
    TriangleFanSet,
    fan_count,
    Shape::Fan,
    "fanCount"
);

/// TriangleSet: every three coordinates are a triangle.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TriangleSet(pub(crate) Composed);

/// QuadSet: every four coordinates are a quad.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct QuadSet(pub(crate) Composed);

impl TriangleSet {
    /// The faces as polygons.
    ///
    /// # Errors
    /// No points, or no triangle that can be used.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        in_order(&self.0, 3)
    }
}

impl QuadSet {
    /// The faces as polygons.
    ///
    /// # Errors
    /// No points, or no quad that can be used.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        in_order(&self.0, 4)
    }
}

fn in_order(node: &Composed, size: usize) -> Result<Geometry, GeometryError> {
    let mut repairs = Repairs::default();
    with_faces(node, "coord", Shape::Single(size), &mut repairs, |faces| singles(faces, size, node.coord.len(), |i| i as i64))
}

fn from_index(node: &Composed, index: &[i32], shape: Shape) -> Result<Geometry, GeometryError> {
    let mut repairs = Repairs::default();
    with_faces(node, "index", shape, &mut repairs, |faces| {
        if let Shape::Single(size) = shape {
            singles(faces, size, index.len(), |i| i64::from(index[i]));
            return;
        }
        let mut start = 0;
        for (group, run) in index.split(|i| *i < 0).enumerate() {
            if !run.is_empty() {
                cut_run(faces, group as u32, shape, start, run.len(), |i| i64::from(index[i]));
            }
            start += run.len() + 1;
        }
    })
}

fn from_counts(node: &Composed, counts: &[i32], shape: Shape, field: &'static str) -> Result<Geometry, GeometryError> {
    let mut repairs = Repairs::default();
    let mut runs = vec![];
    let mut start = 0;
    for (at, count) in counts.iter().enumerate() {
        let wanted = usize::try_from(*count).unwrap_or_default();
        let length = wanted.min(node.coord.len() - start);
        if wanted < 3 {
            repairs.note("counts below 3 were passed over", field, at);
        } else if length < wanted {
            repairs.note("counts beyond the last point were cut off", field, at);
        }
        runs.push((start, length));
        start += length;
    }
    if start < node.coord.len() && !counts.is_empty() {
        repairs.note("points after the last count were left out", "coord", start);
    }
    with_faces(node, "coord", shape, &mut repairs, |faces| {
        for (group, (start, length)) in runs.iter().enumerate().filter(|(_, (_, length))| *length > 0) {
            cut_run(faces, group as u32, shape, *start, *length, |i| i as i64);
        }
    })
}

/// Every `size` entries of a list are a face.
fn singles(faces: &mut Collector<'_>, size: usize, length: usize, vertex: impl Fn(usize) -> i64) {
    for start in (0..length / size * size).step_by(size) {
        faces.face(0, (start..start + size).map(|i| (vertex(i), i)));
    }
    if !length.is_multiple_of(size) {
        faces.note("entries after the last whole face were left out", length / size * size);
    }
}

/// A strip or fan of a list from `start`. In a strip every second triangle is turned around, so that all look the same way.
fn cut_run(faces: &mut Collector<'_>, group: u32, shape: Shape, start: usize, length: usize, vertex: impl Fn(usize) -> i64) {
    if length < 3 {
        faces.note("runs of fewer than three vertices were left out", start);
        return;
    }
    for i in start..start + length - 2 {
        let corners = match shape {
            Shape::Fan => [start, i + 1, i + 2],
            _ if (i - start) % 2 == 1 => [i + 1, i, i + 2],
            _ => [i, i + 1, i + 2],
        };
        faces.face(group, corners.map(|c| (vertex(c), c)));
    }
}

fn with_faces(
    node: &Composed,
    field: &'static str,
    shape: Shape,
    repairs: &mut Repairs,
    collect: impl FnOnce(&mut Collector<'_>),
) -> Result<Geometry, GeometryError> {
    has_points(node)?;
    let mut collector = Collector::new(&node.coord, field, matches!(shape, Shape::Strip | Shape::Fan), repairs);
    collect(&mut collector);
    let faces = collector.finish()?;
    let smoothing = if node.normal_per_vertex { Smoothing::Shared(&faces.groups) } else { Smoothing::Flat };
    Ok(assemble(node, &faces, Lookups::VERTEX, smoothing, std::mem::take(repairs)))
}
