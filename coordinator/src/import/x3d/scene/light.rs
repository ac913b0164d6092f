//! From X3D's lights to the canonical ones (ISO/IEC 19775-1: 17), with all fields of Kamburelis's extension checked.
//!
//! X3D's lights have no unit: by its lighting model a Lambert surface that faces a light of intensity 1 has radiance Kd, so it receives the
//! irradiance pi. `--light-units physical` takes the numbers as W/sr (W/m² for directional lights) with the inverse square instead.

use super::{
    projection,
    space::{self, direction, point, upright, wide},
    walk::Placed,
};
use crate::import::{findings::Findings, mesh::stretch, x3d::NodeRef};
use glam::DVec3;
use kiln_proto::{
    limits,
    options::LightUnits,
    scene::{Falloff, Light, LightShape, Projection, ShadowCompare, ShadowMap, ShadowUpdate, SpotProfile},
    units::Rgb,
};
use std::f32::consts::{FRAC_PI_2, PI};

/// Which values of a projection are still to be found: bits of [`Projection::automatic`].
pub(super) const NEAR: u8 = 1;
/// See [`NEAR`].
pub(super) const FAR: u8 = 2;
/// See [`NEAR`].
pub(super) const RECTANGLE: u8 = 4;
/// See [`NEAR`].
pub(super) const ANGLE: u8 = 8;
/// Whether a directional light has no place of its own: until its rectangle is found, and no part of the scene.
pub(super) const LOCATION: u8 = 16;

/// The light of a node; `None` where its numbers make none, which is then an error. `shines` is false for a light that stands only in
/// `GeneratedShadowMap.light` or `projector` (Kamburelis 4.4).
pub(super) fn convert(placed: &Placed<'_>, name: String, shines: bool, units: LightUnits, findings: &mut Findings) -> Option<Light> {
    let node = placed.node;
    let Emission { colour, intensity, ambient } = emission(node, findings)?;
    let shadow_intensity = node.float("shadowIntensity");
    if !(0.0..=1.0).contains(&shadow_intensity) {
        findings.warn(node.at_field("shadowIntensity"), format!("shadowIntensity {shadow_intensity} was brought into [0, 1]"));
    }
    if ambient > 0.0 {
        findings.count(node.at_field("ambientIntensity"), "lights have an ambient term, which became a constant addition where they reach");
    }
    let shape = shape(placed, findings)?;
    let unit = match units {
        LightUnits::X3d => PI,
        LightUnits::Physical => 1.0,
    };
    let (strength, surrounding) = if shines { (colour * (intensity * unit), colour * ambient) } else { (Rgb::BLACK, Rgb::BLACK) };
    for (field, value, result) in [("intensity", intensity, strength), ("ambientIntensity", ambient, surrounding)] {
        if !(0.0..=limits::BRIGHTEST).contains(&result.max_channel()) {
            let message = format!("{} has the {field} {value:e}, which with its color is more than {:e}", node.kind(), limits::BRIGHTEST);
            findings.error(node.at_field(field), message);
            return None;
        }
    }
    Some(Light {
        name,
        shape,
        intensity: strength,
        falloff: falloff(placed, units, findings)?,
        ambient: surrounding,
        casts_shadows: node.bool("shadows"),
        shadow_intensity: if shadow_intensity.is_finite() { shadow_intensity.clamp(0.0, 1.0) } else { 1.0 },
        projection: projection(placed, findings)?,
        shadow_map: node.node("defaultShadowMap").and_then(|map| shadow_map(map, findings)),
        texture: None,
    })
}

/// What every light has.
pub(super) struct Emission {
    pub(super) colour: Rgb,
    pub(super) intensity: f32,
    pub(super) ambient: f32,
}

