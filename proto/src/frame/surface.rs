//! The frames of a whole surface: one per triangle where it is flat in each, interpolated ones where it has vertex normals.
//!
//! A smooth surface has a normal and a tangent at every corner. The normal is the author's, or the triangle's own where the author's does
//! not point to the front. The tangent is the sum of dP/du over the triangles that meet in this vertex of the texture (same chart, position
//! and texture coordinates), each counted by its area, made orthogonal to the normal. Between the corners both are interpolated linearly
//! and made orthogonal again, which is what a fragment shader does with vertex attributes: baker, decoder and page build the same frame at
//! every point. A frame per triangle would cost a third of the memory and show every edge of a rounded body in its highlights. MikkTSpace's
//! tangents weigh by angle and split vertices in ways of their own; nothing outside reads these frames, so the simpler sum does.

use super::{Frame, FrameRule, Lie};
use crate::{
    plan::SurfacePlan,
    scene::{Scene, Surface},
};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Length below which an interpolated normal points nowhere.
const LEAST_NORMAL: f64 = 1e-6;

/// The frames of one surface in its texture.
pub struct SurfaceFrames {
    rule: FrameRule,
    /// One frame per triangle, of its plane; `None` for triangles without area.
    flat: Vec<Option<Frame>>,
    /// What is interpolated within each triangle; empty for surfaces that are flat in each.
    smooth: Vec<Corners>,
}

/// Unit normals and tangents at the corners of a triangle, rounded as they travel to a shader.
#[derive(Clone, Copy)]
struct Corners {
    normals: [Vec3; 3],
    tangents: [Vec3; 3],
}

/// A vertex of the texture: chart, position and texture coordinates.
type Vertex = (u32, u32, [u32; 2]);

impl SurfaceFrames {
    /// The frames of a surface that is laid out as its plan says. Cost: linear in triangles; 40 bytes each, 112 on smooth surfaces.
    #[must_use]
    pub fn new(scene: &Scene, surface: &Surface, plan: &SurfacePlan, rule: FrameRule) -> Self {
        let frame = |(t, uv): (_, &[[f32; 2]; 3])| Frame::of_triangle(scene.corners(t), uv.map(|c| c.map(f64::from)), rule);
        let flat: Vec<Option<Frame>> = surface.triangles.iter().zip(&plan.uv).map(frame).collect();
        let smooth = if surface.normals.is_empty() { vec![] } else { smooth(scene, surface, plan, &flat) };
        Self { rule, flat, smooth }
    }

    /// The frame at a point of a triangle, given by the barycentric weights of its second and third corner; `None` for a triangle without
    /// area.
    #[must_use]
    pub fn at(&self, triangle: u32, bary: [f64; 2]) -> Option<Frame> {
        let flat = self.flat[triangle as usize]?;
        let Some(corners) = self.smooth.get(triangle as usize) else { return Some(flat) };
        let weights = [1.0 - bary[0] - bary[1], bary[0], bary[1]];
        let mix = |v: &[Vec3; 3]| v.iter().zip(weights).map(|(v, w)| v.as_dvec3() * w).sum::<DVec3>();
        let normal = mix(&corners.normals);
        let length = normal.length();
        let normal = if length >= LEAST_NORMAL { normal / length } else { flat.normal.as_dvec3() };
        Some(match self.rule {
            FrameRule::Thesis => Frame::thesis(normal),
            FrameRule::Texture => Frame::oriented(normal, mix(&corners.tangents)),
        })
    }

    /// The normal of a triangle's plane; `None` for a triangle without area.
    #[must_use]
    pub fn geometric_normal(&self, triangle: u32) -> Option<Vec3> {
        self.flat[triangle as usize].map(|f| f.normal)
    }

    /// Whether normals are interpolated.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        !self.smooth.is_empty()
    }
}

