//! Whole captures against answers known by other means.

use super::*;
use crate::simd::Simd;
use crate::{
    eval::{Query, evaluate},
    testing::{add_quad, closed_box, empty, lambert, mirror, phong, plan, scaled, settings},
};
use glam::DVec3;
use kiln_proto::{
    scene::{LayerMode, Scene, TextureLayer, TextureRef},
    wire::message::Phase,
};
use std::f64::consts::PI;

pub(super) fn capture(scene: Scene, json: &str, simd: Simd) -> Capture {
    let plan = plan(&scene, &settings(json));
    Capture::new(Arc::new(BakeScene::new(scene, simd).unwrap()), Arc::new(plan)).unwrap()
}

fn tiles(capture: &Capture) -> Vec<TileRadiance> {
    (0..capture.plan().tile_count(Phase::Bake)).map(|t| capture.bake_tile(TileIndex(t)).unwrap()).collect()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// A floor of 10 m x 10 m under a quad light of 2 m x 2 m that hangs 6 m above it.
pub(super) fn lit_floor(floor: kiln_proto::scene::Material) -> Scene {
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 10.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], floor);
    add_quad(&mut scene, "light", [4.0, 6.0, 4.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 20.0));
    scene
}

const LIGHT: [DVec3; 4] = [DVec3::new(4.0, 6.0, 4.0), DVec3::new(6.0, 6.0, 4.0), DVec3::new(6.0, 6.0, 6.0), DVec3::new(4.0, 6.0, 6.0)];

/// Lambert's polygon formula (1760): irradiance over radiance of a polygon above the horizon.
pub(super) fn polygon_factor(p: DVec3, normal: DVec3) -> f64 {
    let v = LIGHT.map(|c| (c - p).normalize());
    let edge = |k: usize| {
        let (a, b) = (v[k], v[(k + 1) % 4]);
        let cross = a.cross(b);
        kiln_proto::math::acos(a.dot(b)) * cross.normalize().dot(normal)
    };
    (0..4).map(edge).sum::<f64>().abs() / 2.0
}

#[test]
fn a_closed_emitting_box_sums_the_powers_of_its_albedo() {
    for (depth, kd, ke) in [(1u32, 0.6, 0.7), (2, 0.6, 0.7), (5, 0.6, 0.7), (40, 0.5, 0.5)] {
        let json = format!(r#"{{"samples":64,"max_depth":{depth},"directions":"4x8"}}"#);
        let all = tiles(&capture(closed_box(3.0, &lambert(kd, ke)), &json, Simd::Auto));
        let expected = (0..depth).fold(0.0, |sum, _| f64::from(ke) + f64::from(kd) * sum);
        for tile in &all {
            let got = mean(&tile.radiance);
            assert!((got / expected - 1.0).abs() < 0.02, "depth {depth}: {got} {expected}");
        }
        let overall = all.iter().map(|t| mean(&t.radiance)).sum::<f64>() / all.len() as f64;
        assert!((overall / expected - 1.0).abs() < 0.005, "depth {depth}: {overall} {expected}");
    }
}

/// A sphere of radius 3 about (1, 2, 3), seen from inside, as one surface of 2 x 12 x 24 triangles less those at the poles.
fn closed_sphere() -> Scene {
    const RINGS: u32 = 12;
    const SECTORS: u32 = 24;
    let mut scene = empty();
    let mut triangles = vec![];
    for i in 0..=RINGS {
        for j in 0..SECTORS {
            let (sin_theta, cos_theta) = kiln_proto::math::sin_cos_degrees(180.0 * f64::from(i) / f64::from(RINGS));
            let (sin_phi, cos_phi) = kiln_proto::math::sin_cos_degrees(360.0 * f64::from(j) / f64::from(SECTORS));
            let p = DVec3::new(1.0, 2.0, 3.0) + 3.0 * DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi);
            scene.positions.push(p.as_vec3().to_array());
            let at = |i: u32, j: u32| i * SECTORS + j % SECTORS;
            let triangle = |corners: [u32; 3]| (kiln_proto::scene::Triangle { corners, polygon: 0 }, None);
            if i > 0 && i < RINGS {
                triangles.push(triangle([at(i, j), at(i + 1, j), at(i, j + 1)]));
                triangles.push(triangle([at(i, j + 1), at(i - 1, j + 1), at(i, j)]));
            }
        }
    }
    scene.materials.push(lambert(0.5, 0.5));
    scene.surfaces.push(kiln_proto::scene::Surface::plain("sphere", 0, triangles));
    scene
}

