mod meshes;

use super::*;
use kiln_proto::{
    frame::FrameRule,
    scene::{Material, Triangle},
    settings::SettingsPatch,
    texel::{GUTTER, SurfaceRaster},
    units::Rgb,
};
use proptest::prelude::*;

/// A scene of one surface `s`.
fn scene(positions: Vec<[f32; 3]>, triangles: Vec<(Triangle, Option<[[f32; 2]; 3]>)>) -> Scene {
    let grey = Material::matt("grey", Rgb::splat(0.5));
    Scene { positions, surfaces: vec![Surface::plain("s", 0, triangles)], materials: vec![grey], ..Scene::empty() }
}

/// A 4 m x 2 m rectangle of two triangles; its corners have these texture coordinates.
fn rectangle(uv: Option<[[f32; 2]; 4]>) -> Scene {
    let triangle = |c: [usize; 3]| (Triangle { corners: c.map(|k| k as u32), polygon: 0 }, uv.map(|uv| c.map(|k| uv[k])));
    scene(vec![[0.0; 3], [4.0, 0.0, 0.0], [4.0, 2.0, 0.0], [0.0, 2.0, 0.0]], vec![triangle([0, 1, 2]), triangle([0, 2, 3])])
}

const FULL: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// A grid of w x h quads of 1/4 m, two triangles each; `place` says where its points lie.
fn grid(w: u32, h: u32, place: impl Fn(f32, f32) -> [f32; 3]) -> Scene {
    let points = (0..=h).flat_map(|j| (0..=w).map(move |i| (i, j)));
    let positions = points.map(|(i, j)| place(i as f32 / 4.0, j as f32 / 4.0)).collect();
    let quad = |i: u32, j: u32| {
        let at = |x: u32, y: u32| (j + y) * (w + 1) + i + x;
        [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]].map(|corners| (Triangle { corners, polygon: j * w + i }, None))
    };
    scene(positions, (0..h).flat_map(|j| (0..w).flat_map(move |i| quad(i, j))).collect())
}

fn settings(json: &str) -> BakeSettings {
    serde_json::from_str::<SettingsPatch>(json).unwrap().resolve().unwrap()
}

fn laid_out(scene: &Scene, json: &str) -> (SurfacePlan, Vec<String>) {
    let layout = lay_out(scene, &settings(json)).unwrap();
    (layout.surfaces[0].clone(), layout.warnings.iter().map(ToString::to_string).collect())
}

#[test]
fn the_authors_coordinates_decide_size_and_charts() {
    let size = |uv, json: &str| {
        let (plan, warnings) = laid_out(&rectangle(Some(uv)), json);
        assert_eq!((plan.source, warnings.len(), plan.charts), (ChartSource::Author, 0, vec![0, 0]));
        plan.size.to_string()
    };
    assert_eq!(size(FULL, "{}"), "80x40");
    assert_eq!(size(FULL, r#"{"texels_per_metre": 5, "texel_scale": 2}"#), "40x20");
    assert_eq!(size(FULL, r#"{"texture_sizes": {"s": "30x10"}, "texel_scale": 1.5}"#), "45x15");
    let half = FULL.map(|[u, v]| [u, v / 2.0]);
    assert_eq!(size(half, "{}"), "80x80", "a chart on half of the texture needs twice the rows");
    let beyond = FULL.map(|c| c.map(|v| v * 1.0002 - 0.0001));
    assert_eq!(laid_out(&rectangle(Some(beyond)), "{}").0.uv[0][1][0], 1.0);
}

#[test]
fn unusable_coordinates_are_replaced_with_the_reason() {
    let why = |scene: &Scene, reason: &str| {
        let (plan, warnings) = laid_out(scene, "{}");
        assert_eq!((plan.source, plan.size.to_string()), (ChartSource::Polygons, "80x40".to_owned()), "{warnings:?}");
        assert!(warnings.len() == 1 && warnings[0].contains("surface `s`") && warnings[0].contains(reason), "{warnings:?}");
    };
    why(&rectangle(Some(FULL.map(|c| c.map(|v| v * 2.0)))), "leave the unit square (one is 2, 0)");
    why(&rectangle(Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 0.1]])), "turned over");
    let mut twice = rectangle(Some(FULL));
    twice.surfaces[0].uv_sets[0][1] = Some([[0.1, 0.0], [1.0, 0.2], [1.0, 0.9]]);
    why(&twice, "overlap (at texel");
    let whole = |k: u32| (Triangle { corners: [3 * k, 3 * k + 1, 3 * k + 2], polygon: k }, Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]));
    let places = (0..9u8).map(f32::from).flat_map(|z| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]).collect();
    let (_, warnings) = laid_out(&scene(places, (0..9).map(whole).collect()), "{}");
    assert!(warnings[0].contains("overlap (together they cover 4.5 times the texture)"), "{warnings:?}");
    why(&rectangle(Some([[0.5; 2]; 4])), "no area in the texture");
    let mut partial = rectangle(Some(FULL));
    partial.surfaces[0].uv_sets[0][1] = None;
    why(&partial, "1 of 2 triangles have none");
    let (plan, warnings) = laid_out(&rectangle(None), "{}");
    assert_eq!((plan.source, plan.size.to_string(), warnings.len()), (ChartSource::Polygons, "80x40".to_owned(), 0));
}

