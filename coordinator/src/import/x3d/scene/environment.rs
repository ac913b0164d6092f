//! EnvironmentLight (ISO/IEC 19775-1: 17.4.2) becomes the scene's environment: a lat-long map of radiance.
//!
//! Radiance is what the specular texture shows, seen from within. Without one the light is known by its irradiance only, whose nine
//! harmonics are undone (`harmonics`); without that too it is even. A panorama that is turned about +Y keeps its texels, all else is
//! resampled, turned as it stands in the world. Several lights add up: light is a sum, and a scene has one map. Keeping the first alone
//! would be simpler, and wrong.
//!
//! Intensity has the same meaning in all units of light: an even environment of intensity 1 gives a white Lambert surface the radiance 1,
//! as X3D's other lights do, and is a radiance of 1 W/(sr m²).

mod cube;
mod harmonics;
mod map;
mod picture;

use super::{
    light::{Emission, emission},
    space,
    walk::{Placed, World},
};
use crate::import::{
    Bundle,
    environment::clamp,
    findings::{At, Findings},
    surfaces::NAME_CHARS,
    up,
    x3d::{NodeId, NodeRef},
};
use glam::{DMat3, DVec3};
use harmonics::Harmonics;
use kiln_proto::{
    math,
    options::{ImportOptions, ShadowMode, UpAxis},
    scene::Environment,
    units::Rgb,
};
use map::Source;
use picture::Reader;
use std::rc::Rc;

/// EnvironmentLight nodes of one scene that are on: each costs a map of its own.
pub(super) const MOST: usize = 16;

/// What the EnvironmentLight nodes of a scene come to; `None` where none is on, or one makes no light, which is then said, and where the
/// options name another environment: then nothing is read of what is not used.
///
/// Cost: linear in the texels of their textures, or of the map where that has more.
pub(super) fn environment(bundle: &Bundle, world: &World<'_>, options: &ImportOptions, findings: &mut Findings) -> Option<Environment> {
    let shining = &world.environments;
    if let (Some(first), Some(_)) = (shining.first(), &options.environment) {
        let message = format!("the scene's own environment `{}` gives way to the one that the options name", name(first.node));
        findings.warn(first.node.at(), message);
        return None;
    }
    if let Some(placed) = shining.get(MOST) {
        findings.error(placed.node.at(), format!("the scene has more than {MOST} EnvironmentLight nodes that are on; make one of them"));
        return None;
    }
    let mut reader = Reader::new(bundle);
    let mut sum: Option<Environment> = None;
    for (at, placed) in shining.iter().enumerate() {
        say_what_is_not_used(placed, world, options, findings);
        let later = |texture: NodeId| shining[at + 1..].iter().any(|light| shown(light.node).is_some_and(|t| t.id() == texture));
        let Some(own) = convert(&mut reader, placed, &later, options.up, findings) else { continue };
        sum = Some(match sum {
            None => own,
            Some(sum) => add(sum, own, placed.node.at(), findings),
        });
    }
    sum
}

fn name(light: NodeRef<'_>) -> String {
    light.def().unwrap_or(light.kind()).chars().take(NAME_CHARS).collect()
}

