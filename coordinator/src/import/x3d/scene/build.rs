//! The scene from all that the walk found.

use super::{
    coordinates::Source,
    environment,
    fit::Bounds,
    form::{Formed, form},
    inlined,
    material::{self, Sides},
    projectors::{Maker, Projectors},
    reach::{Reach, TooManyPairs},
    shadow::Lights,
    space,
    texture::Textures,
    view,
    walk::{Placed, World},
};
use crate::import::{
    Bundle, NO_LIGHT,
    findings::{At, Findings},
    images::Images,
    surfaces::{Look, NAME_CHARS, Surfaces},
    x3d::{Document, NodeId},
};
use kiln_proto::{
    options::{ImportOptions, OutsideMap, ProjectorMode, ShadowMode},
    scene::{Camera, Mapping, Material, Reflection, Scene, ShadowMap, ShadowRules, TextureRef},
};
use std::{collections::BTreeMap, rc::Rc};

/// The canonical scene of a document, with its textures in `images`; `None` where there were errors.
pub(in crate::import::x3d) fn build(
    bundle: &Bundle,
    document: &Document,
    options: &ImportOptions,
    images: &mut Images,
    findings: &mut Findings,
) -> Option<Scene> {
    let world = World::of(document, findings);
    let mut textures = Textures::new(bundle, images);
    let mut lights = Lights::of(&world, options.light_units, findings);
    let mut reach = Reach::new(&world);
    reach.say_what_shines_on_nothing(findings);
    let mut shapes = form(&world, &mut textures, options, findings);
    receive(&mut shapes, &mut lights, &mut reach, options, findings)?;
    let files = inlined::read(bundle, &world, options, textures.images, findings);
    let (casters, receivers) = boxes(&shapes, &files);
    let main = document.files().first().map_or("", |f| f.as_str());
    let cameras = cameras(&world, findings);
    let maker = Maker { world: &world, cameras: &cameras, casters, options };
    maker.add_lights(&shapes, &mut lights, findings);
    lights.complete(casters, &receivers, findings, At::file(main));
    let mut projectors = maker.make(&shapes, &mut lights, findings);
    let mut surfaces = Surfaces::default();
    let colours_lights = options.x3d_projectors == ProjectorMode::Light;
    let mut looks = Looks { textures: &mut textures, projectors: &projectors, colours_lights, materials: vec![], known: BTreeMap::new() };
    for formed in &shapes {
        if let Err(e) = add(formed, &mut reach, &mut looks, &mut surfaces, findings) {
            findings.error(formed.placed.node.at(), e.to_string());
            break;
        }
    }
    let materials = looks.materials;
    let environment = environment::environment(bundle, &world, options, findings);
    if findings.has_errors() {
        return None;
    }
    let mut scene = Scene {
        positions: vec![],
        materials,
        lights: lights.lights,
        environment,
        projectors: std::mem::take(&mut projectors.list),
        cameras: cameras.into_iter().map(|(_, c)| c).collect(),
        rules: rules(options),
        ..Scene::empty()
    };
    colour_lights(&mut scene, &shapes, &projectors, findings);
    files.absorb(&mut surfaces, &mut scene, &mut reach, findings);
    if findings.has_errors() {
        return None;
    }
    surfaces.finish(&mut scene);
    if scene.surfaces.is_empty() {
        findings.promote();
        findings.error(At::file(main), "no shape of the scene has a surface: there is nothing to bake");
        return None;
    }
    say_what_is_missing(&world, &scene, options, main, findings);
    Some(scene)
}

fn rules(options: &ImportOptions) -> ShadowRules {
    ShadowRules { strict: options.x3d_shadows == ShadowMode::Strict, outside_is_shadowed: options.x3d_outside_map == OutsideMap::Shadowed }
}

/// Finds out whose shadows each shape receives, once for each appearance; `None` where those are too many, which is then an error.
fn receive(
    shapes: &mut [Formed<'_, '_>],
    lights: &mut Lights,
    reach: &mut Reach<'_, '_>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Option<()> {
    let mut known = BTreeMap::new();
    for formed in shapes {
        let Some(appearance) = formed.appearance else { continue };
        let received = known
            .entry(appearance.id())
            .or_insert_with(|| Rc::new(lights.received(appearance, &formed.stack.shadow_maps, options.light_units, findings)));
        formed.received = Rc::clone(received);
        // A map takes as much memory as this many lights.
        let map = size_of::<(u32, ShadowMap)>() / size_of::<u32>();
        let pairs = formed.received.lights.len() + map * formed.received.maps.len();
        reach.take(pairs).map_err(|e| findings.error(formed.placed.node.at(), e.to_string())).ok()?;
    }
    Some(())
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
        let name = name.chars().take(NAME_CHARS).collect();
        Some((node.id(), view::camera(placed, name, findings)?))
    };
    world.viewpoints.iter().filter_map(camera).collect()
}

