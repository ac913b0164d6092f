//! From faces and property nodes to a mesh: how normals, colours and texture coordinates are found for a corner (X3D 3.3, 11.3.2).
//!
//! All rules are one lookup, from a corner or face to an index, and one fallback: a corner for which the author's list has nothing gets
//! what would have been generated. A list that ends early then costs its own corners only, where dropping the list would cost all.

use super::{
    Geometry,
    error::{GeometryError, Repairs},
    faces::{Corner, Faces},
};
use crate::import::mesh::{Channel, Mesh, Smoothing, box_mapping, smooth};
use glam::Vec3;

/// The fields of X3DComposedGeometryNode, with the property nodes' lists in place of the nodes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Composed {
    /// Coordinate or CoordinateDouble: `point`.
    pub(crate) coord: Vec<[f32; 3]>,
    /// Normal: `vector`. Empty: no node.
    pub(crate) normal: Vec<[f32; 3]>,
    /// Color (alpha 1) or ColorRGBA: `color`. Empty: no node.
    pub(crate) color: Vec<[f32; 4]>,
    /// TextureCoordinate, or those of a MultiTextureCoordinate: `point`. Empty: no node.
    pub(crate) tex_coord: Vec<Vec<[f32; 2]>>,
    /// Whether corners run counter-clockwise seen from the front.
    pub(crate) ccw: bool,
    /// Colours belong to vertices, not to faces.
    pub(crate) color_per_vertex: bool,
    /// Normals belong to vertices, not to faces.
    pub(crate) normal_per_vertex: bool,
    /// Only the front is seen.
    pub(crate) solid: bool,
}

impl Default for Composed {
    fn default() -> Self {
        let (coord, normal, color, tex_coord) = (vec![], vec![], vec![], vec![]);
        Self { coord, normal, color, tex_coord, ccw: true, color_per_vertex: true, normal_per_vertex: true, solid: true }
    }
}

/// Where a corner's value stands in its list.
#[derive(Debug, Clone, Copy)]
pub(super) enum Lookup<'a> {
    /// With the corner's coordinate.
    Vertex,
    /// Where an index list says that runs parallel to the coordinates' own.
    List(&'a [i32]),
    /// With the face.
    Face,
    /// Where an index list says that has one entry a face.
    FaceList(&'a [i32]),
}

impl Lookup<'_> {
    fn index(self, corner: Corner, face: u32) -> Option<usize> {
        let listed = |list: &[i32], at: u32| list.get(at as usize).and_then(|i| usize::try_from(*i).ok());
        match self {
            Self::Vertex => Some(corner.vertex as usize),
            Self::List(list) => listed(list, corner.place),
            Self::Face => Some(face as usize),
            Self::FaceList(list) => listed(list, face),
        }
    }
}

/// How the three kinds of values are found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lookups<'a> {
    pub(super) normal: Lookup<'a>,
    pub(super) color: Lookup<'a>,
    pub(super) tex_coord: Lookup<'a>,
}

impl Lookups<'_> {
    /// All with the coordinates.
    pub(super) const VERTEX: Self = Self { normal: Lookup::Vertex, color: Lookup::Vertex, tex_coord: Lookup::Vertex };
}

/// Makes the mesh of faces. `smoothing` says what normals are generated where the author gave none.
pub(super) fn assemble(node: &Composed, faces: &Faces, lookups: Lookups<'_>, smoothing: Smoothing<'_>, mut repairs: Repairs) -> Geometry {
    let mut mesh = skeleton(node, faces);
    if !node.color.is_empty() {
        let (usable, fallback) = (|c: &[f32; 4]| finite(c), |_| [1.0; 4]);
        let mut colours = channel(faces, &node.color, lookups.color, usable, fallback, |at| {
            repairs.note("corners for which there is no colour became white", "color", at);
        });
        colours.values.iter_mut().flatten().for_each(|x| *x = x.clamp(0.0, 1.0));
        mesh.colours = Some(colours);
    }
    let automatic = box_mapping(&mesh);
    for points in &node.tex_coord {
        let fallback = |corner: usize| automatic.get(corner);
        mesh.uv_sets.push(channel(
            faces,
            points,
            lookups.tex_coord,
            |p: &[f32; 2]| finite(p),
            fallback,
            |at| {
                repairs.note("corners for which there is no texture coordinate got an automatic one", "texCoord", at);
            },
        ));
    }
    if node.tex_coord.is_empty() {
        mesh.uv_sets.push(automatic);
    }
    // Turned before normals are made, so that they are made for the front; corner by corner with what the author gave.
    if node.normal.is_empty() {
        if !node.ccw {
            mesh.reverse();
        }
        mesh.normals = Some(smooth(&mesh, &smoothing));
    } else {
        mesh.normals = Some(given_normals(node, faces, lookups.normal, smoothing, &mesh, &mut repairs));
        if !node.ccw {
            mesh.reverse();
        }
    }
    Geometry { mesh, two_sided: !node.solid, repairs }
}