/// The fields that say how bright a light is; `None` where one is negative or no number, which is then an error.
pub(super) fn emission(node: NodeRef<'_>, findings: &mut Findings) -> Option<Emission> {
    let colour = Rgb::from(node.vec3("color"));
    let (intensity, ambient) = (node.float("intensity"), node.float("ambientIntensity"));
    let fields = [("intensity", intensity), ("ambientIntensity", ambient)];
    if let Some((field, value)) = fields.into_iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
        findings.error(node.at_field(field), format!("{} has the {field} {value}; it cannot be negative", node.kind()));
        return None;
    }
    if !colour.is_finite() || colour.to_array().iter().any(|c| *c < 0.0) {
        findings.error(node.at_field("color"), format!("{} has a negative color", node.kind()));
        return None;
    }
    Some(Emission { colour, intensity, ambient })
}

fn shape(placed: &Placed<'_>, findings: &mut Findings) -> Option<LightShape> {
    let node = placed.node;
    let position = || space::narrow(point(&placed.matrix, node.vec3("location")));
    if node.kind() == "PointLight" {
        return Some(LightShape::Point { position: position() });
    }
    let Some(axis) = direction(&placed.matrix, node.vec3("direction")) else {
        findings.error(node.at_field("direction"), format!("{} has a direction without length", node.kind()));
        return None;
    };
    let axis = space::narrow(axis);
    if node.kind() == "DirectionalLight" {
        return Some(LightShape::Directional { direction: axis });
    }
    let (cut_off, beam) = (node.float("cutOffAngle"), node.float("beamWidth"));
    if !(cut_off > 0.0 && cut_off <= FRAC_PI_2 + 1e-5) {
        findings.error(node.at_field("cutOffAngle"), format!("SpotLight has the cutOffAngle {cut_off}; it lies in (0, pi/2]"));
        return None;
    }
    // A beam wider than the cone is a cone without a soft edge.
    let beam_width = if beam >= 0.0 { beam.min(cut_off) } else { cut_off };
    Some(LightShape::Spot { position: position(), direction: axis, cut_off, beam_width, profile: SpotProfile::Linear })
}

fn falloff(placed: &Placed<'_>, units: LightUnits, findings: &mut Findings) -> Option<Falloff> {
    let node = placed.node;
    if units == LightUnits::Physical || node.kind() == "DirectionalLight" {
        return Some(Falloff::InverseSquare { range: None });
    }
    let (attenuation, radius) = (node.vec3("attenuation"), node.float("radius"));
    if !attenuation.iter().all(|a| *a >= 0.0 && a.is_finite()) {
        findings.error(node.at_field("attenuation"), format!("{} has a negative attenuation", node.kind()));
        return None;
    }
    if radius.is_nan() || radius < 0.0 {
        findings.error(node.at_field("radius"), format!("{} has the radius {radius}; it cannot be negative", node.kind()));
        return None;
    }
    // Attenuation counts in the light's own lengths: a light in a scaled group reaches farther.
    let scale = stretch(&placed.matrix) as f32;
    if scale <= 0.0 {
        findings.error(node.at(), format!("{} stands in a group that is scaled to nothing", node.kind()));
        return None;
    }
    let [a0, a1, a2] = attenuation;
    Some(Falloff::Polynomial { attenuation: [a0, a1 / scale, a2 / (scale * scale)], radius: radius * scale })
}

/// The fields of the light as a camera; what is to be found later has its bit in `automatic`.
fn projection(placed: &Placed<'_>, findings: &mut Findings) -> Option<Projection> {
    let (node, matrix) = (placed.node, &placed.matrix);
    let scale = stretch(matrix) as f32;
    let [near, far] = projection::depths(node, scale, findings)?;
    let automatic = [(near, NEAR), (far, FAR)].iter().filter(|(given, _)| given.is_none()).map(|(_, bit)| bit).sum();
    let mut out = Projection { near: near.unwrap_or(0.0), far: far.unwrap_or(0.0), automatic, ..Projection::default() };
    let axis = if node.has("direction") { direction(matrix, node.vec3("direction"))? } else { DVec3::NEG_Z };
    let up = node.vec3("up");
    let wanted = if wide(up) == DVec3::ZERO { [0.0, 1.0, 0.0] } else { up };
    out.up = space::narrow(upright(axis, direction(matrix, wanted).unwrap_or(DVec3::ZERO)));
    if node.kind() == "DirectionalLight" {
        directional(placed, scale, &mut out, findings)?;
    } else {
        out.location = space::narrow(point(matrix, node.vec3("location")));
    }
    if node.kind() == "SpotLight" {
        let angle = node.float("projectionAngle");
        if !(0.0..PI).contains(&angle) {
            findings.error(
                node.at_field("projectionAngle"),
                format!("SpotLight has the projectionAngle {angle}; it lies in [0, pi) (0: automatic)"),
            );
            return None;
        }
        out.automatic |= if angle == 0.0 { ANGLE } else { 0 };
        // Twice the cut-off angle may be a half turn, which no camera has.
        out.angle = if angle == 0.0 { (2.0 * node.float("cutOffAngle")).min(PI - 0.01) } else { angle };
    }
    Some(out)
}

