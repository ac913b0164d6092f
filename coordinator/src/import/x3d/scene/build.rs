//! The scene from all that the walk found.

use super::{
    coordinates::Source,
    fit::Bounds,
    form::{Formed, form},
    inlined,
    material::{self, Sides},
    shadow::{Lights, is_light},
    space,
    texture::Textures,
    view,
    walk::{Placed, World},
};
use crate::import::{
    Bundle, NO_LIGHT,
    findings::{At, Findings},
    surfaces::{Look, Surfaces},
    x3d::{Document, NodeId, NodeRef},
};
use kiln_proto::{
    limits,
    options::{ImportOptions, OutsideMap, ShadowMode},
    scene::{Camera, Projector, Scene, ShadowRules},
};
use std::collections::BTreeMap;

/// The canonical scene of a document; `None` where there were errors.
pub(in crate::import::x3d) fn build(
    bundle: &Bundle,
    document: &Document,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Option<Scene> {
    let world = World::of(document, findings);
    let mut textures = Textures::new(bundle);
    let mut lights = Lights::of(&world, options.light_units, findings);
    let mut shapes = form(&world, &mut textures, options, findings);
    for formed in &mut shapes {
        formed.received = lights.received(formed.appearance, &formed.stack.shadow_maps, options.light_units, findings);
    }
    let files = inlined::read(bundle, &world, options, findings);
    let (casters, receivers) = boxes(&shapes, &files);
    let main = document.files().first().map_or("", |f| f.as_str());
    let cameras = cameras(&world, findings);
    // Projectors may name lights that stand nowhere else: those must be there before projections are completed.
    for node in shapes.iter().flat_map(projecting).filter(|n| is_light(*n)) {
        lights.of_node(node, options.light_units, findings);
    }
    lights.complete(casters, &receivers, findings, At::file(main));
    let mut projectors = projectors(&shapes, &world, &mut lights, &cameras, casters, options, findings);
    let mut surfaces = Surfaces::default();
    let mut looks = Looks { textures: &mut textures, materials: vec![], known: BTreeMap::new() };
    for formed in &shapes {
        add(formed, &world, &lights, &projectors, &mut looks, &mut surfaces, findings);
    }
    let materials = looks.materials;
    if findings.has_errors() {
        return None;
    }
    let mut scene = Scene {
        positions: vec![],
        materials,
        textures: textures.images.textures,
        lights: lights.lights,
        projectors: std::mem::take(&mut projectors.list),
        cameras: cameras.into_iter().map(|(_, c)| c).collect(),
        rules: ShadowRules {
            strict: options.x3d_shadows == ShadowMode::Strict,
            outside_is_shadowed: options.x3d_outside_map == OutsideMap::Shadowed,
        },
        ..Scene::empty()
    };
    colour_lights(&mut scene, &shapes, &projectors, findings);
    files.absorb(&mut surfaces, &mut scene, findings);
    surfaces.finish(&mut scene);
    if scene.surfaces.is_empty() {
        findings.promote();
        findings.error(At::file(main), "no shape of the scene has a surface: there is nothing to bake");
        return None;
    }
    say_what_is_missing(&world, &scene, main, findings);
    Some(scene)
}

/// The box of what casts shadows, and for each light that of what receives its shadows.
fn boxes(shapes: &[Formed<'_, '_>], files: &inlined::Files<'_, '_>) -> (Bounds, Vec<Bounds>) {
    let (mut casters, mut receivers) = (Bounds::EMPTY, vec![]);
    for formed in shapes {
        let mut own = Bounds::EMPTY;
        formed.mesh.corners.iter().for_each(|c| own.add(space::wide(formed.mesh.positions[*c as usize])));
        if formed.casts {
            casters = casters.with(own);
        }
        for light in &formed.received.lights {
            let at = *light as usize;
            receivers.resize(receivers.len().max(at + 1), Bounds::EMPTY);
            receivers[at] = receivers[at].with(own);
        }
    }
    for (placed, scene) in files.placed() {
        for c in scene.surfaces.iter().flat_map(|s| &s.triangles).flat_map(|t| t.corners) {
            casters.add(space::point(&placed.matrix, scene.positions[c as usize]));
        }
    }
    (casters, receivers)
}

fn cameras(world: &World<'_>, findings: &mut Findings) -> Vec<(NodeId, Camera)> {
    let camera = |placed: &Placed<'_>| {
        let node = placed.node;
        let name = if node.string("description").is_empty() { node.def().unwrap_or(node.kind()) } else { node.string("description") };
        let name = name.chars().take(limits::NAME_BYTES / 8).collect();
        Some((node.id(), view::camera(placed, name, findings)?))
    };
    world.viewpoints.iter().take(limits::LIGHTS).filter_map(camera).collect()
}

