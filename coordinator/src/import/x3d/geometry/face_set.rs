//! IndexedFaceSet (X3D 3.3, 13.3.6).
//!
//! `convex` is not among the fields: every polygon is looked at before it is cut, so that a concave one under `convex TRUE`, which the
//! specification leaves undefined and exporters write all the time, comes out right as well.

use super::{
    Composed, Geometry,
    composed::{Lookup, Lookups, assemble, crease, has_points},
    error::{GeometryError, Repairs},
    faces::{Collector, Faces},
};

/// The fields of an IndexedFaceSet.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct IndexedFaceSet {
    /// The fields that all composed geometry has.
    pub(crate) composed: Composed,
    /// Corners of each face, closed by -1.
    pub(crate) coord_index: Vec<i32>,
    /// Colours of corners or faces. Empty: as the coordinates, or one a face in order.
    pub(crate) color_index: Vec<i32>,
    /// Normals of corners or faces. Empty: as the coordinates, or one a face in order.
    pub(crate) normal_index: Vec<i32>,
    /// Texture coordinates of corners. Empty: as the coordinates.
    pub(crate) tex_coord_index: Vec<i32>,
    /// Radians: edges between faces that differ by less are smooth, where normals are generated.
    pub(crate) crease_angle: f32,
}

impl IndexedFaceSet {
    /// The faces as polygons, each with the number that it has among the usable ones. Cost: n log n in the corners.
    ///
    /// # Errors
    /// No points, no faces, or none that can be used.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        has_points(&self.composed)?;
        let mut repairs = Repairs::default();
        let faces = self.faces(&mut repairs)?;
        let smoothing = crease(self.crease_angle, &mut repairs);
        let lookups = Lookups {
            normal: per(self.composed.normal_per_vertex, &self.normal_index),
            color: per(self.composed.color_per_vertex, &self.color_index),
            tex_coord: per(true, &self.tex_coord_index),
        };
        Ok(assemble(&self.composed, &faces, lookups, smoothing, repairs))
    }

    fn faces(&self, repairs: &mut Repairs) -> Result<Faces, GeometryError> {
        let mut collector = Collector::new(&self.composed.coord, "coordIndex", false, repairs);
        let mut start = 0;
        for run in self.coord_index.split(|i| *i < 0) {
            if !run.is_empty() {
                collector.face(0, run.iter().enumerate().map(|(k, i)| (i64::from(*i), start + k)));
            }
            start += run.len() + 1;
        }
        collector.finish()
    }
}

/// The rule of colours and normals: by corner or by face, through an index list where there is one.
fn per(vertex: bool, list: &[i32]) -> Lookup<'_> {
    match (vertex, list.is_empty()) {
        (true, true) => Lookup::Vertex,
        (true, false) => Lookup::List(list),
        (false, true) => Lookup::Face,
        (false, false) => Lookup::FaceList(list),
    }
}
