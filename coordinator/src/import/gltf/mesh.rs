//! Meshes as the file describes them, checked whether a node shows them or not: which accessor is what, and that indices stay within.

use super::{
    accessor::{Accessor, Accessors},
    element::Component,
    form::{COLOR, COORDINATES, INDICES, JOINTS, TANGENT, VECTOR, WEIGHTS, of_form},
    json::Json,
    property::ANY,
    report::Report,
    topology::Topology,
};
use kiln_proto::limits;

/// A mesh.
pub(super) struct Mesh<'s, 'd> {
    /// Its name, read once for all nodes that show it.
    pub(super) name: Option<String>,
    /// What of it can be shown.
    pub(super) primitives: Vec<Primitive<'s, 'd>>,
    /// Default weights of its morph targets.
    pub(super) weights: Vec<f64>,
}

/// One piece of a mesh: triangles of one material.
pub(super) struct Primitive<'s, 'd> {
    /// Its description.
    pub(super) json: Json<'d>,
    topology: Topology,
    indices: Option<&'s Accessor<'d>>,
    /// Vertex positions.
    pub(super) positions: &'s Accessor<'d>,
    /// Vertex normals.
    pub(super) normals: Option<&'s Accessor<'d>>,
    /// Vertex tangents.
    pub(super) tangents: Option<&'s Accessor<'d>>,
    /// Texture coordinates by set.
    pub(super) uvs: Vec<Option<&'s Accessor<'d>>>,
    /// Vertex colours.
    pub(super) colors: Option<&'s Accessor<'d>>,
    /// Joints and their weights, four at a time.
    pub(super) influences: Vec<(&'s Accessor<'d>, &'s Accessor<'d>)>,
    /// Morph targets: displacements of positions, normals and tangents.
    pub(super) targets: Vec<[Option<&'s Accessor<'d>>; 3]>,
    /// Index of its material.
    pub(super) material: Option<usize>,
}

/// Other materials for a primitive.
const VARIANTS: &str = "KHR_materials_variants";
/// Sets of joints and weights that are read: 32 joints a vertex.
const INFLUENCES: usize = 8;

/// Reads all meshes.
pub(super) fn load<'s, 'd>(
    root: Json<'d>,
    accessors: &'s Accessors<'d, '_>,
    materials: usize,
    report: &mut Report<'_>,
) -> Vec<Mesh<'s, 'd>> {
    report.objects(root, "meshes").into_iter().map(|json| mesh(json, accessors, materials, report)).collect()
}

fn mesh<'s, 'd>(json: Json<'d>, accessors: &'s Accessors<'d, '_>, materials: usize, report: &mut Report<'_>) -> Mesh<'s, 'd> {
    if report.required(json, "primitives").is_some_and(|list| list.items().next().is_none()) {
        report.error(json, "the mesh has no primitives");
    }
    let list = report.objects(json, "primitives");
    let primitives: Vec<Primitive<'_, '_>> =
        list.into_iter().filter_map(|p| if report.is_full() { None } else { primitive(p, accessors, materials, report) }).collect();
    let weights: Vec<f64> = report.list(json, "weights").into_iter().filter_map(|w| report.number_at(w, &ANY)).collect();
    for p in &primitives {
        let (first, own) = (primitives[0].targets.len(), p.targets.len());
        if own != first {
            report.error(p.json, format!("the primitive has {own} morph targets, the first of its mesh {first}"));
        } else if !weights.is_empty() && weights.len() != own {
            report.error(p.json, format!("the mesh has {} weights for {own} morph targets", weights.len()));
        }
    }
    Mesh { name: json.name(), primitives, weights }
}

