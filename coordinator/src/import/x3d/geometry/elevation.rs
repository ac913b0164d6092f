//! ElevationGrid (X3D 3.3, 13.3.4).

use super::{
    Composed, Geometry,
    composed::{Lookup, Lookups, assemble, crease},
    error::{GeometryError, Repairs, bounded, positive},
    faces::{Collector, Faces},
};
use kiln_proto::limits;

/// The fields of an ElevationGrid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ElevationGrid {
    /// Normal: `vector`. Empty: no node.
    pub(crate) normal: Vec<[f32; 3]>,
    /// Color (alpha 1) or ColorRGBA: `color`. Empty: no node.
    pub(crate) color: Vec<[f32; 4]>,
    /// TextureCoordinate, or those of a MultiTextureCoordinate: `point`. Empty: no node.
    pub(crate) tex_coord: Vec<Vec<[f32; 2]>>,
    /// Whether the front looks toward +Y.
    pub(crate) ccw: bool,
    /// Colours belong to vertices, not to quads.
    pub(crate) color_per_vertex: bool,
    /// Normals belong to vertices, not to quads.
    pub(crate) normal_per_vertex: bool,
    /// Only the front is seen.
    pub(crate) solid: bool,
    /// Radians: edges between quads that differ by less are smooth, where normals are generated.
    pub(crate) crease_angle: f32,
    /// Heights, x fastest.
    pub(crate) height: Vec<f32>,
    /// Points along X.
    pub(crate) x_dimension: i32,
    /// Distance between them.
    pub(crate) x_spacing: f32,
    /// Points along Z.
    pub(crate) z_dimension: i32,
    /// Distance between them.
    pub(crate) z_spacing: f32,
}

impl Default for ElevationGrid {
    fn default() -> Self {
        Self {
            normal: vec![],
            color: vec![],
            tex_coord: vec![],
            ccw: true,
            color_per_vertex: true,
            normal_per_vertex: true,
            solid: true,
            crease_angle: 0.0,
            height: vec![],
            x_dimension: 0,
            x_spacing: 1.0,
            z_dimension: 0,
            z_spacing: 1.0,
        }
    }
}

impl ElevationGrid {
    /// One quad a cell. Without texture coordinates S runs along X and T along Z, both from 0 to 1.
    ///
    /// # Errors
    /// Dimensions below 2 (nothing to see), spacings that are not positive, too few heights for two rows, more cells than a scene may have.
    /// Missing last rows are left out: a grid is never larger than its list of heights, whatever it says of itself.
    pub(crate) fn build(&self) -> Result<Geometry, GeometryError> {
        let spacing = [positive("xSpacing", self.x_spacing)?, positive("zSpacing", self.z_spacing)?];
        let mut repairs = Repairs::default();
        let (columns, rows) = self.dimensions(&mut repairs)?;
        let coord = (0..rows * columns)
            .map(|v| [((v % columns) as f64 * spacing[0]) as f32, self.height[v], ((v / columns) as f64 * spacing[1]) as f32])
            .collect();
        let tex_coord = if self.tex_coord.is_empty() { vec![spread(columns, rows)] } else { self.tex_coord.clone() };
        let node = Composed {
            coord,
            normal: self.normal.clone(),
            color: self.color.clone(),
            tex_coord,
            ccw: self.ccw,
            color_per_vertex: self.color_per_vertex,
            normal_per_vertex: self.normal_per_vertex,
            solid: self.solid,
        };
        let faces = quads(&node.coord, columns, rows, &mut repairs)?;
        let per = |vertex: bool| if vertex { Lookup::Vertex } else { Lookup::Face };
        let lookups = Lookups { normal: per(self.normal_per_vertex), color: per(self.color_per_vertex), tex_coord: Lookup::Vertex };
        let smoothing = crease(self.crease_angle, &mut repairs);
        Ok(assemble(&node, &faces, lookups, smoothing, repairs))
    }

    /// Columns and rows that the heights fill.
    fn dimensions(&self, repairs: &mut Repairs) -> Result<(usize, usize), GeometryError> {
        let dimension = |field: &'static str, value: i32| match u64::try_from(value) {
            Err(_) => Err(GeometryError::OutOfRange { field, value: f64::from(value), wanted: "0 or greater" }),
            Ok(0 | 1) => Err(GeometryError::Empty { why: "xDimension or zDimension is below 2" }),
            Ok(n) => Ok(n),
        };
        let (columns, rows) = (dimension("xDimension", self.x_dimension)?, dimension("zDimension", self.z_dimension)?);
        bounded((columns - 1) * (rows - 1), "xDimension times zDimension", limits::TRIANGLES / 2)?;
        let found = self.height.len() as u64;
        let whole = (found / columns).min(rows);
        if whole < 2 {
            let why = "xDimension times zDimension";
            return Err(GeometryError::Count { field: "height", found: self.height.len(), wanted: columns * rows, why });
        }
        if whole < rows {
            repairs.note("rows for which there are no heights were left out, from", "height", (whole * columns) as usize);
        }
        Ok((columns as usize, whole as usize))
    }
}

/// Texture coordinates over the whole grid.
fn spread(columns: usize, rows: usize) -> Vec<[f32; 2]> {
    let share = |i: usize, n: usize| (i as f64 / (n - 1) as f64) as f32;
    (0..rows * columns).map(|v| [share(v % columns, columns), share(v / columns, rows)]).collect()
}

fn quads(coord: &[[f32; 3]], columns: usize, rows: usize, repairs: &mut Repairs) -> Result<Faces, GeometryError> {
    let mut faces = Collector::new(coord, "height", false, repairs);
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let v = row * columns + column;
            faces.face(0, [v, v + columns, v + columns + 1, v + 1].map(|v| (v as i64, v)));
        }
    }
    faces.finish()
}
