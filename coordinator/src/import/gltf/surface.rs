//! From nodes with meshes to surfaces: each primitive of each node is one, in world space, named after its node.
//!
//! Copies are made because every copy needs a light field of its own. Their number is known before the first is made, so a file of a few
//! kilobytes that asks for a billion triangles is refused at once.

use super::{
    accessor::Accessors,
    deform::{Moved, Shape, Skin},
    instance::Instances,
    material::{Chosen, Materials},
    mesh::{Mesh, Primitive},
    node::{Graph, Node},
    report::Report,
};
use crate::import::surfaces;
use glam::{DMat4, DVec3};
use kiln_proto::{
    limits,
    scene::{Part, Surface, Triangle},
};

/// Vertices that may be read to place the primitives of a scene: so many for each triangle that is made of them, for each byte of the
/// buffers, and in any scene. An honest primitive has at most three vertices a triangle, or shares a list of them with others.
const READ_PER_TRIANGLE: u64 = 16;
const READ_PER_BYTE: u64 = 128;
const READ: u64 = 1 << 24;
/// A vertex that no triangle has used yet.
const UNUSED: u32 = u32::MAX;

/// What nodes refer to.
pub(super) struct Source<'s, 'd, 'b> {
    pub(super) accessors: &'s Accessors<'d, 'b>,
    pub(super) meshes: &'s [Mesh<'s, 'd>],
    pub(super) skins: &'s [Skin<'s, 'd>],
    pub(super) graph: &'s Graph<'d>,
}

/// The surfaces of a scene so far.
#[derive(Default)]
pub(super) struct Surfaces {
    pub(super) made: surfaces::Surfaces,
    triangles: usize,
    /// Vertices read for them.
    read: u64,
}

/// A primitive in world space.
struct Placed<'p, 's, 'd> {
    primitive: &'p Primitive<'s, 'd>,
    shape: Shape,
    moved: Moved,
    /// Texture coordinates by set, v up; an absent set is empty.
    uvs: Vec<Vec<[f32; 2]>>,
    /// Colours; empty where all are opaque white.
    colors: Vec<[f32; 4]>,
}

impl Surfaces {
    /// Adds what one node shows; `None` where that was an error.
    pub(super) fn add(
        &mut self,
        node: &Node<'_>,
        source: &Source<'_, '_, '_>,
        materials: &mut Materials<'_, '_>,
        report: &mut Report<'_>,
    ) -> Option<()> {
        let Some(index) = node.mesh() else { return Some(()) };
        let mesh = &source.meshes[index];
        let copies = Instances::of(node, source.accessors, report)?;
        self.count(node, mesh, copies.count, source, report)?;
        let name = node.json.name().or_else(|| mesh.name.clone()).unwrap_or_else(|| format!("mesh{index}"));
        let joints = node.skin().map(|skin| source.skins[skin].matrices(source.graph, source.accessors));
        for copy in 0..copies.count {
            let world = *node.world * copies.matrix(copy, source.accessors);
            for primitive in &mesh.primitives {
                let placed = place(node, world, joints.as_deref(), mesh, primitive, source.accessors, report)?;
                let tint = || surfaces::mean_colour(placed.colors.iter().copied());
                let chosen = materials.choose(primitive.material, tint, placed.moved.stretch, report);
                let material = materials.materials[chosen.id as usize].name.as_str();
                let wanted = surfaces::called(&name, (mesh.primitives.len() > 1).then_some(material));
                self.surface(&wanted, &placed, &chosen, source.accessors, report);
            }
        }
        Some(())
    }

