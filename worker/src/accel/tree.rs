//! The tree: obvhs's binary hierarchy collapsed into wide nodes whose boxes lie axis by axis.
//!
//! Boxes are grown a little relative to the largest coordinate, so that the rounding of a box test can never cull a triangle that the exact
//! test would hit, also for rays that run along a face of a box. Growing costs a few needless tests; a conservative test per box (Ize 2013)
//! costs a multiplication in every one.

use glam::{Vec3, Vec4};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris, node::Bvh2Node},
    triangle::Triangle,
};
use std::time::Duration;

/// Boxes of one node and triangles of one block: four fill one SSE register, which every x86-64 has.
pub(super) const WIDTH: usize = 4;
/// Levels of wide nodes that the traversal's stack has room for. Thousands of identical triangles make obvhs chain them; what lies below
/// this level becomes one long leaf, which is slow and right.
pub(super) const MAX_DEPTH: usize = 32;
/// How far boxes grow, relative to the largest coordinate: 16 units in the last place.
const GROW: f32 = 16.0 * f32::EPSILON;

/// What lies behind one box of a node: an inner node, or a run of blocks that ends with one marked as last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// The root, and what unused boxes lead to.
    pub(super) const ROOT: Child = Child(0);

    /// Index of the first block of a leaf.
    #[inline(always)]
    pub(super) fn leaf(self) -> Option<usize> {
        (self.0 & Self::LEAF != 0).then_some((self.0 & !Self::LEAF) as usize)
    }

    /// Index of an inner node.
    #[inline(always)]
    pub(super) fn node(self) -> usize {
        self.0 as usize
    }
}

/// A wide node. Unused boxes are inside out and never hit.
#[derive(Debug)]
pub(super) struct Node {
    /// Per axis, the low and high planes of every box.
    pub(super) planes: [[Vec4; 2]; 3],
    pub(super) children: [Child; WIDTH],
}

/// Four triangles of a leaf; the last one is repeated to fill the block.
#[derive(Debug)]
pub(super) struct Block {
    /// Per corner and axis, the coordinates of the four.
    pub(super) corners: [[Vec4; 3]; 3],
    pub(super) prims: [u32; WIDTH],
    /// Whether the leaf ends here.
    pub(super) last: bool,
}

#[derive(Debug)]
pub(super) struct Tree {
    /// The root is the first; empty for no triangles.
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
}

impl Tree {
    pub(super) fn build(triangles: &[[Vec3; 3]]) -> Self {
        let soup: Vec<Triangle> = triangles.iter().map(|t| Triangle { v0: t[0].into(), v1: t[1].into(), v2: t[2].into() }).collect();
        let mut tree = Self { nodes: Vec::new(), blocks: Vec::with_capacity(soup.len() / 2) };
        if soup.is_empty() {
            return tree;
        }
        let params = BvhBuildParams { max_prims_per_leaf: WIDTH as u32, ..BvhBuildParams::medium_build() };
        let binary = build_bvh2_from_tris(&soup, params, &mut Duration::default());
        let largest = triangles.iter().flatten().map(|c| c.abs().max_element()).fold(0.0, f32::max);
        tree.collapse(&binary, triangles, GROW * largest);
        tree
    }

    /// Gives every triangle another number.
    pub(super) fn renumber(&mut self, numbers: &[u32]) {
        self.blocks.iter_mut().flat_map(|b| &mut b.prims).for_each(|p| *p = numbers[*p as usize]);
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
                    Child(next as u32)
                };
                self.nodes[at].set(slot, node, grow, child);
            }
        }
    }

    /// All triangles at or below a binary node as one leaf.
    fn leaf(&mut self, binary: &Bvh2, root: usize, triangles: &[[Vec3; 3]]) -> Child {
        let (mut prims, mut open) = (Vec::new(), vec![root]);
        while let Some(index) = open.pop() {
            let node = &binary.nodes[index];
            let at = node.first_index as usize;
            if node.is_leaf() {
                prims.extend_from_slice(&binary.primitive_indices[at..at + node.prim_count as usize]);
            } else {
                open.extend([at, at + 1]);
            }
        }
        let first = self.blocks.len() as u32;
        self.blocks.extend(prims.chunks(WIDTH).map(|c| Block::new(c, triangles)));
        if let Some(block) = self.blocks.last_mut() {
            block.last = true;
        }
        Child(Child::LEAF | first)
    }
}

impl Block {
    fn new(chunk: &[u32], triangles: &[[Vec3; 3]]) -> Self {
        let prims: [u32; WIDTH] = std::array::from_fn(|lane| chunk[lane.min(chunk.len() - 1)]);
        let coordinate = |corner: usize, axis: usize| Vec4::from_array(prims.map(|p| triangles[p as usize][corner][axis]));
        Self { corners: std::array::from_fn(|c| std::array::from_fn(|a| coordinate(c, a))), prims, last: false }
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
        Self { planes: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3], children: [Child::ROOT; WIDTH] }
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
