//! X3D's geometry nodes (3.3: clauses 11, 13, 14, 32) as polygon meshes.
//!
//! Every node is a plain struct with its X3D fields and their defaults, and a pure function that makes a mesh of it; nothing here knows a
//! parser, a scene or a place in a file. What browsers draw all the same (a face with a wrong index beside good ones, a strip that ends
//! early, too few normals) is repaired and counted in [`Repairs`]; an error is left for nodes of which nothing can be drawn.
//! Browsers differ in what they repair: where they do, the choice here is the one that keeps most of the author's faces.

mod box_node;
mod composed;
mod elevation;
mod error;
mod extrusion;
mod face_set;
mod faces;
mod flat;
mod frames;
mod patch;
mod round;
mod sets;

pub(crate) use box_node::BoxNode;
pub(crate) use composed::Composed;
pub(crate) use elevation::ElevationGrid;
pub(crate) use error::{GeometryError, Repairs};
pub(crate) use extrusion::Extrusion;
pub(crate) use face_set::IndexedFaceSet;
pub(crate) use flat::{ArcClose2D, Disk2D, Rectangle2D, TriangleSet2D};
pub(crate) use round::{Cone, Cylinder, Sphere};
pub(crate) use sets::{
    IndexedQuadSet, IndexedTriangleFanSet, IndexedTriangleSet, IndexedTriangleStripSet, QuadSet, TriangleFanSet, TriangleSet,
    TriangleStripSet,
};

use crate::import::mesh::Mesh;

/// What a geometry node is made into.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Geometry {
    /// Polygons with normals and at least one set of texture coordinates; the front is outside.
    pub(crate) mesh: Mesh,
    /// `solid FALSE`: the backs are seen as well.
    pub(crate) two_sided: bool,
    /// What had to be repaired.
    pub(crate) repairs: Repairs,
}

#[cfg(test)]
mod tests;
