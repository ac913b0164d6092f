//! The node hierarchy: checked to be a forest, with world transforms in f64.
//!
//! Everything here iterates over an order in which parents come before their children; a chain of a million nodes costs no stack.

use super::{json::Json, property::ANY, report::Report};
use glam::{DMat4, DQuat, DVec3, DVec4};

/// A quaternion whose length is further from one than this was not meant as it stands.
const UNIT: f64 = 1e-3;

/// How a node stands within its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Local {
    /// Any affine map.
    Matrix(DMat4),
    /// Scale, then rotation, then translation.
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

/// A node.
#[derive(Debug)]
pub(super) struct Node<'d> {
    /// Its description.
    pub(super) json: Json<'d>,
    parent: Option<usize>,
    children: Vec<usize>,
    /// How it stands within its parent.
    pub(super) local: Local,
    /// Index of its mesh.
    pub(super) mesh: Option<usize>,
    /// Index of its skin.
    pub(super) skin: Option<usize>,
    /// Index of its camera.
    pub(super) camera: Option<usize>,
    /// Its own weights of morph targets.
    pub(super) weights: Option<Vec<f64>>,
    /// To world space.
    pub(super) world: DMat4,
}

/// How many of the things there are that nodes refer to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counts {
    pub(super) meshes: usize,
    pub(super) skins: usize,
    pub(super) cameras: usize,
}

/// All nodes of a file.
#[derive(Debug)]
pub(super) struct Graph<'d> {
    /// The nodes.
    pub(super) nodes: Vec<Node<'d>>,
    /// All of them, parents before children.
    order: Vec<usize>,
}

impl<'d> Graph<'d> {
    /// Reads all nodes; `None` where they are no forest.
    pub(super) fn load(root: Json<'d>, counts: Counts, report: &mut Report<'_>) -> Option<Self> {
        let list = report.objects(root, "nodes");
        let all = list.len();
        let mut nodes: Vec<Node<'d>> = list.into_iter().map(|json| node(json, all, counts, report)).collect();
        for index in 0..all {
            for child in nodes[index].children.clone() {
                if let Some(other) = nodes[child].parent {
                    let message = format!("node {child} is already a child of node {other}; a node has one parent");
                    report.error(nodes[index].json, message);
                    return None;
                }
                nodes[child].parent = Some(index);
            }
        }
        let mut order: Vec<usize> = (0..all).filter(|i| nodes[*i].parent.is_none()).collect();
        let mut next = 0;
        while let Some(index) = order.get(next) {
            order.extend_from_slice(&nodes[*index].children);
            next += 1;
        }
        let graph = Self { nodes, order };
        graph.check_loops(report).then_some(graph)
    }

    /// Every node has one parent at most, so what no root reaches is a loop or hangs from one.
    fn check_loops(&self, report: &mut Report<'_>) -> bool {
        if self.order.len() == self.nodes.len() {
            return true;
        }
        let mut walk = vec![usize::MAX; self.nodes.len()];
        self.order.iter().for_each(|i| walk[*i] = 0);
        for start in 0..self.nodes.len() {
            let mut at = start;
            while walk[at] == usize::MAX {
                walk[at] = start + 1;
                at = self.nodes[at].parent.unwrap_or(at);
            }
            // This walk came back upon itself: around once more, to name them all.
            let first = at;
            let mut left = walk[first] == start + 1;
            while left {
                report.error(self.nodes[at].json, "the node is part of a loop: it is its own ancestor");
                at = self.nodes[at].parent.unwrap_or(first);
                left = at != first;
            }
        }
        false
    }

    /// Computes the world transforms from the local ones.
    pub(super) fn place(&mut self) {
        for index in 0..self.order.len() {
            let node = self.order[index];
            let parent = self.nodes[node].parent.map_or(DMat4::IDENTITY, |p| self.nodes[p].world);
            self.nodes[node].world = parent * self.nodes[node].local.matrix();
        }
    }

