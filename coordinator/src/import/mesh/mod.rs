//! Polygon meshes that importers share: flat arrays of polygons with attributes at their corners, and the tools that work on them.
//!
//! Attributes hang at corners (a vertex as one polygon sees it), each through an index of its own, as X3D and OBJ have them: a seam of a
//! texture or a crease then needs no second copy of the position, and what is one vertex stays one for smoothing. glTF's form, one index
//! for all attributes, is the special case in which all indices are equal. The alternative, splitting vertices at once into that form,
//! loses who was joined with whom before `normals` can ask.

mod ears;
mod normals;
mod polygon;
mod texture;
mod transform;

pub use normals::{Smoothing, smooth};
pub use polygon::{Cut, has_no_area, newell, triangulate};
pub use texture::box_mapping;
pub use transform::{Overflow, axis_angle, for_normals, stretch};

use glam::{DVec3, Vec3};
use std::ops::Range;

/// Values with an index for every corner of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel<T> {
    /// The values.
    pub values: Vec<T>,
    /// For each corner of the mesh, in its order, an index into `values`; one beyond them, such as `u32::MAX`, where a corner has none.
    pub at: Vec<u32>,
}

impl<T> Default for Channel<T> {
    fn default() -> Self {
        Self { values: vec![], at: vec![] }
    }
}

impl<T: Copy> Channel<T> {
    /// The value at a corner, where it has one.
    #[must_use]
    pub fn find(&self, corner: usize) -> Option<T> {
        self.values.get(*self.at.get(corner)? as usize).copied()
    }

    /// The value at a corner of a channel in which every corner has one.
    #[must_use]
    pub fn get(&self, corner: usize) -> T {
        self.values[self.at[corner] as usize]
    }

    /// Adds a corner with a value of its own.
    pub fn push(&mut self, value: T) {
        self.at.push(self.values.len() as u32);
        self.values.push(value);
    }
}

/// Polygons in the space of their node, counter-clockwise seen from the front.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions, in the node's unit of length.
    pub positions: Vec<[f32; 3]>,
    /// Corners of all polygons one after the other: indices into `positions`.
    pub corners: Vec<u32>,
    /// Where each polygon's run of corners ends.
    pub ends: Vec<u32>,
    /// Unit normals at corners. None: flat.
    pub normals: Option<Channel<[f32; 3]>>,
    /// Sets of texture coordinates at corners, v up. Corners may lack them.
    pub uv_sets: Vec<Channel<[f32; 2]>>,
    /// Colours (RGBA, as the file has them) at corners.
    pub colours: Option<Channel<[f32; 4]>>,
}

impl Mesh {
    /// Number of polygons.
    #[must_use]
    pub fn polygon_count(&self) -> usize {
        self.ends.len()
    }

    /// Runs of corners, one a polygon.
    pub fn polygons(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| start as usize..*end as usize)
    }

    /// The run of corners of one polygon.
    #[must_use]
    pub fn run(&self, polygon: usize) -> Range<usize> {
        let start = if polygon == 0 { 0 } else { self.ends[polygon - 1] };
        start as usize..self.ends[polygon] as usize
    }

    /// Adds a polygon of these positions; channels are the caller's.
    pub fn push_polygon(&mut self, corners: impl IntoIterator<Item = u32>) {
        self.corners.extend(corners);
        self.ends.push(self.corners.len() as u32);
    }

    /// Where a corner lies.
    #[must_use]
    pub fn place(&self, corner: usize) -> DVec3 {
        Vec3::from_array(self.positions[self.corners[corner] as usize]).as_dvec3()
    }

    /// Cuts one polygon into triangles of its corners, counted from the start of its run. Cost: linear for a convex one, see
    /// [`triangulate`] for others.
    #[must_use]
    pub fn cut(&self, polygon: usize) -> Cut {
        let places: Vec<DVec3> = self.run(polygon).map(|c| self.place(c)).collect();
        triangulate(&places)
    }

    /// Turns every polygon around, so that its back becomes its front. Normals stay as they are.
    pub fn reverse(&mut self) {
        let runs: Vec<Range<usize>> = self.polygons().collect();
        for run in runs {
            self.corners[run.clone()].reverse();
            let channels = self.uv_sets.iter_mut().map(|c| &mut c.at);
            let channels = channels.chain(self.normals.as_mut().map(|c| &mut c.at)).chain(self.colours.as_mut().map(|c| &mut c.at));
            channels.for_each(|at| at[run.clone()].reverse());
        }
    }
}

#[cfg(test)]
pub(in crate::import) mod tests;
