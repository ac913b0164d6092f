//! The mesh of a whole OBJ file, with normals: those of the file, else smooth ones within smoothing groups, else flat.
//!
//! Smoothing knows vertices and nothing of objects and materials, so it works on the file as one mesh: a ball in two materials has no seam.

use super::scan::{Face, NONE, Scan, State};
use crate::import::{
    findings::{At, Findings},
    mesh::{Channel, Mesh, Smoothing, newell, smooth},
};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// What remains of a scan once its geometry is a mesh: a face for each polygon.
pub(super) struct Shaded {
    pub(super) mesh: Mesh,
    pub(super) faces: Vec<Face>,
    pub(super) states: Vec<State>,
    pub(super) names: Vec<(String, u32)>,
}

impl Shaded {
    /// Whether a face has no texture coordinates.
    pub(super) fn lacks_uv(&self, face: usize) -> bool {
        self.mesh.uv_sets.first().is_none_or(|set| set.find(self.mesh.run(face).start).is_none())
    }
}

/// Makes the mesh of a scan without errors.
pub(super) fn shade(file: &str, scan: Scan, findings: &mut Findings) -> Shaded {
    let Scan { vertices, faces, corners: [corners, mut uvs, mut normals], states, names, .. } = scan;
    let mut mesh = Mesh { positions: vertices.positions, corners, ends: faces.iter().map(|f| f.end).collect(), ..Mesh::default() };
    if !vertices.colours.is_empty() {
        let values = vertices.colours.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
        mesh.colours = Some(Channel { values, at: mesh.corners.clone() });
    }
    if !uvs.is_empty() {
        uvs.resize(mesh.corners.len(), NONE);
        mesh.uv_sets = vec![Channel { values: vertices.uvs, at: uvs }];
    }
    let given = Given { file, faces: &faces, values: &vertices.normals };
    if !normals.is_empty() {
        normals.resize(mesh.corners.len(), NONE);
        given.check(&mesh, &mut normals, findings);
    }
    mesh.normals = given.complete(&mesh, normals, &states);
    Shaded { mesh, faces, states, names }
}

/// The normals that the file gives.
struct Given<'a> {
    file: &'a str,
    faces: &'a [Face],
    values: &'a [[f32; 3]],
}

impl Given<'_> {
    fn unit(&self, index: u32) -> Option<DVec3> {
        let given = self.values.get(index as usize)?;
        Vec3::from_array(*given).as_dvec3().try_normalize()
    }

    /// Takes the normals from faces that name one that does not exist or has no length, and says what is odd about the others.
    fn check(&self, mesh: &Mesh, normals: &mut [u32], findings: &mut Findings) {
        for (face, run) in self.faces.iter().zip(mesh.polygons()) {
            if normals[run.clone()].iter().all(|n| *n == NONE) {
                continue;
            }
            let at = At::line(self.file, face.line);
            let flat = newell(run.clone().map(|c| mesh.place(c)));
            let units: Vec<Option<DVec3>> = normals[run.clone()].iter().map(|n| self.unit(*n)).collect();
            if units.iter().any(Option::is_none) {
                let exist = normals[run.clone()].iter().all(|n| (*n as usize) < self.values.len());
                let what = if exist {
                    "faces have normals without a length, and are shaded as if they had none"
                } else {
                    "faces refer to normals that do not exist, and are shaded as if they had none"
                };
                findings.count(at, what);
                normals[run].fill(NONE);
            } else if units.iter().flatten().any(|n| n.dot(flat) < 0.0) {
                findings.count(at, "faces have normals on the side of their back; they were kept");
            }
        }
    }

    /// Normals for all corners; `None` where every face is flat. Of `normals` there are none, or one for each corner.
    fn complete(&self, mesh: &Mesh, normals: Vec<u32>, states: &[State]) -> Option<Channel<[f32; 3]>> {
        let is_smooth = |face: &Face| states[face.state as usize].smoothing != 0;
        if normals.iter().all(|n| *n == NONE) && !self.faces.iter().any(is_smooth) {
            return None;
        }
        if !normals.is_empty() && normals.iter().all(|n| *n != NONE) {
            let value = |n: u32| self.unit(n).unwrap_or(DVec3::Z).as_vec3().to_array();
            return Some(Channel { values: (0..self.values.len() as u32).map(value).collect(), at: normals });
        }
        let mut all = self.generated(mesh, states);
        let mut ids = BTreeMap::new();
        for (at, index) in all.at.iter_mut().zip(&normals).filter(|(_, n)| **n != NONE) {
            let Some(unit) = self.unit(*index) else { continue };
            *at = *ids.entry(*index).or_insert_with(|| {
                all.values.push(unit.as_vec3().to_array());
                all.values.len() as u32 - 1
            });
        }
        Some(all)
    }

    /// The normals that smoothing groups give; a face without a group is a group of its own.
    fn generated(&self, mesh: &Mesh, states: &[State]) -> Channel<[f32; 3]> {
        let numbers = states.iter().map(|s| s.smoothing).filter(|s| *s != 0);
        let groups: BTreeMap<u32, u32> = numbers.zip(0..).collect();
        let alone = states.len() as u32;
        let group_of = |(polygon, face): (usize, &Face)| {
            let own = groups.get(&states[face.state as usize].smoothing);
            own.copied().unwrap_or(alone + polygon as u32)
        };
        let of_polygon: Vec<u32> = self.faces.iter().enumerate().map(group_of).collect();
        smooth(mesh, &Smoothing::Shared(&of_polygon))
    }
}
