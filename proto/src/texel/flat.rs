//! One triangle as it lies in the texture.

use glam::DVec2;

/// Slack of the inside test, in barycentric units: a centre on an edge is inside.
pub(super) const EDGE: f64 = 1e-9;
/// What counts as nothing, in texels: texture coordinates are f32, so that edges that should coincide may differ by half of it in the
/// largest texture. Inside tests of slivers, which round worse, end that far beyond their boxes.
pub(super) const SLACK: f64 = 1e-3;
/// Bound of what an inside test's cross products may be wrong by, of the squared length of the triangle's edges: 90 roundings of f64.
const ROUNDING: f64 = 1e-14;

/// A triangle in texel coordinates, with the inverse of its edge matrix.
pub(super) struct Flat {
    pub(super) corners: [DVec2; 3],
    /// Rows of the inverse of [e1 e2]; `None` for a triangle without area in the texture.
    pub(super) inverse: Option<[DVec2; 2]>,
    pub(super) low: DVec2,
    pub(super) high: DVec2,
}

impl Flat {
    pub(super) fn new(uv: [[f32; 2]; 3], width: f64, height: f64) -> Self {
        let p = uv.map(|[u, v]| DVec2::new(f64::from(u) * width, f64::from(v) * height));
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let det = e1.perp_dot(e2);
        let inverse = (det.abs() > 1e-12).then(|| [DVec2::new(e2.y, -e2.x) / det, DVec2::new(-e1.y, e1.x) / det]);
        Self { corners: p, inverse, low: p[0].min(p[1]).min(p[2]), high: p[0].max(p[1]).max(p[2]) }
    }

    /// Barycentric weights of the second and third corner, unclamped.
    pub(super) fn bary(&self, at: DVec2) -> Option<DVec2> {
        let rows = self.inverse?;
        let d = at - self.corners[0];
        Some(DVec2::new(rows[0].dot(d), rows[1].dot(d)))
    }

    /// The same for a point of the triangle.
    pub(super) fn inside(&self, at: DVec2) -> Option<DVec2> {
        if at.cmplt(self.low - SLACK).any() || at.cmpgt(self.high + SLACK).any() {
            return None;
        }
        self.bary(at).filter(|b| b.x >= -EDGE && b.y >= -EDGE && b.x + b.y <= 1.0 + EDGE)
    }

    /// Between which x the triangle may lie in the band `low <= y < high`; `None` where it does not reach into it. No point that
    /// [`Self::inside`] accepts and no part of the triangle lies beside; what it has too much of is [`SLACK`] beyond each edge, and beyond
    /// tips.
    pub(super) fn extent(&self, low: f64, high: f64) -> Option<(f64, f64)> {
        let (bottom, top) = (low.max(self.low.y - SLACK), high.min(self.high.y + SLACK));
        if bottom >= high || top < low {
            return None;
        }
        let (e1, e2) = (self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]);
        // Its sign, rounded as for the inside test, tells on which side of its edges that has points.
        let (det, size) = (e1.perp_dot(e2), e1.length() + e2.length());
        let (mut left, mut right) = (self.low.x - SLACK, self.high.x + SLACK);
        for k in 0..3 {
            let from = self.corners[k];
            let edge = (self.corners[(k + 1) % 3] - from) * det.signum();
            let slack = SLACK * edge.length() + EDGE * det.abs() + ROUNDING * size * size;
            // Inside is where edge x (p - from) >= -slack: edge.y (x - from.x) <= most at the band's better border.
            let most = (edge.x * (bottom - from.y)).max(edge.x * (top - from.y)) + slack;
            if edge.y > 0.0 {
                right = right.min(from.x + most / edge.y);
            } else if edge.y < 0.0 {
                left = left.max(from.x + most / edge.y);
            } else if most < 0.0 {
                return None;
            }
        }
        (left <= right).then_some((left, right))
    }

    /// Whether the triangle may reach into a box, by the same measure.
    pub(super) fn meets(&self, low: DVec2, high: DVec2) -> bool {
        self.extent(low.y, high.y).is_some_and(|(left, right)| left < high.x && right >= low.x)
    }

    /// The point of the triangle within a box that is nearest to `to`, a point of the box outside of the triangle; `None` where the
    /// triangle does not reach into the box by more than [`SLACK`]: most charts end on the border of a texel.
    pub(super) fn nearest_within(&self, (low, high): (DVec2, DVec2), to: DVec2) -> Option<DVec2> {
        if self.low.cmpge(high - SLACK).any() || self.high.cmple(low + SLACK).any() {
            return None;
        }
        let mut polygon = self.corners.to_vec();
        for axis in 0..2 {
            polygon = clip(&polygon, |p| p[axis] - low[axis]);
            polygon = clip(&polygon, |p| high[axis] - p[axis]);
        }
        let middle = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
        if !(middle.cmpgt(low + SLACK).all() && middle.cmplt(high - SLACK).all()) {
            return None;
        }
        let edges = (0..polygon.len()).map(|k| (polygon[k], polygon[(k + 1) % polygon.len()]));
        let points = edges.map(|(a, b)| closest(to, a, b));
        points.min_by(|a, b| a.distance_squared(to).total_cmp(&b.distance_squared(to)))
    }
}

/// What of a convex polygon lies where `side` is not negative (Sutherland and Hodgman 1974).
fn clip(polygon: &[DVec2], side: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (at_p, at_q) = (side(*p), side(q));
        if at_p >= 0.0 {
            kept.push(*p);
        }
        if (at_p < 0.0) != (at_q < 0.0) {
            kept.push(*p + (q - *p) * (at_p / (at_p - at_q)));
        }
    }
    kept
}

/// Barycentric weights of the second and third corner moved onto the triangle.
pub(super) fn onto(bary: DVec2) -> DVec2 {
    let clamped = bary.max(DVec2::ZERO);
    clamped / (clamped.x + clamped.y).max(1.0)
}

/// The point of a segment that is nearest to `at`.
pub(super) fn closest(at: DVec2, a: DVec2, b: DVec2) -> DVec2 {
    let along = b - a;
    let square = along.length_squared();
    let t = if square > 0.0 { ((at - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    a + along * t
}