/// The unit normals that are interpolated within a triangle: the author's, and the triangle's own where those do not point to its front.
/// `None` where the surface has none, or the triangle no area. Every corner is on the front's side, and so is every normal between.
#[must_use]
pub fn corner_normals(scene: &Scene, surface: &Surface, triangle: usize) -> Option<[DVec3; 3]> {
    let authored = surface.normals.get(triangle)?;
    let [a, b, c] = scene.corners(surface.triangles.get(triangle)?);
    let own = (b - a).cross(c - a);
    let length = own.length();
    if length <= 0.0 || !length.is_finite() {
        return None;
    }
    let own = own / length;
    Some(authored.map(|index| {
        let normal = Vec3::from_array(scene.normals[index as usize]).as_dvec3();
        let size = normal.length();
        if size > 0.0 && normal.dot(own) > 0.0 { normal / size } else { own }
    }))
}

fn smooth(scene: &Scene, surface: &Surface, plan: &SurfacePlan, flat: &[Option<Frame>]) -> Vec<Corners> {
    let vertex = |t: usize, k: usize| -> Vertex { (plan.charts[t], surface.triangles[t].corners[k], plan.uv[t][k].map(f32::to_bits)) };
    // Looked up, never iterated, and summed in the order of the triangles: hashing cannot matter.
    let mut tangents: HashMap<Vertex, DVec3> = HashMap::new();
    for t in 0..flat.len() {
        let corners = scene.corners(&surface.triangles[t]);
        let Some(lie) = Lie::of(corners, plan.uv[t].map(|uv| uv.map(f64::from))) else { continue };
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        (0..3).for_each(|k| *tangents.entry(vertex(t, k)).or_default() += lie.along_u * area);
    }
    let corners = |t: usize| {
        let own = flat[t].map_or(Vec3::Y, |f| f.normal).as_dvec3();
        let normals = corner_normals(scene, surface, t).unwrap_or([own; 3]);
        let tangent = |k: usize| {
            let sum = tangents.get(&vertex(t, k)).copied().unwrap_or_default();
            Frame::oriented(normals[k], sum.normalize_or_zero()).tangent
        };
        Corners { normals: normals.map(|n| n.as_vec3()), tangents: std::array::from_fn(tangent) }
    };
    (0..flat.len()).map(corners).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plan::ChartSource,
        scene::{Material, Triangle},
        settings::TextureSize,
        units::Rgb,
    };

    /// A strip of `n` quads around a quarter of a cylinder of radius 1 about z, u along the arc; normals point away from the axis.
    fn arc(n: u32, smooth: bool) -> (Scene, SurfacePlan) {
        let (mut scene, mut triangles) = (Scene::empty(), vec![]);
        for i in 0..=n {
            let (sin, cos) = crate::math::sin_cos_degrees(90.0 * f64::from(i) / f64::from(n));
            for z in [0.0, 1.0] {
                scene.positions.push([cos as f32, sin as f32, z]);
                scene.normals.push([cos as f32, sin as f32, 0.0]);
            }
            if i < n {
                let at = |k: u32| [(i + k / 2) as f32 / n as f32, (1 - k % 2) as f32];
                for c in [[0, 2, 3], [0, 3, 1]] {
                    triangles.push((Triangle { corners: c.map(|k| 2 * i + k), polygon: i }, Some(c.map(at))));
                }
            }
        }
        scene.materials = vec![Material::matt("m", Rgb::splat(0.5))];
        let mut surface = Surface::plain("s", 0, triangles);
        if smooth {
            surface.normals = surface.triangles.iter().map(|t| t.corners).collect();
        }
        let uv = surface.uv_sets[0].iter().map(|uv| uv.unwrap()).collect();
        let charts = vec![0; surface.triangles.len()];
        scene.surfaces = vec![surface];
        let size = TextureSize { width: 16, height: 16 };
        (scene, SurfacePlan { size, source: ChartSource::Author, uv, charts, covered: 0, tiles: vec![] })
    }

    fn frames(scene: &Scene, plan: &SurfacePlan, rule: FrameRule) -> SurfaceFrames {
        SurfaceFrames::new(scene, &scene.surfaces[0], plan, rule)
    }

    #[test]
    fn a_smooth_arc_turns_evenly_and_does_not_jump_at_its_edges() {
        let (scene, plan) = arc(6, true);
        let smooth = frames(&scene, &plan, FrameRule::Texture);
        for t in 0..12 {
            // The second triangle of a quad shares the diagonal (corners 0 and 3) with the first.
            for (bary, degrees) in [([0.0, 0.0], 0.0), (if t % 2 == 0 { [0.0, 1.0] } else { [1.0, 0.0] }, 15.0)] {
                let (sin, cos) = crate::math::sin_cos_degrees(f64::from(t / 2) * 15.0 + degrees);
                let f = smooth.at(t, bary).unwrap();
                assert!(f.normal.distance(Vec3::new(cos as f32, sin as f32, 0.0)) < 1e-6, "{t}: {f:?}");
                assert!(f.tangent.distance(Vec3::new(-sin as f32, cos as f32, 0.0)) < 0.14 && f.tangent.z.abs() < 1e-6, "{t}: {f:?}");
                assert!(f.tangent.cross(f.bitangent).distance(f.normal) < 1e-6 && f.tangent.dot(f.normal).abs() < 1e-6);
            }
            let middle = smooth.at(t, [1.0 / 3.0; 2]).unwrap();
            assert!(middle.normal.distance(smooth.geometric_normal(t).unwrap()) < 0.1);
        }
        let (flat, _) = arc(6, false);
        let flat = frames(&flat, &plan, FrameRule::Texture);
        assert!(smooth.is_smooth() && !flat.is_smooth());
        assert_eq!(flat.at(3, [0.2, 0.7]), flat.at(3, [0.0, 0.0]));
        assert_eq!(flat.at(3, [0.0, 0.0]).map(|f| f.normal), flat.geometric_normal(3));
    }

    #[test]
    fn tangents_of_different_charts_and_of_cut_edges_are_not_mixed() {
        let (scene, mut plan) = arc(1, true);
        let whole = frames(&scene, &plan, FrameRule::Texture).at(0, [0.0, 0.0]).unwrap();
        // The second triangle is laid out upside down: dP/du points the other way there.
        plan.uv[1] = plan.uv[1].map(|[u, v]| [1.0 - u, 1.0 - v]);
        for charts in [vec![0, 1], vec![0, 0]] {
            plan.charts = charts;
            let f = frames(&scene, &plan, FrameRule::Texture);
            assert!(f.at(0, [0.0, 0.0]).unwrap().tangent.distance(whole.tangent) < 1e-6);
            assert!(f.at(1, [0.0, 0.0]).unwrap().tangent.distance(-whole.tangent) < 1e-6);
        }
    }

    #[test]
    fn what_is_degenerate_falls_back() {
        let (mut scene, mut plan) = arc(1, true);
        let thesis = frames(&scene, &plan, FrameRule::Thesis);
        assert_eq!(thesis.at(0, [0.0, 0.0]).unwrap(), Frame::thesis(DVec3::X));
        plan.uv = vec![[[0.5; 2]; 3]; 2];
        assert_eq!(frames(&scene, &plan, FrameRule::Texture).at(0, [0.0, 0.0]).unwrap(), Frame::thesis(DVec3::X));
        // Normals that point to the back, or nowhere, give way to the triangle's own.
        scene.normals[0] = [-1.0, 0.0, 0.0];
        scene.normals[3] = [0.0; 3];
        let f = frames(&scene, &plan, FrameRule::Texture);
        let own = f.geometric_normal(0).unwrap();
        assert_eq!(f.at(0, [0.0, 0.0]).unwrap().normal, own);
        assert_eq!(f.at(0, [0.0, 1.0]).unwrap().normal, own);
        assert!(f.at(0, [1.0, 0.0]).unwrap().normal.distance(Vec3::Y) < 1e-6);
        scene.positions[2] = scene.positions[0];
        assert!(frames(&scene, &plan, FrameRule::Texture).at(0, [0.0, 0.0]).is_none());
    }
}
