//! Which texel centres lie strictly inside a triangle, row by row.

use glam::DVec2;

/// Distance from an edge, in texels, within which a centre counts as on it: texture coordinates are f32, so edges that should coincide
/// may differ by a thousandth of a texel in the largest texture.
const MARGIN: f64 = 0.01;

/// Visits the texels (x, y) of a `width` x `height` texture whose centres lie strictly inside the triangle `corners` (texel
/// coordinates), until `visit` answers false. Returns whether all were visited. Cost: the triangle's rows and texels.
pub(super) fn inside(corners: [DVec2; 3], width: u32, height: u32, mut visit: impl FnMut(u32, u32) -> bool) -> bool {
    let Some(edges) = half_planes(corners) else { return true };
    let [a, b, c] = corners;
    let clamp = |v: f64, n: u32| v.clamp(0.0, f64::from(n)) as u32;
    let (first, last) = (clamp(a.y.min(b.y).min(c.y).floor(), height), clamp(a.y.max(b.y).max(c.y).ceil(), height));
    for y in first..last {
        let centre = f64::from(y) + 0.5;
        let (mut low, mut high) = (0.0f64, f64::from(width));
        for (normal, offset) in edges {
            // The edge allows x with normal.x * x > rest.
            let rest = MARGIN - offset - normal.y * centre;
            if normal.x > 0.0 {
                low = low.max(rest / normal.x);
            } else if normal.x < 0.0 {
                high = high.min(rest / normal.x);
            } else if rest >= 0.0 {
                high = -1.0;
            }
        }
        // Centres x + 1/2 strictly between low and high.
        let (from, to) = ((low - 0.5).floor() + 1.0, (high - 0.5).ceil());
        if to > from {
            for x in clamp(from, width)..clamp(to, width) {
                if !visit(x, y) {
                    return false;
                }
            }
        }
    }
    true
}

/// Unit inward normals and offsets of the three edges; `None` for a triangle without area.
fn half_planes([a, b, c]: [DVec2; 3]) -> Option<[(DVec2, f64); 3]> {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 || !area.is_finite() {
        return None;
    }
    let side = area.signum();
    let edge = |p: DVec2, q: DVec2| {
        let d = q - p;
        let normal = DVec2::new(-d.y, d.x) * (side / d.length());
        (normal, -normal.dot(p))
    };
    Some([edge(a, b), edge(b, c), edge(c, a)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The rows agree with testing every texel.
        #[test]
        fn rows_agree_with_every_texel(p in prop::array::uniform6(-4.0f64..20.0)) {
            let corners = [DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]), DVec2::new(p[4], p[5])];
            let mut found = vec![];
            inside(corners, 16, 12, |x, y| { found.push((x, y)); true });
            let edges = half_planes(corners).unwrap();
            let strictly = |x: u32, y: u32, slack: f64| {
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                edges.iter().all(|(n, o)| n.dot(at) + o > MARGIN + slack)
            };
            for y in 0..12 {
                for x in 0..16 {
                    let is = found.contains(&(x, y));
                    prop_assert!(!strictly(x, y, 1e-9) || is, "{x},{y} is missing");
                    prop_assert!(strictly(x, y, -1e-9) || !is, "{x},{y} is too much");
                }
            }
        }
    }
}
