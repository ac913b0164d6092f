//! Shapes with their meshes in the world, before they have materials.
//!
//! The mesh of a geometry node is made once however often the node is used, and all triangles are counted before the first copy is made: a
//! file of a few kilobytes whose groups use each other stands for millions of them, and must be refused in a moment.

use super::{
    colours::Colours,
    coordinates::{Coordinates, Source},
    own,
    shadow::{Received, can_project},
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
    scene::{Coding, LayerMode},
};
use std::{collections::BTreeMap, rc::Rc};

/// A shape in the world, without its material.
pub(super) struct Formed<'w, 'd> {
    pub(super) placed: &'w Placed<'d>,
    pub(super) appearance: Option<NodeRef<'d>>,
    pub(super) mesh: Mesh,
    pub(super) coordinates: Rc<Coordinates<'d>>,
    pub(super) colours: Option<Colours>,
    pub(super) two_sided: bool,
    pub(super) casts: bool,
    pub(super) stack: Stack<'d>,
    /// Layers that colour the light which projects them, not the shape.
    pub(super) thrown: Vec<Layer<'d>>,
    /// The nodes that project its textures.
    pub(super) projecting: Vec<NodeRef<'d>>,
    pub(super) received: Rc<Received>,
}

/// What is made of a geometry node, in its own space.
struct Made<'d> {
    geometry: Geometry,
    coordinates: Rc<Coordinates<'d>>,
    colours: Option<Colours>,
}

/// All shapes that have a surface; none where there are too many triangles, which is then an error.
pub(super) fn form<'w, 'd>(
    world: &'w World<'d>,
    textures: &mut Textures<'_, 'd>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Vec<Formed<'w, 'd>> {
    let mut meshes: BTreeMap<NodeId, Option<Made<'d>>> = BTreeMap::new();
    let mut corners = 0usize;
    for placed in &world.shapes {
        let Some(geometry) = surface_of(placed.node, findings) else { continue };
        let made = meshes.entry(geometry.id()).or_insert_with(|| make(geometry, findings));
        corners = corners.saturating_add(made.as_ref().map_or(0, |made| made.geometry.mesh.corners.len()));
        if corners > 3 * limits::TRIANGLES {
            findings.error(placed.node.at(), format!("with this shape the scene has more than {} triangles", limits::TRIANGLES));
            return vec![];
        }
    }
    let shapes = world.shapes.iter().filter_map(|placed| {
        let geometry = placed.node.node("geometry")?;
        let made = meshes.get(&geometry.id())?.as_ref()?;
        is_shown(placed.node).then(|| place(placed, geometry, made, textures, options, findings)).flatten()
    });
    shapes.collect()
}

fn make<'d>(node: NodeRef<'d>, findings: &mut Findings) -> Option<Made<'d>> {
    let mut coordinates = Coordinates::of(node, findings);
    let geometry = shape::mesh(node, &mut coordinates, findings)?;
    let colours = Colours::of(node, &geometry.mesh);
    Some(Made { geometry, coordinates: Rc::new(coordinates), colours })
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
    made: &Made<'d>,
    textures: &mut Textures<'_, 'd>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Option<Formed<'w, 'd>> {
    let mut mesh = made.geometry.mesh.clone();
    if let Err(e) = mesh.transform(&placed.matrix) {
        findings.error(geometry.at(), format!("{}: {e}", geometry.kind()));
        return None;
    }
    let (node, coordinates) = (placed.node, Rc::clone(&made.coordinates));
    let appearance = node.node("appearance");
    let field = |name| appearance.and_then(|a| a.node(name));
    let mut stack = field("texture").map(|t| textures.stack(t, field("textureTransform"), &coordinates, findings)).unwrap_or_default();
    let own = appearance.map(|a| own::all(a, &coordinates)).unwrap_or_default();
    let sources = stack.layers.iter().map(|l| l.source).chain(own.iter().map(|o| o.source));
    let projecting = sources.filter_map(|s| if let Source::Projected(node) = s { Some(node) } else { None }).collect();
    let mut thrown = vec![];
    if options.x3d_projectors == ProjectorMode::Light {
        thrown.extend(stack.layers.extract_if(.., |l| matches!(l.source, Source::Projected(node) if can_project(node))));
        for own in own.into_iter().filter(|own| own.colours_light()) {
            let found = textures.texture(own.texture, own.transform, Coding::Srgb, findings);
            let (channel, mode) = (own.texture.string("alphaChannel"), LayerMode::Modulate { scale: 1.0 });
            thrown.extend(found.map(|(image, texture)| Layer { image, texture, channel, source: own.source, mode }));
        }
    }
    let casts = node.bool("castShadow") && appearance.is_none_or(|a| a.bool("shadowCaster"));
    let (two_sided, colours, received) = (made.geometry.two_sided, made.colours, Rc::default());
    Some(Formed { placed, appearance, mesh, coordinates, colours, two_sided, casts, stack, thrown, projecting, received })
}
