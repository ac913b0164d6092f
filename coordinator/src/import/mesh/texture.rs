//! Texture coordinates for meshes whose author gave none: the bounding-box mapping of X3D 3.3, 13.3.6 (IndexedFaceSet).

use super::{Channel, Mesh};

/// S runs from 0 to 1 along the longest side of the box around the polygons, T from 0 to the ratio of the second longest side to the
/// longest; of equal sides the order is X, Y, Z.
#[must_use]
pub fn box_mapping(mesh: &Mesh) -> Channel<[f32; 2]> {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in mesh.corners.iter().map(|c| mesh.positions[*c as usize]) {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    // In f64: the box of opposite huge corners must not overflow.
    let size: [f64; 3] = std::array::from_fn(|axis| f64::from(high[axis]) - f64::from(low[axis]));
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| size[*b].total_cmp(&size[*a])); // Stable, so that ties keep X, Y, Z.
    let unit = if size[axes[0]] > 0.0 { size[axes[0]] } else { 1.0 };
    let along = |p: &[f32; 3], axis: usize| ((f64::from(p[axis]) - f64::from(low[axis])) / unit) as f32;
    let values = mesh.positions.iter().map(|p| [along(p, axes[0]), along(p, axes[1])]).collect();
    Channel { values, at: mesh.corners.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the specification's figure: X is twice Z and four times Y.
    #[test]
    fn s_follows_the_longest_side_and_t_the_second() {
        let mut mesh = Mesh { positions: vec![[1.0, 0.0, 0.0], [5.0, 1.0, 2.0], [1.0, 1.0, 2.0], [99.0; 3]], ..Mesh::default() };
        mesh.push_polygon([0, 1, 2]);
        let uv = box_mapping(&mesh);
        assert_eq!([uv.get(0), uv.get(1), uv.get(2)], [[0.0, 0.0], [1.0, 0.5], [0.0, 0.5]]);
    }

    #[test]
    fn ties_prefer_x_then_y_and_a_point_maps_to_zero() {
        let mut mesh = Mesh { positions: vec![[0.0; 3], [1.0, 2.0, 2.0], [0.0, 2.0, 0.0]], ..Mesh::default() };
        mesh.push_polygon([0, 1, 2]);
        assert_eq!(box_mapping(&mesh).get(2), [1.0, 0.0], "S along Y, T along Z");
        let mut point = Mesh { positions: vec![[3.0; 3]], ..Mesh::default() };
        point.push_polygon([0, 0, 0]);
        assert_eq!(box_mapping(&point).get(1), [0.0, 0.0]);
    }
}
