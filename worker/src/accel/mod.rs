//! The ray tracer: a wide bounding volume hierarchy over triangles, closest hits and occlusion.
//!
//! obvhs builds a binary tree (PLOC with reinsertion); [`tree`] collapses it into nodes of [`tree::WIDTH`] boxes kept axis by axis, which
//! the compiler turns into vector code, and the traversal is ours. obvhs's own traversals lost: its compressed tree clamps every ray to
//! t >= 1e-4, which breaks scenes a thousandth the size, and neither breaks ties. Which primitive is hit follows from the triangles alone:
//! the nearest, and of equally near ones the lowest index, so that another tree behind the same interface gives the same bytes.

mod traverse;
mod tree;
mod triangle;

#[cfg(test)]
mod tests;

use glam::Vec3;
use tree::Tree;

/// A half-open segment `origin + t · direction`, 0 < t <= `tmax`. The direction need not have unit length; t is in units of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start, metres; nothing is hit at t = 0.
    pub origin: Vec3,
    /// Direction, not zero.
    pub direction: Vec3,
    /// Farthest hit that counts.
    pub tmax: f32,
}

impl Ray {
    /// A ray without end.
    #[must_use]
    pub fn unbounded(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, tmax: f32::INFINITY }
    }
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Index of the triangle as given to [`Accel::build`].
    pub prim: u32,
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

/// How many rays were traced. The caller owns it: a counter inside the tree would be shared by all threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCount(pub u64);

/// A hierarchy over triangles.
#[derive(Debug)]
pub struct Accel {
    tree: Tree,
}

impl Accel {
    /// Builds the hierarchy. Cost: O(n log n); both sides of every triangle are hit.
    #[must_use]
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        Self { tree: Tree::build(triangles) }
    }

    /// The same hierarchy, in which triangle i has the number `numbers[i]`: ascending, so that ties go as before.
    #[must_use]
    pub fn numbered(mut self, numbers: &[u32]) -> Self {
        self.tree.renumber(numbers);
        self
    }

    /// The nearest triangle along a ray; of equally near ones the lowest index.
    #[must_use]
    #[inline]
    pub fn closest(&self, ray: &Ray, rays: &mut RayCount) -> Option<Hit> {
        rays.0 += 1;
        traverse::closest(&self.tree, ray, |_| true)
    }

    /// The nearest triangle along a ray of those that `meets` says yes to, which may be asked about any triangle on the way, in any order
    /// and more than once.
    #[must_use]
    #[inline]
    pub fn closest_where(&self, ray: &Ray, rays: &mut RayCount, meets: impl Fn(&Hit) -> bool) -> Option<Hit> {
        rays.0 += 1;
        traverse::closest(&self.tree, ray, meets)
    }

    /// Whether anything lies along a ray.
    #[must_use]
    #[inline]
    pub fn occluded(&self, ray: &Ray, rays: &mut RayCount) -> bool {
        rays.0 += 1;
        traverse::occluded(&self.tree, ray, |_| true)
    }

    /// Whether anything along a ray blocks it; `blocks` is asked about every triangle on the way until it says yes, in any order and
    /// perhaps more than once.
    #[must_use]
    #[inline]
    pub fn occluded_where(&self, ray: &Ray, rays: &mut RayCount, blocks: impl FnMut(&Hit) -> bool) -> bool {
        rays.0 += 1;
        traverse::occluded(&self.tree, ray, blocks)
    }
}
