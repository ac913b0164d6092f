//! What rays meet and pass, and what a point of a surface is like.

use super::*;
use crate::{
    accel::{Ray, RayCount},
    bsdf::Specular,
    path::{PathSample, Tracer},
    sampling::{Dimension, TexelKey, warp},
    testing::{add_back, add_quad, appendix_b, empty, lambert, mirror, rough},
};
use kiln_proto::{
    scene::{AlphaMode, Coding, Light, LightShape, MetallicRoughness, NormalMap, Opacity, Texture, TextureRef},
    texel::SurfacePoint,
    units::Rgb,
};

/// Unit squares in the planes z = 0, 1, 2, ... that face +Z, and a wall at z = -1.
fn panes(materials: Vec<Material>) -> Scene {
    let mut scene = empty();
    for (k, m) in materials.into_iter().enumerate() {
        add_quad(&mut scene, &format!("pane{k}"), [0.0, 0.0, k as f32], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], m);
    }
    add_quad(&mut scene, "wall", [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], lambert(0.5, 0.0));
    scene
}

fn blend(opacity: f32) -> Material {
    let opacity = Opacity { mode: AlphaMode::Blend, factor: opacity, texture: None };
    Material { opacity, ..lambert(0.5, 0.0) }
}

/// Half of its texels are holes.
fn checker(scene: &mut Scene, cells: u32, mode: AlphaMode) -> Material {
    let texels =
        (0..cells * cells).flat_map(|k| [255, 255, 255, if (k % cells + k / cells).is_multiple_of(2) { 255 } else { 0 }]).collect();
    let texture = Texture { name: "c".into(), width: cells, height: cells, coding: Coding::Srgb, has_alpha: true, texels };
    scene.textures.push(texture);
    let texture = Some(TextureRef { nearest: true, ..TextureRef::plain(scene.textures.len() as u32 - 1, 0) });
    Material { opacity: Opacity { mode, factor: 1.0, texture }, ..lambert(0.5, 0.0) }
}

fn bake(scene: Scene) -> BakeScene {
    BakeScene::new(scene, Simd::Auto).unwrap()
}

fn points() -> impl Iterator<Item = (f32, f32)> {
    (0..4096).map(|k| ((k % 64) as f32 / 64.0 + 0.003, (k / 64) as f32 / 64.0 + 0.004))
}

/// What passes straight down, by shadow rays: the mean over the square.
fn passed(scene: &BakeScene, blockers: Blockers) -> Rgb {
    let mut sum = Rgb::BLACK;
    for (x, y) in points() {
        sum += scene.visible(Vec3::new(x, y, 999.0), Vec3::new(x, y, -0.5), blockers, &mut RayCount::default());
    }
    sum * (1.0 / 4096.0)
}

/// The same by paths: what the wall's light would be worth to them.
fn walked(scene: &BakeScene) -> Rgb {
    let wall = scene.prim_of(scene.scene().surfaces.len() - 1, 0);
    let mut sum = Rgb::BLACK;
    for (k, (x, y)) in points().enumerate() {
        let ray = Ray::unbounded(Vec3::new(x, y, 999.0), -Vec3::Z);
        let met = scene.closest(&ray, || crate::sampling::sequence::mix(k as u64), &mut RayCount::default());
        if let Seen::Hit(hit, weight) = met
            && hit.prim >= wall
        {
            sum += weight;
        }
    }
    sum * (1.0 / 4096.0)
}

#[test]
fn a_checker_of_holes_passes_half_of_the_light() {
    for mode in [AlphaMode::Mask { cutoff: 0.5 }, AlphaMode::Blend] {
        let mut scene = empty();
        let material = checker(&mut scene, 8, mode);
        let scene = bake(Scene { textures: scene.textures, ..panes(vec![material]) });
        assert_eq!((passed(&scene, Blockers::Everything), walked(&scene)), (Rgb::splat(0.5), Rgb::splat(0.5)));
    }
}

