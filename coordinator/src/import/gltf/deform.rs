//! Morph targets and skins, applied once: what is baked stands still.

use super::{
    accessor::{Accessor, Accessors},
    json::Json,
    mesh::Primitive,
    node::Graph,
    report::Report,
};
use glam::{DMat3, DMat4, DVec3, DVec4};

/// A skin.
pub(super) struct Skin<'s, 'd> {
    joints: Vec<usize>,
    inverse_bind: Option<&'s Accessor<'d>>,
}

/// Vertices of a primitive, before or after deformation.
pub(super) struct Shape {
    /// Positions.
    pub(super) positions: Vec<DVec3>,
    /// Normals of any length; empty where there are none.
    pub(super) normals: Vec<DVec3>,
    /// Tangents of any length; empty where there are none.
    pub(super) tangents: Vec<DVec3>,
    /// The sides of their bitangents, 1 or -1.
    pub(super) sides: Vec<f64>,
}

/// Reads all skins.
pub(super) fn load_skins<'s, 'd>(
    root: Json<'d>,
    nodes: usize,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Vec<Skin<'s, 'd>> {
    report.objects(root, "skins").into_iter().map(|json| skin(json, nodes, accessors, report)).collect()
}

fn skin<'s, 'd>(json: Json<'d>, nodes: usize, accessors: &'s Accessors<'d, '_>, report: &mut Report<'_>) -> Skin<'s, 'd> {
    report.required(json, "joints");
    let joints = report.indices(json, "joints", "node", nodes);
    report.index(json, "skeleton", "node", nodes);
    let inverse_bind = json.get("inverseBindMatrices").and_then(|at| {
        let found = accessors.at(at, report)?;
        if found.kind() != "MAT4" || found.count < joints.len() {
            let (kind, count) = (found.kind(), found.count);
            report
                .error(at, format!("{} matrices of type MAT4 are expected for the joints; there are {count} of type {kind}", joints.len()));
            return None;
        }
        Some(found)
    });
    Skin { joints, inverse_bind }
}

impl Shape {
    /// The vertices of a primitive as they are stored, moved by its morph targets.
    pub(super) fn read(primitive: &Primitive<'_, '_>, weights: &[f64], accessors: &Accessors<'_, '_>) -> Self {
        let buffers = &accessors.buffers;
        let mut positions: Vec<DVec3> = primitive.positions.all(buffers).map(DVec3::from_array).collect();
        let mut normals: Vec<DVec3> = primitive.normals.map(|n| n.all(buffers).map(DVec3::from_array).collect()).unwrap_or_default();
        let side = |w: f64| if w < 0.0 { -1.0 } else { 1.0 };
        let given = primitive.tangents.into_iter().flat_map(|t| t.all::<4>(buffers)).map(|[x, y, z, w]| (DVec3::new(x, y, z), side(w)));
        let (mut tangents, sides): (Vec<DVec3>, Vec<f64>) = given.unzip();
        for (target, weight) in primitive.targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            for (values, moves) in [(&mut positions, target[0]), (&mut normals, target[1]), (&mut tangents, target[2])] {
                let Some(moves) = moves else { continue };
                values.iter_mut().zip(moves.all(buffers)).for_each(|(v, by)| *v += DVec3::from_array(by) * *weight);
            }
        }
        Self { positions, normals, tangents, sides }
    }

    /// Takes it to world space; returns whether fronts became backs.
    pub(super) fn place(&mut self, world: DMat4) -> bool {
        let (linear, of_normals) = (DMat3::from_mat4(world), for_normals(DMat3::from_mat4(world)));
        let mirrored = linear.determinant() < 0.0;
        self.positions.iter_mut().for_each(|p| *p = world.transform_point3(*p));
        self.normals.iter_mut().for_each(|n| *n = of_normals * *n);
        self.tangents.iter_mut().for_each(|t| *t = linear * *t);
        if mirrored {
            self.sides.iter_mut().for_each(|side| *side = -*side);
        }
        mirrored
    }

    /// Takes it to world space by the joints of a skin, whose weights are brought to a sum of one; returns whether fronts became backs.
    pub(super) fn bend(
        &mut self,
        primitive: &Primitive<'_, '_>,
        skin: &Skin<'_, '_>,
        graph: &Graph<'_>,
        accessors: &Accessors<'_, '_>,
        report: &mut Report<'_>,
    ) -> Option<bool> {
        let inverse = |i: usize| skin.inverse_bind.map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m.get(&accessors.buffers, i)));
        let joints: Vec<DMat4> = skin.joints.iter().enumerate().map(|(i, node)| graph.nodes[*node].world * inverse(i)).collect();
        let (mut mirrored, mut unbound) = (0, 0);
        for vertex in 0..self.positions.len() {
            let blended = match blend(primitive, vertex, &joints, accessors) {
                Ok((_, sum)) if sum <= 0.0 => {
                    unbound += 1;
                    continue;
                }
                Ok((matrix, sum)) => matrix * (1.0 / sum),
                Err(joint) => {
                    let message = format!("vertex {vertex} names joint {joint}, but the skin has {}", joints.len());
                    report.error(primitive.json, message);
                    return None;
                }
            };
            let linear = DMat3::from_mat4(blended);
            let turned = linear.determinant() < 0.0;
            mirrored += usize::from(turned);
            self.positions[vertex] = blended.transform_point3(self.positions[vertex]);
            if let Some(normal) = self.normals.get_mut(vertex) {
                *normal = for_normals(linear) * *normal;
            }
            if let (Some(tangent), Some(side)) = (self.tangents.get_mut(vertex), self.sides.get_mut(vertex)) {
                (*tangent, *side) = (linear * *tangent, if turned { -*side } else { *side });
            }
        }
        report.count_many(primitive.json, "vertices whose joints have no weight were left in their bind pose", unbound);
        Some(2 * mirrored > self.positions.len())
    }
}

