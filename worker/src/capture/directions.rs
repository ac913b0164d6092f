//! Directions of a gather, axis by axis, as its inner loops want them.

use crate::{bsdf::coat::visible_norm, scene::HORIZON};
use glam::Vec3;
use std::ops::Range;

/// Directions are padded to a multiple of this: the widest vector in use.
pub(super) const LANES: usize = 8;

/// Slices of x, y and z.
pub(super) type Axes<'a> = [&'a [f32]; 3];

/// Local directions, padded with zero vectors: lobes of those are zero, and nothing divides by them.
#[derive(Debug, Clone, Default)]
pub(super) struct Directions {
    axes: [Vec<f32>; 3],
    len: usize,
}

impl Directions {
    /// From local directions.
    pub(super) fn new(directions: &[Vec3]) -> Self {
        let mut new = Self::default();
        new.fill(directions.iter().copied());
        new
    }

    fn fill(&mut self, directions: impl Iterator<Item = Vec3>) {
        self.axes.iter_mut().for_each(Vec::clear);
        for d in directions {
            (0..3).for_each(|axis| self.axes[axis].push(d[axis]));
        }
        self.len = self.axes[0].len();
        let padded = self.len.next_multiple_of(LANES);
        self.axes.iter_mut().for_each(|axis| axis.resize(padded, 0.0));
    }

    /// How many directions there are, padding left out.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The `k`-th direction.
    pub(super) fn get(&self, k: usize) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|axis| self.axes[axis][k]))
    }

    /// All of them with padding.
    pub(super) fn all(&self) -> Axes<'_> {
        std::array::from_fn(|axis| self.axes[axis].as_slice())
    }

    /// A run of them with padding; it starts at a multiple of [`LANES`].
    pub(super) fn run(&self, range: &Range<usize>) -> Axes<'_> {
        std::array::from_fn(|axis| &self.axes[axis][range.start..range.end.next_multiple_of(LANES)])
    }
}

/// The lobes that share their samples: the views of a run of directions by the texel's mean normal, and what their densities are scaled
/// with.
#[derive(Debug, Clone, Default)]
pub(super) struct LobeSet {
    pub(super) views: Directions,
    /// For facets, what D is multiplied with for the density of visible normals; 0 in the padding.
    pub(super) norms: Vec<f32>,
}

impl LobeSet {
    /// For a run of directions seen by `normal`; `alpha` is the width of the facets' distribution, where there are facets.
    pub(super) fn fill(&mut self, directions: &Directions, range: Range<usize>, normal: Vec3, alpha: Option<f32>) {
        self.views.fill(range.map(|k| bent(directions.get(k), normal)));
        self.norms.clear();
        if let Some(alpha) = alpha {
            self.norms.extend((0..self.views.len()).map(|k| visible_norm(self.views.get(k).dot(normal), alpha * alpha)));
            self.norms.resize(self.views.axes[0].len(), 0.0);
        }
    }
}

/// A view bent up to the horizon of a normal: what [`Vertex::toward`](crate::scene::Vertex::toward) does, without a frame.
pub(super) fn bent(view: Vec3, normal: Vec3) -> Vec3 {
    let height = normal.dot(view);
    if height > 0.0 { view } else { (view + normal * (HORIZON - height)).normalize() }
}

/// [`bent`] of many.
#[inline(always)]
pub(super) fn bend_all(views: Axes<'_>, normal: Vec3, out: &mut [Vec<f32>; 3]) {
    let count = views[0].len();
    let [ox, oy, oz] = out;
    for o in [&mut *ox, &mut *oy, &mut *oz] {
        o.resize(count, 0.0);
    }
    let views = views[0].iter().zip(views[1]).zip(views[2]);
    for (((x, y), z), ((ox, oy), oz)) in views.zip(ox.iter_mut().zip(oy).zip(oz)) {
        let height = x * normal.x + y * normal.y + z * normal.z;
        let lift = if height > 0.0 { 0.0 } else { HORIZON - height };
        let (bx, by, bz) = (x + normal.x * lift, y + normal.y * lift, z + normal.z * lift);
        // A view on the horizon keeps 1 - height² of its squared length beside the normal.
        let scale = if height > 0.0 { 1.0 } else { 1.0 / (bx * bx + by * by + bz * bz).sqrt() };
        (*ox, *oy, *oz) = (bx * scale, by * scale, bz * scale);
    }
}

/// The mirror image of a direction about a normal.
#[inline(always)]
pub(super) fn reflect(w: Vec3, normal: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(w)) - w
}

/// The mirror image of a direction on the other side of the plane of a normal.
#[inline(always)]
pub(super) fn across(w: Vec3, normal: Vec3) -> Vec3 {
    w - normal * (2.0 * normal.dot(w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::above_horizon;

    #[test]
    fn many_bent_views_are_those_of_single_ones_and_those_of_a_vertex() {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let views: Vec<Vec3> = (0..9).map(|k| Vec3::new(-0.2 - 0.08 * k as f32, 0.1, 0.5).normalize()).collect();
        let directions = Directions::new(&views);
        let mut out = Default::default();
        bend_all(directions.all(), normal, &mut out);
        let basis = crate::sampling::warp::basis(normal);
        for (k, view) in views.iter().enumerate() {
            let single = bent(*view, normal);
            let local = above_horizon(Vec3::new(basis.0.dot(*view), basis.1.dot(*view), normal.dot(*view)));
            assert!((single - Vec3::new(out[0][k], out[1][k], out[2][k])).length() < 1e-6);
            assert!((single - (basis.0 * local.x + basis.1 * local.y + normal * local.z)).length() < 1e-6);
            assert!(single.dot(normal) > 0.0);
        }
        assert!(views.iter().any(|v| v.dot(normal) < 0.0) && views.iter().any(|v| v.dot(normal) > 0.0));
    }
}
