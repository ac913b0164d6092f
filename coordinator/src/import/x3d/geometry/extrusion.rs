//! Extrusion (X3D 3.3, 13.3.5): a cross-section carried along a spine.
//!
//! The sides are one grid of quads whose rows and columns meet again where the spine or the cross-section is closed, so that a crease
//! angle smooths over the joint as well. The caps are flat and share positions, but no normals, with the sides. `convex` is not among the
//! fields, for the reason that [`IndexedFaceSet`](super::IndexedFaceSet) gives.

use super::{
    Geometry,
    composed::crease,
    error::{GeometryError, Repairs, bounded, finite},
    frames::frames,
};
use crate::import::mesh::{Channel, Mesh, axis_angle, newell, smooth};
use glam::DVec3;
use kiln_proto::limits;

/// The fields of an Extrusion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Extrusion {
    /// Whether the first end is covered.
    pub(crate) begin_cap: bool,
    /// Whether the last end is covered.
    pub(crate) end_cap: bool,
    /// Whether a cross-section that runs counter-clockwise seen against the spine has its front outside.
    pub(crate) ccw: bool,
    /// Radians: edges between sides that differ by less are smooth.
    pub(crate) crease_angle: f32,
    /// Points of the cross-section: x and z.
    pub(crate) cross_section: Vec<[f32; 2]>,
    /// Axis and angle (radians) by which each cross-section is turned in its plane; one for all, or one for each point of the spine.
    pub(crate) orientation: Vec<[f32; 4]>,
    /// Factors of x and z; one for all, or one for each point of the spine.
    pub(crate) scale: Vec<[f32; 2]>,
    /// Only the front is seen.
    pub(crate) solid: bool,
    /// Points of the spine.
    pub(crate) spine: Vec<[f32; 3]>,
}

impl Default for Extrusion {
    fn default() -> Self {
        Self {
            begin_cap: true,
            end_cap: true,
            ccw: true,
            crease_angle: 0.0,
            cross_section: vec![[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]],
            orientation: vec![[0.0, 0.0, 1.0, 0.0]],
            scale: vec![[1.0, 1.0]],
            solid: true,
            spine: vec![[0.0; 3], [0.0, 1.0, 0.0]],
        }
    }
}