#[test]
fn blended_layers_multiply_for_shadow_rays_and_by_chance_for_paths() {
    let scene = bake(panes(vec![blend(0.5), blend(0.25), blend(0.0), blend(0.2)]));
    let expected = 0.5 * 0.75 * 0.8;
    assert!((passed(&scene, Blockers::Everything).r - expected).abs() < 1e-6);
    assert!((walked(&scene).r - expected).abs() < 4.0 * 0.46 / 64.0, "{:?}", walked(&scene));
    // The same ray always goes the same way, another name of it perhaps another.
    let ray = Ray::unbounded(Vec3::new(0.4, 0.4, 9.0), -Vec3::Z);
    let met = |salt| scene.closest(&ray, || salt, &mut RayCount::default());
    assert_eq!(met(7), met(7));
    assert!((0..32).any(|salt| met(salt) != met(7)));
}

#[test]
fn clear_glass_tints_what_passes_and_paths_agree_with_shadow_rays() {
    let glass = |base: [f32; 3], ior: f32| rough(MetallicRoughness { ior, transmission: 0.8, ..appendix_b(base, 0.0, 0.0) });
    let scene = bake(panes(vec![glass([1.0, 0.5, 0.25], 1.0), glass([0.9; 3], 1.5)]));
    let (shadow, path) = (passed(&scene, Blockers::Everything), walked(&scene));
    // ior 1 reflects nothing straight on, ior 1.5 a twenty-fifth.
    for (c, base) in [1.0, 0.5, 0.25].into_iter().enumerate() {
        let expected = 0.8 * base * 0.8 * 0.9 * 0.96;
        assert!((shadow.to_array()[c] - expected).abs() < 1e-4, "{shadow:?}");
        assert!((path.to_array()[c] / expected - 1.0).abs() < 0.08, "{path:?}");
    }
    let frosted = bake(panes(vec![rough(MetallicRoughness { transmission: 1.0, ..appendix_b([1.0; 3], 0.0, 0.3) })]));
    assert_eq!((passed(&frosted, Blockers::Everything), walked(&frosted)), (Rgb::BLACK, Rgb::BLACK), "rough glass scatters");
}

#[test]
fn a_part_that_casts_no_shadow_blocks_paths_alone() {
    let mut scene = panes(vec![lambert(0.5, 0.0)]);
    scene.surfaces[0].parts[0].casts_shadows = false;
    let scene = bake(scene);
    assert_eq!(passed(&scene, Blockers::Casters), Rgb::WHITE);
    assert_eq!((passed(&scene, Blockers::Everything), walked(&scene)), (Rgb::BLACK, Rgb::BLACK));
}

#[test]
fn however_many_layers_there_are_all_count_for_shadow_rays_as_for_paths() {
    for n in [16, 17, 33, 200] {
        let scene = bake(panes(vec![blend(0.01); n]));
        let (shadow, path, expected) = (passed(&scene, Blockers::Everything).r, walked(&scene).r, kiln_proto::math::pow(0.99, n as f32));
        assert!((shadow / expected - 1.0).abs() < 1e-4, "{n} layers: {shadow} {expected}");
        assert!((path - expected).abs() < 4.5 * (expected * (1.0 - expected)).sqrt() / 64.0, "{n} layers: {path} {expected}");
    }
    // Of what is next to nothing, nothing is left, and the ray need not meet the rest.
    let scene = bake(panes(vec![blend(0.5); 3_000]));
    assert_eq!(passed(&scene, Blockers::Everything), Rgb::BLACK);
    // Panes that reflect nothing: a path that gets through forty of them is rare, and counts for all that do not.
    let glass = || rough(MetallicRoughness { ior: 1.0, transmission: 1.0, ..appendix_b([0.99; 3], 0.0, 0.0) });
    let scene = bake(panes((0..40).map(|_| glass()).collect()));
    assert!((passed(&scene, Blockers::Everything).r / kiln_proto::math::pow(0.99, 40.0) - 1.0).abs() < 1e-4);
}