/// Two triangles whose texture coordinates are `gap` apart along u.
fn torn(gap: f32) -> Scene {
    let mut torn = rectangle(Some(FULL));
    torn.surfaces[0].uv_sets[0][0] = Some([[0.4 + gap, 0.0], [1.0, 0.0], [1.0, 0.6]]);
    torn.surfaces[0].uv_sets[0][1] = Some([[0.0, 0.0], [0.4, 1.0], [0.0, 1.0]]);
    torn
}

#[test]
fn charts_of_the_author_follow_shared_edges() {
    let (plan, warnings) = laid_out(&torn(0.2), "{}");
    assert_eq!((plan.source, plan.charts, warnings.len()), (ChartSource::Author, vec![0, 1], 0), "{warnings:?}");
}

#[test]
fn charts_without_room_for_gutters_and_mirrored_ones_are_packed_anew_in_their_shapes() {
    let sizes = |plan: &SurfacePlan| -> Vec<f64> {
        let texels = |uv: &[[f32; 2]; 3]| {
            uv.map(|[u, v]| glam::DVec2::new(f64::from(u) * f64::from(plan.size.width), f64::from(v) * f64::from(plan.size.height)))
        };
        plan.uv.iter().map(texels).map(|[a, b, c]| (b - a).perp_dot(c - a) / 2.0).collect()
    };
    for (scene, reason) in [
        (torn(-0.39), "less than two gutters (4 texels) apart"),
        (rectangle(Some(FULL.map(|[u, v]| [1.0 - u, v]))), "1 of its 1 charts are mirrored"),
    ] {
        let (plan, warnings) = laid_out(&scene, "{}");
        assert_eq!(plan.source, ChartSource::Author);
        assert!(warnings.len() == 1 && warnings[0].contains("packed anew") && warnings[0].contains(reason), "{warnings:?}");
        check(&scene, &plan).unwrap();
        // 4 m² at 20 texels per metre: the density wanted, whatever the author's proportions were.
        assert!(sizes(&plan).iter().all(|texels| (texels / 1600.0 - 1.0).abs() < 0.1), "{:?}", sizes(&plan));
    }
}

#[test]
fn the_set_that_is_meant_for_light_comes_first() {
    let mut scene = rectangle(Some(FULL));
    let half = |k: f32| FULL.map(|[u, v]| [u * k, v]);
    let with = |scene: &mut Scene, uv: [[f32; 2]; 4]| {
        scene.surfaces[0].uv_sets.truncate(1);
        scene.surfaces[0].uv_sets.push([[0, 1, 2], [0, 2, 3]].iter().map(|c| Some(c.map(|k| uv[k]))).collect());
        laid_out(scene, "{}")
    };
    let (plan, warnings) = with(&mut scene, half(0.5));
    assert_eq!((plan.source, plan.uv[0][1], warnings.len()), (ChartSource::Author, [0.5, 0.0], 0));
    let (plan, warnings) = with(&mut scene, half(2.0));
    assert_eq!((plan.source, plan.uv[0][1], warnings.len()), (ChartSource::Author, [1.0, 0.0], 1));
    assert!(warnings[0].contains("set 1 are not used, because they leave the unit square"), "{warnings:?}");
}

