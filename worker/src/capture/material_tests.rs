//! The shared gather against independent paths and quadrature, for every kind of material; thin sheets, both sides.

use super::*;
use crate::{
    eval::{Answer, Query, evaluate},
    simd::Simd,
    testing::{Table, add_back, add_quad, appendix_b, closed_box, empty, lambert, phong, plan, rough, settings},
};
use kiln_proto::scene::{AlphaMode, Coding, Material, MetallicRoughness, NormalMap, Opacity, Reflection, Scene, Texture, TextureRef};

/// A floor under a quad light, beside a bright wall and over a second light, so that every side of it sees something.
fn stage(floor: Material) -> Scene {
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], [0.0, 0.0, -4.0], floor);
    add_quad(&mut scene, "light", [1.0, 3.0, 1.0], [1.5, 0.0, 0.0], [0.0, 0.0, 1.5], lambert(0.0, 8.0));
    add_quad(&mut scene, "wall", [0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0], lambert(0.6, 0.4));
    add_quad(&mut scene, "below", [0.5, -1.5, 3.0], [3.0, 0.0, 0.0], [0.0, 0.0, -3.0], lambert(0.4, 1.0));
    scene
}

fn bump(scene: &mut Scene, mut material: Material) -> Material {
    let texels = [[200u8, 100, 220], [90, 60, 230], [128, 128, 255], [30, 150, 160]].concat();
    let (name, coding) = ("n".into(), Coding::Linear);
    scene.textures.push(Texture { name, width: 2, height: 2, coding, has_alpha: false, texels });
    material.normal_map = Some(NormalMap { texture: TextureRef::plain(scene.textures.len() as u32 - 1, 0), scale: 1.0 });
    material
}