#[test]
fn a_ray_from_behind_meets_the_back_with_its_own_material() {
    let mut scene = panes(vec![lambert(0.2, 0.0)]);
    add_back(&mut scene, 0, mirror(0.0, 0.7, 3.0));
    let scene = bake(scene);
    let meet = |z: f32| {
        let ray = Ray::unbounded(Vec3::new(0.7, 0.2, z), Vec3::new(0.0, 0.0, 0.5 - z));
        match scene.closest(&ray, || 0, &mut RayCount::default()) {
            Seen::Hit(hit, _) => hit,
            other => panic!("{other:?}"),
        }
    };
    let (front, back) = (meet(9.0), meet(-0.5));
    assert_eq!((scene.prim(front.prim).surface, scene.prim(back.prim).surface), (0, 2));
    let at = |hit: &Hit| scene.prim(hit.prim).at([hit.u, hit.v]);
    assert!(at(&front).distance(Vec3::new(0.7, 0.2, 0.0)) < 1e-6 && at(&back).distance(at(&front)) < 1e-6);
    assert_eq!(scene.emission(back.prim, [back.u, back.v]), Rgb::splat(3.0));
    assert!(matches!(scene.vertex(&back).bsdf.specular, Specular::Mirror { .. }));
    assert_eq!(scene.vertex(&back).frame.normal, -Vec3::Z);
    assert_eq!(scene.lights().emitters().list().len(), 2, "both triangles of the back shine");
    // Texture coordinates follow the point, whichever side it is seen from.
    let uv = |hit: &Hit| scene.scene().uv_at(0, &scene.place(hit.prim, [hit.u, hit.v]));
    assert!((uv(&front)[0] - 0.7).abs() < 1e-6 && (uv(&back)[0] - 0.7).abs() < 1e-6 && (uv(&back)[1] - 0.2).abs() < 1e-6);
}

/// The normal that reflection sees in the middle of a square with this texel in its normal map.
fn mapped(texel: [u8; 3], change: impl Fn(&mut Scene)) -> Vec3 {
    let mut scene = panes(vec![lambert(0.5, 0.0)]);
    let texels = texel.to_vec();
    scene.textures.push(Texture { name: "n".into(), width: 1, height: 1, coding: Coding::Linear, has_alpha: false, texels });
    scene.materials[0].normal_map = Some(NormalMap { texture: TextureRef::plain(0, 0), scale: 1.0 });
    change(&mut scene);
    let last = scene.surfaces.len() - 1;
    let surface = if scene.surfaces[last].back_of.is_some() { last } else { 0 };
    let scene = bake(scene);
    let frame = scene.prim(scene.prim_of(surface, 0)).frame;
    let point = SurfacePoint { triangle: 0, bary: [0.3, 0.3], position: Vec3::new(0.6, 0.3, 0.0) };
    let vertex = scene.vertex_at(surface, &point, frame);
    assert_eq!(vertex.frame, frame, "the hemisphere is not the map's");
    vertex.shading.normal
}

