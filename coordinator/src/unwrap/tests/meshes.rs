//! Charts of curved, torn and broken meshes: whatever the mesh, what is covered is covered once, fronts stay fronts, and no look-up mixes
//! charts.

use super::*;
use glam::{DVec2, Vec3};
use kiln_proto::{lookup, texel::Row, tile::Cell};

/// Triangles over points.
#[derive(Debug, Clone)]
struct Shape {
    points: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Points in a grid of `w` x `h` cells, which close up to rings where `rings` says so.
fn sheet(w: u32, h: u32, rings: [bool; 2], place: impl Fn(f64, f64) -> Vec3) -> Shape {
    let (nw, nh) = (w + u32::from(!rings[0]), h + u32::from(!rings[1]));
    let points = (0..nh).flat_map(|j| (0..nw).map(move |i| (i, j)));
    let points = points.map(|(i, j)| place(f64::from(i) / f64::from(w), f64::from(j) / f64::from(h)).to_array()).collect();
    let at = |i: u32, j: u32| j % nh * nw + i % nw;
    let cells = (0..h).flat_map(|j| (0..w).map(move |i| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Shape { points, triangles: triangles.collect() }
}

fn circle(turns: f64) -> (f32, f32) {
    let (sin, cos) = kiln_proto::math::sin_cos_degrees(360.0 * turns);
    (sin as f32, cos as f32)
}

fn torus(w: u32, h: u32) -> Shape {
    sheet(w, h, [true, true], |u, v| {
        let ((su, cu), (sv, cv)) = (circle(u), circle(v));
        Vec3::new((1.0 + 0.4 * cv) * cu, 0.4 * sv, -(1.0 + 0.4 * cv) * su)
    })
}

/// An octahedron whose faces are cut `times` over into four, on the unit sphere.
fn sphere(times: u32) -> Shape {
    let mut points: Vec<Vec3> = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z].to_vec();
    let mut triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..times {
        let mut halves = std::collections::BTreeMap::new();
        let mut half = |a: u32, b: u32, points: &mut Vec<Vec3>| {
            *halves.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut finer = vec![];
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| half(a, b, &mut points));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Shape { points: points.iter().map(|p| p.to_array()).collect(), triangles }
}

/// A strip that winds up around an axis.
fn helix(steps: u32) -> Shape {
    sheet(steps, 2, [false, false], |u, v| {
        let (sin, cos) = circle(3.0 * u);
        Vec3::new(cos * (1.0 + v as f32), 2.0 * u as f32, sin * (1.0 + v as f32))
    })
}

/// Leaves that share one edge, as no surface can.
fn fan(leaves: u32) -> Shape {
    let mut points = vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    points.extend((0..leaves).map(|k| {
        let (sin, cos) = circle(f64::from(k) / f64::from(leaves));
        [cos, 0.5, sin]
    }));
    Shape { points, triangles: (0..leaves).map(|k| [0, 1, 2 + k]).collect() }
}

/// Triangles of any three of some points.
fn soup() -> impl Strategy<Value = Shape> {
    (4usize..20).prop_flat_map(|n| {
        let points = prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), n);
        (points, prop::collection::vec(prop::array::uniform3(0..n as u32), 1..60)).prop_map(|(points, mut triangles)| {
            triangles.retain(|[a, b, c]| a != b && b != c && c != a);
            triangles.push([0, 1, 2]);
            Shape { points, triangles }
        })
    })
}

fn shapes() -> impl Strategy<Value = Shape> {
    let doubled = (3u32..9).prop_map(|n| {
        let mut shape = torus(n, n);
        shape.triangles.extend(shape.triangles.clone());
        shape
    });
    prop_oneof![
        (0u32..4).prop_map(sphere),
        (3u32..24, 3u32..12).prop_map(|(w, h)| torus(w, h)),
        (4u32..90).prop_map(helix),
        (2u32..12).prop_map(fan),
        (1u32..60).prop_map(|n| sheet(n, 1, [false, false], |u, v| Vec3::new(9.0 * u as f32, 1e-3 * v as f32, (u * u) as f32))),
        doubled,
        soup(),
    ]
}

/// The scene of a shape, smooth by the sums of its triangles' normals or flat.
fn scene_of(shape: &Shape, smooth: bool) -> Scene {
    let triangles = shape.triangles.iter().enumerate();
    let triangles = triangles.map(|(k, corners)| (Triangle { corners: *corners, polygon: k as u32 }, None)).collect();
    let mut scene = scene(shape.points.clone(), triangles);
    if smooth {
        let mut normals = vec![Vec3::ZERO; shape.points.len()];
        for t in &scene.surfaces[0].triangles {
            let [a, b, c] = scene.corners(t);
            t.corners.iter().for_each(|k| normals[*k as usize] += (b - a).cross(c - a).as_vec3());
        }
        scene.normals = normals.iter().map(|n| n.normalize_or(Vec3::Y).to_array()).collect();
        scene.surfaces[0].normals = scene.surfaces[0].triangles.iter().map(|t| t.corners).collect();
    }
    scene
}

/// Corners of a triangle in texels.
fn texels(plan: &SurfacePlan, triangle: usize) -> [DVec2; 3] {
    plan.uv[triangle].map(|[u, v]| DVec2::new(f64::from(u) * f64::from(plan.size.width), f64::from(v) * f64::from(plan.size.height)))
}

/// No triangle shows its back in the texture, and no texel lies in two.
fn check_cover(plan: &SurfacePlan) -> Result<(), TestCaseError> {
    let mut taken = vec![None; plan.size.texels() as usize];
    for t in 0..plan.uv.len() {
        let corners = texels(plan, t);
        let area = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]) / 2.0;
        prop_assert!(area > -0.01, "triangle {t} is turned over: {area} texels");
        let mut twice = None;
        raster::inside(corners, plan.size.width, plan.size.height, |x, y| {
            let other = taken[(y * plan.size.width + x) as usize].replace(t);
            twice = twice.or(other.map(|o: usize| (x, y, o)));
            true
        });
        prop_assert!(twice.is_none(), "triangles {t} and {twice:?}");
    }
    Ok(())
}

