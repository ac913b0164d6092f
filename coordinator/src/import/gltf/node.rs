//! The node hierarchy: checked to be a forest, with world transforms in f64.
//!
//! Everything here iterates over an order in which parents come before their children; a chain of a million nodes costs no stack. What
//! most nodes of a long list lack (a place, children, weights) is kept apart, so that a node that says nothing takes a hundred bytes and
//! not four.

use super::{instance::INSTANCING, json::Json, light::PUNCTUAL, local::Local, property::ANY, report::Report};
use glam::DMat4;
use std::rc::Rc;

/// A node.
#[derive(Debug)]
pub(super) struct Node<'d> {
    /// Its description.
    pub(super) json: Json<'d>,
    parent: Option<u32>,
    children: Box<[u32]>,
    /// How it stands within its parent, where it says so.
    local: Option<Box<Local>>,
    mesh: Option<u32>,
    skin: Option<u32>,
    camera: Option<u32>,
    light: Option<u32>,
    /// Its own weights of morph targets.
    pub(super) weights: Option<Box<[f64]>>,
    /// To world space; the parent's own where the node stays where its parent is.
    pub(super) world: Rc<DMat4>,
}

impl Node<'_> {
    /// Index of its mesh.
    pub(super) fn mesh(&self) -> Option<usize> {
        self.mesh.map(|i| i as usize)
    }

    /// Index of its skin.
    pub(super) fn skin(&self) -> Option<usize> {
        self.skin.map(|i| i as usize)
    }

    /// Index of its camera.
    pub(super) fn camera(&self) -> Option<usize> {
        self.camera.map(|i| i as usize)
    }

    /// Index of its light.
    pub(super) fn light(&self) -> Option<usize> {
        self.light.map(|i| i as usize)
    }

    /// Whether it says how it stands by a matrix.
    pub(super) fn has_matrix(&self) -> bool {
        matches!(self.local.as_deref(), Some(Local::Matrix(_)))
    }

    /// How it stands within its parent, to be changed.
    pub(super) fn local(&mut self) -> &mut Local {
        self.local.get_or_insert_with(|| Box::new(Local::STILL))
    }
}

/// How many of the things there are that nodes refer to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) meshes: usize,
    pub(super) skins: usize,
    pub(super) cameras: usize,
    pub(super) lights: usize,
    pub(super) accessors: usize,
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
        let world = Rc::new(DMat4::IDENTITY);
        let mut nodes: Vec<Node<'d>> = list.into_iter().map(|json| node(json, all, counts, &world, report)).collect();
        for index in 0..all {
            for child in nodes[index].children.clone() {
                let child = child as usize;
                if let Some(other) = nodes[child].parent {
                    let message = format!("node {child} is already a child of node {other}; a node has one parent");
                    report.error(nodes[index].json, message);
                    return None;
                }
                nodes[child].parent = Some(index as u32);
            }
        }
        let mut order: Vec<usize> = (0..all).filter(|i| nodes[*i].parent.is_none()).collect();
        let mut next = 0;
        while let Some(index) = order.get(next) {
            order.extend(nodes[*index].children.iter().map(|i| *i as usize));
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
                at = self.nodes[at].parent.map_or(at, |p| p as usize);
            }
            // This walk came back upon itself: around once more, to name them all.
            let first = at;
            let mut left = walk[first] == start + 1;
            while left {
                report.error(self.nodes[at].json, "the node is part of a loop: it is its own ancestor");
                at = self.nodes[at].parent.map_or(first, |p| p as usize);
                left = at != first;
            }
        }
        false
    }

    /// Computes the world transforms from the local ones.
    pub(super) fn place(&mut self) {
        let root = Rc::new(DMat4::IDENTITY);
        for index in 0..self.order.len() {
            let node = &self.nodes[self.order[index]];
            let parent = node.parent.map_or(&root, |p| &self.nodes[p as usize].world);
            let world = node.local.as_ref().map_or_else(|| parent.clone(), |local| Rc::new(**parent * local.matrix()));
            self.nodes[self.order[index]].world = world;
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
            stack.extend(node.children.iter().rev().map(|i| *i as usize));
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

    /// The roots of a scene. What is no root is an error and none of them, so that nothing is shown twice: of a chain whose nodes are all
    /// listed, half the square of their number would be.
    fn roots_of(&self, scene: Json<'d>, report: &mut Report<'_>) -> Vec<usize> {
        let mut roots = report.indices(scene, "nodes", "node", self.nodes.len());
        roots.retain(|index| {
            let Some(parent) = self.nodes[*index].parent else { return true };
            report.error(scene, format!("node {index} of this scene is a child of node {parent}; only roots may be listed"));
            false
        });
        roots
    }
}

fn node<'d>(json: Json<'d>, all: usize, counts: Counts, world: &Rc<DMat4>, report: &mut Report<'_>) -> Node<'d> {
    let narrow = |index: Option<usize>| index.map(|i| i as u32);
    let weights = json.get("weights").map(|_| report.list(json, "weights"));
    let mesh = report.index(json, "mesh", "mesh", counts.meshes);
    let skin = report.index(json, "skin", "skin", counts.skins);
    if skin.is_some() && json.get("mesh").is_none() {
        report.error(json, "the node has a skin but no mesh that it could deform");
    }
    let light = json.extension(PUNCTUAL).and_then(|e| report.required(e, "light"));
    let light = light.and_then(|at| report.index_at(at, "light", counts.lights));
    // Read only where the node is shown.
    for (_, at) in json.extension(INSTANCING).and_then(|e| e.get("attributes")).into_iter().flat_map(Json::members) {
        report.index_at(at, "accessor", counts.accessors);
    }
    Node {
        json,
        parent: None,
        children: report.indices(json, "children", "node", all).into_iter().map(|i| i as u32).collect(),
        local: Some(Local::read(json, report)).filter(|local| *local != Local::STILL).map(Box::new),
        mesh: narrow(mesh),
        skin: narrow(skin),
        camera: narrow(report.index(json, "camera", "camera", counts.cameras)),
        light: narrow(light),
        weights: weights.map(|list| list.into_iter().map(|w| report.number_at(w, &ANY).unwrap_or(0.0)).collect()),
        world: world.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::json::Document;
    use super::*;
    use crate::import::findings::Findings;
    use glam::DVec3;

    /// The shortest nodes are three bytes of a file: what each takes in memory is what such a file may ask for.
    #[test]
    fn nodes_that_say_nothing_take_little_and_share_their_place() {
        assert!(size_of::<Node<'_>>() <= 104, "{}", size_of::<Node<'_>>());
        let text = r#"{"nodes": [{}, {"children": [0], "translation": [1, 2, 3]}, {"scale": [1, 1, 1]}, {}]}"#;
        let (document, mut findings) = (Document::parse(text).unwrap(), Findings::default());
        let mut report = Report::new("a", false, &mut findings);
        let mut graph = Graph::load(document.root(), Counts::default(), &mut report).unwrap();
        graph.place();
        let [a, b, c, d] = &graph.nodes[..] else { panic!() };
        assert!(Rc::ptr_eq(&a.world, &b.world) && Rc::ptr_eq(&c.world, &d.world) && !Rc::ptr_eq(&a.world, &d.world));
        assert_eq!((a.world.w_axis.truncate(), *d.world), (DVec3::new(1.0, 2.0, 3.0), DMat4::IDENTITY));
    }
}