#[test]
fn limits_are_kept_and_named() {
    let error = |scene: &Scene, json: &str| lay_out(scene, &settings(json)).unwrap_err().to_string();
    assert!(error(&rectangle(None), r#"{"texture_sizes": {"wall": "9x9"}}"#).contains("`wall`, which the scene does not have; it has s"));
    assert!(error(&rectangle(None), r#"{"texture_sizes": {"s": "8000x8"}, "texel_scale": 2}"#).contains("16000x16"));
    let (plan, warnings) = laid_out(&rectangle(Some(FULL)), r#"{"texels_per_metre": 4096}"#);
    assert_eq!(plan.size.to_string(), "8192x4096");
    assert!(warnings[0].contains("16384x8192"));
    let (plan, warnings) = laid_out(&rectangle(None), r#"{"texels_per_metre": 4096}"#);
    assert!(plan.size.width == 8192 && warnings[0].contains("do not fit"), "{warnings:?}");
    let mut many = rectangle(Some(FULL));
    // A chart that fills a small part of its texture wants a large texture.
    for uv in many.surfaces[0].uv_sets[0].iter_mut().flatten() {
        *uv = uv.map(|[u, v]| [u * 0.01, v * 0.005]);
    }
    many.surfaces = (0..15).map(|k| Surface { name: format!("s{k}"), ..many.surfaces[0].clone() }).collect();
    assert!(error(&many, r#"{"texels_per_metre": 10000}"#).contains("texel_scale"));
}

#[test]
fn an_explicit_size_holds_all_polygons_or_is_refused() {
    let positions = (0..20).flat_map(|k| [[k as f32, 0.0, 0.0], [k as f32 + 0.9, 0.0, 0.0], [k as f32, 0.9, 0.0]]).collect();
    let triangles = (0..20u32).map(|k| (Triangle { corners: [3 * k, 3 * k + 1, 3 * k + 2], polygon: k }, None)).collect();
    let scene = scene(positions, triangles);
    let (plan, _) = laid_out(&scene, r#"{"texture_sizes": {"s": "60x50"}}"#);
    assert_eq!(plan.size.to_string(), "60x50");
    check(&scene, &plan).unwrap();
    let refused = lay_out(&scene, &settings(r#"{"texture_sizes": {"s": "12x12"}}"#)).unwrap_err();
    assert!(refused.message.contains("20 charts") && refused.message.contains("12x12"), "{refused}");
}

#[test]
fn a_polygon_is_cut_at_a_fold_that_charts_may_not_bend_over() {
    let mut folded = rectangle(None);
    // Folded by more than a right angle.
    folded.positions[3] = [3.0, 0.5, 3.0];
    let (plan, _) = laid_out(&folded, "{}");
    assert_eq!((plan.source, plan.charts), (ChartSource::Polygons, vec![0, 1]));
}

#[test]
fn a_grid_of_coplanar_quads_is_one_chart() {
    let mut scene = grid(40, 25, |x, y| [x, y, 0.25 * x]);
    let (plan, warnings) = laid_out(&scene, "{}");
    assert_eq!((plan.source, plan.charts, warnings.len()), (ChartSource::Polygons, vec![0; 2_000], 0));
    // A wall of the same vertices twice has an overlap, which a cut must end.
    let again = scene.surfaces[0].triangles.clone();
    scene.surfaces[0].triangles.extend(again);
    scene.surfaces[0].parts[0].triangles *= 2;
    let (plan, _) = laid_out(&scene, "{}");
    check(&scene, &plan).unwrap();
}

#[test]
fn the_back_has_the_layout_of_its_front_mirrored() {
    let mut scene = rectangle(Some(FULL.map(|[u, v]| [u * 0.75, v])));
    let front = scene.surfaces[0].clone();
    let turned = |t: &Triangle| Triangle { corners: [t.corners[0], t.corners[2], t.corners[1]], polygon: t.polygon };
    let back = Surface {
        name: "s~back".into(),
        file_stem: "s~back".into(),
        back_of: Some(1),
        triangles: front.triangles.iter().map(turned).collect(),
        uv_sets: vec![],
        ..front.clone()
    };
    // The back stands before its front.
    scene.surfaces = vec![back, front];
    scene.validate().unwrap();
    let layout = lay_out(&scene, &settings(r#"{"texture_sizes": {"s": "40x20"}}"#)).unwrap();
    let [back, front] = &layout.surfaces[..] else { panic!() };
    assert_eq!((front.source, back.source, back.size, layout.warnings.len()), (ChartSource::Author, ChartSource::Front, front.size, 0));
    assert_eq!(back.uv[0], [[1.0, 0.0], [0.25, 1.0], [0.25, 0.0]]);
    let raster = |k: usize| SurfaceRaster::new(&scene, &scene.surfaces[k], &layout.surfaces[k], FrameRule::Texture);
    let (b, f) = (raster(0), raster(1));
    for (x, y) in (0..40).flat_map(|x| (0..20).map(move |y| (x, y))) {
        assert_eq!(f.texel(x, y).map(|t| t.position), b.texel(39 - x, y).map(|t| t.position), "{x}, {y}");
    }
    let named = lay_out(&scene, &settings(r#"{"texture_sizes": {"s": "40x20", "s~back": "8x8"}}"#)).unwrap();
    assert_eq!((named.surfaces[0].source, named.surfaces[0].size.to_string()), (ChartSource::Polygons, "8x8".to_owned()));
}

#[test]
fn parts_whose_coordinates_overlap_are_laid_out_one_by_one() {
    let mut scene = rectangle(Some(FULL));
    scene.positions.extend([[0.0, 0.0, 5.0], [2.0, 0.0, 5.0], [2.0, 2.0, 5.0], [0.0, 2.0, 5.0]]);
    let surface = &mut scene.surfaces[0];
    let more: Vec<Triangle> = surface.triangles.iter().map(|t| Triangle { corners: t.corners.map(|c| c + 4), polygon: 1 }).collect();
    surface.triangles.extend(more);
    let uv = surface.uv_sets[0].clone();
    surface.uv_sets[0].extend(uv);
    surface.parts.push(kiln_proto::scene::Part::plain("second", 0, 2));
    scene.validate().unwrap();
    let (plan, warnings) = laid_out(&scene, "{}");
    assert_eq!((plan.source, &plan.charts[..]), (ChartSource::Parts, &[0, 0, 1, 1][..]));
    assert!(warnings[0].contains("one by one into 2 charts, because they overlap"), "{warnings:?}");
    check(&scene, &plan).unwrap();
    let covered = |k: usize| {
        let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture);
        let texels = (0..plan.size.width).flat_map(|x| (0..plan.size.height).map(move |y| (x, y)));
        texels.filter_map(|(x, y)| raster.texel(x, y)).filter(|t| plan.charts[t.triangle as usize] == k as u32).count()
    };
    assert_eq!((covered(0), covered(1)), (80 * 40, 40 * 40), "one density for all parts");
}

/// What a layout promises: every chart has a texel, every covered texel is in one chart only, charts are two gutters apart, and every
/// gutter texel borrows from within its reach.
fn check(scene: &Scene, plan: &SurfacePlan) -> Result<(), TestCaseError> {
    let (w, h) = (plan.size.width, plan.size.height);
    let raster = SurfaceRaster::new(scene, &scene.surfaces[0], plan, FrameRule::Texture);
    let chart_at: Vec<Option<u32>> = (0..w * h).map(|i| raster.texel(i % w, i / w).map(|t| plan.charts[t.triangle as usize])).collect();
    let charts = plan.charts.iter().max().copied().unwrap_or(0) + 1;
    for chart in 0..charts {
        prop_assert!(chart_at.contains(&Some(chart)), "chart {chart} of {charts} covers no texel of {}", plan.size);
    }
    for (i, chart) in chart_at.iter().enumerate().filter_map(|(i, c)| c.map(|c| (i as i64, c))) {
        let (x, y) = (i % i64::from(w), i / i64::from(w));
        for dy in -2 * GUTTER..=2 * GUTTER {
            for dx in -2 * GUTTER..=2 * GUTTER {
                let (nx, ny) = (x + dx, y + dy);
                if (0..i64::from(w)).contains(&nx) && (0..i64::from(h)).contains(&ny) {
                    let other = chart_at[(ny * i64::from(w) + nx) as usize];
                    prop_assert!(other.is_none_or(|o| o == chart), "charts {chart} and {other:?} meet at {nx}, {ny}");
                }
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Random convex polygons in random planes, thin ones among them.
    #[test]
    fn packed_polygons_keep_their_promises(
        polygons in prop::collection::vec((prop::collection::vec(0.02f64..1.0, 3..8), prop::array::uniform3(-1.0f32..1.0), 0.01f32..1.0), 1..24),
        explicit in any::<bool>(),
    ) {
        let (mut positions, mut triangles) = (vec![], vec![]);
        for (id, (steps, tilt, thin)) in polygons.iter().enumerate() {
            let (whole, first) = (steps.iter().sum::<f64>(), positions.len() as u32);
            let mut turn = 0.0;
            for step in steps {
                let (sin, cos) = kiln_proto::math::sin_cos_degrees(turn * 360.0 / whole);
                let (x, y) = (cos as f32, sin as f32 * thin);
                positions.push([x + tilt[0] * y, y + 3.0 * id as f32, tilt[1] * x + tilt[2] * y]);
                turn += step;
            }
            let n = steps.len() as u32;
            triangles.extend((1..n - 1).map(|k| (Triangle { corners: [first, first + k, first + k + 1], polygon: id as u32 }, None)));
        }
        let scene = scene(positions, triangles);
        let json = if explicit { r#"{"texture_sizes": {"s": "128x96"}}"# } else { r#"{"texels_per_metre": 12}"# };
        let layout = lay_out(&scene, &settings(json)).unwrap();
        check(&scene, &layout.surfaces[0])?;
        prop_assert_eq!(lay_out(&scene, &settings(json)).unwrap(), layout);
    }
}