    /// The nodes of the scene that is shown, parents before children, in the order of the file.
    pub(super) fn shown(&self, root: Json<'d>, report: &mut Report<'_>) -> Vec<usize> {
        let mut stack = self.roots(root, report);
        stack.reverse();
        let mut shown = vec![];
        let mut hidden = 0;
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index];
            if node.json.extension("KHR_node_visibility").is_some_and(|e| !report.boolean(e, "visible", true)) {
                hidden += 1;
                continue;
            }
            shown.push(index);
            stack.extend(node.children.iter().rev());
        }
        if shown.len() < self.nodes.len() {
            let left = self.nodes.len() - shown.len();
            let why = if hidden > 0 { "hidden (KHR_node_visibility) or not part of the scene" } else { "not part of the scene" };
            report.warn_in_file(format!("{left} of {} nodes were left out: they are {why}", self.nodes.len()));
        }
        shown
    }

    fn roots(&self, root: Json<'d>, report: &mut Report<'_>) -> Vec<usize> {
        let scenes = report.objects(root, "scenes");
        let chosen = report.index(root, "scene", "scene", scenes.len()).unwrap_or(0);
        let lists: Vec<Vec<usize>> = scenes.iter().map(|scene| self.roots_of(*scene, report)).collect();
        if scenes.len() > 1 {
            report.warn_in_file(format!("the file has {} scenes; scene {chosen} was imported", scenes.len()));
        }
        let all = || self.order.iter().copied().filter(|i| self.nodes[*i].parent.is_none()).collect();
        lists.into_iter().nth(chosen).unwrap_or_else(all)
    }

    fn roots_of(&self, scene: Json<'d>, report: &mut Report<'_>) -> Vec<usize> {
        let roots = report.indices(scene, "nodes", "node", self.nodes.len());
        for index in &roots {
            if let Some(parent) = self.nodes[*index].parent {
                report.error(scene, format!("node {index} of this scene is a child of node {parent}; only roots may be listed"));
            }
        }
        roots
    }
}

impl Local {
    /// As a matrix.
    pub(super) fn matrix(&self) -> DMat4 {
        match *self {
            Self::Matrix(m) => m,
            Self::Parts { translation, rotation, scale } => DMat4::from_scale_rotation_translation(scale, rotation, translation),
        }
    }
}

fn node<'d>(json: Json<'d>, all: usize, counts: Counts, report: &mut Report<'_>) -> Node<'d> {
    let weights = json.get("weights").map(|_| report.list(json, "weights"));
    let mesh = report.index(json, "mesh", "mesh", counts.meshes);
    let skin = report.index(json, "skin", "skin", counts.skins);
    if skin.is_some() && json.get("mesh").is_none() {
        report.error(json, "the node has a skin but no mesh that it could deform");
    }
    Node {
        json,
        parent: None,
        children: report.indices(json, "children", "node", all),
        local: local(json, report),
        mesh,
        skin,
        camera: report.index(json, "camera", "camera", counts.cameras),
        weights: weights.map(|list| list.into_iter().map(|w| report.number_at(w, &ANY).unwrap_or(0.0)).collect()),
        world: DMat4::IDENTITY,
    }
}

fn local(json: Json<'_>, report: &mut Report<'_>) -> Local {
    let parts = ["translation", "rotation", "scale"].into_iter().find(|name| json.get(name).is_some());
    if let Some(matrix) = report.vector::<16>(json, "matrix", &ANY) {
        if let Some(name) = parts {
            report.error(json, format!("the node has both `matrix` and `{name}`; it may have one of them"));
        }
        let matrix = DMat4::from_cols_array(&matrix);
        if matrix.row(3) != DVec4::W {
            report.error(json, "the last row of `matrix` must be 0, 0, 0, 1");
        }
        let (x, y, z) = (matrix.x_axis.truncate(), matrix.y_axis.truncate(), matrix.z_axis.truncate());
        let skewed = |a: DVec3, b: DVec3| a.dot(b).abs() > 1e-3 * (a.length() * b.length()).max(f64::MIN_POSITIVE);
        if skewed(x, y) || skewed(y, z) || skewed(z, x) {
            report.count(json, "matrices with a shear, which glTF forbids (applied all the same)");
        }
        return Local::Matrix(matrix);
    }
    Local::Parts {
        translation: report.vector(json, "translation", &ANY).map_or(DVec3::ZERO, DVec3::from_array),
        rotation: rotation(json, report),
        scale: report.vector(json, "scale", &ANY).map_or(DVec3::ONE, DVec3::from_array),
    }
}

fn rotation(json: Json<'_>, report: &mut Report<'_>) -> DQuat {
    let Some(q) = report.vector(json, "rotation", &ANY).map(DQuat::from_array) else { return DQuat::IDENTITY };
    let length = q.length();
    if (length - 1.0).abs() > UNIT {
        report.count(json, "rotations that are no unit quaternions (brought to length 1)");
    }
    unit(q)
}

/// A quaternion of length one; no rotation at all where it has no length.
pub(super) fn unit(q: DQuat) -> DQuat {
    let length = q.length();
    if length > 0.0 && length.is_finite() { q * (1.0 / length) } else { DQuat::IDENTITY }
}
