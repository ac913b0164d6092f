//! From `tobj`'s models to surfaces: polygons cut, positions shared, triangles without area and duplicates dropped, names given.
//!
//! A surface is an (object, material) pair: one light field has one material. It is called like its object where the object has one
//! material, and `OBJECT.MATERIAL` where it has several. Objects are `o` names where the file has any, else `g` names, else the file's.

use super::{
    material::Materials,
    scan::{FaceNote, Group, Scan},
};
use crate::import::{
    findings::{At, Findings},
    mesh::triangulate,
    name::{Names, Stems},
    weld::Weld,
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    limits,
    scene::{Surface, Triangle},
};
use std::{collections::BTreeMap, ops::Range};

/// What becomes of one (object, material) pair.
struct Part {
    object: Option<usize>,
    material_name: Option<usize>,
    material: u32,
    line: u32,
    polygons: u32,
    triangles: Vec<(Triangle, Option<[[f32; 2]; 3]>)>,
}

/// One polygon of a model.
struct Face<'m> {
    mesh: &'m tobj::Mesh,
    /// Where its corners stand among the mesh's indices.
    corners: Range<usize>,
    note: FaceNote,
}

impl Face<'_> {
    /// The texture coordinates of its corners, where the file has them.
    fn uv(&self) -> Option<Vec<[f32; 2]>> {
        let at = |i: &u32| [0, 1].map(|k| self.mesh.texcoords[2 * *i as usize + k] + 0.0);
        self.note.has_uv.then(|| self.mesh.texcoord_indices[self.corners.clone()].iter().map(at).collect())
    }
}

/// Builds surfaces from models.
pub(super) struct Builder<'a> {
    file: &'a str,
    scan: &'a Scan,
    by_object: bool,
    weld: Weld,
    parts: Vec<Part>,
    part_ids: BTreeMap<(Option<usize>, Option<usize>), usize>,
    count: usize,
}

impl<'a> Builder<'a> {
    pub(super) fn new(file: &'a str, scan: &'a Scan) -> Self {
        Self {
            file,
            scan,
            by_object: scan.groups.iter().any(|g| g.object.is_some()),
            weld: Weld::default(),
            parts: vec![],
            part_ids: BTreeMap::new(),
            count: 0,
        }
    }

    /// Adds the faces of all models; their order is that of the scan's notes.
    pub(super) fn add(&mut self, models: &[tobj::Model], materials: &mut Materials<'_>, findings: &mut Findings) {
        let mut notes = self.scan.notes.iter();
        for model in models {
            let group = model.name.parse::<usize>().ok().and_then(|i| self.scan.groups.get(i)).copied().unwrap_or_default();
            let mut end = 0;
            for (arity, note) in face_sizes(&model.mesh).zip(&mut notes) {
                let face = Face { mesh: &model.mesh, corners: end..end + arity, note: *note };
                end += arity;
                let part = self.part(group, note.line, materials, findings);
                self.face(&face, part, findings);
                if self.count > limits::TRIANGLES {
                    let message = format!("the scene has more than {} triangles", limits::TRIANGLES);
                    findings.error(At::line(self.file, note.line), message);
                    return;
                }
            }
        }
    }

    fn face(&mut self, face: &Face<'_>, part: usize, findings: &mut Findings) {
        let at = At::line(self.file, face.note.line);
        let corners: Vec<u32> = face.mesh.indices[face.corners.clone()].iter().map(|i| self.place(face.mesh, *i)).collect();
        let uv = face.uv();
        let world: Vec<DVec3> = corners.iter().map(|c| Vec3::from_array(self.weld.positions.values[*c as usize]).as_dvec3()).collect();
        let polygon = self.parts[part].polygons;
        self.parts[part].polygons += 1;
        let cut = triangulate(&world);
        if !cut.sound {
            findings.count(at, "polygons that cross themselves were cut as well as they can be");
        }
        for t in cut.triangles {
            let corners = t.map(|i| corners[i]);
            if let Err(left) = self.weld.triangle(corners) {
                findings.count(at, left.words());
                continue;
            }
            self.parts[part].triangles.push((Triangle { corners, polygon }, uv.as_ref().map(|uv| t.map(|i| uv[i]))));
            self.count += 1;
        }
    }

    fn place(&mut self, mesh: &tobj::Mesh, index: u32) -> u32 {
        self.weld.positions.id(std::array::from_fn(|k| mesh.positions[3 * index as usize + k]))
    }

    fn part(&mut self, group: Group, line: u32, materials: &mut Materials<'_>, findings: &mut Findings) -> usize {
        let key = (if self.by_object { group.object } else { group.group }, group.material);
        if let Some(id) = self.part_ids.get(&key) {
            return *id;
        }
        let name = key.1.map(|i| &self.scan.names[i]);
        let at = At::line(self.file, name.map_or(line, |(_, first)| *first));
        if name.is_none() {
            findings.warn_once(at, "no material", "faces before any `usemtl` have no material; a grey one is used");
        }
        let material = materials.id(name.map(|(n, _)| n.as_str()), at, findings);
        let id = self.parts.len();
        self.parts.push(Part { object: key.0, material_name: key.1, material, line, polygons: 0, triangles: vec![] });
        self.part_ids.insert(key, id);
        id
    }

    /// The surfaces, named, in the order of their first faces.
    pub(super) fn into_surfaces(self, stem: &str, findings: &mut Findings) -> (Vec<[f32; 3]>, Vec<Surface>) {
        let mut pieces: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        self.parts.iter().for_each(|p| *pieces.entry(p.object).or_default() += 1);
        let (mut names, mut stems) = (Names::default(), Stems::default());
        let mut surfaces = vec![];
        for part in self.parts {
            let object = part.object.map_or(stem, |i| self.scan.names[i].0.as_str());
            let material = part.material_name.map_or("default", |i| self.scan.names[i].0.as_str());
            let wanted = if pieces[&part.object] > 1 { format!("{object}.{material}") } else { object.to_owned() };
            if part.triangles.is_empty() {
                findings.warn(At::line(self.file, part.line), format!("the surface `{wanted}` has no triangles left and was dropped"));
                continue;
            }
            let name = names.take(&wanted);
            let file_stem = stems.take(&name);
            surfaces.push(Surface { file_stem, ..Surface::plain(name, part.material, part.triangles) });
        }
        (self.weld.positions.values, surfaces)
    }
}

/// Corners of each face: `tobj` leaves the list out where all are triangles.
fn face_sizes(mesh: &tobj::Mesh) -> Box<dyn Iterator<Item = usize> + '_> {
    if mesh.face_arities.is_empty() {
        Box::new(std::iter::repeat_n(3, mesh.indices.len() / 3))
    } else {
        Box::new(mesh.face_arities.iter().map(|a| *a as usize))
    }
}