impl Extrusion {
    /// One quad for each segment of the spine and of the cross-section, S along the latter and T along the former by their points' numbers,
    /// and a polygon for each cap. Cost: n log n in the quads.
    ///
    /// # Errors
    /// Fewer than two points of spine or cross-section (nothing to see), coordinates that are not numbers, more quads than
    /// [`limits::SWEPT_QUADS`].
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let (rows, columns) = (self.spine.len(), self.cross_section.len());
        if rows < 2 || columns < 2 {
            return Err(GeometryError::Empty { why: "spine or crossSection has fewer than two points" });
        }
        finite("spine", &self.spine)?;
        finite("crossSection", &self.cross_section)?;
        finite("scale", &self.scale)?;
        finite("orientation", &self.orientation)?;
        bounded((rows as u64 - 1) * (columns as u64 - 1), "segments of spine times those of crossSection", limits::SWEPT_QUADS)?;
        let mut repairs = Repairs::default();
        let positions = self.place(&mut repairs)?;
        let mut mesh = Mesh { positions, ..Mesh::default() };
        let uv = self.sides(&mut mesh);
        let mut normals = smooth(&mesh, &crease(self.crease_angle, &mut repairs));
        mesh.uv_sets = vec![uv];
        if self.begin_cap {
            self.cap(&mut mesh, &mut normals, 0);
        }
        if self.end_cap {
            self.cap(&mut mesh, &mut normals, rows - 1);
        }
        mesh.normals = Some(normals);
        if !self.ccw {
            mesh.reverse();
            mesh.normals.iter_mut().flat_map(|c| &mut c.values).for_each(|n| *n = n.map(|x| 0.0 - x));
        }
        Ok(Geometry { mesh, two_sided: !self.solid, repairs })
    }

    /// All points, row by row along the spine.
    fn place(&self, repairs: &mut Repairs) -> Result<Vec<[f32; 3]>, GeometryError> {
        let spine: Vec<DVec3> = self.spine.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
        for (field, count) in [("scale", self.scale.len()), ("orientation", self.orientation.len())] {
            if count != 1 && count < spine.len() {
                repairs.note("points of the spine without a value of their own got the last one before", field, count);
            }
        }
        let mut out = Vec::with_capacity(spine.len() * self.cross_section.len());
        for (i, (at, plane)) in spine.iter().zip(frames(&spine)).enumerate() {
            let scale = value(&self.scale, i).unwrap_or([1.0; 2]);
            let [x, y, z, angle] = value(&self.orientation, i).unwrap_or_default().map(f64::from);
            let turned = plane * axis_angle(DVec3::new(x, y, z), angle);
            for section in &self.cross_section {
                let flat = DVec3::new(f64::from(section[0]) * f64::from(scale[0]), 0.0, f64::from(section[1]) * f64::from(scale[1]));
                let place = (*at + turned * flat).as_vec3();
                if !place.is_finite() {
                    return Err(GeometryError::NotFinite { field: "spine", at: i });
                }
                out.push((place + 0.0).to_array());
            }
        }
        Ok(out)
    }

    /// The quads of the sides; their texture coordinates.
    fn sides(&self, mesh: &mut Mesh) -> Channel<[f32; 2]> {
        let (rows, columns) = (self.spine.len(), self.cross_section.len());
        let row = |i: usize| &mesh.positions[i * columns..(i + 1) * columns];
        let ring = rows > 3 && row(0) == row(rows - 1);
        let tube = self.is_closed();
        let id = |i: usize, k: usize| {
            let i = if ring && i == rows - 1 { 0 } else { i };
            (i * columns + if tube && k == columns - 1 { 0 } else { k }) as u32
        };
        let mut uv =
            Channel { values: (0..rows * columns).map(|v| [share(v % columns, columns), share(v / columns, rows)]).collect(), at: vec![] };
        for i in 0..rows - 1 {
            for k in 0..columns - 1 {
                let quad = [(i, k), (i, k + 1), (i + 1, k + 1), (i + 1, k)];
                mesh.push_polygon(quad.map(|(i, k)| id(i, k)));
                uv.at.extend(quad.map(|(i, k)| (i * columns + k) as u32));
            }
        }
        uv
    }

    /// Covers the cross-section of a row, looking away from the spine. Its texture's larger side is the larger side of the cross-section.
    fn cap(&self, mesh: &mut Mesh, normals: &mut Channel<[f32; 3]>, row: usize) {
        let columns = self.cross_section.len();
        let mut points: Vec<usize> = (0..columns - usize::from(self.is_closed())).collect();
        if points.len() < 3 {
            return;
        }
        if row == 0 {
            points.reverse();
        }
        let start = mesh.corners.len();
        mesh.push_polygon(points.iter().map(|k| (row * columns + k) as u32));
        let places: Vec<DVec3> = (start..mesh.corners.len()).map(|c| mesh.place(c)).collect();
        let normal = newell(places).try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array();
        normals.at.extend(points.iter().map(|_| normals.values.len() as u32));
        normals.values.push(normal);
        let (low, size) = self.section_box();
        for k in points {
            let along = |axis: usize| ((f64::from(self.cross_section[k][axis]) - low[axis]) / size) as f32;
            mesh.uv_sets[0].push([along(0), along(1)]);
        }
    }

    fn is_closed(&self) -> bool {
        self.cross_section.len() > 3 && self.cross_section.first() == self.cross_section.last()
    }

    /// The low corner of the box around the cross-section, and its larger side (1 where it has none).
    fn section_box(&self) -> ([f64; 2], f64) {
        let ends = |axis: usize| {
            let values = self.cross_section.iter().map(|p| f64::from(p[axis]));
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        };
        let [x, z] = [ends(0), ends(1)];
        let size = (x.1 - x.0).max(z.1 - z.0);
        ([x.0, z.0], if size > 0.0 { size } else { 1.0 })
    }
}

/// The value for a point of the spine: its own, or the last there is.
fn value<T: Copy>(list: &[T], i: usize) -> Option<T> {
    list.get(i).or(list.last()).copied()
}

fn share(i: usize, n: usize) -> f32 {
    (i as f64 / (n - 1) as f64) as f32
}
