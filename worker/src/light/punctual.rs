//! Lights without area: what a point, spot or directional light sends to a point, unshadowed.
//!
//! Everything that a light's own fields say is here: cone, falloff, the texture that colours it. Who is in its shadow is
//! [`super::shadow`]'s.

use glam::Vec3;
use kiln_proto::{
    math,
    scene::{Falloff, Light, LightShape, Mapping, Place, Scene, SpotProfile, TextureRef},
    units::Rgb,
};
use std::f32::consts::PI;

/// What a light sends to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    /// Unit world direction toward the light.
    pub direction: Vec3,
    /// Where its shadow ray ends: the light, or beyond the scene for a directional one.
    pub target: Vec3,
    /// Irradiance of a surface that faces it, W/m².
    pub light: Rgb,
    /// Its ambient term: times a material's ambient share and diffuse colour it is radiance reflected toward everywhere, W/(sr m²).
    pub ambient: Rgb,
}

/// A light without area, ready to be asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Punctual {
    aim: Aim,
    falloff: Falloff,
    intensity: Rgb,
    ambient: Rgb,
    texture: Option<TextureRef>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Aim {
    /// Into all directions, or into a cone.
    At { position: Vec3, cone: Option<Cone> },
    /// Travels along `direction`; `reach` leads out of the scene from anywhere in it, metres.
    Along { direction: Vec3, reach: f32 },
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Cone {
    axis: Vec3,
    cut_off: f32,
    beam_width: f32,
    cos_cut_off: f32,
    cos_beam_width: f32,
    profile: SpotProfile,
}

impl Punctual {
    /// A light of a scene.
    #[must_use]
    pub fn new(light: &Light, scene: &Scene) -> Self {
        let aim = match light.shape {
            LightShape::Point { position } => Aim::At { position: position.into(), cone: None },
            LightShape::Spot { position, direction, cut_off, beam_width, profile } => {
                let cos = |angle: f32| math::sin_cos_turns(angle / (2.0 * PI)).1;
                let (cos_cut_off, cos_beam_width) = (cos(cut_off), cos(beam_width));
                let cone = Cone { axis: direction.into(), cut_off, beam_width, cos_cut_off, cos_beam_width, profile };
                Aim::At { position: position.into(), cone: Some(cone) }
            }
            LightShape::Directional { direction } => Aim::Along { direction: direction.into(), reach: 2.0 * super::diameter(scene) },
        };
        Self { aim, falloff: light.falloff, intensity: light.intensity, ambient: light.ambient, texture: light.texture }
    }

    /// What it sends to a world position, metres; `None` where it sends nothing.
    #[must_use]
    #[inline]
    pub fn at(&self, scene: &Scene, position: Vec3) -> Option<Arrival> {
        let (direction, target, share) = match self.aim {
            Aim::Along { direction, reach } => (-direction, position - direction * reach, 1.0),
            Aim::At { position: from, cone } => {
                let toward = from - position;
                let squared = toward.length_squared();
                let distance = squared.sqrt();
                // A light that touches the point has no direction, and one by the inverse square no bound.
                if squared <= 0.0 || !squared.is_finite() {
                    return None;
                }
                let direction = toward / distance;
                let share = cone.map_or(1.0, |c| c.share(-direction)) * fall(self.falloff, distance);
                (direction, from, share)
            }
        };
        if share <= 0.0 || !share.is_finite() {
            return None;
        }
        let colour = self.texture.map_or(Rgb::WHITE, |t| projected(scene, &t, position)) * share;
        Some(Arrival { direction, target, light: self.intensity * colour, ambient: self.ambient * colour })
    }

    /// Roughly what it sends into a scene of this radius (metres), to choose among many lights: W.
    #[must_use]
    pub fn power(&self, radius: f32) -> f64 {
        let mean = f64::from((self.intensity + self.ambient).mean());
        let radius = f64::from(radius);
        match self.aim {
            Aim::Along { .. } => mean * f64::from(PI) * radius * radius,
            Aim::At { cone, .. } => {
                let solid_angle = cone.map_or(4.0, |c| 2.0 * f64::from(1.0 - c.cos_cut_off)) * f64::from(PI);
                mean * solid_angle * reach_squared(self.falloff, radius)
            }
        }
    }
}

impl Cone {
    /// The share of its intensity toward a unit direction away from it, [0, 1].
    fn share(&self, away: Vec3) -> f32 {
        let cos = self.axis.dot(away);
        match self.profile {
            _ if cos < self.cos_cut_off => 0.0,
            _ if cos >= self.cos_beam_width => 1.0,
            SpotProfile::Linear => {
                let angle = math::acos(f64::from(cos)) as f32;
                ((self.cut_off - angle) / (self.cut_off - self.beam_width)).clamp(0.0, 1.0)
            }
            SpotProfile::SquaredCosine => {
                let share = ((cos - self.cos_cut_off) / (self.cos_beam_width - self.cos_cut_off)).clamp(0.0, 1.0);
                share * share
            }
        }
    }
}

/// How `distance`, metres, weakens a light: 1/m² for the inverse square.
fn fall(falloff: Falloff, distance: f32) -> f32 {
    match falloff {
        Falloff::InverseSquare { range } => {
            let window = range.map_or(1.0, |r| {
                let ratio = (distance / r) * (distance / r);
                (1.0 - ratio * ratio).clamp(0.0, 1.0)
            });
            window / (distance * distance)
        }
        Falloff::Polynomial { radius, .. } if distance > radius => 0.0,
        Falloff::Polynomial { attenuation: [a, b, c], .. } => 1.0 / (a + b * distance + c * distance * distance).max(1.0),
    }
}

/// The square of the distance times the falloff there, at a typical distance in a scene of this radius, metres.
fn reach_squared(falloff: Falloff, radius: f64) -> f64 {
    match falloff {
        Falloff::InverseSquare { .. } => 1.0,
        Falloff::Polynomial { radius: own, .. } => {
            let typical = radius.min(f64::from(own));
            typical * typical * f64::from(fall(falloff, typical as f32))
        }
    }
}

/// The colour that a light's texture gives it at a position: white where its projector does not reach, as projected textures of surfaces
/// leave their colour.
fn projected(scene: &Scene, texture: &TextureRef, position: Vec3) -> Rgb {
    let Mapping::Projected { .. } = texture.mapping else { return Rgb::WHITE };
    // Only the position matters to a projector.
    let place = Place { surface: u32::MAX, triangle: 0, bary: [0.0; 2], position: position.to_array() };
    scene.texture_at(texture, &place).map_or(Rgb::WHITE, |[r, g, b, _]| Rgb::new(r, g, b))
}