/// The nodes that project textures onto a shape.
fn projecting<'a, 'd>(formed: &'a Formed<'_, 'd>) -> impl Iterator<Item = NodeRef<'d>> + use<'a, 'd> {
    formed.stack.layers.iter().chain(&formed.thrown).filter_map(|l| if let Source::Projected(node) = l.source { Some(node) } else { None })
}

/// Projectors by the node that projects.
#[derive(Default)]
struct Projectors {
    by_node: BTreeMap<NodeId, u32>,
    list: Vec<Projector>,
}

fn projectors(
    shapes: &[Formed<'_, '_>],
    world: &World<'_>,
    lights: &mut Lights,
    cameras: &[(NodeId, Camera)],
    casters: Bounds,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Projectors {
    let mut out = Projectors::default();
    for node in shapes.iter().flat_map(projecting) {
        if out.by_node.contains_key(&node.id()) {
            continue;
        }
        let name = node.def().unwrap_or(node.kind()).to_owned();
        let projector = if is_light(node) {
            let light = lights.of_node(node, options.light_units, findings);
            light.map(|index| Projector { name, light: Some(index), matrix: view::light_matrix(&lights.lights[index as usize]) })
        } else if matches!(node.kind(), "Viewpoint" | "OrthoViewpoint") {
            viewpoint(node, name, world, cameras, casters, findings)
        } else {
            findings.warn(node.at(), format!("{} cannot project a texture", node.kind()));
            None
        };
        let Some(projector) = projector else { continue };
        out.by_node.insert(node.id(), out.list.len() as u32);
        out.list.push(projector);
    }
    out
}

fn viewpoint(
    node: NodeRef<'_>,
    name: String,
    world: &World<'_>,
    cameras: &[(NodeId, Camera)],
    casters: Bounds,
    findings: &mut Findings,
) -> Option<Projector> {
    let alone = Placed { node, matrix: glam::DMat4::IDENTITY, group: 0, name: None };
    let placed = world.viewpoints.iter().find(|p| p.node.id() == node.id()).unwrap_or(&alone);
    let camera = view::camera(placed, name.clone(), findings)?;
    let is_bound = cameras.first().is_some_and(|(id, _)| *id == node.id());
    let (found_near, found_far) =
        super::fit::depth(super::fit::Rays::Along(space::wide(camera.eye), space::wide(camera.forward)), casters, casters);
    let given = |field, found| if node.float(field) > 0.0 { f64::from(node.float(field)) } else { found };
    let (near, far) = (given("projectionNear", found_near), given("projectionFar", found_far));
    if near >= far {
        findings.error(node.at(), format!("the viewpoint `{name}` projects from {near} to {far}, which is nothing"));
        return None;
    }
    Some(Projector { name, light: None, matrix: view::viewpoint_matrix(placed, &camera, is_bound, near, far) })
}

/// Materials by what they depend on.
struct Looks<'t, 'b> {
    textures: &'t mut Textures<'b>,
    materials: Vec<kiln_proto::scene::Material>,
    known: BTreeMap<Key, (u32, Option<u32>)>,
}

/// Appearance, coordinates, the automatic coordinate set, vertex colours.
type Key = (Option<NodeId>, Vec<NodeId>, u32, bool);

impl Looks<'_, '_> {
    fn sides(&mut self, formed: &Formed<'_, '_>, projectors: &Projectors, findings: &mut Findings) -> (u32, Option<u32>) {
        let has_colours = formed.mesh.colours.is_some();
        let geometry = formed.placed.node.node("geometry");
        let texture_nodes = geometry.filter(|g| g.has("texCoord")).iter().flat_map(|g| g.children("texCoord")).map(|n| n.id()).collect();
        let key = (formed.appearance.map(|a| a.id()), texture_nodes, formed.coordinates.automatic, has_colours);
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let by_node = |node: NodeRef<'_>| projectors.by_node.get(&node.id()).copied();
        let (appearance, layers, coordinates) = (formed.appearance, formed.stack.layers.as_slice(), &formed.coordinates);
        let shape = material::Shape { appearance, layers, coordinates, has_colours, projectors: &by_node };
        let Sides { front, back } = material::convert(&shape, self.textures, findings);
        let mut push = |m| {
            self.materials.push(m);
            self.materials.len() as u32 - 1
        };
        let sides = (push(front), back.map(push));
        self.known.insert(key, sides);
        sides
    }
}

#[allow(clippy::too_many_arguments)] // What one shape is joined from.
fn add(
    formed: &Formed<'_, '_>,
    world: &World<'_>,
    lights: &Lights,
    projectors: &Projectors,
    looks: &mut Looks<'_, '_>,
    surfaces: &mut Surfaces,
    findings: &mut Findings,
) {
    let (front, back) = looks.sides(formed, projectors, findings);
    let unlit_by = (0..world.lights.len() as u32)
        .zip(&world.lights)
        .filter(|(_, l)| !l.node.bool("global") && !world.is_inside(formed.placed.group, l.group))
        .map(|(index, _)| index)
        .filter(|index| (*index as usize) < lights.lights.len())
        .collect();
    let look = Look {
        name: formed.placed.name.unwrap_or("Shape"),
        front,
        back,
        two_sided: formed.two_sided,
        casts_shadows: formed.casts,
        receive_shadows: formed.received.lights.clone(),
        unlit_by,
        shadow_maps: formed.received.maps.clone(),
    };
    let at = formed.placed.node.at();
    if !surfaces.add(&formed.mesh, 0..formed.mesh.polygon_count(), look, |_| at, findings) {
        findings.count(at, "shapes without any triangle left were dropped");
    }
}

/// `--x3d-projectors light`: each light takes the first texture that is projected from it.
fn colour_lights(scene: &mut Scene, shapes: &[Formed<'_, '_>], projectors: &Projectors, findings: &mut Findings) {
    for layer in shapes.iter().flat_map(|s| &s.thrown) {
        let Source::Projected(node) = layer.source else { continue };
        let Some(projector) = projectors.by_node.get(&node.id()) else { continue };
        let Some(light) = scene.projectors[*projector as usize].light else { continue };
        let light = &mut scene.lights[light as usize];
        let mapping = kiln_proto::scene::Mapping::Projected { projector: *projector };
        let texture = kiln_proto::scene::TextureRef { mapping, ..layer.texture };
        match light.texture {
            None => light.texture = Some(texture),
            Some(first) if first.texture == texture.texture => {}
            Some(_) => {
                findings.warn(node.at(), format!("more than one texture is projected from `{}`; the first colours the light", light.name));
            }
        }
    }
}

fn say_what_is_missing(world: &World<'_>, scene: &Scene, main: &str, findings: &mut Findings) {
    for node in &world.bindables {
        match node.kind() {
            "Background" | "TextureBackground" => findings.count(node.at(), "Background nodes were left out, they give no light in X3D"),
            "Fog" | "LocalFog" => findings.count(node.at(), "Fog nodes were left out"),
            _ => {}
        }
    }
    let headlight = world.bindables.iter().find(|n| n.has("headlight")).is_none_or(|n| n.bool("headlight"));
    if headlight && !scene.has_light() {
        findings.warn_once(
            At::file(main),
            NO_LIGHT,
            "the scene is lit by the viewer's headlight only, which moves with the camera and cannot be baked",
        );
    }
}