/// The weighted sum of the joints of a vertex, and of the weights; or a joint that there is not.
fn blend(primitive: &Primitive<'_, '_>, vertex: usize, joints: &[DMat4], accessors: &Accessors<'_, '_>) -> Result<(DMat4, f64), usize> {
    let (mut matrix, mut sum) = (DMat4::ZERO, 0.0);
    for (indices, weights) in &primitive.influences {
        let (indices, weights) = (indices.get::<4>(&accessors.buffers, vertex), weights.get::<4>(&accessors.buffers, vertex));
        for (joint, weight) in indices.into_iter().zip(weights) {
            let joint = joint as usize;
            let of_joint = joints.get(joint).ok_or(joint)?;
            if weight > 0.0 {
                matrix += *of_joint * weight;
                sum += weight;
            }
        }
    }
    // A blend of affine maps is one, whatever rounding made of its last row.
    matrix.x_axis.w = 0.0;
    matrix.y_axis.w = 0.0;
    matrix.z_axis.w = 0.0;
    matrix.w_axis = DVec4::new(matrix.w_axis.x, matrix.w_axis.y, matrix.w_axis.z, sum);
    Ok((matrix, sum))
}

/// What takes normals along with a linear map: its inverse transposed, up to a positive factor, and also where a map flattens space.
fn for_normals(m: DMat3) -> DMat3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if m.determinant() < 0.0 { cofactors * -1.0 } else { cofactors }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_stay_orthogonal_to_what_they_stand_on() {
        let m = DMat3::from_cols(DVec3::new(-2.0, 0.1, 0.0), DVec3::new(0.3, 0.5, 0.2), DVec3::new(0.0, 0.7, 3.0));
        let (a, b) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-0.5, 0.25, 1.0));
        let normal = a.cross(b);
        let moved = for_normals(m) * normal;
        assert!(moved.dot(m * a).abs() < 1e-12 && moved.dot(m * b).abs() < 1e-12);
        assert!(m.determinant() < 0.0);
        assert!(moved.dot(m.inverse().transpose() * normal) > 0.0, "outside stays outside, also in a mirror");
        let flat = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0));
        assert_eq!((for_normals(flat) * DVec3::Z).normalize(), DVec3::Z);
    }
}