#[test]
fn a_normal_map_tilts_along_the_coordinates_of_its_texture() {
    // x = 0.6, z = 0.8 in the map's own axes.
    let texel = [204, 128, 230];
    let expected = Vec3::new(0.6, 0.0, 0.8);
    let near = |n: Vec3, e: Vec3| assert!(n.distance(e) < 0.01, "{n} {e}");
    near(mapped(texel, |_| {}), expected);
    let each_uv = |s: &mut Scene, f: fn(&mut [f32; 2])| s.surfaces[0].uv_sets[0].iter_mut().flatten().flatten().for_each(f);
    near(mapped(texel, |s| each_uv(s, |uv| uv[0] = -uv[0])), Vec3::new(-0.6, 0.0, 0.8));
    near(mapped(texel, |s| each_uv(s, |uv| uv.swap(0, 1))), Vec3::new(0.0, 0.6, 0.8));
    near(mapped([128, 204, 230], |s| each_uv(s, |uv| uv[1] *= -3.0)), Vec3::new(0.0, -0.6, 0.8));
    near(mapped(texel, |s| s.materials[0].normal_map.as_mut().unwrap().scale = 0.5), Vec3::new(0.3, 0.0, 0.8).normalize());
    // The back of a sheet has the front's bumps as dents: the same normal, reversed.
    near(mapped(texel, |s| add_back(s, 0, s.materials[0].clone())), -expected);
    // A normal that looks inside is bent up to the surface; one without a tangent stays.
    let inside = mapped([255, 128, 0], |_| {});
    assert!(inside.z > 0.0 && inside.z < 0.05 && inside.x > 0.99, "{inside}");
    assert_eq!(mapped(texel, |s| each_uv(s, |uv| *uv = [0.5, 0.5])), Vec3::Z);
}

#[test]
fn views_below_the_tilted_horizon_are_taken_along_it_and_light_from_there_leaks_nowhere() {
    let mut scene = panes(vec![lambert(0.5, 0.0)]);
    let texels = vec![255, 128, 150];
    scene.textures.push(Texture { name: "n".into(), width: 1, height: 1, coding: Coding::Linear, has_alpha: false, texels });
    scene.materials[0].normal_map = Some(NormalMap { texture: TextureRef::plain(0, 0), scale: 1.0 });
    let scene = bake(scene);
    let vertex = scene.vertex(&Hit { prim: 0, t: 1.0, u: 0.3, v: 0.3 });
    let away = Vec3::new(-0.9, 0.0, 0.436);
    assert!(vertex.shading.normal.dot(away) < 0.0);
    let wo = vertex.toward(away);
    assert!(wo.z > 0.0 && wo.z < 2e-3 && (wo.length() - 1.0).abs() < 1e-6);
    assert!(vertex.arriving(away).is_none(), "above the surface, but reflection looks elsewhere");
    assert!(vertex.arriving(Vec3::new(0.9, 0.0, -0.436)).is_none(), "below the surface, where reflection would look");
    assert!(vertex.arriving(Vec3::new(0.6, 0.0, 0.8)).is_some());
}

/// A triangle of the unit sphere about the origin with the normals of the sphere.
fn facet(material: Material) -> Scene {
    let (sin, cos) = kiln_proto::math::sin_cos_degrees(22.5);
    let at = |x: f64, y: f64| Vec3::new((sin * x) as f32, cos as f32, (sin * y) as f32);
    let corners = [at(-1.0, 0.0), at(1.0, 0.0), at(0.0, -1.0)];
    let mut scene = empty();
    add_quad(&mut scene, "s", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], material);
    scene.positions = corners.map(|c| c.to_array()).to_vec();
    scene.normals = corners.map(|c| c.normalize().to_array()).to_vec();
    scene.surfaces[0].triangles.truncate(1);
    scene.surfaces[0].uv_sets.clear();
    scene.surfaces[0].parts[0].triangles = 1;
    scene.surfaces[0].normals = vec![[0, 1, 2]];
    scene
}

#[test]
fn points_of_smooth_triangles_are_raised_onto_the_sphere_that_their_normals_mean() {
    let scene = bake(facet(lambert(0.5, 0.0)));
    let middle = scene.vertex(&Hit { prim: 0, t: 1.0, u: 0.4, v: 0.2 });
    let (flat, corner) = (scene.prim(0).at([0.4, 0.2]), scene.vertex(&Hit { prim: 0, t: 1.0, u: 0.0, v: 0.0 }));
    assert!(middle.frame.normal.distance(flat.normalize()) < 0.02, "{} {}", middle.frame.normal, flat.normalize());
    // Tangent planes lie outside the sphere, and nowhere farther than its sagitta is deep.
    assert!(middle.lifted.length() > 1.0 && middle.lifted.length() < 1.08, "{}", middle.lifted.length());
    assert!((corner.lifted.length() - 1.0).abs() < 1e-4);
    assert!(middle.sunk.length() < flat.length(), "behind the triangle nothing is raised");
}