/// The author's normals, made unit.
fn given_normals(
    node: &Composed,
    faces: &Faces,
    lookup: Lookup<'_>,
    smoothing: Smoothing<'_>,
    mesh: &Mesh,
    repairs: &mut Repairs,
) -> Channel<[f32; 3]> {
    let side = if node.ccw { 1.0 } else { -1.0 };
    let mut generated = None;
    let fallback = |corner: usize| generated.get_or_insert_with(|| smooth(mesh, &smoothing)).get(corner).map(|x| x * side);
    let usable = |n: &[f32; 3]| Vec3::from_array(*n).as_dvec3().try_normalize().is_some();
    let mut normals = channel(faces, &node.normal, lookup, usable, fallback, |at| {
        repairs.note("corners for which there is no normal got a generated one", "normal", at);
    });
    for n in &mut normals.values {
        *n = Vec3::from_array(*n).as_dvec3().normalize_or_zero().as_vec3().to_array();
    }
    normals
}

/// Polygons and the positions that they use, in the order of their first use.
fn skeleton(node: &Composed, faces: &Faces) -> Mesh {
    let mut ids = vec![u32::MAX; node.coord.len()];
    let mut mesh = Mesh { ends: faces.ends.clone(), ..Mesh::default() };
    for corner in &faces.corners {
        let id = &mut ids[corner.vertex as usize];
        if *id == u32::MAX {
            *id = mesh.positions.len() as u32;
            mesh.positions.push(node.coord[corner.vertex as usize].map(|x| x + 0.0));
        }
        mesh.corners.push(*id);
    }
    mesh
}

fn finite<const N: usize>(value: &[f32; N]) -> bool {
    value.iter().all(|x| x.is_finite())
}

/// Values for all corners; `missing` hears the place of each corner that has none.
fn channel<T: Copy>(
    faces: &Faces,
    values: &[T],
    lookup: Lookup<'_>,
    usable: impl Fn(&T) -> bool,
    mut fallback: impl FnMut(usize) -> T,
    mut missing: impl FnMut(usize),
) -> Channel<T> {
    // Only what is used: one list may serve a thousand shapes.
    let mut ids = vec![u32::MAX; values.len()];
    let mut out = Channel { values: vec![], at: Vec::with_capacity(faces.corners.len()) };
    let mut start = 0;
    for (end, number) in faces.ends.iter().zip(&faces.numbers) {
        for corner in start..*end as usize {
            let index = lookup.index(faces.corners[corner], *number).filter(|i| values.get(*i).is_some_and(&usable));
            let Some(index) = index else {
                missing(faces.corners[corner].place as usize);
                out.push(fallback(corner));
                continue;
            };
            if ids[index] == u32::MAX {
                ids[index] = out.values.len() as u32;
                out.values.push(values[index]);
            }
            out.at.push(ids[index]);
        }
        start = *end as usize;
    }
    out
}

/// How edges are smoothed below this `creaseAngle`, radians.
pub(super) fn crease(angle: f32, repairs: &mut Repairs) -> Smoothing<'static> {
    if angle >= 0.0 {
        return Smoothing::Crease(f64::from(angle));
    }
    repairs.note("values that are no angle were read as 0", "creaseAngle", 0);
    Smoothing::Flat
}

/// Refuses a node without points.
pub(super) fn has_points(node: &Composed) -> Result<(), GeometryError> {
    if node.coord.is_empty() { Err(GeometryError::Empty { why: "coord has no points" }) } else { Ok(()) }
}