fn directional(placed: &Placed<'_>, scale: f32, out: &mut Projection, findings: &mut Findings) -> Option<()> {
    let (node, matrix) = (placed.node, &placed.matrix);
    let rectangle = node.vec4("projectionRectangle");
    out.location = space::narrow(point(matrix, node.vec3("projectionLocation")));
    if rectangle == [0.0; 4] {
        // Asked of the file's numbers: in the world the light's group has moved them.
        let has_place = wide(node.vec3("projectionLocation")) != DVec3::ZERO;
        out.automatic |= if has_place { RECTANGLE } else { RECTANGLE | LOCATION };
        return Some(());
    }
    out.rectangle = projection::rectangle(node, "projectionRectangle", rectangle, scale, findings)?;
    Some(())
}

/// The parameters of a GeneratedShadowMap; `None` where they make none, which is then an error, and for other nodes, which are reported.
pub(super) fn shadow_map(node: NodeRef<'_>, findings: &mut Findings) -> Option<ShadowMap> {
    if node.kind() != "GeneratedShadowMap" {
        findings.warn(node.at(), format!("{} is no GeneratedShadowMap and was ignored there", node.kind()));
        return None;
    }
    let (size, scale, bias) = (node.int("size"), node.float("scale"), node.float("bias"));
    let Some(texels) = u32::try_from(size).ok().filter(|s| *s > 0 && *s <= limits::TEXTURE_SIDE) else {
        let max = limits::TEXTURE_SIDE;
        findings.error(node.at_field("size"), format!("GeneratedShadowMap has the size {size}; it lies from 1 to {max}"));
        return None;
    };
    if !scale.is_finite() || !bias.is_finite() {
        findings.error(node.at(), "GeneratedShadowMap has a scale or a bias that is no number");
        return None;
    }
    let update = match node.string("update") {
        "NONE" => ShadowUpdate::None,
        "NEXT_FRAME_ONLY" => ShadowUpdate::NextFrameOnly,
        "ALWAYS" => ShadowUpdate::Always,
        other => {
            findings.warn(node.at_field("update"), format!("GeneratedShadowMap has the update `{other}`; NONE is used"));
            ShadowUpdate::None
        }
    };
    let compare = match node.string("compareMode") {
        // COMPARE_R_EQUAL is a misprint of the paper.
        "COMPARE_R_LEQUAL" | "COMPARE_R_EQUAL" => ShadowCompare::LessEqual,
        "COMPARE_R_GEQUAL" => ShadowCompare::GreaterEqual,
        "NONE" => ShadowCompare::None,
        other => {
            findings
                .warn(node.at_field("compareMode"), format!("GeneratedShadowMap has the compareMode `{other}`; COMPARE_R_LEQUAL is used"));
            ShadowCompare::LessEqual
        }
    };
    Some(ShadowMap { update, size: texels, scale, bias, compare })
}

/// What a NULL defaultShadowMap stands for where a shadow is wanted: the defaults, made always.
pub(super) const DEFAULT_MAP: ShadowMap =
    ShadowMap { update: ShadowUpdate::Always, size: 128, scale: 1.1, bias: 4.0, compare: ShadowCompare::LessEqual };