/// Every texel that a look-up inside a chart gets light from holds that chart's light: with all others poisoned, none is tasted.
fn check_poison(scene: &Scene, plan: &SurfacePlan) -> Result<(), TestCaseError> {
    let raster = SurfaceRaster::new(scene, &scene.surfaces[0], plan, FrameRule::Texture);
    let cells = (0..raster.rows()).flat_map(|y| (0..raster.columns()).map(move |x| Cell { x: x as u16, y: y as u16 }));
    let mut chart = vec![None; plan.size.texels() as usize];
    for Row { x, y, source } in cells.flat_map(|cell| raster.tile(cell)) {
        chart[(y * plan.size.width + x) as usize] = raster.texel(source.0, source.1).map(|t| plan.charts[t.triangle as usize]);
    }
    for t in 0..plan.uv.len() {
        for weights in
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.4, 0.3, 0.3]]
        {
            let uv = std::array::from_fn(|k| (0..3).map(|c| plan.uv[t][c][k] * weights[c]).sum());
            for (texel, weight) in lookup::footprint(uv, plan.size) {
                let found = chart[texel as usize];
                let own = weight <= 1e-3 || found.is_none_or(|found| found == plan.charts[t]);
                prop_assert!(own, "triangle {t} of chart {} tastes chart {found:?}", plan.charts[t]);
            }
        }
    }
    Ok(())
}

/// One layout, whatever the number of threads.
fn laid_out_by(threads: usize, scene: &Scene, json: &str) -> Result<Layout, Problem> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| lay_out(scene, &settings(json)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_mesh_is_laid_out_without_overlap_and_without_bleeding(shape in shapes(), smooth in any::<bool>(), density in 1u32..40, fixed in any::<bool>()) {
        let scene = scene_of(&shape, smooth);
        let json = if fixed { r#"{"texture_sizes": {"s": "300x200"}}"#.to_owned() } else { format!(r#"{{"texels_per_metre": {density}}}"#) };
        let layout = laid_out_by(1, &scene, &json).unwrap();
        let plan = &layout.surfaces[0];
        check_cover(plan)?;
        check(&scene, plan)?;
        check_poison(&scene, plan)?;
        prop_assert_eq!(laid_out_by(3, &scene, &json).unwrap(), layout);
    }
}

/// A finer mesh of the same body has no more charts, texels of the wanted density, and most of its texture in use.
#[test]
fn curved_meshes_are_flattened_into_few_charts_of_the_wanted_density() {
    for (shape, smooth, most) in [(torus(48, 24), true, 20), (torus(48, 24), false, 20), (sphere(4), true, 16)] {
        let scene = scene_of(&shape, smooth);
        let (plan, warnings) = laid_out(&scene, r#"{"texels_per_metre": 60}"#);
        let charts = plan.charts.iter().max().unwrap() + 1;
        assert!(plan.source == ChartSource::Atlas && charts <= most && warnings.is_empty(), "{charts} {warnings:?}");
        let area = |t: &Triangle| {
            let [a, b, c] = scene.corners(t);
            (b - a).cross(c - a).length() / 2.0
        };
        let wanted = scene.surfaces[0].triangles.iter().map(area).sum::<f64>() * 3_600.0;
        let got: f64 = (0..plan.uv.len()).map(|t| texels(&plan, t)).map(|[a, b, c]| (b - a).perp_dot(c - a) / 2.0).sum();
        assert!((got / wanted - 1.0).abs() < 0.05, "{got} texels of {wanted}");
        assert!(got > 0.4 * plan.size.texels() as f64, "{got} of {}", plan.size);
        check(&scene, &plan).unwrap();
    }
}

#[test]
fn the_polygons_of_large_flat_facets_stay_apart() {
    let (plan, _) = laid_out(&scene_of(&sphere(1), false), r#"{"texels_per_metre": 40}"#);
    assert_eq!((plan.source, plan.charts.iter().max()), (ChartSource::Polygons, Some(&31)));
}
