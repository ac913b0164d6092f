//! Texels that begin inside other geometry: moved out of it, or known to be hidden.
//!
//! A texel whose place lies under the foot of a wall or just behind one is black, and filtering draws its black out into what is seen. From
//! there eight rays run along the surface as far as the texel reaches; where the nearest thing is the back of a face, all sample points
//! that lie behind that face are moved in front of it, along the surface. A texel deeper inside, from which nearly everything seen is a
//! back, is hidden. Filtering tastes it where what is seen begins within a texel of it, so that it looks for the nearest face again, twice
//! as far, and is moved out there: inside a wall that two rooms share, each texel has the light of the room that it is nearer to. For the
//! others a visible neighbour stands in ([`bake`](super::bake)). Cost: eight short rays a texel, and five more for one that sees fronts.
//! Testing every sample would cost a ray for each and find the same faces.

use crate::{
    accel::{Ray, RayCount},
    sampling::{TexelKey, warp},
    scene::{BakeScene, Hit, Seen},
};
use glam::Vec3;
use kiln_proto::{
    math::sin_cos_turns,
    texel::{SurfacePoint, SurfaceRaster, Texel},
};

/// Rays along the surface.
const AROUND: u32 = 8;
/// Faces whose normals have less than this squared beside the surface's lie along it: there is no way out of them within the texel.
const STEEP: f32 = 0.06;
/// How far in front of a face points are moved, in units of the larger of both lifts.
const BEFORE: f32 = 4.0;
/// How far a hidden texel looks for its way out, in reaches ([`SurfaceRaster::reach`]): a texel's diagonal where it shows its centre.
pub(super) const FAR: f32 = 2.0;
/// Cosine-distributed rays, a square of them, of which so many must hit backs before a texel is hidden.
const SEEN: (u32, u32) = (4, 12);

/// A face that points are moved in front of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Push {
    /// A point just in front of it, and its normal.
    before: Vec3,
    normal: Vec3,
    /// Along the surface, for each metre behind the face.
    slide: Vec3,
}

impl Push {
    /// A position moved in front of the face, along the surface; one that lies there already stays.
    pub(crate) fn out(&self, position: Vec3) -> Vec3 {
        position + self.slide * (self.before - position).dot(self.normal).max(0.0)
    }
}

/// Looks around from texels of one surface.
pub(super) struct Lookout<'a> {
    pub(super) scene: &'a BakeScene,
    pub(super) surface: usize,
    pub(super) raster: &'a SurfaceRaster,
}

impl Lookout<'_> {
    /// The face that a texel's points must be moved in front of, if its place lies no farther behind one than `reaches` times what the
    /// texel reaches.
    pub(super) fn push(&self, texel: &Texel, reaches: f32, key: TexelKey, rays: &mut RayCount) -> Option<Push> {
        let vertex = self.scene.vertex_at(self.surface, &self.raster.centre(texel), texel.frame);
        let (own, tmax) = (self.scene.prim(vertex.prim), self.raster.reach(texel) * reaches);
        let mut nearest: Option<(Hit, Vec3)> = None;
        for k in 0..AROUND {
            let (sin, cos) = sin_cos_turns(k as f32 / AROUND as f32);
            let direction = own.frame.tangent * cos + own.frame.bitangent * sin;
            let ray = Ray { origin: vertex.lifted, direction, tmax };
            if let Seen::Hit(hit, _) = self.scene.closest(&ray, || key.salt(k, 0), rays)
                && nearest.is_none_or(|(least, _)| hit.t < least.t)
            {
                nearest = Some((hit, direction));
            }
        }
        let (hit, direction) = nearest?;
        let face = self.scene.prim(hit.prim);
        let normal = face.frame.normal;
        let beside = normal - own.frame.normal * own.frame.normal.dot(normal);
        let square = beside.length_squared();
        if normal.dot(direction) <= 0.0 || square < STEEP {
            return None;
        }
        let before = vertex.lifted + direction * hit.t + normal * (BEFORE * own.lift.max(face.lift));
        // A wall of two layers in one place shows its back first as rounding has it; there is no way out through the other.
        let way = Ray { origin: vertex.lifted, direction: before - vertex.lifted, tmax: 1.0 };
        let is_open = !self.scene.meets_front(&way, rays);
        is_open.then_some(Push { before, normal, slide: beside / square })
    }

    /// Whether nearly all that is seen from a texel's place, once moved, are backs of faces.
    pub(super) fn is_hidden(&self, texel: &Texel, push: Option<&Push>, key: TexelKey, rays: &mut RayCount) -> bool {
        let centre = self.raster.centre(texel);
        let position = push.map_or(centre.position, |p| p.out(centre.position));
        let vertex = self.scene.vertex_at(self.surface, &SurfacePoint { position, ..centre }, texel.frame);
        let (side, enough) = SEEN;
        let (mut backs, mut others) = (0, 0);
        for k in 0..side * side {
            let u = [k % side, k / side].map(|i| (i as f32 + 0.5) / side as f32);
            let direction = vertex.frame.to_world(warp::cosine_hemisphere(u));
            let ray = Ray::unbounded(vertex.origin(direction), direction);
            match self.scene.closest(&ray, || key.salt(k, 1), rays) {
                Seen::Hit(hit, _) if self.scene.prim(hit.prim).frame.normal.dot(direction) > 0.0 => backs += 1,
                _ => others += 1,
            }
            if others > side * side - enough {
                return false;
            }
        }
        backs >= enough
    }
}
