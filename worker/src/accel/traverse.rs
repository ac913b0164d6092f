//! Walking the tree: nearest boxes first for closest hits, any order for occlusion.
//!
//! Compiled once per main axis of the ray (the triangle test shears onto it), so that no component is picked at run time.

use super::{
    Hit, Ray,
    tree::{Child, MAX_DEPTH, Node, Tree, WIDTH},
    triangle::Sheared,
};
use glam::{Vec3, Vec4};

/// A direction component this small counts as this large when it is inverted: 1/0 times a distance of 0 would be no number.
const SMALLEST: f32 = 1e-18;

#[inline]
pub(super) fn closest(tree: &Tree, ray: &Ray, meets: impl Fn(&Hit) -> bool) -> Option<Hit> {
    match main_axis(ray.direction) {
        0 => closest_along::<0>(tree, ray, meets),
        1 => closest_along::<1>(tree, ray, meets),
        _ => closest_along::<2>(tree, ray, meets),
    }
}

#[inline]
pub(super) fn occluded(tree: &Tree, ray: &Ray, blocks: impl FnMut(&Hit) -> bool) -> bool {
    match main_axis(ray.direction) {
        0 => occluded_along::<0>(tree, ray, blocks),
        1 => occluded_along::<1>(tree, ray, blocks),
        _ => occluded_along::<2>(tree, ray, blocks),
    }
}

fn main_axis(d: Vec3) -> usize {
    let d = d.abs();
    if d.x >= d.y && d.x >= d.z {
        0
    } else if d.y >= d.z {
        1
    } else {
        2
    }
}

/// The boxes of a node against one ray.
struct Slabs {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Per axis, which plane of a box the ray meets first: 0 the low one.
    near: [usize; 3],
}

impl Slabs {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        let inverse = ray.direction.to_array().map(|d| 1.0 / if d.abs() < SMALLEST { SMALLEST.copysign(d) } else { d });
        Self { origin: ray.origin.to_array(), inverse, near: inverse.map(|i| usize::from(i < 0.0)) }
    }

    /// Where the ray enters each box, and a bit for each that it enters within (0, tmax].
    #[inline(always)]
    fn enter(&self, node: &Node, tmax: f32) -> (Vec4, u32) {
        let (mut enter, mut leave) = (Vec4::ZERO, Vec4::splat(tmax));
        for axis in 0..3 {
            let (o, i) = (self.origin[axis], self.inverse[axis]);
            let near = (node.planes[axis][self.near[axis]] - o) * i;
            let far = (node.planes[axis][1 - self.near[axis]] - o) * i;
            enter = enter.max(near);
            leave = leave.min(far);
        }
        (enter, enter.cmple(leave).bitmask())
    }
}

/// Nodes still to visit: at most WIDTH - 1 siblings wait on each level, and one node is current.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

fn closest_along<const K: usize>(tree: &Tree, ray: &Ray, meets: impl Fn(&Hit) -> bool) -> Option<Hit> {
    let (slabs, sheared) = (Slabs::new(ray), Sheared::<K>::new(ray.origin, ray.direction));
    let mut best = Hit { prim: u32::MAX, t: ray.tmax, u: 0.0, v: 0.0 };
    let mut stack = [(0.0f32, Child::ROOT); STACK];
    let mut used = usize::from(!tree.nodes.is_empty());
    while used > 0 {
        used -= 1;
        let (entry, child) = stack[used];
        if entry > best.t {
            continue;
        }
        if let Some(first) = child.leaf() {
            for block in &tree.blocks[first..] {
                sheared.cross(block, best.t, |lane, (t, u, v)| {
                    let prim = block.prims[lane];
                    let hit = Hit { prim, t, u, v };
                    if (t < best.t || (t == best.t && prim < best.prim)) && meets(&hit) {
                        best = hit;
                    }
                });
                if block.last {
                    break;
                }
            }
            continue;
        }
        let node = &tree.nodes[child.node()];
        let (enter, mut hits) = slabs.enter(node, best.t);
        let (enter, base) = (enter.to_array(), used);
        while hits != 0 {
            let k = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            // Insertion keeps the nearest on top.
            let mut at = used;
            while at > base && stack[at - 1].0 < enter[k] {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = (enter[k], node.children[k]);
            used += 1;
        }
    }
    (best.prim != u32::MAX).then_some(best)
}

fn occluded_along<const K: usize>(tree: &Tree, ray: &Ray, mut blocks: impl FnMut(&Hit) -> bool) -> bool {
    let (slabs, sheared) = (Slabs::new(ray), Sheared::<K>::new(ray.origin, ray.direction));
    let mut stack = [Child::ROOT; STACK];
    let mut used = usize::from(!tree.nodes.is_empty());
    while used > 0 {
        used -= 1;
        let Some(first) = stack[used].leaf() else {
            let node = &tree.nodes[stack[used].node()];
            let (_, mut hits) = slabs.enter(node, ray.tmax);
            while hits != 0 {
                stack[used] = node.children[hits.trailing_zeros() as usize];
                used += 1;
                hits &= hits - 1;
            }
            continue;
        };
        for block in &tree.blocks[first..] {
            let mut blocked = false;
            sheared.cross(block, ray.tmax, |lane, (t, u, v)| blocked = blocked || blocks(&Hit { prim: block.prims[lane], t, u, v }));
            if blocked {
                return true;
            }
            if block.last {
                break;
            }
        }
    }
    false
}
