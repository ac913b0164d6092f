//! glTF 2.0: `container` and `json` take the file apart, `extension` says whether it can be read at all, `buffer`, `accessor` and `element`
//! give its numbers, `node`, `animation` and `deform` put things in their places, `mesh`, `topology`, `material`, `texture`, `picture` and
//! `light` say what they are, and `surface` makes the scene of them.
//!
//! The file is checked as it is read, by the rules of the specification and with the strictness of the Khronos validator, whether
//! something is shown or not: who exports a broken accessor wants to know. The crate `gltf` would give the types of the JSON, but its
//! validation stops short, it trusts the result, and its errors have no lines; so the JSON is read here, property by property, each with
//! its place.

mod accessor;
mod animation;
mod buffer;
mod container;
mod deform;
mod element;
mod extension;
mod form;
mod instance;
mod json;
mod layout;
mod light;
mod local;
mod material;
mod mesh;
mod node;
mod picture;
mod property;
mod reflection;
mod report;
mod surface;
mod texture;
mod topology;
mod uri;
mod values;

#[cfg(test)]
mod tests;

use super::{Bundle, BundlePath, findings::Findings, images::Images};
use accessor::Accessors;
use buffer::Buffers;
use json::{Document, Json, Kind};
use kiln_proto::{limits, scene::Scene};
use node::{Counts, Graph, Node};
use report::Report;

/// Imports a glTF file of the bundle, at rest or at a time in seconds; `None` where there were errors.
pub(super) fn import(
    bundle: &Bundle,
    file: &BundlePath,
    bytes: &[u8],
    time: Option<f64>,
    images: &mut Images,
    findings: &mut Findings,
) -> Option<Scene> {
    let has_lines = !container::is_binary(file.as_str(), bytes);
    let mut report = Report::new(file.as_str(), has_lines, findings);
    let scene = read(bundle, file, bytes, time, images, &mut report);
    scene.filter(|_| !findings.has_errors())
}

/// The files that a glTF refers to, with the lines where it does; nothing where it cannot be read.
pub(super) fn references(name: &str, bytes: &[u8]) -> Vec<(u32, String)> {
    let (mut findings, mut found) = (Findings::default(), vec![]);
    let Some(parts) = container::open(name, bytes, &mut Report::new(name, false, &mut findings)) else { return found };
    let Ok(document) = Document::parse(parts.text) else { return found };
    let lists = ["buffers", "images"].into_iter().filter_map(|list| document.root().get(list));
    for at in lists.flat_map(Json::items).filter_map(|item| item.get("uri")).take(limits::BUNDLE_FILES) {
        found.extend(at.string().and_then(|uri| super::uri::path(&uri)).map(|path| (at.line(), path)));
    }
    found
}

fn read(
    bundle: &Bundle,
    file: &BundlePath,
    bytes: &[u8],
    time: Option<f64>,
    images: &mut Images,
    report: &mut Report<'_>,
) -> Option<Scene> {
    let parts = container::open(file.as_str(), bytes, report)?;
    let document = Document::parse(parts.text).map_err(|e| report.error_at_line(e.line, e.to_string())).ok()?;
    let root = document.root();
    if root.kind() != Kind::Object {
        report.error(root, "a glTF file is a JSON object");
        return None;
    }
    check_version(root, report)?;
    extension::check(root, report);
    let buffers = Buffers::load(bundle, file, parts.binary, root, report);
    let most = buffers.total() + bytes.len() as u64;
    let accessors = Accessors::load(root, buffers, most, report);
    build(bundle, file, root, &accessors, time, images, report)
}

fn build(
    bundle: &Bundle,
    file: &BundlePath,
    root: Json<'_>,
    accessors: &Accessors<'_, '_>,
    time: Option<f64>,
    images: &mut Images,
    report: &mut Report<'_>,
) -> Option<Scene> {
    let (materials, cameras) = (report.objects(root, "materials"), report.objects(root, "cameras"));
    let meshes = mesh::load(root, accessors, materials.len(), report);
    let number_of = |list: &str| root.get(list).map_or(0, Json::len);
    let lights = root.extension(light::PUNCTUAL).and_then(|e| e.get("lights")).map_or(0, Json::len);
    let counts = Counts { meshes: meshes.len(), skins: number_of("skins"), cameras: cameras.len(), lights, accessors: accessors.count() };
    let graph = Graph::load(root, counts, report);
    let skins = deform::load_skins(root, number_of("nodes"), accessors, report);
    let textures = texture::Textures::new(bundle, file, &accessors.buffers, root, images, report);
    let mut materials = material::Materials::new(materials, textures);
    let mut graph = graph?;
    animation::apply(root, &mut graph, accessors, time, report);
    graph.place();
    let shown = graph.shown(root, report);
    let nodes: Vec<&Node<'_>> = shown.iter().map(|i| &graph.nodes[*i]).collect();
    let (lights, cameras) = (light::lights(root, &nodes, report), light::cameras(&cameras, &nodes, report));
    let mut surfaces = surface::Surfaces::default();
    if !report.has_errors() {
        let source = surface::Source { accessors, meshes: &meshes, skins: &skins, graph: &graph };
        nodes.iter().try_for_each(|node| surfaces.add(node, &source, &mut materials, report));
    }
    materials.check(report);
    if surfaces.made.len() == 0 && !report.has_errors() {
        report.error_in_file("no node of the scene shows a triangle: there is nothing to bake");
    }
    let mut scene = Scene { materials: materials.materials, lights, cameras, ..Scene::empty() };
    surfaces.made.finish(&mut scene);
    Some(scene)
}

/// glTF 2.0, section 3.2.
fn check_version(root: Json<'_>, report: &mut Report<'_>) -> Option<()> {
    let asset = report.required(root, "asset")?;
    report.required(asset, "version")?;
    let version = report.string(asset, "version")?;
    let least = report.string(asset, "minVersion");
    let parse = |text: &str| -> Option<(u32, u32)> {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    match (parse(&version), least.as_deref().map(parse)) {
        (Some((2, _)), None | Some(Some((..=1, _) | (2, 0)))) => Some(()),
        (Some((2, _)), Some(_)) => {
            let least = least.unwrap_or_default();
            report.error(asset, format!("the file needs a reader of glTF {least}; this one reads 2.0"));
            None
        }
        _ => {
            report.error(asset, format!("this is glTF of version `{version}`; version 2.0 is read"));
            None
        }
    }
}