    /// Counts what the copies of a mesh add before one is made; `None` where that is too much.
    fn count(
        &mut self,
        node: &Node<'_>,
        mesh: &Mesh<'_, '_>,
        copies: usize,
        source: &Source<'_, '_, '_>,
        report: &mut Report<'_>,
    ) -> Option<()> {
        let each: usize = mesh.primitives.iter().map(Primitive::triangle_count).sum();
        self.triangles = self.triangles.saturating_add(each.saturating_mul(copies));
        let surfaces = self.made.len().saturating_add(mesh.primitives.len().saturating_mul(copies));
        for (what, found, most) in [("triangles", self.triangles, limits::TRIANGLES), ("surfaces", surfaces, limits::SURFACES)] {
            if found > most {
                report.error(node.json, format!("with this node the scene has {found} {what}; at most {most} are allowed"));
                return None;
            }
        }
        let weights = node.weights.as_deref().unwrap_or(&mesh.weights);
        let joints = node.skin().map_or(0, |skin| source.skins[skin].joint_count() as u64);
        let each = mesh.primitives.iter().map(|p| p.work(weights)).fold(0, u64::saturating_add);
        self.read = self.read.saturating_add(joints).saturating_add(each.saturating_mul(copies as u64));
        let of_bytes = source.accessors.buffers.total().saturating_mul(READ_PER_BYTE);
        let most = READ.saturating_add(of_bytes).saturating_add(READ_PER_TRIANGLE.saturating_mul(self.triangles as u64));
        if self.read > most {
            let message = format!(
                "with this node {} vertices (counted again for each morph target and set of joints) are read for {} triangles; at most \
                 {most} are read in such a file; let primitives have no more vertices than they use",
                self.read, self.triangles
            );
            report.error(node.json, message);
            return None;
        }
        Some(())
    }

    fn surface(
        &mut self,
        wanted: &str,
        placed: &Placed<'_, '_, '_>,
        chosen: &Chosen,
        accessors: &Accessors<'_, '_>,
        report: &mut Report<'_>,
    ) {
        let json = placed.primitive.json;
        say_what_is_missing(placed, chosen, report);
        let tangents = if chosen.has_normal_map { tangents(placed, report) } else { vec![] };
        let mut surface = Surface { uv_sets: vec![vec![]; placed.uvs.len()], ..Surface::default() };
        let mut places = vec![UNUSED; placed.shape.positions.len()];
        for (polygon, corners) in placed.primitive.triangles(accessors).enumerate() {
            let [a, b, c] = corners;
            let corners = if placed.moved.mirrored { [a, c, b] } else { corners };
            let ids = corners.map(|v| {
                if places[v] == UNUSED {
                    places[v] = self.made.weld.positions.id(placed.shape.positions[v].as_vec3().to_array());
                }
                places[v]
            });
            if let Err(left) = self.made.weld.triangle(ids) {
                report.count(json, left.words());
                continue;
            }
            surface.triangles.push(Triangle { corners: ids, polygon: polygon as u32 });
            self.corners(&mut surface, placed, corners, report);
            if !tangents.is_empty() {
                surface.tangents.push(corners.map(|v| self.made.weld.tangents.id(tangents[v])));
            }
        }
        if surface.triangles.is_empty() {
            report.count(json, "primitives without any triangle left were dropped");
            return;
        }
        let part = Part::plain("", chosen.id, surface.triangles.len());
        self.made.push(surface, part, wanted, chosen.two_sided, None);
    }

    /// What belongs to the corners of the triangle that was added last.
    fn corners(&mut self, surface: &mut Surface, placed: &Placed<'_, '_, '_>, corners: [usize; 3], report: &mut Report<'_>) {
        for (set, uvs) in surface.uv_sets.iter_mut().zip(&placed.uvs) {
            set.push((!uvs.is_empty()).then(|| corners.map(|v| uvs[v])));
        }
        if !placed.colors.is_empty() {
            surface.colors.push(corners.map(|v| self.made.weld.colors.id(placed.colors[v])));
        }
        if !placed.shape.normals.is_empty() {
            let [a, b, c] = corners.map(|v| placed.shape.positions[v]);
            let flat = (b - a).cross(c - a);
            let normals = corners.map(|v| {
                placed.shape.normals[v].try_normalize().filter(|n| n.is_finite()).unwrap_or_else(|| {
                    report.count(placed.primitive.json, "normals without a length were replaced by those of their triangles");
                    flat.normalize_or(DVec3::Y)
                })
            });
            surface.normals.push(normals.map(|n| self.made.weld.normals.id(n.as_vec3().to_array())));
        }
    }
}

