//! How a triangle lies in a texture: one rule for frames, for the tangents of normal maps and for those that importers complete.

use glam::DVec3;

/// How a triangle lies in a texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lie {
    /// Unit dP/du, in the triangle's plane.
    pub along_u: DVec3,
    /// 1, or -1 where the texture shows its mirror image: the bitangent is that times normal x tangent.
    pub side: f64,
}

impl Lie {
    /// Of a triangle with `corners` in metres and these texture coordinates; `None` where they or the triangle have no area to speak of.
    #[must_use]
    pub fn of(corners: [DVec3; 3], uv: [[f64; 2]; 3]) -> Option<Self> {
        let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let [a, b, c] = uv;
        let (dv1, dv2) = (b[1] - a[1], c[1] - a[1]);
        let det = (b[0] - a[0]) * dv2 - (c[0] - a[0]) * dv1;
        let along = (e1 * dv2 - e2 * dv1) * det.signum();
        let size = along.length();
        let usable = det != 0.0 && size > 1e-12 * (e1.length() + e2.length()) * (dv1.abs() + dv2.abs()) && e1.cross(e2).length() > 0.0;
        usable.then(|| Self { along_u: along / size, side: det.signum() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn the_texture_turns_and_mirrors() {
        assert_eq!(Lie::of(CORNERS, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), Some(Lie { along_u: DVec3::X, side: 1.0 }));
        assert_eq!(Lie::of(CORNERS, [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]), Some(Lie { along_u: DVec3::Y, side: -1.0 }));
        assert_eq!(Lie::of(CORNERS, [[9.0, 5.0], [9.0, 5.5], [8.5, 5.0]]), Some(Lie { along_u: DVec3::NEG_Y, side: 1.0 }));
    }

    #[test]
    fn without_area_there_is_none() {
        assert_eq!(Lie::of(CORNERS, [[0.5, 0.5]; 3]), None);
        assert_eq!(Lie::of(CORNERS, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
        assert_eq!(Lie::of([DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), None);
        assert_eq!(Lie::of(CORNERS, [[0.0, 0.0], [f64::NAN, 0.0], [0.0, 1.0]]), None);
    }
}