fn primitive<'s, 'd>(
    json: Json<'d>,
    accessors: &'s Accessors<'d, '_>,
    materials: usize,
    report: &mut Report<'_>,
) -> Option<Primitive<'s, 'd>> {
    check_references(json, accessors.count(), materials, report);
    let material = report.index(json, "material", "material", materials);
    let topology = Topology::of(json, report)?;
    let attributes = report.required(json, "attributes")?;
    let Some(at) = attributes.get("POSITION") else {
        report.warn(attributes, "the primitive has no POSITION and was left out");
        return None;
    };
    let positions = of_form(at, &VECTOR, None, accessors, report)?;
    if json.extension("KHR_draco_mesh_compression").is_some() && !positions.has_bytes() {
        report
            .error(json, "the primitive is compressed with KHR_draco_mesh_compression only, which is not decoded; export it uncompressed");
        return None;
    }
    if json.extension(VARIANTS).is_some() {
        report.count(json, "primitives with material variants were imported in their default material (KHR_materials_variants)");
    }
    if !positions.has_bounds {
        report.count(at, "positions without `min` and `max`, which glTF wants (computed)");
    }
    let mut primitive = Primitive {
        json,
        topology,
        indices: None,
        positions,
        normals: None,
        tangents: None,
        uvs: vec![],
        colors: None,
        influences: vec![],
        targets: vec![],
        material,
    };
    primitive.attributes(attributes, accessors, report)?;
    primitive.influences = influences(attributes, positions.count, accessors, report);
    primitive.targets = targets(json, positions.count, accessors, report)?;
    if let Some(at) = json.get("indices") {
        primitive.indices = Some(of_form(at, &INDICES, None, accessors, report)?);
        primitive.check_indices(at, accessors, report)?;
    }
    primitive.check_count(report);
    Some(primitive)
}

/// Checks that what a primitive refers to is there, that among it which is not read, and that of primitives which are not shown.
fn check_references(json: Json<'_>, accessors: usize, materials: usize, report: &mut Report<'_>) {
    let lists = json.get("attributes").into_iter().chain(json.get("targets").into_iter().flat_map(Json::items));
    for at in lists.flat_map(Json::members).map(|(_, at)| at).chain(json.get("indices")) {
        report.index_at(at, "accessor", accessors);
    }
    for mapping in json.extension(VARIANTS).and_then(|e| e.get("mappings")).into_iter().flat_map(Json::items) {
        report.index(mapping, "material", "material", materials);
    }
}

impl<'s, 'd> Primitive<'s, 'd> {
    /// Reads what lies beside positions.
    fn attributes(&mut self, attributes: Json<'d>, accessors: &'s Accessors<'d, '_>, report: &mut Report<'_>) -> Option<()> {
        let count = Some(self.positions.count);
        for (name, at) in attributes.members() {
            let number = name.rsplit_once('_').and_then(|(_, n)| n.parse::<usize>().ok());
            match (name.as_ref(), number) {
                ("NORMAL", _) => self.normals = Some(of_form(at, &VECTOR, count, accessors, report)?),
                ("TANGENT", _) => self.tangents = Some(of_form(at, &TANGENT, count, accessors, report)?),
                ("COLOR_0", _) => self.colors = Some(of_form(at, &COLOR, count, accessors, report)?),
                (set, Some(n)) if set.starts_with("TEXCOORD_") && n < limits::UV_SETS => {
                    self.uvs.resize(self.uvs.len().max(n + 1), None);
                    self.uvs[n] = Some(of_form(at, &COORDINATES, count, accessors, report)?);
                }
                (set, Some(_)) if set.starts_with("TEXCOORD_") => {
                    report.count(at, "sets of texture coordinates beyond the eighth were ignored");
                }
                (set, Some(_)) if set.starts_with("COLOR_") => report.count(at, "sets of vertex colours beyond the first were ignored"),
                ("POSITION", _) => {}
                (own, _) if own.starts_with('_') || own.starts_with("JOINTS_") || own.starts_with("WEIGHTS_") => {}
                _ => report.count(at, "attributes that glTF does not know were ignored"),
            }
        }
        Some(())
    }

