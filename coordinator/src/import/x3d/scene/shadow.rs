//! Who throws shadows on whom: `receiveShadows`, GeneratedShadowMap and `defaultShadowMap`, and the completion of automatic projections.

use super::{
    fit::{self, Bounds, Rays},
    light::{self, DEFAULT_MAP, FAR, LOCATION, NEAR, RECTANGLE},
    projection,
    space::{narrow, wide},
    walk::{Placed, World},
};
use crate::import::{
    findings::{At, Findings},
    name::Names,
    x3d::{NodeId, NodeRef},
};
use glam::DMat4;
use kiln_proto::{
    options::LightUnits,
    scene::{Light, LightShape, ShadowMap},
};
use std::collections::BTreeMap;

/// The lights of a scene, shining or only named.
#[derive(Debug, Default)]
pub(super) struct Lights {
    /// The lights, those of the walk first.
    pub(super) lights: Vec<Light>,
    /// The first light of each node; `None` for a node that makes none, which is an error that is said once.
    by_node: BTreeMap<NodeId, Option<u32>>,
    names: Names,
}

/// What a shape's appearance says of shadows.
#[derive(Debug, Clone, Default)]
pub(super) struct Received {
    /// Indices of lights whose shadows it receives, ascending.
    pub(super) lights: Vec<u32>,
    /// GeneratedShadowMap textures.
    pub(super) maps: Vec<(u32, ShadowMap)>,
}

/// Whether a node is a light that throws shadows.
pub(super) fn is_light(node: NodeRef<'_>) -> bool {
    can_project(node) || node.kind() == "PointLight"
}

/// Whether a node is a light that looks one way, so that it can project a texture (Kamburelis 4.5).
pub(super) fn can_project(node: NodeRef<'_>) -> bool {
    matches!(node.kind(), "DirectionalLight" | "SpotLight")
}

impl Lights {
    /// Converts the lights that the walk met.
    pub(super) fn of(world: &World<'_>, units: LightUnits, findings: &mut Findings) -> Self {
        let mut lights = Self::default();
        for placed in &world.lights {
            let shines = placed.node.bool("on");
            lights.add(placed, shines, units, findings);
        }
        lights
    }

    fn add(&mut self, placed: &Placed<'_>, shines: bool, units: LightUnits, findings: &mut Findings) -> Option<u32> {
        let wanted = placed.node.def().unwrap_or(placed.node.kind());
        let name = self.names.take(wanted);
        let light = light::convert(placed, name, shines, units, findings);
        let index = light.is_some().then_some(self.lights.len() as u32);
        self.lights.extend(light);
        let first = self.by_node.entry(placed.node.id()).or_default();
        *first = first.or(index);
        index
    }

    /// The light of a node; one that stands nowhere in the scene is added, but does not shine (Kamburelis 4.4).
    pub(super) fn of_node(&mut self, node: NodeRef<'_>, units: LightUnits, findings: &mut Findings) -> Option<u32> {
        if let Some(known) = self.by_node.get(&node.id()) {
            return *known;
        }
        self.add(&Placed { node, matrix: DMat4::IDENTITY, group: 0, name: None }, false, units, findings)
    }

    /// What an appearance and its GeneratedShadowMap textures ask for.
    pub(super) fn received(
        &mut self,
        appearance: NodeRef<'_>,
        maps: &[NodeRef<'_>],
        units: LightUnits,
        findings: &mut Findings,
    ) -> Received {
        let mut received = Received::default();
        for node in appearance.children("receiveShadows") {
            if is_light(node) {
                received.lights.extend(self.of_node(node, units, findings));
            } else {
                findings.warn(node.at(), format!("{} in receiveShadows is no light and was ignored", node.kind()));
            }
        }
        for map in maps {
            let Some(node) = map.node("light").filter(|n| is_light(*n)) else {
                findings.warn(map.at(), "GeneratedShadowMap has no light and was ignored");
                continue;
            };
            let Some(light) = self.of_node(node, units, findings) else { continue };
            if let Some(parameters) = light::shadow_map(*map, findings) {
                received.maps.push((light, parameters));
                received.lights.push(light);
            }
        }
        received.lights.sort_unstable();
        received.lights.dedup();
        received
    }

    /// Fills in what projections leave to be found. `receivers` has the box of what receives the shadows of each light.
    pub(super) fn complete(&mut self, casters: Bounds, receivers: &[Bounds], findings: &mut Findings, at: At<'_>) {
        for (index, light) in self.lights.iter_mut().enumerate() {
            let receiving = receivers.get(index).copied().unwrap_or(Bounds::EMPTY);
            complete(light, casters, receiving, |message| findings.warn(at, message));
            if !receiving.is_empty() || light.casts_shadows {
                light.shadow_map.get_or_insert(DEFAULT_MAP);
            }
        }
    }
}

fn complete(light: &mut Light, casters: Bounds, receivers: Bounds, warn: impl FnOnce(String)) {
    let p = &mut light.projection;
    if let LightShape::Directional { direction } = light.shape
        && p.automatic & RECTANGLE != 0
    {
        let direction = wide(direction);
        if p.automatic & LOCATION != 0 {
            p.location = narrow(fit::location(direction, casters));
            p.automatic &= !LOCATION;
        }
        p.rectangle = fit::rectangle(wide(p.location), direction, wide(p.up), casters).map(|v| v as f32);
        // A flat scene seen from its side has no extent: a camera needs some.
        let [left, bottom, right, top] = &mut p.rectangle;
        for (low, high) in [(left, right), (bottom, top)] {
            if *high <= *low {
                // Far from the location half a metre is less than the next number.
                let half = low.abs().max(high.abs()).max(5e5) * 1e-6;
                (*low, *high) = (*low - half, *high + half);
            }
        }
    }
    let location = wide(p.location);
    let rays = match light.shape {
        LightShape::Directional { direction } | LightShape::Spot { direction, .. } => Rays::Along(location, wide(direction)),
        LightShape::Point { .. } => Rays::From(location),
    };
    let given = [(p.near, NEAR), (p.far, FAR)].map(|(value, bit)| (p.automatic & bit == 0).then_some(value));
    let who = format!("the light `{}`", light.name);
    [p.near, p.far] = projection::ends(given, fit::depth(rays, casters, receivers), &who, warn);
}