/// Materials by what they depend on.
struct Looks<'t, 'b, 'd> {
    textures: &'t mut Textures<'b, 'd>,
    projectors: &'t Projectors,
    colours_lights: bool,
    materials: Vec<Material>,
    known: BTreeMap<Key, (u32, Option<u32>)>,
}

/// Appearance, coordinates, the automatic coordinate set, vertex colours.
type Key = (Option<NodeId>, Option<NodeId>, u32, Option<ColourKey>);

/// Whether vertex colours have an opacity and use it, and what unlit materials take of them.
type ColourKey = (bool, bool, Option<(bool, [u32; 3])>);

impl<'d> Looks<'_, '_, 'd> {
    fn sides(&mut self, formed: &Formed<'_, 'd>, findings: &mut Findings) -> (u32, Option<u32>) {
        let geometry = formed.placed.node.node("geometry");
        let texture_coordinates = geometry.filter(|g| g.has("texCoord")).and_then(|g| g.node("texCoord"));
        let is_unlit = material::is_unlit(formed.appearance);
        let colours = formed.colours.map(|c| {
            let mean = is_unlit.then(|| (c.vary, c.mean.to_array().map(f32::to_bits)));
            (c.has_alpha, c.transparent, mean)
        });
        let key = (formed.appearance.map(|a| a.id()), texture_coordinates.map(|n| n.id()), formed.coordinates.automatic, colours);
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let shape = material::Shape {
            at: formed.placed.node.at(),
            appearance: formed.appearance,
            layers: &formed.stack.layers,
            coordinates: &formed.coordinates,
            colours: formed.colours,
            projectors: &|node| self.projectors.of(node),
            colours_lights: self.colours_lights,
        };
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

fn add<'d>(
    formed: &Formed<'_, 'd>,
    reach: &mut Reach<'_, '_>,
    looks: &mut Looks<'_, '_, 'd>,
    surfaces: &mut Surfaces,
    findings: &mut Findings,
) -> Result<(), TooManyPairs> {
    let (front, back) = looks.sides(formed, findings);
    let unlit_by = reach.unlit_by(formed.placed.group)?;
    reach.take(unlit_by.len())?;
    let look = Look {
        name: formed.placed.name.unwrap_or("Shape"),
        front,
        back,
        two_sided: formed.two_sided,
        casts_shadows: formed.casts,
        receive_shadows: formed.received.lights.clone(),
        unlit_by: unlit_by.to_vec(),
        shadow_maps: formed.received.maps.clone(),
    };
    let at = formed.placed.node.at();
    if !surfaces.add(&formed.mesh, 0..formed.mesh.polygon_count(), look, |_| at, findings) {
        findings.count(at, "shapes without any triangle left were dropped");
    }
    Ok(())
}

/// `--x3d-projectors light`: each light takes the first texture that is projected from it.
fn colour_lights(scene: &mut Scene, shapes: &[Formed<'_, '_>], projectors: &Projectors, findings: &mut Findings) {
    for layer in shapes.iter().flat_map(|s| &s.thrown) {
        let Source::Projected(node) = layer.source else { continue };
        let Some(projector) = projectors.of(node.id()) else { continue };
        let Some(light) = scene.projectors[projector as usize].light else { continue };
        let light = &mut scene.lights[light as usize];
        let texture = TextureRef { mapping: Mapping::Projected { projector }, ..layer.texture };
        match light.texture {
            None => light.texture = Some(texture),
            Some(first) if first.texture == texture.texture => {}
            Some(_) => {
                let message = format!("more than one texture is projected from `{}`; the first colours the light", light.name);
                findings.warn_once(node.at(), &light.name, message);
            }
        }
    }
}

fn say_what_is_missing(world: &World<'_>, scene: &Scene, options: &ImportOptions, main: &str, findings: &mut Findings) {
    for node in &world.bindables {
        match node.kind() {
            "Background" | "TextureBackground" => findings.count(node.at(), "Background nodes were left out, they give no light in X3D"),
            "Fog" | "LocalFog" => findings.count(node.at(), "Fog nodes were left out"),
            _ => {}
        }
    }
    let headlight = world.bindables.iter().find(|n| n.has("headlight")).is_none_or(|n| n.bool("headlight"));
    let is_lit = options.environment.is_some() || scene.environment.is_some() || scene.lights.iter().any(|l| !l.intensity.is_black());
    let wants_light = scene.materials.iter().any(|m| m.reflection != Reflection::None);
    if headlight && !is_lit && wants_light {
        let message = if scene.has_light() {
            "the viewer's headlight, which moves with the camera, cannot be baked: what shines by itself is all the light that the scene has"
        } else {
            "the scene is lit by the viewer's headlight only, which moves with the camera and cannot be baked"
        };
        findings.warn_once(At::file(main), NO_LIGHT, message);
    }
}
