//! Lights (KHR_lights_punctual) and cameras, in world space. Both look along -Z of their node, and neither is scaled by it.

use super::{
    json::Json,
    node::Node,
    property::{POSITIVE, SHARE},
    report::Report,
};
use crate::import::name::Names;
use glam::{DMat4, DVec3};
use kiln_proto::{
    limits,
    scene::{Camera, Falloff, Lens, Light, LightShape, SpotProfile},
    units::Rgb,
};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The extension that lights are written in: those of the file in its root, which of them a node has in the node.
pub(super) const PUNCTUAL: &str = "KHR_lights_punctual";

/// The largest inner angle of a spot light as a share of the outer one; its falloff divides by the difference of their cosines.
const HARD_EDGE: f64 = 0.999;

/// A light before a node places it.
#[derive(Debug, Clone, Copy)]
struct Lamp {
    intensity: Rgb,
    range: Option<f32>,
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Point,
    Spot { inner: f32, outer: f32 },
    Directional,
}

/// The lights of the nodes that are shown, named after their nodes.
pub(super) fn lights(root: Json<'_>, nodes: &[&Node<'_>], report: &mut Report<'_>) -> Vec<Light> {
    let list = root.extension(PUNCTUAL).map(|e| report.objects(e, "lights")).unwrap_or_default();
    let lamps: Vec<(Option<Lamp>, Option<String>)> = list.iter().map(|json| (lamp(*json, report), json.name())).collect();
    let (mut lights, mut names) = (vec![], Names::default());
    for node in nodes {
        let Some((index, (Some(lamp), given))) = node.light().and_then(|i| Some((i, lamps.get(i)?))) else { continue };
        if lights.len() >= limits::LIGHTS {
            report.error(node.json, format!("the scene has more than {} lights", limits::LIGHTS));
            break;
        }
        let name = node.json.name().or_else(|| given.clone()).unwrap_or_else(|| format!("light{index}"));
        lights.push(lamp.place(names.take(&name), node, report));
    }
    lights
}

fn lamp(json: Json<'_>, report: &mut Report<'_>) -> Option<Lamp> {
    let color = report.vector::<3>(json, "color", &SHARE).unwrap_or([1.0; 3]);
    let intensity = report.number(json, "intensity", 1.0, &POSITIVE);
    let range = json.get("range").and_then(|at| report.number_at(at, &POSITIVE)).map(|r| r as f32);
    if range == Some(0.0) {
        report.error(json, "the range of a light must be more than 0");
    }
    let kind = match report.required(json, "type")?.string().as_deref() {
        Some("point") => Kind::Point,
        Some("directional") => Kind::Directional,
        Some("spot") => spot(json, report)?,
        other => {
            report.error(json, format!("`{}` is no type of light; there are point, spot and directional", other.unwrap_or_default()));
            return None;
        }
    };
    let strength = Rgb::from(color.map(|c| (c * intensity) as f32));
    if strength.max_channel() > limits::BRIGHTEST {
        report.error(json, format!("the light has the intensity {intensity:e}; at most {:e} is possible", limits::BRIGHTEST));
        return None;
    }
    Some(Lamp { intensity: strength, range: range.filter(|r| *r > 0.0), kind })
}

fn spot(json: Json<'_>, report: &mut Report<'_>) -> Option<Kind> {
    let cone = report.required(json, "spot")?;
    let angle = 0.0..=FRAC_PI_2 + 1e-6;
    let outer = report.number(cone, "outerConeAngle", FRAC_PI_4, &angle);
    let mut inner = report.number(cone, "innerConeAngle", 0.0, &angle);
    if inner > outer || outer == 0.0 {
        report.error(cone, format!("the inner angle {inner} of the cone must be less than the outer angle {outer}"));
        return None;
    }
    if inner > HARD_EDGE * outer {
        report.count(cone, "spot lights without a soft edge, which glTF forbids, were given a narrow one");
        inner = HARD_EDGE * outer;
    }
    Some(Kind::Spot { inner: inner as f32, outer: outer as f32 })
}