fn mean_and_error(runs: &[Vec<Rgb>], k: usize) -> (f64, f64) {
    let n = runs.len() as f64;
    let values = runs.iter().map(|r| f64::from(r[k].g));
    let mean = values.clone().sum::<f64>() / n;
    (mean, (values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// Runs with seeds of their own agree within what they scatter, direction by direction, and so does their sum.
fn agree(name: &str, scene: Scene, texel: (u32, u32)) {
    const RUNS: u64 = 24;
    let json = r#"{"samples":256,"max_depth":4,"directions":"4x6"}"#;
    let layout = plan(&scene, &settings(json));
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(layout)).unwrap();
    let at = |samples, seed| BakeSettings { samples, seed, max_depth: 4, ..settings("{}") };
    let ours: Vec<Vec<Rgb>> = (0..RUNS).map(|s| shared(&capture, 0, texel, &at(512, s)).unwrap().0).collect();
    let theirs: Vec<Vec<Rgb>> = (0..RUNS).map(|s| per_direction(&capture, 0, texel, &at(256, 1_000 + s)).unwrap().0).collect();
    same(name, &ours, &theirs);
}

/// Whether runs of two estimators agree.
fn same(name: &str, ours: &[Vec<Rgb>], theirs: &[Vec<Rgb>]) {
    let (mut z2, mut sums) = (0.0, [0.0f64; 2]);
    for k in 0..24 {
        let ((a, ea), (b, eb)) = (mean_and_error(ours, k), mean_and_error(theirs, k));
        let z = (a - b) / (ea * ea + eb * eb + 1e-12 + 1e-8 * b * b).sqrt();
        assert!(z.abs() < 5.0, "{name}, direction {k}: {a} +- {ea}, {b} +- {eb}");
        (z2, sums) = (z2 + z * z / 24.0, [sums[0] + a, sums[1] + b]);
    }
    // Directions of a run share their noise, so that z² scatters more than that of 24 free numbers.
    assert!(z2 < 2.6, "{name}: {z2}");
    assert!((sums[0] / sums[1] - 1.0).abs() < 0.02, "{name}: {sums:?}");
}

#[test]
fn the_shared_gather_agrees_with_independent_paths_for_every_material() {
    let sheet = |roughness, transmission| rough(MetallicRoughness { transmission, ..appendix_b([0.9, 0.8, 0.3], 0.0, roughness) });
    let materials = [
        ("phong 20", phong(0.3, 0.5, 20.0)),
        ("phong 500", phong(0.3, 0.5, 500.0)),
        ("metal 0.3", rough(appendix_b([0.9, 0.6, 0.3], 1.0, 0.3))),
        ("metal 0.15", rough(appendix_b([0.9, 0.6, 0.3], 1.0, 0.15))),
        ("metal 1", rough(appendix_b([0.9, 0.6, 0.3], 1.0, 1.0))),
        ("dielectric 0.2", rough(appendix_b([0.7, 0.6, 0.3], 0.0, 0.2))),
        ("half metal 0.5", rough(appendix_b([0.7, 0.6, 0.3], 0.5, 0.5))),
        ("polished", rough(appendix_b([0.7, 0.6, 0.3], 0.0, 0.0))),
        ("frosted", sheet(0.5, 0.7)),
        ("finely frosted", sheet(0.2, 1.0)),
    ];
    for (name, material) in materials {
        agree(name, stage(material), (3, 4));
    }
}

#[test]
fn the_two_agree_under_normal_maps_and_textured_roughness_too() {
    let materials = [
        ("lambert", lambert(0.6, 0.0)),
        ("phong", phong(0.3, 0.5, 20.0)),
        ("metal", rough(appendix_b([0.9, 0.6, 0.3], 1.0, 0.4))),
        ("polished", rough(appendix_b([0.7, 0.6, 0.3], 0.0, 0.0))),
        ("frosted", rough(MetallicRoughness { transmission: 0.6, ..appendix_b([0.9, 0.8, 0.3], 0.0, 0.6) })),
    ];
    for (name, material) in materials {
        let mut scene = stage(material.clone());
        scene.materials[0] = bump(&mut scene, material);
        if let Reflection::MetallicRoughness(m) = &mut scene.materials[0].reflection {
            m.metallic_roughness_texture = Some(TextureRef::plain(0, 0));
        }
        agree(name, scene, (1, 5));
    }
}

/// Roughness by a texture of this many columns, the first of them perfectly smooth.
fn partly_polished(m: MetallicRoughness, columns: u32) -> Scene {
    let mut scene = stage(rough(m));
    let texels = (0..columns).flat_map(|x| [0, if x == 0 { 0 } else { 255 }, 255]).collect();
    scene.textures.push(Texture { name: "r".into(), width: columns, height: 1, coding: Coding::Linear, has_alpha: false, texels });
    let Reflection::MetallicRoughness(m) = &mut scene.materials[0].reflection else { panic!() };
    m.metallic_roughness_texture = Some(TextureRef { nearest: true, ..TextureRef::plain(0, 0) });
    scene
}

#[test]
fn texels_that_are_mirrors_in_part_are_the_mean_of_mirror_and_rough_points() {
    // Half of it, and so little that none of the points that a texel is judged by is smooth.
    for (name, m, columns) in [
        ("metal", appendix_b([0.9, 0.6, 0.3], 1.0, 0.4), 2),
        ("finely brushed", appendix_b([0.9, 0.6, 0.3], 1.0, 0.15), 2),
        ("frosted", MetallicRoughness { transmission: 0.8, ..appendix_b([0.9, 0.8, 0.3], 0.0, 0.5) }, 2),
        ("a scratch", appendix_b([0.7; 3], 1.0, 0.6), 24),
    ] {
        let scene = Arc::new(BakeScene::new(partly_polished(m, columns), Simd::Auto).unwrap());
        let json = r#"{"max_depth":3,"directions":"4x6","texture_sizes":{"floor":"1x1"}}"#;
        let layout = Arc::new(plan(scene.scene(), &settings(json)));
        let capture = Capture::new(scene.clone(), layout).unwrap();
        let views = Views::grid(&settings(json).directions.directions());
        let texel = capture.rasters[0].texel(0, 0).unwrap();
        let site = |seed| Site {
            surface: 0,
            frame: texel.frame,
            points: Points::Area { raster: &capture.rasters[0], texel: &texel, push: None },
            key: TexelKey::new(seed, 0, 0),
        };
        let (mut ours, mut theirs) = (vec![], vec![]);
        for seed in 0..24 {
            let (mut a, mut b) = (vec![Rgb::BLACK; 24], vec![Rgb::BLACK; 24]);
            let budget = |samples| Budget { samples, max_depth: 3 };
            hemisphere::capture(&scene, &site(seed), budget(512), &views, &mut Scratch::default(), &mut a);
            hemisphere::capture_each(&scene, &site(1_000 + seed), budget(256), &views, &mut b);
            ours.push(a);
            theirs.push(b);
        }
        same(name, &ours, &theirs);
    }
}

#[test]
fn textures_within_a_footprint_are_averaged_as_they_are() {
    // One texel of 2 x 2 over a whole texture: the mean of many point answers is the texel's.
    let mut scene = stage(rough(appendix_b([0.9, 0.6, 0.3], 1.0, 0.7)));
    let plain = scene.materials[0].clone();
    scene.materials[0] = bump(&mut scene, plain);
    let Reflection::MetallicRoughness(m) = &mut scene.materials[0].reflection else { panic!() };
    m.metallic_roughness_texture = Some(TextureRef::plain(0, 0));
    let layout =
        |seed: u64| format!(r#"{{"samples":8192,"max_depth":2,"directions":"2x4","texture_sizes":{{"floor":"1x1"}},"seed":{seed}}}"#);
    let scene = Arc::new(BakeScene::new(scene, Simd::Auto).unwrap());
    let bake = |seed: u64| {
        let capture = Capture::new(scene.clone(), Arc::new(plan(scene.scene(), &settings(&layout(seed))))).unwrap();
        capture.bake_tile(TileIndex(0)).unwrap().radiance.chunks_exact(3).map(|c| Rgb::new(c[0], c[1], c[2])).collect::<Vec<Rgb>>()
    };
    let texels: Vec<Vec<Rgb>> = (0..16).map(bake).collect();
    let frame = kiln_proto::frame::Frame { tangent: Vec3::X, bitangent: -Vec3::Z, normal: Vec3::Y };
    for (k, direction) in settings(&layout(0)).directions.directions().into_iter().enumerate() {
        let query = |j: u32| {
            let (x, z) = ((j % 32) as f32 / 8.0 + 0.0625, (j / 32) as f32 / 8.0 + 0.0625);
            Query { surface: "floor".into(), position: Vec3::new(x, 0.0, z), direction: frame.to_world(direction) }
        };
        let queries: Vec<Query> = (0..1024).map(query).collect();
        let answers = evaluate(&scene, &queries, &settings(r#"{"samples":64,"max_depth":2,"directions":"2x4"}"#), 4);
        let answers: Vec<Answer> = answers.into_iter().map(Result::unwrap).collect();
        let expected = answers.iter().map(|a| f64::from(a.radiance.g)).sum::<f64>() / 1024.0;
        let variance = answers.iter().map(|a| f64::from(a.stderr.g) * f64::from(a.stderr.g)).sum::<f64>() / (1024.0 * 1024.0);
        let (mean, error) = mean_and_error(&texels, k);
        let sigma = (variance + error * error).sqrt();
        assert!((mean - expected).abs() < 4.5 * sigma + 2e-3 * expected, "{k}: {mean} +- {error}, {expected} +- {}", variance.sqrt());
        assert!(sigma < 0.05 * expected, "{k}: the test would see nothing");
    }
}

#[test]
fn one_bounce_off_a_rough_plate_matches_quadrature() {
    for m in [appendix_b([0.9, 0.6, 0.3], 1.0, 0.35), appendix_b([0.6, 0.5, 0.4], 0.0, 0.5), appendix_b([0.6; 3], 0.5, 0.8)] {
        let mut scene = empty();
        add_quad(&mut scene, "floor", [0.0, 0.0, 10.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], rough(m));
        add_quad(&mut scene, "light", [4.0, 6.0, 4.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 20.0));
        let scene = BakeScene::new(scene, Simd::Auto).unwrap();
        let bsdf = scene.bsdf(0, [0.3, 0.3]);
        for k in 0..12 {
            let (sin, cos) = kiln_proto::math::sin_cos_turns(k as f32 * 0.618);
            let z = 0.2 + 0.75 * k as f32 / 12.0;
            let r = (1.0 - z * z).sqrt();
            let (at, wo) = (Vec3::new(1.0 + k as f32 * 0.6, 0.0, 8.5 - k as f32 * 0.5), Vec3::new(r * cos, z, r * sin));
            let query = Query { surface: "floor".into(), position: at, direction: wo };
            let answer = evaluate(&scene, &[query], &settings(r#"{"samples":1024,"max_depth":2}"#), 24).remove(0).unwrap();
            let expected = super::tests::quadrature(|wi, wo| bsdf.eval(wi, wo).g, at, wo);
            let off = (f64::from(answer.radiance.g) - expected).abs();
            assert!(off < 5.0 * f64::from(answer.stderr.g) + 1e-3 * expected, "{k}: {answer:?} {expected}");
        }
    }
}

#[test]
fn a_plate_in_a_furnace_shows_its_tabulated_albedo() {
    let table = Table::read("reference/metallic-roughness/albedo.csv");
    for row in table.rows().step_by(9) {
        let [ior, metallic, roughness, cos] = ["ior", "metallic", "roughness", "cos_o"].map(|c| row.number(c));
        let m = MetallicRoughness { ior, ..appendix_b(row.vector("base").to_array(), metallic, roughness) };
        let mut scene = closed_box(2.0, &lambert(0.0, 1.0));
        scene.materials[0] = rough(m);
        let direction = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), cos, 0.0);
        let query = Query { surface: "wall0".into(), position: Vec3::new(0.7, 0.0, 0.9), direction };
        let scene = BakeScene::new(scene, Simd::Auto).unwrap();
        let Answer { radiance, stderr } = evaluate(&scene, &[query], &settings(r#"{"samples":512,"max_depth":2}"#), 16).remove(0).unwrap();
        let expected = row.number("g");
        let off = (radiance.g - expected).abs();
        assert!(off < 5.0 * stderr.g + 1e-3 * expected, "{metallic} {roughness} {cos}: {radiance:?} {stderr:?} {expected}");
    }
}

#[test]
fn a_leaf_lit_from_one_side_shows_each_side_its_own_light() {
    let leaf = |material: Material| {
        let mut scene = empty();
        add_quad(&mut scene, "leaf", [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], material.clone());
        add_back(&mut scene, 0, material);
        add_quad(&mut scene, "light", [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lambert(0.0, 5.0));
        let json = r#"{"samples":1024,"max_depth":3,"directions":"2x4"}"#;
        let layout = plan(&scene, &settings(json));
        let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(layout)).unwrap();
        [0, 1].map(|surface| {
            let tile = capture.bake_tile(capture.plan().first_tile(surface)).unwrap();
            tile.radiance.iter().sum::<f32>() / tile.radiance.len() as f32
        })
    };
    let [lit, dark] = leaf(lambert(0.5, 0.0));
    assert!(lit > 0.3 && dark == 0.0, "{lit} {dark}");
    let [front, back] = leaf(rough(MetallicRoughness { transmission: 0.5, ..appendix_b([0.8; 3], 0.0, 0.9) }));
    assert!(front > 0.1 && back > 0.1 * front, "light shines through: {front} {back}");
}

#[test]
fn a_blended_texel_holds_what_it_would_hold_opaque() {
    let bake = |opacity: f32| {
        let mut scene = stage(phong(0.4, 0.3, 10.0));
        scene.materials[0].opacity = Opacity { mode: AlphaMode::Blend, factor: opacity, texture: None };
        let layout = plan(&scene, &settings(r#"{"samples":1024,"max_depth":2,"directions":"2x4"}"#));
        Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(layout)).unwrap().bake_tile(TileIndex(0)).unwrap()
    };
    assert_eq!(bake(0.25).radiance, bake(1.0).radiance);
}

#[test]
fn bytes_of_rough_mapped_and_veiled_scenes_depend_neither_on_threads_nor_on_vector_width() {
    let bake = |threads: usize, simd: Simd| {
        let mut scene = stage(rough(MetallicRoughness { transmission: 0.3, ..appendix_b([0.9, 0.6, 0.3], 0.3, 0.6) }));
        let plain = scene.materials[0].clone();
        scene.materials[0] = bump(&mut scene, plain);
        scene.materials[2] =
            Material { opacity: Opacity { mode: AlphaMode::Blend, factor: 0.7, texture: None }, ..rough(appendix_b([0.5; 3], 1.0, 0.15)) };
        let layout = plan(&scene, &settings(r#"{"samples":50,"max_depth":4,"directions":"5x6"}"#));
        let capture = Capture::new(Arc::new(BakeScene::new(scene, simd).unwrap()), Arc::new(layout)).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (0..4).map(|t| capture.bake_tile(TileIndex(t)).unwrap()).collect::<Vec<_>>())
    };
    let one = bake(1, Simd::Portable);
    assert!(one.iter().flat_map(|t| &t.radiance).all(|v| v.is_finite() && *v >= 0.0));
    assert!(bake(3, Simd::Portable) == one && bake(2, Simd::Auto) == one);
}
