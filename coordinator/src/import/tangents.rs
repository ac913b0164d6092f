//! Tangents for the normal maps of smooth surfaces, where the author gives none.
//!
//! Normal maps are made for tangents that are interpolated across the edges of a mesh; a tangent for each triangle shows every edge in
//! the highlights. These are MikkTSpace's (Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008), which glTF asks for and
//! modelling programs bake with: the corners of triangles that meet in a vertex, share edges there and are not mirror images of each
//! other in the texture have one tangent, the sum of their dP/du by the angle of each. The crate `bevy_mikktspace` is the yardstick of
//! the test but not used: it recurses once for each triangle around a vertex and takes the square of their number, so a disc of a
//! hundred thousand sectors would overflow the stack. Cost: O(n log n).

use super::weld::Pool;
use glam::{DVec3, Vec3};
use kiln_proto::{
    frame::Lie,
    math,
    scene::{Mapping, Scene, Surface, TextureRef},
};
use std::{
    collections::{HashMap, VecDeque},
    ops::Range,
};

/// Stands for a corner without a tangent: it is that of its triangle, if that has any.
pub(super) const NONE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// Gives tangents to the smooth surfaces that have a normal map and no tangents yet.
pub(super) fn complete(scene: &mut Scene) {
    // Backs have repeated values: indices change with them.
    let mut pool = Pool::default();
    let ids: Vec<u32> = std::mem::take(&mut scene.tangents).into_iter().map(|tangent| pool.id(tangent)).collect();
    scene.surfaces.iter_mut().flat_map(|s| s.tangents.as_flattened_mut()).for_each(|index| *index = ids[*index as usize]);
    for index in 0..scene.surfaces.len() {
        let surface = &scene.surfaces[index];
        if surface.normals.is_empty() || !surface.tangents.is_empty() || !scene.materials_of(surface).any(|m| m.normal_map.is_some()) {
            continue;
        }
        let (mut tangents, mut first) = (vec![], 0);
        for part in &surface.parts {
            let range = first..first + part.triangles as usize;
            first = range.end;
            match &scene.materials[part.material as usize].normal_map {
                Some(map) => tangents.extend(of_part(scene, surface, range, &map.texture)),
                None => tangents.extend(range.map(|_| [NONE; 3])),
            }
        }
        scene.surfaces[index].tangents = tangents.into_iter().map(|t| t.map(|t| pool.id(t))).collect();
    }
    scene.tangents = pool.values;
}

/// The tangents of a run of triangles along the coordinates by which they look a map up.
fn of_part(scene: &Scene, surface: &Surface, range: Range<usize>, map: &TextureRef) -> Vec<[[f32; 4]; 3]> {
    let Mapping::Uv { set } = map.mapping else { return vec![[NONE; 3]; range.len()] };
    let uv = |t: usize| surface.uv(set as usize, t).map(|corners| corners.map(|uv| map.moved(uv)));
    let coordinates: Vec<Option<[[f64; 2]; 3]>> = range.clone().map(uv).collect();
    // Looked up, never iterated: the order of hashing cannot matter.
    let mut numbers: HashMap<(u32, u32, [u64; 2]), u32> = HashMap::new();
    let mut vertices = Vec::with_capacity(range.len());
    for (t, uv) in range.clone().zip(&coordinates) {
        vertices.push(std::array::from_fn(|k| {
            let uv = uv.map_or([0; 2], |uv| uv[k].map(|c| (c + 0.0).to_bits()));
            let next = numbers.len() as u32;
            *numbers.entry((surface.triangles[t].corners[k], surface.normals[t][k], uv)).or_insert(next)
        }));
    }
    let along = |(t, uv): (usize, &Option<_>)| uv.and_then(|uv| Lie::of(scene.corners(&surface.triangles[t]), uv)).map(Along::from);
    let mut along: Vec<Option<Along>> = range.clone().zip(&coordinates).map(along).collect();
    let groups = Groups::of(&vertices, &mut along);
    let mut sums = vec![DVec3::ZERO; 3 * along.len()];
    for (i, t) in range.enumerate() {
        let Some(Along { direction: Some(direction), .. }) = along[i] else { continue };
        for k in 0..3 {
            let normal = Vec3::from_array(scene.normals[surface.normals[t][k] as usize]).as_dvec3();
            let flat = |v: DVec3| (v - normal * normal.dot(v)).normalize_or_zero();
            let corners = scene.corners(&surface.triangles[t]);
            let [before, after] = [2, 1].map(|step| flat(corners[(k + step) % 3] - corners[k]));
            sums[groups.of_corner(3 * i + k)] += flat(direction) * math::acos(before.dot(after));
        }
    }
    let tangent = |i: usize, k: usize| match (sums[groups.of_corner(3 * i + k)].try_normalize(), along[i]) {
        (Some(sum), Some(along)) => sum.as_vec3().extend(along.side).to_array(),
        // What is interpolated toward such a corner stays on its side.
        (None, Some(along)) => Vec3::ZERO.extend(along.side).to_array(),
        (_, None) => NONE,
    };
    (0..along.len()).map(|i| std::array::from_fn(|k| tangent(i, k))).collect()
}

