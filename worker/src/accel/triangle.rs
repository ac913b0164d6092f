//! The watertight ray-triangle test of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
//!
//! The ray is sheared onto its largest axis, `K`; the signs of three edge functions decide. An edge shared by two triangles gives both the
//! same number with opposite sign, so no ray slips through between them; where an edge function is exactly zero it is taken again in f64.
//! Unlike the paper's, this version keeps the axes' cyclic order instead of the winding: nothing here is culled by facing.

use glam::Vec3;

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

    /// The crossing with 0 < t <= tmax, if there is one.
    #[inline(always)]
    pub(super) fn cross(&self, corners: &[Vec3; 3], tmax: f32) -> Option<Crossing> {
        let local = corners.map(|c| (c - self.origin).to_array());
        let x = local.map(|c| c[Self::X] - self.shear_x * c[K]);
        let y = local.map(|c| c[Self::Y] - self.shear_y * c[K]);
        let mut edge = [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]];
        if edge[0] == 0.0 || edge[1] == 0.0 || edge[2] == 0.0 {
            edge = exact_edges(x, y);
        }
        let negative = edge[0] < 0.0 || edge[1] < 0.0 || edge[2] < 0.0;
        let positive = edge[0] > 0.0 || edge[1] > 0.0 || edge[2] > 0.0;
        let det = edge[0] + edge[1] + edge[2];
        if (negative && positive) || det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let t = (edge[0] * local[0][K] + edge[1] * local[1][K] + edge[2] * local[2][K]) * self.shear_z * inverse;
        (t > 0.0 && t <= tmax).then(|| (t, edge[1] * inverse, edge[2] * inverse))
    }
}

/// The edge functions in f64, where the products of f32 numbers are exact.
#[cold]
fn exact_edges(x: [f32; 3], y: [f32; 3]) -> [f32; 3] {
    let (x, y) = (x.map(f64::from), y.map(f64::from));
    [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]].map(|e| e as f32)
}