impl Lamp {
    fn place(self, name: String, node: &Node<'_>, report: &mut Report<'_>) -> Light {
        let (eye, [_, _, back]) = frame(node, report);
        let (position, direction) = (single(eye), single(-back));
        let shape = match self.kind {
            Kind::Point => LightShape::Point { position },
            Kind::Directional => LightShape::Directional { direction },
            Kind::Spot { inner, outer } => {
                LightShape::Spot { position, direction, cut_off: outer, beam_width: inner, profile: SpotProfile::SquaredCosine }
            }
        };
        Light { falloff: Falloff::InverseSquare { range: self.range }, ..Light::new(name, shape, self.intensity) }
    }
}

/// The cameras of the nodes that are shown.
pub(super) fn cameras(list: &[Json<'_>], nodes: &[&Node<'_>], report: &mut Report<'_>) -> Vec<Camera> {
    let lenses: Vec<(Option<Lens>, Option<String>)> = list.iter().map(|json| (lens(*json, report), json.name())).collect();
    let mut cameras = vec![];
    for node in nodes {
        let Some((index, (Some(lens), given))) = node.camera().map(|i| (i, &lenses[i])) else { continue };
        if cameras.len() >= limits::LIGHTS {
            report.error(node.json, format!("the scene has more than {} cameras", limits::LIGHTS));
            break;
        }
        let name = node.json.name().or_else(|| given.clone()).unwrap_or_else(|| format!("camera{index}"));
        let (eye, [_, up, back]) = frame(node, report);
        cameras.push(Camera { name, eye: single(eye), forward: single(-back), up: single(up), lens: *lens });
    }
    cameras
}

fn lens(json: Json<'_>, report: &mut Report<'_>) -> Option<Lens> {
    match report.required(json, "type")?.string().as_deref() {
        Some("perspective") => {
            let perspective = report.required(json, "perspective")?;
            let at = report.required(perspective, "yfov")?;
            let fov = report.number_at(at, &(0.0..=PI))?;
            // A number may be more than zero and yet too small for single precision.
            if fov as f32 == 0.0 || fov >= PI {
                report.error(at, format!("the field of view {fov} must lie between 0 and pi"));
                return None;
            }
            Some(Lens::Perspective { fov: fov as f32, of_smaller: false })
        }
        Some("orthographic") => {
            let orthographic = report.required(json, "orthographic")?;
            let at = report.required(orthographic, "ymag")?;
            let half = report.number_at(at, &POSITIVE)?;
            if half as f32 == 0.0 {
                report.error(at, "the height that a camera shows must be more than 0");
                return None;
            }
            Some(Lens::Orthographic { half_height: half as f32 })
        }
        other => {
            report.error(json, format!("`{}` is no type of camera; there are perspective and orthographic", other.unwrap_or_default()));
            None
        }
    }
}

/// Where a node stands and its axes, made orthonormal around its Z axis; those of the world where it has none.
fn frame(node: &Node<'_>, report: &mut Report<'_>) -> (DVec3, [DVec3; 3]) {
    let world: DMat4 = *node.world;
    let back = world.z_axis.truncate().try_normalize().filter(|v| v.is_finite()).unwrap_or(DVec3::Z);
    let raw = world.y_axis.truncate();
    let up = [raw, DVec3::Y, DVec3::X].into_iter().find_map(|up| {
        let across = up - back * up.dot(back);
        across.try_normalize().filter(|v| v.is_finite() && across.length() > 1e-6 * up.length())
    });
    let up = up.unwrap_or(DVec3::Y);
    let eye = world.w_axis.truncate();
    let fits = eye.abs().max_element() <= f64::from(f32::MAX);
    if !fits {
        report.error(node.json, "the node stands where single precision does not reach");
    }
    (if fits { eye } else { DVec3::ZERO }, [up.cross(back), up, back])
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array().map(|c| c + 0.0)
}