/// How a triangle lies in its texture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Along {
    /// Unit dP/du; `None` for a triangle that has none, and follows its neighbours.
    direction: Option<DVec3>,
    /// 1, or -1 where the texture shows its mirror image.
    side: f32,
}

impl From<Lie> for Along {
    fn from(lie: Lie) -> Self {
        Self { direction: Some(lie.along_u), side: lie.side as f32 }
    }
}

/// Which corners share a tangent: a forest over corners, the roots of which name groups.
struct Groups(Vec<u32>);

impl Groups {
    /// Joins what meets at edges. Triangles without a place in the texture become those of the first neighbour that has one.
    fn of(vertices: &[[u32; 3]], along: &mut [Option<Along>]) -> Self {
        let mut groups = Self((0..3 * vertices.len() as u32).collect());
        let pairs = pairs(vertices);
        for [p, q] in &pairs {
            let [p, q] = [p, q].map(|corners| corners[0] as usize / 3);
            let (own, other) = (along[p], along[q]);
            let follow = |a: Option<Along>| a.filter(|a| a.direction.is_some()).map(|a| Along { direction: None, ..a });
            match (own, other) {
                (None, Some(_)) => along[p] = follow(other),
                (Some(_), None) => along[q] = follow(own),
                _ => {}
            }
        }
        for [p, q] in pairs {
            let [own, other] = [p, q].map(|corners| along[corners[0] as usize / 3]);
            if own.zip(other).is_some_and(|(a, b)| a.side == b.side) {
                (0..2).for_each(|end| groups.join(p[end], q[end]));
            }
        }
        (0..groups.0.len()).for_each(|corner| groups.0[corner] = groups.root(corner as u32));
        groups
    }

    fn root(&mut self, mut corner: u32) -> u32 {
        while self.0[corner as usize] != corner {
            let above = self.0[self.0[corner as usize] as usize];
            self.0[corner as usize] = above;
            corner = above;
        }
        corner
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn of_corner(&self, corner: usize) -> usize {
        self.0[corner] as usize
    }
}

/// The edges at which two triangles meet: the corners of either at its one end and at its other. Of more than two triangles at an edge each
/// meets the first that runs along it the other way and has none yet.
fn pairs(vertices: &[[u32; 3]]) -> Vec<[[u32; 2]; 2]> {
    let mut edges = Vec::with_capacity(3 * vertices.len());
    for (t, v) in vertices.iter().enumerate() {
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let (forward, low, high) = if v[i] <= v[j] { (true, (v[i], i), (v[j], j)) } else { (false, (v[j], j), (v[i], i)) };
            if low.0 != high.0 {
                edges.push((low.0, high.0, [low.1, high.1].map(|k| (3 * t + k) as u32), forward));
            }
        }
    }
    edges.sort_unstable_by_key(|(low, high, corners, _)| (*low, *high, corners[0]));
    let (mut pairs, mut waiting) = (vec![], VecDeque::new());
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        waiting.clear();
        for (_, _, corners, forward) in same {
            match waiting.front() {
                Some((other, way)) if way != forward => {
                    pairs.push([*other, *corners]);
                    waiting.pop_front();
                }
                _ => waiting.push_back((*corners, *forward)),
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests;
