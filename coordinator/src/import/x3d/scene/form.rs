//! Shapes with their meshes in the world, before they have materials.
//!
//! The mesh of a geometry node is made once however often the node is used, and all triangles are counted before the first copy is made: a file
//! of a few kilobytes whose groups use each other stands for millions of them, and must be refused in a moment.

use super::{
    coordinates::{Coordinates, Source},
    shadow::{Received, is_light},
    shape,
    texture::{Layer, Stack, Textures},
    walk::{Placed, World},
};
use crate::import::{
    findings::Findings,
    mesh::Mesh,
    x3d::{NodeId, NodeRef, geometry::Geometry},
};
use kiln_proto::{
    limits,
    options::{ImportOptions, ProjectorMode},
};
use std::collections::BTreeMap;

/// A shape in the world, without its material.
pub(super) struct Formed<'w, 'd> {
    pub(super) placed: &'w Placed<'d>,
    pub(super) appearance: Option<NodeRef<'d>>,
    pub(super) mesh: Mesh,
    pub(super) coordinates: Coordinates<'d>,
    pub(super) two_sided: bool,
    pub(super) casts: bool,
    pub(super) stack: Stack<'d>,
    /// Layers that colour the light which projects them, not the shape.
    pub(super) thrown: Vec<Layer<'d>>,
    pub(super) received: Received,
}

/// The mesh of each geometry node, in its own space.
type Meshes<'d> = BTreeMap<NodeId, Option<(Geometry, Coordinates<'d>)>>;

/// All shapes that have a surface; none where there are too many triangles, which is then an error.
pub(super) fn form<'w, 'd>(
    world: &'w World<'d>,
    textures: &mut Textures<'_>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Vec<Formed<'w, 'd>> {
    let mut meshes = Meshes::new();
    let mut corners = 0usize;
    for placed in &world.shapes {
        let Some(geometry) = surface_of(placed.node, findings) else { continue };
        let made = meshes.entry(geometry.id()).or_insert_with(|| {
            let mut coordinates = Coordinates::of(geometry, findings);
            shape::mesh(geometry, &mut coordinates, findings).map(|mesh| (mesh, coordinates))
        });
        corners = corners.saturating_add(made.as_ref().map_or(0, |(g, _)| g.mesh.corners.len()));
        if corners > 3 * limits::TRIANGLES {
            findings.error(placed.node.at(), format!("with this shape the scene has more than {} triangles", limits::TRIANGLES));
            return vec![];
        }
    }
    let shapes = world.shapes.iter().filter_map(|placed| {
        let geometry = placed.node.node("geometry")?;
        let (made, coordinates) = meshes.get(&geometry.id())?.as_ref()?;
        is_shown(placed.node).then(|| place(placed, geometry, made.clone(), coordinates.clone(), textures, options, findings)).flatten()
    });
    shapes.collect()
}

fn is_shown(node: NodeRef<'_>) -> bool {
    node.bool("visible") && node.bool("render")
}

/// The geometry of a shape that is shown and has a surface.
fn surface_of<'d>(node: NodeRef<'d>, findings: &mut Findings) -> Option<NodeRef<'d>> {
    if !is_shown(node) {
        findings.count(node.at(), "shapes that are not visible were left out");
        return None;
    }
    let geometry = node.node("geometry")?;
    if shape::has_no_surface(geometry.kind()) {
        findings.count(geometry.at(), "shapes of points and lines were left out, they have no surface");
        return None;
    }
    Some(geometry)
}

fn place<'w, 'd>(
    placed: &'w Placed<'d>,
    geometry: NodeRef<'d>,
    mut built: Geometry,
    coordinates: Coordinates<'d>,
    textures: &mut Textures<'_>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Option<Formed<'w, 'd>> {
    if let Err(e) = built.mesh.transform(&placed.matrix) {
        findings.error(geometry.at(), format!("{}: {e}", geometry.kind()));
        return None;
    }
    let node = placed.node;
    let appearance = node.node("appearance");
    let field = |name| appearance.and_then(|a| a.node(name));
    let mut stack = field("texture").map(|t| textures.stack(t, field("textureTransform"), &coordinates, findings)).unwrap_or_default();
    let projects_light = options.x3d_projectors == ProjectorMode::Light;
    let by_light = |l: &mut Layer<'_>| projects_light && matches!(l.source, Source::Projected(node) if is_light(node));
    let thrown = stack.layers.extract_if(.., by_light).collect();
    let casts = node.bool("castShadow") && appearance.is_none_or(|a| a.bool("shadowCaster"));
    let (mesh, two_sided, received) = (built.mesh, built.two_sided, Received::default());
    Some(Formed { placed, appearance, mesh, coordinates, two_sided, casts, stack, thrown, received })
}
