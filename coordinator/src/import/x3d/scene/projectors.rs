//! What projects textures: lights and viewpoints as projectors of the scene (Kamburelis 4.5).

use super::{
    fit::{self, Bounds, Rays},
    form::Formed,
    projection,
    shadow::{Lights, can_project},
    space, view,
    walk::{Placed, World},
};
use crate::import::{
    findings::Findings,
    mesh::stretch,
    x3d::{NodeId, NodeRef},
};
use glam::DMat4;
use kiln_proto::{
    options::ImportOptions,
    scene::{Camera, Projector},
};
use std::collections::{BTreeMap, BTreeSet};

/// Projectors by the node that projects.
#[derive(Default)]
pub(super) struct Projectors {
    by_node: BTreeMap<NodeId, u32>,
    pub(super) list: Vec<Projector>,
}

/// What projectors are made from.
pub(super) struct Maker<'a, 'd> {
    pub(super) world: &'a World<'d>,
    pub(super) cameras: &'a [(NodeId, Camera)],
    pub(super) casters: Bounds,
    pub(super) options: &'a ImportOptions,
}

impl Projectors {
    /// The index of what a node projects through; `None` where it projects nothing.
    pub(super) fn of(&self, node: NodeId) -> Option<u32> {
        self.by_node.get(&node).copied()
    }
}

impl Maker<'_, '_> {
    /// Adds the lights that stand nowhere but in a projector, which must be there before projections are completed.
    pub(super) fn add_lights(&self, shapes: &[Formed<'_, '_>], lights: &mut Lights, findings: &mut Findings) {
        for node in shapes.iter().flat_map(|s| &s.projecting).filter(|n| can_project(**n)) {
            lights.of_node(*node, self.options.light_units, findings);
        }
    }

    /// The projectors of all textures of some shapes. The projections of lights have to be complete.
    pub(super) fn make(&self, shapes: &[Formed<'_, '_>], lights: &mut Lights, findings: &mut Findings) -> Projectors {
        let mut out = Projectors::default();
        let mut seen = BTreeSet::new();
        for node in shapes.iter().flat_map(|s| &s.projecting).copied().filter(|n| seen.insert(n.id())) {
            if let Some(projector) = self.projector(node, lights, findings) {
                out.by_node.insert(node.id(), out.list.len() as u32);
                out.list.push(projector);
            }
        }
        out
    }

    fn projector(&self, node: NodeRef<'_>, lights: &mut Lights, findings: &mut Findings) -> Option<Projector> {
        let name = node.def().unwrap_or(node.kind()).to_owned();
        if can_project(node) {
            let index = lights.of_node(node, self.options.light_units, findings)?;
            return Some(Projector { name, light: Some(index), matrix: view::light_matrix(&lights.lights[index as usize])? });
        }
        if matches!(node.kind(), "Viewpoint" | "OrthoViewpoint") {
            return self.viewpoint(node, name, findings);
        }
        findings.warn(node.at(), format!("{} cannot project a texture; automatic coordinates are used", node.kind()));
        None
    }

    fn viewpoint(&self, node: NodeRef<'_>, name: String, findings: &mut Findings) -> Option<Projector> {
        let alone = Placed { node, matrix: DMat4::IDENTITY, group: 0, name: None };
        let among_cameras = self.world.viewpoints.iter().find(|p| p.node.id() == node.id());
        let placed = among_cameras.or_else(|| self.world.further_viewpoints.get(&node.id())).unwrap_or(&alone);
        let scale = stretch(&placed.matrix) as f32;
        let given = projection::depths(node, scale, findings)?;
        let rectangle = match node.kind() {
            "OrthoViewpoint" => Some(projection::rectangle(node, "fieldOfView", view::extent(node), scale, findings)?),
            _ => None,
        };
        let camera = view::camera(placed, name.clone(), findings)?;
        let is_bound = self.cameras.first().is_some_and(|(id, _)| *id == node.id());
        let rays = Rays::Along(space::wide(camera.eye), space::wide(camera.forward));
        let found = fit::depth(rays, self.casters, self.casters);
        let who = format!("the viewpoint `{name}`");
        let ends = projection::ends(given, found, &who, |message| findings.warn(node.at_field("projectionNear"), message));
        Some(Projector { name, light: None, matrix: view::viewpoint_matrix(&camera, is_bound, rectangle, ends) })
    }
}
