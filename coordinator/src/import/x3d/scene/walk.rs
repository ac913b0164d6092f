//! The walk through a document: every shape, light and viewpoint with its place in the world.
//!
//! The graph is expanded, because every instance gets a light field of its own. Instances are counted, so that a few nodes that stand for
//! a billion shapes are refused instead of built. Order is that of the file, parents before children.

use super::{environment, space};
use crate::import::{
    BundlePath,
    findings::Findings,
    x3d::{Document, Inlined, NodeId, NodeRef},
};
use glam::DMat4;
use kiln_proto::limits;
use std::collections::{BTreeMap, BTreeSet};

/// A group instance, counted in the order of the walk.
pub(super) type Group = u32;

/// A node with its place in the world.
#[derive(Debug, Clone)]
pub(super) struct Placed<'d> {
    /// The node.
    pub(super) node: NodeRef<'d>,
    /// From its space to the world.
    pub(super) matrix: DMat4,
    /// The group that it stands in.
    pub(super) group: Group,
    /// The nearest name above it, for a node without one of its own.
    pub(super) name: Option<&'d str>,
}

/// All that a document places.
#[derive(Debug, Default)]
pub(super) struct World<'d> {
    pub(super) shapes: Vec<Placed<'d>>,
    pub(super) lights: Vec<Placed<'d>>,
    /// EnvironmentLight nodes that are on: those that count, and one more where there are too many.
    pub(super) environments: Vec<Placed<'d>>,
    pub(super) viewpoints: Vec<Placed<'d>>,
    /// Viewpoints beyond those that become cameras, which may still project textures: each at its first place.
    pub(super) further_viewpoints: BTreeMap<NodeId, Placed<'d>>,
    /// Files of other formats with their places.
    pub(super) files: Vec<(Placed<'d>, BundlePath)>,
    /// NavigationInfo, Background and Fog nodes, of which the first counts.
    pub(super) bindables: Vec<NodeRef<'d>>,
    /// The group around each group.
    parents: Vec<Group>,
}

/// A walk under way.
struct Walk<'d, 'f> {
    document: &'d Document,
    world: World<'d>,
    findings: &'f mut Findings,
    /// Visits so far, and entries of lists that were looked at and passed over.
    steps: u64,
}

/// Visits of one walk: instances of nodes, not nodes. A hundred lines can stand for any number; a million takes a tenth of a second.
const MAX_STEPS: u64 = 1 << 20;
/// Viewpoints that become cameras.
const MAX_VIEWPOINTS: usize = 1000;

impl<'d> World<'d> {
    /// Walks a document from its roots.
    pub(super) fn of(document: &'d Document, findings: &mut Findings) -> Self {
        let world = Self { parents: vec![0], ..Self::default() };
        let mut walk = Walk { document, world, findings, steps: 0 };
        let root = Place { matrix: DMat4::IDENTITY, group: 0, name: None };
        for node in document.roots() {
            if !walk.visit(node, root) {
                let message = format!(
                    "the scene stands for more than {MAX_STEPS} nodes and hidden entries, {} shapes or inlined files, or {} lights",
                    limits::SURFACES,
                    limits::LIGHTS
                );
                walk.findings.error(node.at(), message);
                break;
            }
        }
        walk.world
    }

    /// The group itself and all around it, ascending.
    pub(super) fn around(&self, mut group: Group) -> Vec<Group> {
        let mut around = vec![group];
        // A group's number is above that of the group around it.
        while group > 0 {
            group = self.parents[group as usize];
            around.push(group);
        }
        around.reverse();
        around
    }
}

