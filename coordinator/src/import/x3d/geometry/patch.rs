//! A mesh whose corners are computed: what the primitives are made with.

use super::{Geometry, error::Repairs};
use crate::import::{
    mesh::{Channel, Mesh},
    weld::Pool,
};
use glam::{DVec2, DVec3};

/// A corner with its exact normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) place: DVec3,
    pub(super) normal: DVec3,
    pub(super) uv: DVec2,
}

/// Polygons in the making; equal places become one vertex.
#[derive(Debug, Default)]
pub(super) struct Patch {
    places: Pool<3>,
    mesh: Mesh,
    normals: Channel<[f32; 3]>,
    uv: Channel<[f32; 2]>,
}

impl Patch {
    /// Adds a polygon, counter-clockwise seen from the front.
    pub(super) fn face(&mut self, points: &[Point]) {
        let ids: Vec<u32> = points.iter().map(|p| self.places.id(p.place.as_vec3().to_array())).collect();
        self.mesh.push_polygon(ids);
        for p in points {
            self.normals.push(p.normal.as_vec3().to_array());
            self.uv.push(p.uv.as_vec2().to_array());
        }
    }

    pub(super) fn finish(mut self, solid: bool, repairs: Repairs) -> Geometry {
        self.mesh.positions = self.places.values;
        self.mesh.normals = Some(self.normals);
        self.mesh.uv_sets = vec![self.uv];
        Geometry { mesh: self.mesh, two_sided: !solid, repairs }
    }
}
