//! The watertight ray-triangle test of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
//!
//! The ray is sheared onto its largest axis, `K`; the signs of three edge functions decide. An edge shared by two triangles gives both the
//! same number with opposite sign, so no ray slips through between them; where an edge function is exactly zero it is taken again in f64.
//! Unlike the paper's, this version keeps the axes' cyclic order instead of the winding: nothing here is culled by facing.

use super::tree::Block;
use glam::{Vec3, Vec4};

/// What a test needs of a ray whose largest direction component lies along axis `K`.
pub(super) struct Sheared<const K: usize> {
    origin: Vec3,
    shear_x: f32,
    shear_y: f32,
    shear_z: f32,
}

/// t and the barycentric weights of the second and third corner.
pub(super) type Crossing = (f32, f32, f32);

impl<const K: usize> Sheared<K> {
    const X: usize = (K + 1) % 3;
    const Y: usize = (K + 2) % 3;

    #[inline(always)]
    pub(super) fn new(origin: Vec3, direction: Vec3) -> Self {
        let d = direction.to_array();
        let shear_z = 1.0 / d[K];
        Self { origin, shear_x: d[Self::X] * shear_z, shear_y: d[Self::Y] * shear_z, shear_z }
    }

    /// Calls `found` with lane and crossing of every triangle of a block that is crossed with 0 < t <= tmax.
    #[inline(always)]
    pub(super) fn cross(&self, block: &Block, tmax: f32, mut found: impl FnMut(usize, Crossing)) {
        let o = self.origin.to_array();
        let depth: [Vec4; 3] = std::array::from_fn(|c| block.corners[c][K] - o[K]);
        let x: [Vec4; 3] = std::array::from_fn(|c| (block.corners[c][Self::X] - o[Self::X]) - depth[c] * self.shear_x);
        let y: [Vec4; 3] = std::array::from_fn(|c| (block.corners[c][Self::Y] - o[Self::Y]) - depth[c] * self.shear_y);
        let edges = [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]];
        let (low, high) = (edges[0].min(edges[1]).min(edges[2]), edges[0].max(edges[1]).max(edges[2]));
        let inside = low.cmpge(Vec4::ZERO) | high.cmple(Vec4::ZERO);
        // The sign of an edge of zero counts only after it was taken again.
        let doubtful = (edges[0].cmpeq(Vec4::ZERO) | edges[1].cmpeq(Vec4::ZERO) | edges[2].cmpeq(Vec4::ZERO)).bitmask();
        let mut lanes = inside.bitmask() | doubtful;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let edge = if doubtful >> lane & 1 == 1 { exact_edges(x.map(|x| x[lane]), y.map(|y| y[lane])) } else { edges.map(|e| e[lane]) };
            if let Some(crossing) = self.finish(edge, depth.map(|d| d[lane]), tmax) {
                found(lane, crossing);
            }
        }
    }

    /// The crossing of one triangle, from its edge functions and the depths of its corners along the main axis.
    #[inline(always)]
    fn finish(&self, edge: [f32; 3], depth: [f32; 3], tmax: f32) -> Option<Crossing> {
        let negative = edge[0] < 0.0 || edge[1] < 0.0 || edge[2] < 0.0;
        let positive = edge[0] > 0.0 || edge[1] > 0.0 || edge[2] > 0.0;
        let det = edge[0] + edge[1] + edge[2];
        if (negative && positive) || det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let t = (edge[0] * depth[0] + edge[1] * depth[1] + edge[2] * depth[2]) * self.shear_z * inverse;
        (t > 0.0 && t <= tmax).then(|| (t, edge[1] * inverse, edge[2] * inverse))
    }
}

/// The edge functions in f64, where the products of f32 numbers are exact.
#[cold]
fn exact_edges(x: [f32; 3], y: [f32; 3]) -> [f32; 3] {
    let (x, y) = (x.map(f64::from), y.map(f64::from));
    [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]].map(|e| e as f32)
}