impl<'d> Walk<'d, '_> {
    /// Adds a node and what it holds; false where there is too much.
    fn visit(&mut self, node: NodeRef<'d>, place: Place<'d>) -> bool {
        self.steps += 1;
        let world = &mut self.world;
        let surfaces = world.shapes.len().max(world.files.len());
        if self.steps > MAX_STEPS || surfaces > limits::SURFACES || world.lights.len() > limits::LIGHTS {
            return false;
        }
        let placed = || Placed { node, matrix: place.matrix, group: place.group, name: node.def().or(place.name) };
        match node.kind() {
            "Shape" => world.shapes.push(placed()),
            "DirectionalLight" | "PointLight" | "SpotLight" => world.lights.push(placed()),
            "EnvironmentLight" if node.bool("on") && world.environments.len() <= environment::MOST => world.environments.push(placed()),
            "EnvironmentLight" => {}
            "Viewpoint" | "OrthoViewpoint" if world.viewpoints.len() >= MAX_VIEWPOINTS => {
                self.findings.count(node.at(), "viewpoints beyond the first thousand were left out");
                world.further_viewpoints.entry(node.id()).or_insert_with(placed);
            }
            "Viewpoint" | "OrthoViewpoint" => world.viewpoints.push(placed()),
            "NavigationInfo" | "KambiNavigationInfo" | "Background" | "TextureBackground" | "Fog" | "LocalFog" => {
                world.bindables.push(node);
            }
            _ => return self.descend(node, place),
        }
        true
    }

    fn descend(&mut self, node: NodeRef<'d>, place: Place<'d>) -> bool {
        if is_hidden(node) {
            self.findings.count(node.at(), HIDDEN);
            return true;
        }
        let group = self.world.parents.len() as Group;
        let inner = Place { matrix: place.matrix * space::local(node), group, name: node.def().or(place.name) };
        let children = match node.inlined() {
            Some(Inlined::Nodes(roots)) => roots.iter().map(|id| self.document.node(*id)).collect(),
            Some(Inlined::File(path)) => {
                let placed = Placed { node, matrix: inner.matrix, group, name: inner.name };
                self.world.files.push((placed, path.clone()));
                vec![]
            }
            None => self.shown(node),
        };
        if self.steps > MAX_STEPS {
            return false;
        }
        if children.is_empty() && self.world.files.last().is_none_or(|(f, _)| f.group != group) {
            return true;
        }
        self.world.parents.push(place.group);
        children.into_iter().all(|child| self.visit(child, inner))
    }

    /// What of a group is baked.
    fn shown(&mut self, node: NodeRef<'d>) -> Vec<NodeRef<'d>> {
        let children = || node.children("children");
        match node.kind() {
            "Switch" => {
                let Ok(choice) = usize::try_from(node.int("whichChoice")) else { return vec![] };
                self.steps += choice.min(children().len()) as u64;
                children().nth(choice).into_iter().collect()
            }
            "LOD" => {
                if children().nth(1).is_some() {
                    self.findings.count(node.at(), "LOD nodes show their first level");
                }
                children().take(1).collect()
            }
            "HAnimHumanoid" => {
                if node.node("skin").is_some() {
                    self.findings.count(node.at(), "skins of humanoids were baked as their points stand, whatever the pose of the joints");
                }
                node.children("skeleton").chain(node.children("skin")).collect()
            }
            // X3D 3 has a list for the children of a CADLayer, X3D 4 one word for all.
            "CADLayer" if node.mf_int("visible").len() > 1 => {
                let hidden = |at: usize| node.mf_int("visible").get(at).is_some_and(|v| *v == 0);
                self.unhidden(children().enumerate().map(|(at, child)| (child, hidden(at))))
            }
            "LayerSet" => {
                self.findings.count(node.at(), "layers were baked as one scene: none is drawn over another");
                let order: BTreeSet<i32> = node.mf_int("order").iter().copied().collect();
                self.steps += node.mf_int("order").len() as u64;
                // Layer 0 is what stands beside the LayerSet.
                self.unhidden((1..).zip(node.children("layers")).map(|(number, layer)| (layer, !order.contains(&number))))
            }
            "CADFace" => node.node("shape").into_iter().collect(),
            "Billboard" => {
                self.findings.count(node.at(), "Billboard nodes were baked as they stand, not turned to a viewer");
                children().collect()
            }
            _ => children().collect(),
        }
    }

    /// Those of some nodes that are not said to be hidden; the others cost time too.
    fn unhidden(&mut self, nodes: impl Iterator<Item = (NodeRef<'d>, bool)>) -> Vec<NodeRef<'d>> {
        let (mut shown, mut first, mut number) = (vec![], None, 0);
        for (node, hidden) in nodes {
            if hidden {
                first = first.or(Some(node));
                number += 1;
            } else {
                shown.push(node);
            }
        }
        self.steps += number;
        if let Some(first) = first {
            self.findings.count_lazily(HIDDEN, number, || (first.at(), String::new()));
        }
        shown
    }
}

/// What is said of groups that are left out because they are told not to be seen.
const HIDDEN: &str = "groups that are not visible were left out";

fn is_hidden(node: NodeRef<'_>) -> bool {
    match node.kind() {
        "CADLayer" => node.mf_int("visible") == [0],
        _ => node.has("visible") && !node.bool("visible"),
    }
}

/// Where the walk stands.
#[derive(Debug, Clone, Copy)]
struct Place<'d> {
    matrix: DMat4,
    group: Group,
    name: Option<&'d str>,
}
