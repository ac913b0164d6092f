//! A light as a camera: near, far and rectangle where the author left them to be found.
//!
//! Kamburelis 4.1 leaves open how; this follows his engine. Distances are measured along the light's direction for all lights that have one
//! (and from the position for point lights), to the corners of the boxes around what throws shadows and what receives them. Then far is
//! doubled and near halved, so that a shape that moves a little stays inside. A directional light whose rectangle is to be found and that
//! has no location is put one size of the box beside the box's corner that faces it, axis by axis.

use glam::DVec3;

/// A box around points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bounds {
    /// Around nothing.
    pub(super) const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// Grows it around a point.
    pub(super) fn add(&mut self, p: DVec3) {
        self.low = self.low.min(p);
        self.high = self.high.max(p);
    }

    /// The box around both.
    #[must_use]
    pub(super) fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Whether there is no point in it.
    pub(super) fn is_empty(self) -> bool {
        self.low.x > self.high.x
    }

    fn corners(self) -> impl Iterator<Item = DVec3> {
        (0..8).map(move |k| {
            let pick = |axis: usize| if k >> axis & 1 == 0 { self.low[axis] } else { self.high[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The least and greatest of a function over the corners.
    fn range(self, f: impl Fn(DVec3) -> f64) -> (f64, f64) {
        self.corners().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    }
}

/// From where distances are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rays {
    /// Along a direction from a point.
    Along(DVec3, DVec3),
    /// From a point all around.
    From(DVec3),
}

impl Rays {
    fn range(self, bounds: Bounds) -> (f64, f64) {
        match self {
            Rays::Along(origin, direction) => bounds.range(|c| (c - origin).dot(direction)),
            Rays::From(origin) => {
                let nearest = origin.clamp(bounds.low, bounds.high).distance(origin);
                (nearest, bounds.range(|c| c.distance(origin)).1)
            }
        }
    }
}

/// Near and far where they are to be found, metres.
pub(super) fn depth(rays: Rays, casters: Bounds, receivers: Bounds) -> (f64, f64) {
    if casters.is_empty() {
        return (0.1, 1.0);
    }
    let (nearest, farthest) = rays.range(casters);
    let receiving = if receivers.is_empty() { farthest } else { rays.range(receivers).1 };
    let far = 2.0 * farthest.min(receiving).max(0.0);
    if far <= 0.0 {
        return (0.1, 1.0); // All of it lies behind the light.
    }
    ((nearest.max(0.0) / 2.0).max(far / 1000.0), far)
}

/// Where a directional light stands that has no location of its own.
pub(super) fn location(direction: DVec3, casters: Bounds) -> DVec3 {
    if casters.is_empty() {
        return DVec3::ZERO;
    }
    let size = casters.high - casters.low;
    DVec3::select(direction.cmplt(DVec3::ZERO), casters.high + size, casters.low - size)
}

/// Left, bottom, right and top of the casters as seen along the light, metres; (-1, -1, 1, 1) without casters.
pub(super) fn rectangle(location: DVec3, direction: DVec3, up: DVec3, casters: Bounds) -> [f64; 4] {
    if casters.is_empty() {
        return [-1.0, -1.0, 1.0, 1.0];
    }
    let (left, right) = casters.range(|c| (c - location).dot(direction.cross(up)));
    let (bottom, top) = casters.range(|c| (c - location).dot(up));
    [left, bottom, right, top]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A head of 2.734 x 1.97 x 1.703 m on a thin post, and a plane of 146 m a side: values that his engine shows for such a scene.
    fn statue() -> Bounds {
        Bounds { low: DVec3::new(-1.367_187_5, -0.072_234, -0.851_562_5), high: DVec3::new(1.367_187_5, 3.171_71, 0.851_562_5) }
    }

    fn close(found: f64, wanted: f64) {
        assert!((found - wanted).abs() < 0.006, "{found} is not {wanted}");
    }

    #[test]
    fn automatic_values_are_those_of_the_papers_engine() {
        let direction = DVec3::new(0.0, -1.0, -1.0).normalize();
        let at = location(direction, statue());
        [(at.x, -4.10), (at.y, 6.42), (at.z, 2.55)].into_iter().for_each(|(a, b)| close(a, b));
        let up = super::super::space::upright(direction, DVec3::Y);
        let (near, far) = depth(Rays::Along(at, direction), statue(), Bounds::EMPTY);
        close(near, 1.75);
        close(far, 13.99);
        let found = rectangle(at, direction, up, statue());
        found.into_iter().zip([2.73, -3.38, 5.47, 0.11]).for_each(|(a, b)| close(a, b));
        let (near, far) = depth(Rays::Along(DVec3::new(0.0, 10.0, 10.0), direction), statue(), Bounds::EMPTY);
        close(near, 5.65);
        close(far, 29.59);
    }

    #[test]
    fn the_nearer_of_the_two_far_ends_counts_and_near_never_vanishes() {
        let casters = Bounds { low: DVec3::new(-1.0, -1.0, -5.0), high: DVec3::new(1.0, 1.0, 5.0) };
        let receivers = Bounds { low: DVec3::new(-1.0, -1.0, 0.0), high: DVec3::new(1.0, 1.0, 2.0) };
        // The light stands inside the casters' box.
        assert_eq!(depth(Rays::Along(DVec3::ZERO, DVec3::Z), casters, receivers), (0.004, 4.0));
        assert_eq!(depth(Rays::Along(DVec3::ZERO, DVec3::Z), Bounds::EMPTY, receivers), (0.1, 1.0));
        assert_eq!(depth(Rays::Along(DVec3::new(0.0, 0.0, 9.0), DVec3::Z), casters, receivers), (0.1, 1.0), "nothing ahead");
        let (near, far) = depth(Rays::From(DVec3::new(0.0, 0.0, 9.0)), casters, casters);
        assert_eq!(near, 2.0);
        close(far, 2.0 * 198f64.sqrt());
    }
}
