//! Tangents against MikkTSpace's own, and where it has none.

use super::*;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use kiln_proto::{
    scene::{Coding, Material, NormalMap, Texture, Triangle},
    units::Rgb,
};

/// A wavy sheet of `n` x `n` quads with its normals. Beyond its middle the texture is its own mirror image, and there is a seam at a third.
fn waves(n: u32) -> Scene {
    let mut scene = Scene::empty();
    let height = |x: f64, y: f64| {
        let (sin, cos) = math::sin_cos_degrees(200.0 * x + 90.0 * y);
        (0.3 * sin, 0.3 * cos)
    };
    let at = |i: u32| f64::from(i) / f64::from(n);
    for (x, y) in (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))) {
        let (z, slope) = height(at(x), at(y));
        scene.positions.push([at(x) as f32, at(y) as f32, z as f32]);
        let degree = std::f64::consts::PI / 180.0;
        let normal = DVec3::new(-slope * 200.0 * degree, -slope * 90.0 * degree, 1.0).normalize();
        scene.normals.push(normal.as_vec3().to_array());
    }
    let uv = |x: u32, y: u32, right: bool| {
        let (u, v) = (at(x), 0.7 * at(y) + 0.2 * at(x) * at(y));
        let u = if 3 * x > n || (3 * x == n && right) { u * 1.3 + 0.1 } else { u };
        [if 2 * x > n { (1.3 * 0.5 + 0.1) * 2.0 - u } else { u } as f32, v as f32]
    };
    let mut triangles = vec![];
    for (x, y) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        for c in [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]] {
            let corners = c.map(|(i, j)| (y + j) * (n + 1) + x + i);
            let polygon = triangles.len() as u32;
            triangles.push((Triangle { corners, polygon }, Some(c.map(|(i, j)| uv(x + i, y + j, 3 * x >= n)))));
        }
    }
    let texels = vec![128, 128, 255];
    scene.textures = vec![Texture { name: "n".into(), width: 1, height: 1, coding: Coding::Linear, has_alpha: false, texels }];
    scene.materials = vec![Material::matt("m", Rgb::splat(0.5))];
    scene.materials[0].normal_map = Some(NormalMap { texture: TextureRef::plain(0, 0), scale: 1.0 });
    let mut surface = Surface::plain("s", 0, triangles);
    surface.normals = surface.triangles.iter().map(|t| t.corners).collect();
    scene.surfaces = vec![surface];
    scene
}

/// A surface as the crate wants it, and what it says of it.
struct Mikk<'a>(&'a Scene, Vec<[[f32; 4]; 3]>);

impl Geometry for Mikk<'_> {
    fn num_faces(&self) -> usize {
        self.0.surfaces[0].triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.0.positions[self.0.surfaces[0].triangles[face].corners[vert] as usize]
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.0.normals[self.0.surfaces[0].normals[face][vert] as usize]
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.0.surfaces[0].uv(0, face).unwrap()[vert]
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, vert: usize) {
        self.1[face][vert] = tangent.map_or(NONE, |t| t.tangent_encoded());
    }
}

fn made(scene: &mut Scene) -> Vec<[[f32; 4]; 3]> {
    complete(scene);
    scene.validate().unwrap();
    scene.surfaces[0].tangents.iter().map(|t| t.map(|k| scene.tangents[k as usize])).collect()
}

fn near([a, b]: [[f32; 4]; 2]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-4)
}

#[test]
fn tangents_are_those_of_mikktspace() {
    for n in [6, 12] {
        let mut scene = waves(n);
        if n == 12 {
            // Two vertices have one place in the texture: the triangles of both have none there, and follow their neighbours.
            let (triangles, at) = (scene.surfaces[0].triangles.clone(), |x: u32, y: u32| y * (n + 1) + x);
            let uv = scene.surfaces[0].uv_sets[0].iter_mut().flatten();
            let place = [5.0 / 12.0 * 1.3 + 0.1, 0.5];
            for (t, uv) in triangles.iter().zip(uv) {
                (0..3).filter(|k| [at(5, 8), at(5, 9)].contains(&t.corners[*k])).for_each(|k| uv[k] = place);
            }
        }
        let ours = made(&mut scene);
        let mut theirs = Mikk(&scene, vec![[[0.0; 4]; 3]; ours.len()]);
        generate_tangents(&mut theirs).unwrap();
        for (t, (a, b)) in ours.iter().zip(&theirs.1).enumerate() {
            assert!((0..3).all(|k| near([a[k], b[k]])), "triangle {t} of {n}²: {a:?} {b:?}");
        }
        let sides: Vec<f32> = ours.iter().map(|t| t[0][3]).collect();
        assert!(sides.contains(&1.0) && sides.contains(&-1.0));
        // A vertex of two halves has a tangent for each; otherwise triangles that share a vertex of the texture share it.
        assert!(scene.tangents.len() < 3 * ours.len() / 2, "{} of {}", scene.tangents.len(), ours.len());
    }
}