/// Takes a primitive to world space, by the joints of its node's skin where there are some.
fn place<'p, 's, 'd>(
    node: &Node<'_>,
    world: DMat4,
    joints: Option<&[DMat4]>,
    mesh: &Mesh<'_, '_>,
    primitive: &'p Primitive<'s, 'd>,
    accessors: &Accessors<'_, '_>,
    report: &mut Report<'_>,
) -> Option<Placed<'p, 's, 'd>> {
    let json = primitive.json;
    let weights = node.weights.as_deref().unwrap_or(&mesh.weights);
    if !weights.is_empty() && weights.len() != primitive.targets.len() {
        let message = format!("{} weights are given for the {} morph targets of the mesh", weights.len(), primitive.targets.len());
        report.error(node.json, message);
        return None;
    }
    match (joints.is_some(), !primitive.influences.is_empty()) {
        (true, false) => report.count(node.json, "nodes have a skin, but their meshes have no joints; they were not bent"),
        (false, true) => report.count(json, "primitives have joints, but their nodes have no skin; they were not bent"),
        _ => {}
    }
    let mut shape = Shape::read(primitive, weights, accessors);
    let moved = match joints.filter(|_| !primitive.influences.is_empty()) {
        Some(joints) => shape.bend(primitive, joints, accessors, report)?,
        None => shape.place(world),
    };
    if shape.positions.iter().any(|p| !p.is_finite() || p.abs().max_element() > f64::from(f32::MAX)) {
        report.error(json, "a vertex lies where single precision does not reach, after the transforms of its node");
        return None;
    }
    let uvs = primitive.uvs.iter().map(|set| set.map(|set| set.all(&accessors.buffers).map(upright).collect()).unwrap_or_default());
    let uvs = uvs.collect();
    Some(Placed { primitive, shape, moved, uvs, colors: colors(primitive, accessors, report) })
}

/// glTF counts v from the top of an image, a scene from the bottom.
fn upright([u, v]: [f64; 2]) -> [f32; 2] {
    [u as f32 + 0.0, (1.0 - v) as f32 + 0.0]
}

fn colors(primitive: &Primitive<'_, '_>, accessors: &Accessors<'_, '_>, report: &mut Report<'_>) -> Vec<[f32; 4]> {
    let Some(found) = primitive.colors else { return vec![] };
    let is_opaque = found.width() == 3;
    let mut clamped = 0;
    let read = found.all::<4>(&accessors.buffers).map(|mut color| {
        if is_opaque {
            color[3] = 1.0;
        }
        clamped += u64::from(color.iter().any(|c| !(0.0..=1.0).contains(c)));
        color.map(|c| c.clamp(0.0, 1.0) as f32)
    });
    let colors: Vec<[f32; 4]> = read.collect();
    report.count_many(primitive.json, "vertex colours outside [0, 1] were clamped", clamped);
    if colors.iter().all(|c| *c == [1.0; 4]) { vec![] } else { colors }
}

fn say_what_is_missing(placed: &Placed<'_, '_, '_>, chosen: &Chosen, report: &mut Report<'_>) {
    let json = placed.primitive.json;
    if chosen.sets.iter().any(|set| placed.uvs.get(*set as usize).is_none_or(Vec::is_empty)) {
        report.count(json, "primitives lack texture coordinates that their material looks up; the lower left texel is taken");
    }
}

/// The author's unit tangents with the sides of their bitangents; empty where there are none to be used, so that they are made.
fn tangents(placed: &Placed<'_, '_, '_>, report: &mut Report<'_>) -> Vec<[f32; 4]> {
    let (shape, json) = (&placed.shape, placed.primitive.json);
    if shape.tangents.is_empty() {
        return vec![];
    }
    if shape.normals.is_empty() {
        report.count(json, "tangents of primitives without normals were ignored, as glTF wants");
        return vec![];
    }
    let unit = |t: &DVec3| t.try_normalize().filter(|t| t.is_finite());
    let tangents = shape.tangents.iter().zip(&shape.sides).map(|(t, side)| Some(unit(t)?.as_vec3().extend(*side as f32).to_array()));
    let all: Option<Vec<[f32; 4]>> = tangents.collect();
    all.unwrap_or_else(|| {
        report.count(json, "primitives with a tangent without a length; all of their tangents were made from texture coordinates");
        vec![]
    })
}