#[test]
fn inside_a_closed_emitting_sphere_the_radiance_is_one_everywhere() {
    for factor in [1e-3, 1.0, 1e3] {
        let scene = BakeScene::new(scaled(closed_sphere(), factor), Simd::Auto).unwrap();
        let queries: Vec<Query> = (0..scene.scene().triangle_count() as u32)
            .step_by(7)
            .map(|prim| {
                let (c, n) = (scene.prim(prim).corners, scene.prim(prim).frame.normal);
                // The middle of some triangles, right beside a corner of others.
                let w = [Vec3::splat(1.0 / 3.0), Vec3::new(0.998, 0.001, 0.001)][prim as usize % 2];
                Query { surface: "sphere".into(), position: c[0] * w.x + c[1] * w.y + c[2] * w.z, direction: n }
            })
            .collect();
        let answers = evaluate(&scene, &queries, &settings(r#"{"samples":64,"max_depth":24}"#), 2);
        let light: Vec<f32> = answers.into_iter().map(|a| a.unwrap().radiance.g).collect();
        assert!(light.iter().all(|l| (l - 1.0).abs() < 0.12), "{light:?}");
        assert!((mean(&light) - 1.0).abs() < 0.005, "{}", mean(&light));
    }
}

#[test]
fn a_furnace_of_mirrors_and_lobes_keeps_its_radiance() {
    // In a closed box of uniform radiance 1 the mirror returns Ks and the diffuse base Kd: with emission 1 - Kd - Ks the radiance is 1.
    let all = tiles(&capture(closed_box(2.0, &mirror(0.3, 0.4, 0.3)), r#"{"samples":128,"max_depth":30,"directions":"4x8"}"#, Simd::Auto));
    for tile in &all {
        assert!((mean(&tile.radiance) - 1.0).abs() < 0.01, "{}", mean(&tile.radiance));
    }
    // One glossy wall in a box whose other walls emit 1 and reflect nothing reflects its albedo toward the normal.
    let mut scene = closed_box(2.0, &lambert(0.0, 1.0));
    scene.materials[0] = phong(0.3, 0.5, 40.0);
    let query = Query { surface: "wall0".into(), position: Vec3::new(0.7, 0.0, 0.9), direction: Vec3::Y };
    let scene = BakeScene::new(scene, Simd::Auto).unwrap();
    let answer = evaluate(&scene, &[query], &settings(r#"{"samples":1024,"max_depth":2}"#), 16).remove(0).unwrap();
    assert!((answer.radiance.r - 0.8).abs() < 4.0 * answer.stderr.r.max(1e-3), "{answer:?}");
}

#[test]
fn a_floor_under_a_quad_light_matches_lamberts_polygon_formula() {
    let kd = 0.6;
    let capture =
        capture(lit_floor(lambert(kd, 0.0)), r#"{"samples":1024,"max_depth":2,"directions":"2x2","footprint":"point"}"#, Simd::Auto);
    let tile = capture.bake_tile(TileIndex(0)).unwrap();
    let mut bias = 0.0;
    for (row, light) in tile.rows.iter().zip(tile.radiance.chunks_exact(12)) {
        let p = DVec3::new((f64::from(row.x) + 0.5) * 1.25, 0.0, 10.0 - (f64::from(row.y) + 0.5) * 1.25);
        let expected = f64::from(kd) / PI * 20.0 * polygon_factor(p, DVec3::Y);
        assert!(light.iter().all(|l| *l == light[0]), "a diffuse texel is exactly constant");
        bias += f64::from(light[0]) / expected - 1.0;
        assert!((f64::from(light[0]) / expected - 1.0).abs() < 0.05, "{row:?}: {} {expected}", light[0]);
    }
    assert!((bias / tile.rows.len() as f64).abs() < 0.003, "{bias}");
}

#[test]
fn direct_light_on_a_phong_floor_matches_quadrature() {
    let (kd, ks, n) = (0.3, 0.5, 40.0);
    let scene = BakeScene::new(lit_floor(phong(kd, ks, n)), Simd::Auto).unwrap();
    let bsdf = scene.bsdf(0, [0.3, 0.3]);
    let cases: Vec<(Vec3, Vec3)> = (0..24)
        .map(|k| {
            let (sin, cos) = kiln_proto::math::sin_cos_turns(k as f32 * 0.618);
            let z = 0.2 + 0.75 * k as f32 / 24.0;
            let r = (1.0 - z * z).sqrt();
            (Vec3::new(0.5 + (k * 7 % 24) as f32 * 0.39, 0.0, 9.5 - k as f32 * 0.37), Vec3::new(r * cos, z, r * sin))
        })
        .collect();
    let queries: Vec<Query> =
        cases.iter().map(|(position, direction)| Query { surface: "floor".into(), position: *position, direction: *direction }).collect();
    let answers = evaluate(&scene, &queries, &settings(r#"{"samples":1024,"max_depth":2}"#), 32);
    let mut z2 = 0.0;
    for ((position, wo), answer) in cases.iter().zip(answers) {
        let answer = answer.unwrap();
        let expected = quadrature(|wi, wo| bsdf.eval(wi, wo).r, *position, *wo);
        let z = (f64::from(answer.radiance.r) - expected) / f64::from(answer.stderr.r).max(1e-5 * expected);
        assert!(z.abs() < 5.5, "at {position} toward {wo}: {answer:?} {expected}");
        z2 += z * z / cases.len() as f64;
    }
    assert!(z2 < 2.2, "{z2}");
}

/// Midpoint rule over the light of [`lit_floor`] for a BRDF's values (wi, wo). World +Y is the normal; local x and y may be any: the BRDF
/// is isotropic.
pub(super) fn quadrature(value: impl Fn(Vec3, Vec3) -> f32, p: Vec3, wo: Vec3) -> f64 {
    const N: usize = 300;
    let local = |w: DVec3| Vec3::new(w.x as f32, w.z as f32, w.y as f32);
    let mut sum = 0.0;
    for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
        let at = DVec3::new(4.0 + 2.0 * (i as f64 + 0.5) / N as f64, 6.0, 4.0 + 2.0 * (j as f64 + 0.5) / N as f64) - p.as_dvec3();
        let wi = at.normalize();
        let f = f64::from(value(local(wi), local(wo.as_dvec3())));
        sum += f * wi.y * wi.y / at.length_squared();
    }
    20.0 * sum * 4.0 / (N * N) as f64
}

#[test]
fn the_same_scene_a_thousand_times_smaller_or_larger_bakes_the_same() {
    let bake = |factor: f32| {
        let mut scene = lit_floor(phong(0.3, 0.5, 40.0));
        add_quad(&mut scene, "wall", [0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], phong(0.5, 0.3, 15.0));
        let all = tiles(&capture(scaled(scene, factor), r#"{"samples":64,"max_depth":4,"directions":"4x8"}"#, Simd::Auto));
        all.into_iter().flat_map(|t| t.radiance).collect::<Vec<f32>>()
    };
    let metre = bake(1.0);
    for factor in [1e-3, 1e3] {
        // The same random numbers meet the same geometry up to rounding: nearly every value agrees closely.
        let other = bake(factor);
        let scale = mean(&metre) as f32;
        let off = metre.iter().zip(&other).filter(|(a, b)| (*a - *b).abs() > 1e-3 * scale + 1e-3 * a.abs()).count();
        assert!(off < metre.len() / 100, "{off} of {} values differ at {factor}", metre.len());
        assert!((mean(&other) / mean(&metre) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn bytes_depend_neither_on_threads_nor_on_vector_width() {
    let bake = |threads: usize, simd: Simd| {
        let mut scene = lit_floor(phong(0.3, 0.5, 40.3));
        add_quad(&mut scene, "wall", [0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], mirror(0.2, 0.3, 0.0));
        let capture = capture(scene, r#"{"samples":50,"max_depth":4,"directions":"5x6"}"#, simd);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (tiles(&capture), capture.probe_tile(TileIndex(0)).unwrap()))
    };
    let one = bake(1, Simd::Portable);
    assert_eq!(bake(3, Simd::Portable), one);
    assert_eq!(bake(2, Simd::Auto), one);
}

#[test]
fn gutter_rows_are_copies_of_their_source_also_across_tiles() {
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], lambert(0.5, 0.0));
    add_quad(&mut scene, "light", [1.0, 3.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lambert(0.0, 5.0));
    // The chart ends at column 32 of 64, where the next tile begins.
    scene.surfaces[0].uv_sets[0].iter_mut().flatten().flatten().for_each(|c| c[0] *= 0.5);
    let capture = capture(scene, r#"{"samples":16,"directions":"2x2","texture_sizes":{"floor":"64x32"}}"#, Simd::Auto);
    let (own, next) = (capture.bake_tile(TileIndex(0)).unwrap(), capture.bake_tile(TileIndex(1)).unwrap());
    assert_eq!((own.rows.len(), next.rows.len()), (1024, 64));
    for (row, light) in next.rows.iter().zip(next.radiance.chunks_exact(12)) {
        let source = own.rows.iter().position(|r| (r.x, r.y) == row.source).unwrap();
        assert_eq!(light, &own.radiance[source * 12..source * 12 + 12]);
        assert!(light[0] > 0.0);
    }
    assert!(matches!(capture.bake_tile(TileIndex(99)), Err(CaptureError::NoSuchTile { .. })));
}

#[test]
fn backs_are_black_and_blocked_texels_exactly_zero() {
    // A floor seen from below, in a scene whose only light is above it.
    let mut scene = lit_floor(lambert(0.6, 0.0));
    add_quad(&mut scene, "under", [0.0, -0.5, 0.0], [10.0, 0.0, 0.0], [0.0, 0.0, 10.0], phong(0.5, 0.5, 20.0));
    add_quad(&mut scene, "below", [0.0, -1.0, 10.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], phong(0.5, 0.5, 20.0));
    let capture = capture(scene, r#"{"samples":64,"max_depth":6,"directions":"4x8"}"#, Simd::Auto);
    let dark = |surface: usize| capture.bake_tile(capture.plan().first_tile(surface)).unwrap().radiance;
    assert!(dark(2).iter().chain(&dark(3)).all(|l| *l == 0.0));
    assert!(mean(&dark(0)) > 0.0);
}

#[test]
fn a_textured_floor_shows_its_texture_in_linear_light() {
    let mut scene = lit_floor(lambert(0.8, 0.0));
    let texels = [[255u8; 3], [0; 3], [0; 3], [255; 3]].concat();
    let (name, coding) = ("checker".into(), kiln_proto::scene::Coding::Srgb);
    scene.textures.push(kiln_proto::scene::Texture { name, width: 2, height: 2, coding, has_alpha: false, texels });
    let kiln_proto::scene::Reflection::Phong(phong) = &mut scene.materials[0].reflection else { panic!() };
    phong.layers = vec![TextureLayer { texture: TextureRef::plain(0, 0), mode: LayerMode::Modulate { scale: 1.0 } }];
    let json = r#"{"samples":256,"max_depth":2,"directions":"2x2","texture_sizes":{"floor":"2x2"}}"#;
    let tile = capture(scene, json, Simd::Auto).bake_tile(TileIndex(0)).unwrap();
    let flat = capture(lit_floor(lambert(0.8, 0.0)), json, Simd::Auto).bake_tile(TileIndex(0)).unwrap();
    // Over one texel of the checker's own resolution, bilinear interpolation averages to 9/16 of white and 3/16 of each neighbour or so.
    let ratio: Vec<f64> = (0..4).map(|k| f64::from(tile.radiance[k * 12]) / f64::from(flat.radiance[k * 12])).collect();
    assert!((ratio[0] - ratio[3]).abs() < 0.05 && (ratio[1] - ratio[2]).abs() < 0.05, "{ratio:?}");
    assert!(ratio[0] > 0.55 && ratio[1] < 0.45 && ((ratio[0] + ratio[1]) - 1.0).abs() < 0.05, "{ratio:?}");
}

#[test]
fn a_plan_of_another_scene_is_refused() {
    let scene = Arc::new(BakeScene::new(closed_box(1.0, &lambert(0.5, 0.5)), Simd::Auto).unwrap());
    let mut other = plan(scene.scene(), &settings("{}"));
    other.surfaces.pop();
    assert!(matches!(Capture::new(scene, Arc::new(other)), Err(CaptureError::Mismatch { .. })));
}

#[test]
fn a_textured_light_emits_its_texture_and_is_sampled_by_its_mean() {
    // Half of the light's texture is black: the floor gets about half the light, the light itself shows its texture.
    let json = r#"{"samples":1024,"max_depth":2,"directions":"2x2","texture_sizes":{"light":"4x4","floor":"2x2"}}"#;
    let bake = |texture: Option<Vec<u8>>| {
        let mut scene = lit_floor(lambert(0.8, 0.0));
        if let Some(rgb) = texture {
            let (name, coding) = ("t".into(), kiln_proto::scene::Coding::Srgb);
            scene.textures.push(kiln_proto::scene::Texture { name, width: 4, height: 1, coding, has_alpha: false, texels: rgb });
            scene.materials[1].emission_texture = Some(TextureRef::plain(0, 0));
        }
        tiles(&capture(scene, json, Simd::Auto))
    };
    let (plain, white) = (bake(None), bake(Some(vec![255; 12])));
    let halved = bake(Some([[255u8; 3], [255; 3], [0; 3], [0; 3]].concat()));
    assert!((mean(&white[0].radiance) / mean(&plain[0].radiance) - 1.0).abs() < 1e-4);
    assert!((mean(&halved[0].radiance) / mean(&plain[0].radiance) - 0.5).abs() < 0.03);
    assert!((mean(&halved[1].radiance) - 10.0).abs() < 0.2, "{}", mean(&halved[1].radiance));
    // Columns 1 and 2 of the light's texels straddle no edge of the texture: fully bright and fully dark but for interpolation.
    assert!(halved[1].radiance[12] > 15.0 && halved[1].radiance[36] < 15.0);
}

#[test]
fn a_probe_counts_what_its_texels_show() {
    let capture = capture(lit_floor(phong(0.3, 0.5, 20.0)), r#"{"samples":256,"max_depth":2,"directions":"4x8"}"#, Simd::Auto);
    assert_eq!(capture.plan().tile_count(Phase::Probe), 2);
    let mut sums = kiln_proto::probe::ProbeSums::new(2);
    for tile in 0..2 {
        sums.add(&capture.probe_tile(TileIndex(tile)).unwrap().0);
    }
    // All 64 texels of the floor toward 32 directions; the light, which emits, is left out.
    assert_eq!(sums.histogram.iter().sum::<u64>(), 64 * 32);
    assert!(sums.variation[0].0 > 0 && sums.variation[0].1 > 0);
    assert_eq!(sums.variation[1], (0, 0), "the light shows the same toward every direction");
    assert!(matches!(capture.probe_tile(TileIndex(2)), Err(CaptureError::NoSuchTile { .. })));
}

#[test]
fn independent_paths_and_the_shared_gather_agree() {
    let mut scene = lit_floor(phong(0.3, 0.5, 20.0));
    add_quad(&mut scene, "wall", [0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], mirror(0.3, 0.4, 0.2));
    let json = r#"{"samples":4096,"max_depth":4,"directions":"3x4"}"#;
    let capture = capture(scene, json, Simd::Auto);
    for surface in [0, 2] {
        let (ours, _) = shared(&capture, surface, (3, 5), &settings(json)).unwrap();
        let (theirs, _) = per_direction(&capture, surface, (3, 5), &settings(json)).unwrap();
        for (a, b) in ours.iter().zip(&theirs) {
            assert!((a.r - b.r).abs() < 0.05 * b.r.max(0.05), "surface {surface}: {a:?} {b:?}");
        }
    }
}

/// Every texel of a floor whose corners are black at one end sees some of the light: none is judged by a single point of it.
#[test]
fn texels_with_colours_that_begin_black_are_gathered() {
    let mut scene = lit_floor(lambert(1.0, 0.0));
    scene.colors = vec![[0.0, 0.0, 0.0, 1.0], [1.0; 4]];
    // Black along u = 0, white along u = 1: interpolated over both triangles.
    scene.surfaces[0].colors = vec![[0, 1, 1], [0, 1, 0]];
    let json = r#"{"samples":64,"max_depth":2,"directions":"2x2","texture_sizes":{"floor":"4x4"}}"#;
    let tile = capture(scene, json, Simd::Auto).bake_tile(TileIndex(0)).unwrap();
    let column = |x: u32| -> f32 { tile.rows.iter().zip(tile.radiance.chunks(12)).filter(|(r, _)| r.x == x).map(|(_, l)| l[0]).sum() };
    let columns: Vec<f32> = (0..4).map(column).collect();
    // The light hangs over the middle. In the texels at the ends, an eighth and seven eighths of the way from black to white:
    assert!((columns[0] / columns[3] - 1.0 / 7.0).abs() < 0.04, "{columns:?}");
}