#[test]
fn coordinates_as_they_are_looked_up_decide_and_backs_are_their_fronts_turned_over() {
    let plain = made(&mut waves(4));
    let mut scene = waves(4);
    // A quarter turn: u runs along -v.
    scene.materials[0].normal_map.as_mut().unwrap().texture.transform = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
    let mut back = scene.surfaces[0].clone();
    (back.name, back.file_stem, back.back_of) = ("s~back".into(), "s-back".into(), Some(0));
    back.triangles.iter_mut().for_each(|t| t.corners.swap(1, 2));
    back.uv_sets[0].iter_mut().flatten().for_each(|c| c.swap(1, 2));
    let reversed: Vec<[f32; 3]> = scene.normals.iter().map(|n| n.map(|v| -v)).collect();
    back.normals.iter_mut().for_each(|c| *c = [c[0], c[2], c[1]].map(|n| n + reversed.len() as u32));
    scene.normals.extend(reversed);
    scene.surfaces.push(back);
    let turned = made(&mut scene);
    let (t, p) = (Vec3::from_slice(&turned[0][0]), Vec3::from_slice(&plain[0][0]));
    assert!(t.dot(p).abs() < 0.35 && turned[0][0][3] == plain[0][0][3], "{t} {p}");
    for (front, back) in turned.iter().zip(&scene.surfaces[1].tangents) {
        let [a, c, b] = back.map(|k| scene.tangents[k as usize]).map(|[x, y, z, side]| [x, y, z, -side]);
        assert!([a, b, c].iter().zip(front).all(|(a, b)| near([*a, *b])), "{front:?} {a:?} {b:?} {c:?}");
    }
}

#[test]
fn only_smooth_surfaces_with_a_map_and_no_tangents_of_their_own_get_some() {
    let mut flat = waves(2);
    flat.surfaces[0].normals.clear();
    let mut plain = waves(2);
    plain.materials[0].normal_map = None;
    for mut scene in [flat, plain] {
        complete(&mut scene);
        assert!(scene.surfaces[0].tangents.is_empty() && scene.tangents.is_empty());
    }
    let mut own = waves(2);
    (own.tangents, own.surfaces[0].tangents) = (vec![[0.0, 1.0, 0.0, -1.0]], vec![[0; 3]; 8]);
    assert_eq!(made(&mut own), vec![[[0.0, 1.0, 0.0, -1.0]; 3]; 8]);
    let mut nowhere = waves(2);
    nowhere.surfaces[0].uv_sets[0].fill(None);
    assert_eq!(made(&mut nowhere), vec![[NONE; 3]; 8]);
}

#[test]
fn a_disc_of_very_many_sectors_is_no_trouble() {
    const SECTORS: u32 = 60_000;
    let mut scene = waves(1);
    let rim = |k: u32| math::sin_cos_degrees(360.0 * f64::from(k % SECTORS) / f64::from(SECTORS));
    scene.positions = std::iter::once([0.0; 3]).chain((0..SECTORS).map(rim).map(|(s, c)| [c as f32, s as f32, 0.0])).collect();
    scene.normals = vec![[0.0, 0.0, 1.0]];
    let sector = |k: u32| Triangle { corners: [0, 1 + k, 1 + (k + 1) % SECTORS], polygon: k };
    let surface = &mut scene.surfaces[0];
    surface.triangles = (0..SECTORS).map(sector).collect();
    surface.parts[0].triangles = SECTORS;
    surface.normals = vec![[0; 3]; SECTORS as usize];
    surface.uv_sets[0] = surface
        .triangles
        .iter()
        .map(|t| Some(t.corners.map(|c| [scene.positions[c as usize][0], scene.positions[c as usize][1]])))
        .collect();
    assert!(made(&mut scene).iter().flatten().all(|t| near([*t, [1.0, 0.0, 0.0, 1.0]])));
}
