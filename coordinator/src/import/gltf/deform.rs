//! Morph targets and skins, applied once: what is baked stands still.

use super::{
    accessor::{Accessor, Accessors},
    form::{BIND, of_form},
    json::Json,
    mesh::Primitive,
    node::Graph,
    report::Report,
};
use crate::import::mesh::{for_normals, stretch};
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

/// What taking a shape to world space did to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    /// Whether fronts became backs.
    pub(super) mirrored: bool,
    /// By how much lengths were stretched, in the mean.
    pub(super) stretch: f64,
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
        let found = of_form(at, &BIND, None, accessors, report)?;
        if found.count < joints.len() {
            report.error(at, format!("{} matrices of type MAT4 are expected for the joints; there are {}", joints.len(), found.count));
            return None;
        }
        Some(found)
    });
    Skin { joints, inverse_bind }
}

impl Skin<'_, '_> {
    /// How many joints it has.
    pub(super) fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// What each joint does to what is bound to it, in the world.
    pub(super) fn matrices(&self, graph: &Graph<'_>, accessors: &Accessors<'_, '_>) -> Vec<DMat4> {
        let inverse = |i: usize| self.inverse_bind.map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m.get(&accessors.buffers, i)));
        self.joints.iter().enumerate().map(|(i, node)| *graph.nodes[*node].world * inverse(i)).collect()
    }
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

    /// Takes it to world space.
    pub(super) fn place(&mut self, world: DMat4) -> Moved {
        let (linear, of_normals) = (DMat3::from_mat4(world), for_normals(DMat3::from_mat4(world)));
        let mirrored = linear.determinant() < 0.0;
        self.positions.iter_mut().for_each(|p| *p = world.transform_point3(*p));
        self.normals.iter_mut().for_each(|n| *n = of_normals * *n);
        self.tangents.iter_mut().for_each(|t| *t = linear * *t);
        if mirrored {
            self.sides.iter_mut().for_each(|side| *side = -*side);
        }
        Moved { mirrored, stretch: stretch(&world) }
    }

    /// Takes it to world space by the joints of a skin (their [`Skin::matrices`]), whose weights are brought to a sum of one.
    pub(super) fn bend(
        &mut self,
        primitive: &Primitive<'_, '_>,
        joints: &[DMat4],
        accessors: &Accessors<'_, '_>,
        report: &mut Report<'_>,
    ) -> Option<Moved> {
        let (mut mirrored, mut unbound) = (0, 0);
        for vertex in 0..self.positions.len() {
            let blended = match blend(primitive, vertex, joints, accessors) {
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
        let stretch = joints.iter().map(stretch).sum::<f64>() / joints.len().max(1) as f64;
        Some(Moved { mirrored: 2 * mirrored > self.positions.len(), stretch })
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
