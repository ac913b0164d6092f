//! Spine-aligned cross-section planes (SCP) of an Extrusion: X3D 3.3, 13.3.5.3 and 13.3.5.4.

use glam::{DMat3, DVec3};

/// Sine of the angle below which three points of a spine are on a line; the rounding of f32 coordinates stays below it.
const COLLINEAR: f64 = 1e-6;

/// For each point of a spine, its plane's axes X, Y (along the spine), Z as columns: a rotation.
///
/// Coincident points have the same plane, so the rules are applied to the spine without repetitions.
pub(super) fn frames(spine: &[DVec3]) -> Vec<DMat3> {
    let mut distinct: Vec<DVec3> = vec![];
    let mut which = Vec::with_capacity(spine.len());
    for p in spine {
        if distinct.last() != Some(p) {
            distinct.push(*p);
        }
        which.push(distinct.len() - 1);
    }
    let of_distinct = of_distinct(&distinct);
    which.into_iter().map(|i| of_distinct[i]).collect()
}

/// The frames of a spine whose neighbours differ.
fn of_distinct(spine: &[DVec3]) -> Vec<DMat3> {
    let n = spine.len();
    if n < 2 {
        return vec![DMat3::IDENTITY; n];
    }
    let closed = n > 3 && spine[0] == spine[n - 1];
    let neighbours = |i: usize| match i {
        0 if closed => Some((n - 2, 1)),
        i if i == n - 1 && closed => Some((n - 2, 1)),
        i if i == 0 || i == n - 1 => None,
        i => Some((i - 1, i + 1)),
    };
    let mut z: Vec<Option<DVec3>> = (0..n)
        .map(|i| {
            let (before, after) = neighbours(i)?;
            let (to, from) = (spine[after] - spine[i], spine[before] - spine[i]);
            let across = to.cross(from);
            (across.length() > COLLINEAR * to.length() * from.length()).then(|| across.normalize())
        })
        .collect();
    let Some(first) = z.iter().flatten().next().copied() else {
        return vec![straight(spine); n];
    };
    let mut previous = first;
    for z in &mut z {
        let own = z.unwrap_or(previous);
        previous = if own.dot(previous) < 0.0 { -own } else { own };
        *z = Some(previous);
    }
    if closed {
        z[n - 1] = z[0];
    }
    let y = |i: usize| {
        let (before, after) = neighbours(i).unwrap_or(if i == 0 { (0, 1) } else { (n - 2, n - 1) });
        // A spine that turns back on itself has no direction at the turn; the one it came in is as good as any.
        (spine[after] - spine[before]).try_normalize().unwrap_or_else(|| (spine[i] - spine[before]).normalize_or_zero())
    };
    (0..n).map(|i| frame(y(i), z[i].unwrap_or(first))).collect()
}

/// The frame with this Y and a Z as near as possible to the given one, which an inherited one need not be at right angles to Y.
fn frame(y: DVec3, z: DVec3) -> DMat3 {
    let z = (z - y * y.dot(z)).try_normalize().unwrap_or_else(|| y.any_orthonormal_vector());
    DMat3::from_cols(y.cross(z), y, z)
}

/// The one frame of a spine on a line: the smallest rotation that takes +Y along it; half a turn about X where it points to -Y.
fn straight(spine: &[DVec3]) -> DMat3 {
    let along = (spine[spine.len() - 1] - spine[0]).try_normalize().unwrap_or_else(|| (spine[1] - spine[0]).normalize_or_zero());
    let k = DVec3::Y.cross(along);
    let sine_squared = k.length_squared();
    if sine_squared == 0.0 {
        return if along.y < 0.0 { DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z) } else { DMat3::IDENTITY };
    }
    // (1 - cos) / sin² keeps its digits near half a turn, where the shorter 1 / (1 + cos) has none.
    let turned = |v: DVec3| v * along.y + k.cross(v) + k * (k.dot(v) * (1.0 - along.y) / sine_squared);
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn is_rotation(m: &DMat3) -> bool {
        (*m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12) && (m.determinant() - 1.0).abs() < 1e-12
    }

    #[test]
    fn a_straight_spine_turns_the_plane_as_a_whole() {
        let up = frames(&[DVec3::ZERO, DVec3::Y, DVec3::Y * 2.0]);
        assert_eq!(up, [DMat3::IDENTITY; 3]);
        let along_x = frames(&[DVec3::ZERO, DVec3::X])[0];
        assert_eq!((along_x.y_axis, along_x.z_axis, along_x.x_axis), (DVec3::X, DVec3::Z, DVec3::NEG_Y));
        for direction in [DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Y, DVec3::new(1e-5, -1.0, 0.0)] {
            let m = frames(&[DVec3::ZERO, direction])[1];
            assert!(is_rotation(&m) && m.y_axis.abs_diff_eq(direction.normalize(), 1e-9), "{direction}");
        }
        assert_eq!(frames(&[DVec3::ONE; 3]), [DMat3::IDENTITY; 3], "a single place");
    }

    #[test]
    fn bends_have_their_axis_and_straight_ends_inherit_it() {
        let spine =
            [DVec3::ZERO, DVec3::Y, DVec3::Y * 2.0, DVec3::new(1.0, 2.0, 0.0), DVec3::new(1.0, 2.0, 0.0), DVec3::new(2.0, 2.0, 0.0)];
        let m = frames(&spine);
        // (+X) x (-Y) = -Z at the bend, and everywhere.
        assert!(m.iter().all(|m| m.z_axis == DVec3::NEG_Z && is_rotation(m)));
        assert!(m[2].y_axis.abs_diff_eq(DVec3::new(1.0, 1.0, 0.0).normalize(), 1e-12));
        assert_eq!((m[0].y_axis, m[5].y_axis, m[3]), (DVec3::Y, DVec3::X, m[4]));
    }

    #[test]
    fn an_s_bend_does_not_flip_and_a_ring_closes() {
        let s = [DVec3::ZERO, DVec3::Y, DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 2.0, 0.0)];
        assert!(frames(&s).iter().all(|m| m.z_axis == DVec3::NEG_Z));
        let ring = [DVec3::X, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z, DVec3::X];
        let m = frames(&ring);
        assert!(m[0] == m[4] && m[0].y_axis.abs_diff_eq(DVec3::Z, 1e-12));
        let axis = m[0].z_axis;
        assert!(m.iter().all(|m| is_rotation(m) && m.z_axis == axis));
    }

    #[test]
    fn a_spine_that_turns_back_still_has_frames() {
        let back = [DVec3::ZERO, DVec3::Y, DVec3::ZERO, DVec3::new(0.0, 0.0, 3.0)];
        assert!(frames(&back).iter().all(is_rotation));
        assert!(frames(&back[..3]).iter().all(is_rotation));
    }

    proptest! {
        /// Spines on a small lattice are full of repetitions, straight runs, hairpins and rings: all frames are rotations.
        #[test]
        fn every_frame_is_a_rotation(points in prop::collection::vec(prop::array::uniform3(-1i8..=1), 1..9), scale in 1e-30f64..1e30) {
            let spine: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(p.map(f64::from)) * scale).collect();
            let frames = frames(&spine);
            prop_assert!(frames.len() == spine.len() && frames.iter().all(is_rotation));
        }
    }
}