/// The texture whose light it is.
fn shown(light: NodeRef<'_>) -> Option<NodeRef<'_>> {
    light.node("specularTexture").or_else(|| light.node("diffuseTexture"))
}

/// The map of one light, in the world as it is once that axis points up. `later` tells of a texture whether another light needs it.
fn convert(
    reader: &mut Reader<'_>,
    placed: &Placed<'_>,
    later: &dyn Fn(NodeId) -> bool,
    axis: UpAxis,
    findings: &mut Findings,
) -> Option<Environment> {
    let node = placed.node;
    let Emission { colour, intensity, ambient } = emission(node, findings)?;
    let turn = up::matrix(axis) * turn(placed, findings)?;
    let source = source(reader, node, later, findings)?;
    let name = name(node);
    // A panorama that is turned about +Y keeps its texels.
    let kept = match about_up(turn) {
        Some(radians) => map::kept(source).map(|map| (map, radians)),
        None => Err(source),
    };
    let mut map = match kept {
        Ok((map, radians)) => Environment { name, rotation: map.rotation + radians as f32, ..map },
        Err(source) => {
            let (size, wanted) = (source.size(), source.wanted());
            if size != wanted {
                let [[width, height], [much_width, much_height]] = [size, wanted];
                let message =
                    format!("the environment would take {much_width}x{much_height} pixels to keep all texels; it has {width}x{height}");
                findings.warn(node.at(), message);
            }
            Environment { name, ..map::baked(&source, turn.transpose(), size) }
        }
    };
    if map.rgb.as_flattened().iter().any(|v| *v < 0.0) {
        findings.count(node.at(), "environments given by nine harmonics have directions with less light than none, which were made black");
        map.rgb.as_flattened_mut().iter_mut().for_each(|v| *v = v.max(0.0));
    }
    if ambient > 0.0 {
        let at = node.at_field("ambientIntensity");
        findings.count(at, "EnvironmentLight nodes have an ambient term, which became light from all around");
    }
    let (factor, addition) = (colour * intensity, colour * ambient);
    map.rgb.iter_mut().for_each(|texel| *texel = (Rgb::from(*texel) * factor + addition).to_array());
    clamp(&mut map.rgb, node.at(), findings);
    Some(map)
}

/// Where the radiance of a light comes from, in the light's space; `None` where that cannot be had, which is said.
fn source(reader: &mut Reader<'_>, node: NodeRef<'_>, later: &dyn Fn(NodeId) -> bool, findings: &mut Findings) -> Option<Rc<Source>> {
    let coefficients = node.mf_float("diffuseCoefficients");
    let (specular, diffuse) = (node.node("specularTexture"), node.node("diffuseTexture"));
    if specular.is_some() && (diffuse.is_some() || !coefficients.is_empty()) {
        findings
            .count(node.at(), "EnvironmentLight nodes have a diffuse part beside their specularTexture, which a bake works out by itself");
    } else if diffuse.is_some() && !coefficients.is_empty() {
        findings.count(
            node.at_field("diffuseCoefficients"),
            "EnvironmentLight nodes have a diffuseTexture, whose diffuseCoefficients were ignored",
        );
    }
    if let Some(texture) = specular {
        return reader.source(texture, later(texture.id()), findings);
    }
    let harmonics = if let Some(texture) = diffuse {
        let source = reader.source(texture, later(texture.id()), findings)?;
        Harmonics::undone(&Harmonics::of(&source).times(std::f32::consts::PI))
    } else if coefficients.is_empty() {
        return Some(Rc::new(Source::even()));
    } else {
        let Some(irradiance) = Harmonics::read(&coefficients) else {
            let message = format!("diffuseCoefficients has {} numbers; it has 27 finite ones, nine colours", coefficients.len());
            findings.error(node.at_field("diffuseCoefficients"), message);
            return None;
        };
        Harmonics::undone(&irradiance)
    };
    findings.count(node.at(), "EnvironmentLight nodes have no specularTexture: the nine harmonics of their irradiance light the scene");
    Some(Rc::new(Source::Harmonics(harmonics)))
}

/// From the light's space to the world: `rotation` and that of the groups around it, without their scale; mirrors mirror.
fn turn(placed: &Placed<'_>, findings: &mut Findings) -> Option<DMat3> {
    let node = placed.node;
    let m = DMat3::from_mat4(placed.matrix);
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
    let across = m.z_axis - m.z_axis.dot(m.y_axis) / m.y_axis.length_squared() * m.y_axis;
    let (Some(up), Some(side)) = (m.y_axis.try_normalize(), across.try_normalize()) else {
        findings.error(node.at(), "EnvironmentLight stands in a group that is scaled to nothing");
        return None;
    };
    let longest = lengths.into_iter().fold(0.0, f64::max);
    let skew = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
    if lengths.iter().any(|l| longest - l > 1e-4 * longest) || skew.iter().any(|s| s.abs() > 1e-4 * longest * longest) {
        findings.count(
            node.at(),
            "EnvironmentLight nodes stand in groups that stretch; their light was turned with the group and not stretched",
        );
    }
    let mirror = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Some(DMat3::from_cols(up.cross(side) * mirror, up, side) * space::rotation(node.vec4("rotation")))
}

/// The angle of a turn about +Y, radians; `None` for other turns and for mirrors.
fn about_up(turn: DMat3) -> Option<f64> {
    let stays = (turn.y_axis - DVec3::Y).length() < 1e-6 && turn.determinant() > 0.0;
    stays.then(|| math::atan2(-turn.x_axis.z, turn.x_axis.x))
}

/// The sum of two maps, with the texels of the larger.
fn add(a: Environment, b: Environment, at: At<'_>, findings: &mut Findings) -> Environment {
    let size = [a.width.max(b.width), a.height.max(b.height)];
    let name = a.name.clone();
    let mut sum = map::baked(&Source::Map(a), DMat3::IDENTITY, size);
    let more = map::baked(&Source::Map(b), DMat3::IDENTITY, size);
    sum.rgb.as_flattened_mut().iter_mut().zip(more.rgb.as_flattened()).for_each(|(a, b)| *a += b);
    clamp(&mut sum.rgb, at, findings);
    Environment { name, ..sum }
}

/// Reports the fields that have no meaning for light from all around, and a group that does not keep it.
fn say_what_is_not_used(placed: &Placed<'_>, world: &World<'_>, options: &ImportOptions, findings: &mut Findings) {
    let node = placed.node;
    let places = || world.shapes.iter().chain(world.files.iter().map(|(placed, _)| placed));
    if !node.bool("global") && places().any(|shape| world.around(shape.group).binary_search(&placed.group).is_err()) {
        findings.count(node.at(), "EnvironmentLight nodes that are not global stand in a group; they light the whole scene");
    }
    if node.float("shadowIntensity") != 1.0 || (options.x3d_shadows == ShadowMode::Strict && !node.bool("shadows")) {
        findings.count(node.at(), "EnvironmentLight nodes throw whole shadows, whatever their shadows and shadowIntensity say");
    }
    if node.vec3("origin") != [0.0; 3] {
        findings.count(
            node.at_field("origin"),
            "EnvironmentLight nodes have an origin, which was not used: their light comes from infinitely far away",
        );
    }
    let is_camera = ["projectionNear", "projectionFar"].iter().any(|field| node.float(field) != 0.0) || node.vec3("up") != [0.0; 3];
    if is_camera || node.node("defaultShadowMap").is_some() {
        findings.count(node.at(), "EnvironmentLight nodes have fields of a light as a camera, which they cannot be");
    }
}
