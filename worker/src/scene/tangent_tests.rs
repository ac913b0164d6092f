//! Normal maps along the tangents of a surface.

use super::*;
use crate::testing::{add_back, empty, lambert};
use kiln_proto::{
    math::sin_cos_degrees,
    scene::{Coding, NormalMap, Surface, Texture, TextureRef, Triangle},
};
use std::collections::BTreeMap;

const RINGS: u32 = 6;
const SECTORS: u32 = 8;

/// A coarse sphere without its poles under a normal map that tilts everywhere alike: u goes around, v down, tangents along u.
fn ball(side: f32) -> Scene {
    let mut scene = empty();
    let texels = vec![200, 160, 215];
    scene.textures.push(Texture { name: "n".into(), width: 1, height: 1, coding: Coding::Linear, has_alpha: false, texels });
    let normal_map = Some(NormalMap { texture: TextureRef::plain(0, 0), scale: 1.0 });
    scene.materials.push(Material { normal_map, ..lambert(0.5, 0.0) });
    let mut triangles = vec![];
    for (i, j) in (0..=RINGS).flat_map(|i| (0..=SECTORS).map(move |j| (i, j))) {
        let (sin_theta, cos_theta) = sin_cos_degrees(30.0 + 120.0 * f64::from(i) / f64::from(RINGS));
        let (sin_phi, cos_phi) = sin_cos_degrees(360.0 * f64::from(j) / f64::from(SECTORS));
        let normal = [sin_theta * cos_phi, cos_theta, sin_theta * sin_phi].map(|v| v as f32);
        scene.positions.push(normal);
        scene.normals.push(normal);
        scene.tangents.push([-sin_phi as f32, 0.0, cos_phi as f32, side]);
        if i < RINGS && j < SECTORS {
            for c in [[(0, 0), (0, 1), (1, 1)], [(0, 0), (1, 1), (1, 0)]] {
                let corners = c.map(|(di, dj)| (i + di) * (SECTORS + 1) + j + dj);
                let uv = c.map(|(di, dj)| [(j + dj) as f32 / SECTORS as f32, (i + di) as f32 / RINGS as f32]);
                triangles.push((Triangle { corners, polygon: 0 }, Some(uv)));
            }
        }
    }
    let mut surface = Surface::plain("ball", 0, triangles);
    surface.normals = surface.triangles.iter().map(|t| t.corners).collect();
    surface.tangents = surface.normals.clone();
    scene.surfaces.push(surface);
    scene
}

fn bake(scene: Scene) -> BakeScene {
    BakeScene::new(scene, Simd::Auto).unwrap()
}

fn at(scene: &BakeScene, prim: u32, [u, v]: [f32; 2]) -> Vertex {
    scene.vertex(&Hit { prim, t: 1.0, u, v })
}

/// The largest difference of the normals that reflection sees between the two sides of an edge.
fn jump(scene: &BakeScene) -> f32 {
    let mut seen: BTreeMap<[u32; 2], Vec<Vec3>> = BTreeMap::new();
    for (t, triangle) in scene.scene().surfaces[0].triangles.iter().enumerate() {
        for (a, b, bary) in [(0, 1, [0.5, 0.0]), (1, 2, [0.5, 0.5]), (2, 0, [0.0, 0.5])] {
            let (a, b) = (triangle.corners[a], triangle.corners[b]);
            seen.entry([a.min(b), a.max(b)]).or_default().push(at(scene, t as u32, bary).shading.normal);
        }
    }
    assert!(seen.values().filter(|n| n.len() == 2).count() > 100);
    seen.values().filter(|n| n.len() == 2).map(|n| n[0].distance(n[1])).fold(0.0, f32::max)
}

#[test]
fn a_coarse_ball_under_a_tilted_map_has_no_edges() {
    let scene = bake(ball(1.0));
    assert!(jump(&scene) < 1e-5, "{}", jump(&scene));
    let tilt = at(&scene, 20, [0.3, 0.3]);
    assert!(tilt.shading.normal.dot(tilt.frame.normal) < 0.9, "the map tilts");
    let mut faceted = ball(1.0);
    faceted.surfaces[0].tangents.clear();
    assert!(jump(&bake(faceted)) > 0.03, "a tangent for each triangle shows every edge");
}

#[test]
fn the_side_of_the_bitangent_is_the_authors() {
    let (right, left) = (bake(ball(1.0)), bake(ball(-1.0)));
    for prim in [0, 21, 50] {
        let (r, l) = (at(&right, prim, [0.2, 0.3]), at(&left, prim, [0.2, 0.3]));
        let (n, both, apart) = (r.frame.normal, r.shading.normal + l.shading.normal, r.shading.normal - l.shading.normal);
        // Along the tangent and the normal they agree; what differs is the part along the bitangent, in the green channel above a half.
        let along = both - n * n.dot(both);
        assert!(apart.dot(n).abs() < 1e-5 && apart.dot(along).abs() < 1e-5, "{r:?} {l:?}");
        assert!(n.cross(along.normalize()).dot(apart) > 0.2 && along.dot(Vec3::Y.cross(n)) < -0.3, "{r:?} {l:?}");
    }
}

#[test]
fn backs_have_the_normals_of_their_fronts_reversed_and_zero_tangents_are_the_triangles() {
    let mut scene = ball(1.0);
    let material = scene.materials[0].clone();
    add_back(&mut scene, 0, material);
    let scene = bake(scene);
    for prim in [0, 21, 50] {
        let (front, back) = (at(&scene, prim, [0.2, 0.3]), at(&scene, scene.prim(prim).other.unwrap(), [0.3, 0.2]));
        assert!(front.shading.normal.distance(-back.shading.normal) < 1e-5, "{front:?} {back:?}");
    }
    let (mut none, mut faceted) = (ball(1.0), ball(1.0));
    none.tangents.fill([0.0, 0.0, 0.0, 1.0]);
    faceted.surfaces[0].tangents.clear();
    assert_eq!(at(&bake(none), 7, [0.2, 0.3]).shading, at(&bake(faceted), 7, [0.2, 0.3]).shading);
}
