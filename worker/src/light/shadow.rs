//! Who is in the shadow of a light without area: always what it does not see, or what X3D's fields say (`--x3d-shadows strict`).
//!
//! Shadows need no map here, they are traced; a map's fields matter only where it ends. Parts that cast no shadow are invisible to the
//! shadow rays of these lights and to nothing else: paths, and with them the light of emissive surfaces and of the environment, always see
//! them. Were next-event estimation blind to a part that the same light's other technique sees, the answer would depend on their weights.

use glam::Vec3;
use kiln_proto::{
    math,
    scene::{Light, LightShape, Part, Projection, ShadowRules},
};

/// What has to be known of a shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shadow {
    /// It is decided without a ray: the share of light that is left.
    Known(f32),
    /// A ray decides; where it is blocked this share is left.
    Trace {
        /// 1 - shadowIntensity.
        left: f32,
    },
}

/// How the light with this index shadows a position on a part.
#[must_use]
pub fn shadow(rules: ShadowRules, light: &Light, index: u32, part: &Part, position: Vec3) -> Shadow {
    if !rules.strict {
        return Shadow::Trace { left: 0.0 };
    }
    if !(light.casts_shadows || part.receive_shadows.contains(&index)) {
        return Shadow::Known(1.0);
    }
    let left = 1.0 - light.shadow_intensity;
    if rules.outside_is_shadowed && !is_on_map(light, position) { Shadow::Known(left) } else { Shadow::Trace { left } }
}

/// Whether a position falls on a light's shadow map: beside it or behind the light it does not, however far away it may. The map of a
/// point light is a cube, which has no outside, and a light of a format without shadow maps has none that could end.
fn is_on_map(light: &Light, position: Vec3) -> bool {
    let p = &light.projection;
    if *p == Projection::default() {
        return true;
    }
    match light.shape {
        LightShape::Point { .. } => true,
        LightShape::Directional { direction } => {
            let [_, x, y] = seen_along(direction.into(), p, position - Vec3::from_array(p.location));
            let [left, bottom, right, top] = p.rectangle;
            (left..=right).contains(&x) && (bottom..=top).contains(&y)
        }
        LightShape::Spot { position: from, direction, .. } => {
            let [depth, x, y] = seen_along(direction.into(), p, position - Vec3::from_array(from));
            // At half a turn the map would be all that lies in front.
            let (sin, cos) = math::sin_cos_turns(p.angle / (4.0 * std::f32::consts::PI));
            depth > 0.0 && x.abs() * cos <= depth * sin && y.abs() * cos <= depth * sin
        }
    }
}

/// A vector along the direction, sideways and upwards.
fn seen_along(direction: Vec3, p: &Projection, v: Vec3) -> [f32; 3] {
    let up = Vec3::from_array(p.up);
    [v.dot(direction), v.dot(direction.cross(up)), v.dot(up)]
}

#[cfg(test)]
mod tests {
    use super::super::tests::light;
    use super::*;

    const STRICT: ShadowRules = ShadowRules { strict: true, outside_is_shadowed: false };

    fn sun() -> Light {
        let shape = LightShape::Directional { direction: [0.0, -1.0, 0.0] };
        let rectangle = [-1.0, -2.0, 3.0, 4.0];
        let projection = Projection { up: [0.0, 0.0, -1.0], rectangle, location: [10.0, 5.0, 0.0], ..Projection::default() };
        Light { projection, shadow_intensity: 0.75, casts_shadows: false, ..light(shape) }
    }

    #[test]
    fn only_strict_shadows_ask_who_receives_them() {
        let (part, receiver) = (Part::plain("p", 0, 1), Part { receive_shadows: vec![2], ..Part::plain("p", 0, 1) });
        assert_eq!(shadow(ShadowRules::default(), &sun(), 2, &part, Vec3::ZERO), Shadow::Trace { left: 0.0 });
        assert_eq!(shadow(STRICT, &sun(), 2, &part, Vec3::ZERO), Shadow::Known(1.0));
        assert_eq!(shadow(STRICT, &sun(), 2, &receiver, Vec3::ZERO), Shadow::Trace { left: 0.25 });
        assert_eq!(shadow(STRICT, &sun(), 1, &receiver, Vec3::ZERO), Shadow::Known(1.0), "another light");
        let casting = Light { casts_shadows: true, ..sun() };
        assert_eq!(shadow(STRICT, &casting, 2, &part, Vec3::ZERO), Shadow::Trace { left: 0.25 });
    }

    #[test]
    fn beside_the_map_is_shadow_where_that_is_asked_for() {
        let receiver = Part { receive_shadows: vec![0], ..Part::plain("p", 0, 1) };
        let rules = ShadowRules { outside_is_shadowed: true, ..STRICT };
        let on = |light: &Light, p: [f32; 3]| shadow(rules, light, 0, &receiver, p.into()) == Shadow::Trace { left: 0.25 };
        // Down is forward, -Z is up, so +X is to the right: x in [9, 13], z in [-4, 2].
        for (p, expected) in [([10.0, 0.0, 0.0], true), ([12.9, -99.0, -3.9], true), ([8.9, 0.0, 0.0], false), ([10.0, 0.0, 2.1], false)] {
            assert_eq!(on(&sun(), p), expected, "{p:?}");
        }
        let shape = LightShape::Spot {
            position: [0.0; 3],
            direction: [0.0, 0.0, -1.0],
            cut_off: 0.4,
            beam_width: 0.4,
            profile: kiln_proto::scene::SpotProfile::Linear,
        };
        let projection = Projection { up: [0.0, 1.0, 0.0], angle: std::f32::consts::FRAC_PI_2, ..Projection::default() };
        let spot = Light { shape, projection, ..sun() };
        for (p, expected) in [([1.9, -1.9, -2.0], true), ([2.1, 0.0, -2.0], false), ([0.0, 2.1, -2.0], false), ([0.0, 0.0, 1.0], false)] {
            assert_eq!(on(&spot, p), expected, "{p:?}");
        }
        assert!(on(&Light { projection: Projection::default(), ..sun() }, [9.0; 3]), "an inlined glTF file's");
        assert!(on(&Light { shape: LightShape::Point { position: [0.0; 3] }, ..sun() }, [9.0; 3]), "a cube has no outside");
    }
}