    /// Indices must name vertices, and none may be the restart value of its type.
    fn check_indices(&self, at: Json<'_>, accessors: &Accessors<'_, '_>, report: &mut Report<'_>) -> Option<()> {
        let (indices, vertices) = (self.indices?, self.positions.count);
        let restart = match indices.component {
            Component::U8 => 255,
            Component::U16 => 65_535,
            _ => u32::MAX as usize,
        };
        if indices.highest() < restart.min(vertices) {
            return Some(());
        }
        for (i, [v]) in indices.all(&accessors.buffers).enumerate() {
            let v = v as usize;
            if v == restart {
                report.error(at, format!("index {i} is {v}, the primitive restart value, which glTF forbids"));
                return None;
            }
            if v >= vertices {
                report.error(at, format!("index {i} is {v}, but the primitive has {vertices} vertices"));
                return None;
            }
        }
        Some(())
    }

    fn check_count(&self, report: &mut Report<'_>) {
        if !self.topology.fits(self.corner_count()) {
            report.count(self.json, "primitives whose last corners make no whole triangle (those were ignored)");
        }
    }

    fn corner_count(&self) -> usize {
        self.indices.unwrap_or(self.positions).count
    }

    /// How many triangles it describes.
    pub(super) fn triangle_count(&self) -> usize {
        self.topology.triangle_count(self.corner_count())
    }

    /// How many vertices are read to place it once, counted again for each morph target and set of joints that moves them.
    pub(super) fn work(&self, weights: &[f64]) -> u64 {
        let targets = weights.iter().take(self.targets.len()).filter(|w| **w != 0.0).count();
        (self.positions.count as u64).saturating_mul(1 + targets as u64 + self.influences.len() as u64)
    }

    /// Its triangles as vertex indices, counter-clockwise from the front.
    pub(super) fn triangles<'a>(&'a self, accessors: &'a Accessors<'d, '_>) -> impl Iterator<Item = [usize; 3]> + use<'a, 's, 'd> {
        let corner = move |i: usize| self.indices.map_or(i, |indices| indices.get::<1>(&accessors.buffers, i)[0] as usize);
        let topology = self.topology;
        (0..self.triangle_count()).map(move |i| topology.corners(i).map(corner))
    }
}

fn influences<'s, 'd>(
    attributes: Json<'d>,
    vertices: usize,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Vec<(&'s Accessor<'d>, &'s Accessor<'d>)> {
    let mut found = vec![];
    for set in 0..=INFLUENCES {
        let (joints, weights) = (attributes.get(&format!("JOINTS_{set}")), attributes.get(&format!("WEIGHTS_{set}")));
        match (joints, weights) {
            (None, None) => break,
            (Some(at), _) | (_, Some(at)) if set == INFLUENCES => {
                report.count(at, "sets of joints and weights beyond the eighth were ignored");
            }
            (Some(joints), Some(weights)) => {
                let joints = of_form(joints, &JOINTS, Some(vertices), accessors, report);
                found.extend(joints.zip(of_form(weights, &WEIGHTS, Some(vertices), accessors, report)));
            }
            (Some(at), None) | (None, Some(at)) => {
                report.error(at, format!("JOINTS_{set} and WEIGHTS_{set} come together or not at all"));
                break;
            }
        }
    }
    found
}

fn targets<'s, 'd>(
    json: Json<'d>,
    vertices: usize,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Option<Vec<[Option<&'s Accessor<'d>>; 3]>> {
    let mut found = vec![];
    for target in report.objects(json, "targets") {
        let read = |name: &str, report: &mut Report<'_>| match target.get(name) {
            Some(at) => of_form(at, &VECTOR, Some(vertices), accessors, report).map(Some),
            None => Some(None),
        };
        found.push([read("POSITION", report)?, read("NORMAL", report)?, read("TANGENT", report)?]);
        if target.members().any(|(name, _)| name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) {
            report.count(target, "morph targets of texture coordinates or colours were ignored, only shape is morphed");
        }
    }
    Some(found)
}
