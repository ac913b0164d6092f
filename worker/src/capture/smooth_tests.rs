//! Smooth surfaces: the terminator, hollows, furnaces.

use crate::{
    eval::{Query, evaluate},
    sampling::warp::basis,
    scene::BakeScene,
    simd::Simd,
    testing::{add_quad, closed_box, empty, lambert, phong, scaled, settings},
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    scene::{Material, Reflection, Scene, Surface, Triangle},
    units::Rgb,
};

/// A closed sphere about the origin, smooth, whose triangles face out (or in).
fn sphere(radius: f32, rings: u32, sectors: u32, inward: bool, material: Material) -> Scene {
    let mut scene = empty();
    let mut triangles = vec![];
    for i in 0..=rings {
        for j in 0..sectors {
            let (sin_theta, cos_theta) = kiln_proto::math::sin_cos_degrees(180.0 * f64::from(i) / f64::from(rings));
            let (sin_phi, cos_phi) = kiln_proto::math::sin_cos_degrees(360.0 * f64::from(j) / f64::from(sectors));
            let n = DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi).as_vec3();
            scene.positions.push((n * radius).to_array());
            scene.normals.push(if inward { -n } else { n }.to_array());
            let at = |i: u32, j: u32| i * sectors + j % sectors;
            if i > 0 && i < rings {
                triangles.extend([[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i, j + 1), at(i - 1, j + 1), at(i, j)]]);
            }
        }
    }
    if !inward {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    scene.materials.push(material);
    let listed = triangles.iter().map(|c| (Triangle { corners: *c, polygon: 0 }, None)).collect();
    scene.surfaces.push(Surface { normals: triangles, ..Surface::plain("sphere", 0, listed) });
    scene
}

/// Points of every so many triangles, with the interpolated normal there and the triangle's.
fn points_of(scene: &BakeScene, step: usize) -> Vec<[Vec3; 3]> {
    let surface = &scene.scene().surfaces[0];
    let weights = [[0.34, 0.33, 0.33], [0.7, 0.2, 0.1], [0.1, 0.3, 0.6]];
    let point = |(k, t): (usize, &Triangle)| {
        let w = weights[k % 3];
        let mix = |pool: &[[f32; 3]], c: [u32; 3]| (0..3).map(|i| Vec3::from_array(pool[c[i] as usize]) * w[i]).sum::<Vec3>();
        let (at, normal) = (mix(&scene.scene().positions, t.corners), mix(&scene.scene().normals, surface.normals[k]).normalize());
        [at, normal, scene.prim(k as u32).frame.normal]
    };
    surface.triangles.iter().enumerate().step_by(step).map(point).collect()
}

#[test]
fn a_sphere_of_eight_segments_under_a_distant_light_is_lit_by_its_normals() {
    for (factor, toward) in [(1.0, Vec3::Y), (1.0, Vec3::new(0.6, 0.64, 0.48)), (1e-3, Vec3::new(0.48, -0.6, 0.64))] {
        let mut scene = sphere(1.0, 8, 8, false, lambert(0.8, 0.0));
        // A square of 8 m, 200 m away, that faces the sphere.
        let (x, y) = basis(-toward);
        let corner = toward * 200.0 - x * 4.0 - y * 4.0;
        let (x, y) = ((x * 8.0).to_array(), (y * 8.0).to_array());
        add_quad(&mut scene, "sun", corner.to_array(), x, y, lambert(0.0, 1_000.0));
        let scene = BakeScene::new(scaled(scene, factor), Simd::Auto).unwrap();
        let irradiance = 1_000.0 * 64.0 / (200.0 * 200.0);
        let (mut lit, mut turned) = (0, 0);
        for [at, n, flat] in points_of(&scene, 1) {
            let query = Query { surface: "sphere".into(), position: at, direction: n };
            let answer = evaluate(&scene, &[query], &settings(r#"{"samples":64,"max_depth":2}"#), 2).remove(0).unwrap();
            let cos = n.dot(toward);
            let expected = 0.8 / std::f32::consts::PI * irradiance * cos.max(0.0);
            assert!((answer.radiance.g - expected).abs() < 0.02 * irradiance, "at {at}, normal {n}: {answer:?} {expected}");
            lit += u32::from(expected > 0.0);
            // Between the terminators of the normals and of the triangles.
            turned += u32::from(cos > 0.05 && flat.dot(toward) < 0.0);
        }
        assert!(lit > 40 && (turned > 0 || toward == Vec3::Y), "{lit} {turned}");
    }
}

#[test]
fn smooth_furnaces_keep_their_light() {
    // Seen from inside, hollow: every ray below a triangle's own horizon goes on above it.
    for material in [lambert(0.5, 0.5), Material { emission: Rgb::splat(0.3), ..phong(0.3, 0.4, 8.0) }] {
        let lossless = matches!(&material.reflection, Reflection::Phong(p) if p.specular.is_black());
        let scene = BakeScene::new(sphere(3.0, 12, 24, true, material), Simd::Auto).unwrap();
        let queries: Vec<Query> = points_of(&scene, 5)
            .into_iter()
            .map(|[position, direction, _]| Query { surface: "sphere".into(), position, direction })
            .collect();
        let answers = evaluate(&scene, &queries, &settings(r#"{"samples":64,"max_depth":24}"#), 2);
        let light: Vec<f32> = answers.into_iter().map(|a| a.unwrap().radiance.g).collect();
        let mean = light.iter().sum::<f32>() / light.len() as f32;
        let within = if lossless { (mean - 1.0).abs() < 0.005 } else { mean <= 1.0 && mean > 0.8 };
        assert!(within, "{mean} {light:?}");
    }
}

#[test]
fn a_smooth_ball_in_a_furnace_is_as_bright_as_its_albedo() {
    let mut scene = closed_box(6.0, &lambert(0.0, 1.0));
    scene.positions.iter_mut().flatten().for_each(|v| *v -= 3.0);
    let ball = sphere(1.0, 10, 10, false, lambert(0.6, 0.0));
    let first = scene.positions.len() as u32;
    scene.positions.extend(ball.positions);
    scene.normals.extend(ball.normals);
    let mut surface = ball.surfaces[0].clone();
    surface.triangles.iter_mut().for_each(|t| t.corners = t.corners.map(|c| c + first));
    surface.parts[0].material = scene.materials.len() as u32;
    scene.materials.extend(ball.materials);
    scene.surfaces.insert(0, surface);
    let scene = BakeScene::new(scene, Simd::Auto).unwrap();
    let mut sum = 0.0;
    let triangles: Vec<Triangle> = scene.scene().surfaces[0].triangles.clone();
    for t in &triangles {
        let at = t.corners.iter().map(|c| Vec3::from_array(scene.scene().positions[*c as usize])).sum::<Vec3>() / 3.0;
        let query = Query { surface: "sphere".into(), position: at, direction: at };
        let answer = evaluate(&scene, &[query], &settings(r#"{"samples":256,"max_depth":2}"#), 2).remove(0).unwrap();
        assert!((answer.radiance.g - 0.6).abs() < 0.03, "at {at}: {answer:?}");
        sum += answer.radiance.g / triangles.len() as f32;
    }
    assert!((sum - 0.6).abs() < 0.003, "{sum}");
}
