//! The tree: obvhs's binary hierarchy collapsed into wide nodes whose boxes lie axis by axis.
//!
//! Boxes are grown a little relative to the largest coordinate, so that the rounding of a box test can never cull a triangle that the exact
//! test would hit, also for rays that run along a face of a box. Growing costs a few needless tests; a conservative test per box (Ize 2013)
//! costs a multiplication in every one.

use glam::Vec3;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris, node::Bvh2Node},
    triangle::Triangle,
};
use std::time::Duration;

/// Boxes of one node: four fill one SSE register, which every x86-64 has.
pub(super) const WIDTH: usize = 4;
/// Levels of wide nodes that the traversal's stack has room for. Thousands of identical triangles make obvhs chain them; what lies below
/// this level becomes one long leaf, which is slow and right.
pub(super) const MAX_DEPTH: usize = 32;
/// How far boxes grow, relative to the largest coordinate: 16 units in the last place.
const GROW: f32 = 16.0 * f32::EPSILON;

/// What lies behind one box of a node: an inner node, or triangles of the leaf order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child {
    /// Index of a node, or of the first triangle.
    pub(super) first: u32,
    /// Triangles; 0 for an inner node.
    pub(super) count: u32,
}

/// A wide node. Unused boxes are inside out and never hit.
#[derive(Debug)]
#[repr(align(16))]
pub(super) struct Node {
    /// Per axis, the low and high planes of every box.
    pub(super) planes: [[[f32; WIDTH]; 2]; 3],
    pub(super) children: [Child; WIDTH],
}

/// A triangle where its leaf is.
#[derive(Debug)]
pub(super) struct Leaf {
    pub(super) corners: [Vec3; 3],
    pub(super) prim: u32,
}

#[derive(Debug)]
pub(super) struct Tree {
    /// The root is the first; empty for no triangles.
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
}

impl Tree {
    pub(super) fn build(triangles: &[[Vec3; 3]]) -> Self {
        let soup: Vec<Triangle> = triangles.iter().map(|t| Triangle { v0: t[0].into(), v1: t[1].into(), v2: t[2].into() }).collect();
        let mut tree = Self { nodes: Vec::new(), leaves: Vec::with_capacity(soup.len()) };
        if soup.is_empty() {
            return tree;
        }
        let binary = build_bvh2_from_tris(&soup, BvhBuildParams::medium_build(), &mut Duration::default());
        let largest = triangles.iter().flatten().map(|c| c.abs().max_element()).fold(0.0, f32::max);
        tree.collapse(&binary, triangles, GROW * largest);
        tree
    }

    /// Emits wide nodes breadth first without recursion: the depth of the input is not ours to trust.
    fn collapse(&mut self, binary: &Bvh2, triangles: &[[Vec3; 3]], grow: f32) {
        self.nodes.push(Node::unused());
        let mut open = vec![(0usize, 0usize, 1usize)]; // (wide node to fill, binary node it stands for, its level)
        while let Some((at, root, level)) = open.pop() {
            for (slot, index) in gather_children(binary, root).into_iter().enumerate() {
                let node = &binary.nodes[index];
                let child = if node.is_leaf() || level == MAX_DEPTH {
                    self.leaf(binary, index, triangles)
                } else {
                    let next = self.nodes.len();
                    self.nodes.push(Node::unused());
                    open.push((next, index, level + 1));
                    Child { first: next as u32, count: 0 }
                };
                self.nodes[at].set(slot, node, grow, child);
            }
        }
    }

    /// All triangles at or below a binary node as one leaf.
    fn leaf(&mut self, binary: &Bvh2, root: usize, triangles: &[[Vec3; 3]]) -> Child {
        let first = self.leaves.len() as u32;
        let mut open = vec![root];
        while let Some(index) = open.pop() {
            let node = &binary.nodes[index];
            let at = node.first_index as usize;
            if node.is_leaf() {
                let prims = &binary.primitive_indices[at..at + node.prim_count as usize];
                self.leaves.extend(prims.iter().map(|prim| Leaf { corners: triangles[*prim as usize], prim: *prim }));
            } else {
                open.extend([at, at + 1]);
            }
        }
        Child { first, count: self.leaves.len() as u32 - first }
    }
}

/// The binary nodes that become the children of one wide node: the largest inner one is opened until the node is full.
fn gather_children(binary: &Bvh2, root: usize) -> Vec<usize> {
    let mut children = vec![root];
    while children.len() < WIDTH {
        let inner = children.iter().enumerate().filter(|(_, c)| !binary.nodes[**c].is_leaf());
        let area = |c: usize| binary.nodes[c].aabb().half_area();
        let Some((slot, index)) = inner.map(|(s, c)| (s, *c)).max_by(|a, b| area(a.1).total_cmp(&area(b.1))) else { break };
        let first = binary.nodes[index].first_index as usize;
        children[slot] = first;
        children.push(first + 1);
    }
    children
}

impl Node {
    fn unused() -> Self {
        let planes = [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3];
        Self { planes, children: [Child { first: 0, count: 0 }; WIDTH] }
    }

    fn set(&mut self, slot: usize, node: &Bvh2Node, grow: f32, child: Child) {
        let bounds = node.aabb();
        for axis in 0..3 {
            self.planes[axis][0][slot] = bounds.min[axis] - grow;
            self.planes[axis][1][slot] = bounds.max[axis] + grow;
        }
        self.children[slot] = child;
    }
}