#[test]
fn normals_that_point_to_the_back_are_replaced_as_they_are_for_texels() {
    let mut scene = panes(vec![]);
    let tilted = Vec3::new(0.17, 0.0, -0.985).normalize().to_array();
    scene.normals = vec![tilted, [0.0, 0.6, 0.8]];
    scene.surfaces[0].normals = vec![[0, 1, 1], [0, 1, 1]];
    let wanted = kiln_proto::frame::corner_normals(&scene, &scene.surfaces[0], 0).unwrap();
    assert_eq!(wanted[0].as_vec3(), Vec3::Z, "the triangle's own");
    let scene = bake(scene);
    let normals = scene.normals[scene.prim(0).smooth.unwrap() as usize];
    assert_eq!(normals, wanted.map(|n| n.as_vec3()));
}

/// A lamp is 4 cm behind a leaf whose front is raised by as much again: a light sample that starts there is neither where nor as strong as
/// what a path finds that starts behind.
#[test]
fn light_close_behind_a_coarse_smooth_leaf_is_the_same_by_light_samples_and_by_paths() {
    let leaf = rough(MetallicRoughness { transmission: 1.0, ..appendix_b([1.0; 3], 0.0, 0.9) });
    let mut scene = facet(leaf);
    add_quad(&mut scene, "lamp", [0.0, 0.884, -0.15], [0.06, 0.0, 0.0], [0.0, 0.0, -0.06], lambert(0.0, 1.0));
    scene.lights = vec![Light::new("l", LightShape::Point { position: [0.03, 0.884, -0.05] }, Rgb::WHITE)];
    let scene = bake(scene);
    let vertex = scene.vertex(&Hit { prim: 0, t: 1.0, u: 0.4, v: 0.3 });
    assert!(vertex.bsdf.is_translucent() && vertex.lifted.distance(vertex.sunk) > 0.03, "{vertex:?}");
    let (mut tracer, wo) = (Tracer::new(&scene, 2), vertex.toward(vertex.frame.normal));
    let value = |wi: Vec3| vertex.bsdf.eval(wi, wo).g * wi.z.abs();
    const COUNT: u32 = 1 << 16;
    let (mut by_light, mut by_path) = (0.0, 0.0);
    for index in 0..COUNT {
        let key = TexelKey::new(1, 0, 0);
        if let Some(light) = tracer.connect(&vertex, key.pair(Dimension::LIGHT, index)) {
            let arriving = vertex.arriving(light.direction).unwrap();
            by_light += f64::from(light.emitted.g * tracer.reaches(&light).g * value(arriving) / light.pdf) / f64::from(COUNT);
        }
        let up = warp::cosine_hemisphere(key.pair(Dimension::COSINE, index));
        let wi = up.with_z(-up.z);
        let found = tracer.incident(&vertex, vertex.frame.to_world(wi), 2, PathSample { key, index });
        by_path += f64::from(found.emitted.g * value(wi) / (up.z * std::f32::consts::FRAC_1_PI)) / f64::from(COUNT);
    }
    assert!(by_light > 0.005 && (by_light / by_path - 1.0).abs() < 0.02, "{by_light} {by_path}");
    let shine = tracer.shine(&vertex, 0).unwrap();
    let toward = Vec3::new(0.03, 0.884, -0.05) - vertex.sunk;
    assert!(
        (shine.light.g * toward.length_squared() - 1.0).abs() < 1e-4 && shine.direction.distance(toward.normalize()) < 1e-5,
        "{shine:?}"
    );
}
