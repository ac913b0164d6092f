//! Vertices of paths: where rays leave a surface, its hemisphere, and the normal that reflection sees.
//!
//! There are up to three normals at a point. The triangle's own decides what is hit from the front. The interpolated one owns the
//! hemisphere of the light field: light from below it counts only where the surface lets light through. The mapped one tilts reflection
//! alone.

use super::{BakeScene, Hit, Prim};
use crate::{
    accel::{Ray, RayCount},
    bsdf::Bsdf,
    sampling::warp,
};
use glam::Vec3;
use kiln_proto::{frame::Frame, texel::SurfacePoint};

/// A view below the horizon of the normal that reflection sees is taken along it, this high: no point is black because a map or an
/// interpolated normal turns away from the viewer.
pub const HORIZON: f32 = 1e-3;

/// A point on a primitive, seen from its front.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// The primitive.
    pub prim: u32,
    /// World position lifted off the surface, metres: where rays start that leave its front.
    pub lifted: Vec3,
    /// The same behind the surface.
    pub sunk: Vec3,
    /// The frame of the hemisphere.
    pub frame: Frame,
    /// The frame of the normal that reflection sees: the same but for normal maps.
    pub shading: Frame,
    /// How it reflects there.
    pub bsdf: Bsdf,
}

/// A local direction, bent up to the horizon where it lies below.
#[must_use]
#[inline]
pub fn above_horizon(w: Vec3) -> Vec3 {
    if w.z > 0.0 { w } else { w.with_z(HORIZON).normalize() }
}

impl Vertex {
    /// A world direction toward the viewer as reflection sees it.
    #[must_use]
    #[inline]
    pub fn toward(&self, direction: Vec3) -> Vec3 {
        above_horizon(self.shading.to_local(direction))
    }

    /// A world direction toward a light as reflection sees it; `None` where light from there leaks below the surface's own horizon, or
    /// above it while reflection looks below.
    #[must_use]
    #[inline]
    pub fn arriving(&self, direction: Vec3) -> Option<Vec3> {
        let wi = self.shading.to_local(direction);
        (wi.z * self.frame.normal.dot(direction) > 0.0).then_some(wi)
    }

    /// Where a ray into a direction starts.
    #[must_use]
    #[inline]
    pub fn origin(&self, direction: Vec3) -> Vec3 {
        if self.frame.normal.dot(direction) >= 0.0 { self.lifted } else { self.sunk }
    }

    /// Where a point is seen from: the origin whose rays, by [`Vertex::origin`], can meet it. A smooth surface is lifted far and sunk
    /// little, so direction and distance of a near light differ between the two, and so does its density. `None` between the lifted and
    /// the sunk horizon, where no ray of either goes.
    #[must_use]
    #[inline]
    pub fn origin_toward(&self, point: Vec3) -> Option<Vec3> {
        let height = |from: Vec3| self.frame.normal.dot(point - from);
        if height(self.lifted) >= 0.0 { Some(self.lifted) } else { (height(self.sunk) < 0.0).then_some(self.sunk) }
    }
}

impl BakeScene {
    /// The point of a primitive with these weights of its second and third corner, lifted off its front.
    #[inline]
    pub fn lifted(&self, prim: u32, bary: [f32; 2]) -> Vec3 {
        let p = self.prim(prim);
        p.inset(p.at(bary)) + p.frame.normal * p.lift
    }

    /// The vertex of a path where a ray met a primitive.
    #[inline]
    pub fn vertex(&self, hit: &Hit) -> Vertex {
        let (p, bary) = (self.prim(hit.prim), [hit.u, hit.v]);
        let frame = match self.smooth_normals(hit.prim) {
            Some(normals) => frame_of(p.normal_at(bary, normals)),
            None => p.frame,
        };
        self.vertex_of(hit.prim, bary, p.at(bary), frame)
    }

    /// The vertex at a point of a surface, in the frame of the surface there.
    #[inline]
    pub fn vertex_at(&self, surface: usize, point: &SurfacePoint, frame: Frame) -> Vertex {
        self.vertex_of(self.prim_of(surface, point.triangle), point.bary, point.position, frame)
    }

    #[inline]
    fn vertex_of(&self, prim: u32, bary: [f32; 2], position: Vec3, frame: Frame) -> Vertex {
        let p = self.prim(prim);
        let (lift, inset) = (p.frame.normal * p.lift, p.inset(position));
        let raised = self.smooth_normals(prim).map_or(inset, |normals| self.raised(p, inset, bary, normals));
        let shading = match p.is_mapped {
            true => Some(self.mapped_normal(prim, bary, frame.normal)).filter(|n| *n != frame.normal).map_or(frame, frame_of),
            false => frame,
        };
        Vertex { prim, lifted: raised + lift, sunk: inset - lift, frame, shading, bsdf: self.bsdf(prim, bary) }
    }

    /// A point moved onto the smooth surface, unless something stands between: then the ray would leave from beyond a wall. The ray that
    /// finds out is as short as the step and not counted among those that carry light.
    fn raised(&self, p: &Prim, at: Vec3, bary: [f32; 2], normals: &[Vec3; 3]) -> Vec3 {
        let raised = p.raised(at, bary, normals);
        let (from, step) = (at + p.frame.normal * p.lift, raised - at);
        if step.length_squared() <= p.lift * p.lift {
            return at;
        }
        let ray = Ray { origin: from, direction: step, tmax: 1.0 };
        if self.accel.occluded(&ray, &mut RayCount::default()) { at } else { raised }
    }

    #[inline]
    fn smooth_normals(&self, prim: u32) -> Option<&[Vec3; 3]> {
        self.prim(prim).smooth.map(|index| &self.normals[index as usize])
    }
}

#[inline]
fn frame_of(normal: Vec3) -> Frame {
    let (tangent, bitangent) = warp::basis(normal);
    Frame { tangent, bitangent, normal }
}
