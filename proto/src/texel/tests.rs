//! Coverage, gutters, footprints and seams.

use super::{cover::nearest, *};
use crate::{
    frame::FrameRule,
    plan::{ChartSource, SurfacePlan},
    scene::{Scene, Surface, Triangle},
    settings::TextureSize,
    tile::Cell,
};

/// A unit square of two triangles with the given texture coordinates of its corners.
fn square(uv: [[f32; 2]; 4], width: u32, height: u32) -> (Scene, SurfacePlan) {
    let corners = [[0u32, 1, 2], [0, 2, 3]];
    let triangles = corners.iter().map(|c| (Triangle { corners: *c, polygon: 0 }, Some(c.map(|k| uv[k as usize])))).collect();
    let surface = Surface::plain("s", 0, triangles);
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let scene = Scene { positions, surfaces: vec![surface], ..Scene::empty() };
    let plan = SurfacePlan {
        size: TextureSize { width, height },
        source: ChartSource::Author,
        uv: corners.iter().map(|c| c.map(|k| uv[k as usize])).collect(),
        charts: vec![0, 0],
        covered: 0,
        tiles: vec![],
    };
    (scene, plan)
}

const FULL: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

#[test]
fn a_full_chart_covers_every_texel_once_and_centres_lie_where_they_should() {
    let (scene, plan) = square(FULL, 40, 20);
    let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture);
    for (x, y) in [(0, 0), (39, 19), (13, 7), (32, 0)] {
        let t = raster.texel(x, y).unwrap();
        assert!(t.position.distance(Vec3::new((x as f32 + 0.5) / 40.0, (y as f32 + 0.5) / 20.0, 0.0)) < 1e-6);
        assert_eq!((t.frame.tangent, t.frame.normal), (Vec3::X, Vec3::Z));
    }
    let rows: Vec<Row> = [(0, 0), (1, 0)].iter().flat_map(|(x, y)| raster.tile(Cell { x: *x, y: *y })).collect();
    assert_eq!(rows.len(), 800);
    assert!(rows.iter().all(|r| r.is_covered()));
}

#[test]
fn gutters_are_two_texels_and_reach_into_neighbouring_tiles() {
    // The chart ends exactly at column 32, the edge of the first tile.
    let (scene, plan) = square([[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]], 64, 32);
    let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture);
    assert_eq!(raster.tile(Cell { x: 0, y: 0 }).len(), 1024);
    let next = raster.tile(Cell { x: 1, y: 0 });
    assert_eq!(next.len(), 64);
    assert!(next.iter().all(|r| !r.is_covered() && r.source == (31, r.y) && (32..34).contains(&r.x)));
    assert!(raster.texel(32, 0).is_none());
}

#[test]
fn gutter_ties_go_to_the_lowest_row_then_column() {
    let only = |set: &'static [(i64, i64)]| move |x: i64, y: i64| set.contains(&(x, y));
    assert_eq!(nearest(5, 5, &only(&[(4, 5), (5, 4), (6, 5)])), Some((5, 4)));
    assert_eq!(nearest(5, 5, &only(&[(6, 5), (4, 5)])), Some((4, 5)));
    assert_eq!(nearest(5, 5, &only(&[(3, 3), (7, 5)])), Some((7, 5)));
    assert_eq!(nearest(5, 5, &only(&[(2, 5)])), None);
}

#[test]
fn a_footprint_spans_the_triangles_of_its_chart_and_nothing_else() {
    let (scene, mut plan) = square(FULL, 4, 4);
    let share = |plan: &SurfacePlan| {
        let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], plan, FrameRule::Texture);
        let texel = raster.texel(1, 1).unwrap();
        (0..64).filter(|k| raster.footprint(&texel, (k % 8) as f32 / 8.0 + 0.06, (k / 8) as f32 / 8.0 + 0.01).is_some()).count()
    };
    assert_eq!(share(&plan), 64, "the diagonal runs through the texel, both halves count");
    plan.charts = vec![0, 1];
    assert!(share(&plan) < 64, "another chart is another surface in the texture");
}

#[test]
fn smooth_triangles_join_where_they_bend_and_frames_turn_within_a_texel() {
    // The square is folded along its diagonal; normals lean toward each other as far as its smooth surface has them equal there.
    let (mut scene, plan) = square(FULL, 4, 4);
    scene.positions[3] = [0.0, 1.0, 0.5];
    scene.normals = [[0.3, -0.3, 1.0], [0.0, 0.0, 1.0], [0.3, -0.3, 1.0], [0.5, -0.5, 1.0]]
        .map(|n| Vec3::from_array(n).normalize().to_array())
        .to_vec();
    let shares = |scene: &Scene| {
        let raster = SurfaceRaster::new(scene, &scene.surfaces[0], &plan, FrameRule::Texture);
        let texel = raster.texel(1, 1).unwrap();
        let points: Vec<SurfacePoint> =
            (0..64).filter_map(|k| raster.footprint(&texel, (k % 8) as f32 / 8.0 + 0.06, (k / 8) as f32 / 8.0 + 0.01)).collect();
        let normals: Vec<Vec3> = points.iter().map(|p| raster.frame(p).unwrap().normal).collect();
        (points.len(), normals.iter().map(|n| n.distance(texel.frame.normal)).fold(0.0, f32::max))
    };
    let (flat, _) = shares(&scene);
    assert!(flat < 64, "a fold is an edge on a flat surface");
    scene.surfaces[0].normals = scene.surfaces[0].triangles.iter().map(|t| t.corners).collect();
    let (joined, turn) = shares(&scene);
    assert!(joined == 64 && turn > 0.01 && turn < 0.2, "{joined} {turn}");
    // Another normal at one end of the fold: a hard edge.
    scene.normals.push([0.0, 0.0, 1.0]);
    scene.surfaces[0].normals[1][0] = 4;
    assert_eq!(shares(&scene).0, flat);
}

/// A strip of quads of 1 m along an arc (or a line, for no turn), laid out in two charts of 16 texels a metre: the second half of the quads
/// is turned by 90 degrees. No edge lies on a texel's.
fn strip(quads: u32, turn_degrees: f64, smooth: bool) -> (Scene, SurfacePlan) {
    let (mut scene, mut at, mut angle) = (Scene::empty(), glam::DVec2::ZERO, 0.0);
    let (mut triangles, mut uv, mut charts) = (vec![], vec![], vec![]);
    for i in 0..=quads {
        let (sin, cos) = crate::math::sin_cos_degrees(angle - turn_degrees / 2.0);
        for y in [0.0, 1.0] {
            scene.positions.push([at.x as f32, y, at.y as f32]);
            scene.normals.push([-sin as f32, 0.0, cos as f32]);
        }
        let (sin, cos) = crate::math::sin_cos_degrees(angle);
        (at, angle) = (at + glam::DVec2::new(cos, sin), angle + turn_degrees);
        if i == quads {
            break;
        }
        let second = i >= quads / 2;
        let place = |k: u32| -> [f32; 2] {
            let (along, beside) = ((i + k / 2 - if second { quads / 2 } else { 0 }) as f32 * 16.0, (k % 2) as f32 * 16.0);
            let [x, y] = if second { [40.37 + 16.0 - beside, 4.61 + along] } else { [4.37 + along, 4.61 + beside] };
            [x / 64.0, y / 64.0]
        };
        for corners in [[0, 2, 3], [0, 3, 1]] {
            triangles.push((Triangle { corners: corners.map(|k| 2 * i + k), polygon: u32::from(second) }, Some(corners.map(place))));
            uv.push(corners.map(place));
            charts.push(u32::from(second));
        }
    }
    let mut surface = Surface::plain("s", 0, triangles);
    if smooth {
        surface.normals = surface.triangles.iter().map(|t| t.corners).collect();
    } else {
        scene.normals.clear();
    }
    scene.surfaces.push(surface);
    let size = TextureSize { width: 64, height: 64 };
    (scene, SurfacePlan { size, source: ChartSource::Author, uv, charts, covered: 0, tiles: vec![] })
}

/// Light that grows along the surface and toward one side, at a place toward a world direction.
fn light(at: Vec3, toward: Vec3) -> f32 {
    (3.0 + 2.0 * at.x + 0.5 * at.y) * (2.0 + toward.x + 0.4 * toward.y)
}

/// The largest difference of both charts' light fields along the middle of their common edge, of the mean light.
fn jump(scene: &Scene, plan: &SurfacePlan, with_seams: bool) -> f32 {
    let grid = crate::grid::SphericalGrid::new(4, 8).unwrap();
    let directions = grid.directions();
    let mut raster = SurfaceRaster::new(scene, &scene.surfaces[0], plan, FrameRule::Texture);
    if with_seams {
        raster = raster.with_seams(scene, &scene.surfaces[0], plan);
    }
    let cells = (0..4).map(|k| Cell { x: k % 2, y: k / 2 });
    let mut held = std::collections::BTreeMap::new();
    for row in cells.flat_map(|cell| raster.tile(cell)) {
        let texel = raster.beyond(row).or_else(|| raster.texel(row.source.0, row.source.1)).unwrap();
        let points = (0..64).filter_map(|k| raster.footprint(&texel, (k % 8) as f32 / 8.0 + 0.0625, (k / 8) as f32 / 8.0 + 0.0625));
        let points: Vec<(Vec3, Frame)> = points.map(|p| (p.position, raster.frame_within(&texel, &p).unwrap_or(texel.frame))).collect();
        let mean = |d: &Vec3| points.iter().map(|(at, frame)| light(*at, frame.to_world(*d))).sum::<f32>() / points.len() as f32;
        held.insert(u64::from(row.y) * 64 + u64::from(row.x), directions.iter().map(mean).collect::<Vec<f32>>());
    }
    let middle = plan.charts.iter().position(|c| *c == 1).unwrap();
    let mut largest = 0.0f32;
    for k in 0..25 {
        let y = 0.25 + 0.02 * f64::from(k);
        // Corners 2 and 3 of the last quad of one chart are 0 and 1 of the first of the other: triangles (0, 2, 3) and (0, 3, 1).
        let (own, other) = ((middle as u32 - 2, [1.0 - y, y]), (middle as u32 + 1, [0.0, y]));
        let seen = |(t, bary): (u32, [f64; 2])| {
            let frame = raster.frames.at(t, bary).unwrap();
            let [a, b, c] = plan.uv[t as usize].map(|c| DVec2::new(f64::from(c[0]), f64::from(c[1])));
            let uv = (a + (b - a) * bary[0] + (c - a) * bary[1]).as_vec2().to_array();
            let view = frame.to_local((frame.normal + Vec3::new(0.3, 0.2, 0.0)).normalize());
            let sample = |texel: u64, depth: u32| Some(crate::units::Rgb::splat(held.get(&texel)?[depth as usize]));
            crate::lookup::radiance(uv, view, plan.size, grid, sample).unwrap().g
        };
        let (a, b) = (seen(own), seen(other));
        largest = largest.max((a - b).abs() / (0.5 * (a + b)));
    }
    largest
}

#[test]
fn light_runs_on_over_a_seam_between_coplanar_charts_that_are_turned_against_each_other() {
    let (scene, plan) = strip(2, 0.0, false);
    let (open, closed) = (jump(&scene, &plan, false), jump(&scene, &plan, true));
    assert!(open > 5e-3 && closed < 1e-5, "{open} {closed}");
}

#[test]
fn light_runs_on_over_a_seam_of_a_smooth_cylinder() {
    let (scene, plan) = strip(4, 10.0, true);
    let (open, closed) = (jump(&scene, &plan, false), jump(&scene, &plan, true));
    assert!(open > 5e-3 && closed < 0.1 * open, "{open} {closed}");
    // A fold of the same angle is an edge on a flat surface, whose charts end there.
    let (scene, plan) = strip(4, 10.0, false);
    assert_eq!(jump(&scene, &plan, false), jump(&scene, &plan, true));
}

#[test]
fn a_gutter_texel_beyond_a_seam_lies_where_its_chart_would_go_on() {
    let (scene, plan) = strip(2, 0.0, false);
    let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &plan, FrameRule::Texture).with_seams(&scene, &scene.surfaces[0], &plan);
    let rows = raster.tile(Cell { x: 0, y: 0 });
    let mut carried = 0;
    for row in &rows {
        let (x, y) = ((row.x as f32 + 0.5 - 4.37) / 16.0, (row.y as f32 + 0.5 - 4.61) / 16.0);
        let beyond = raster.beyond(*row);
        let inside = x > 1.0 && (0.0..=1.0).contains(&y);
        assert_eq!(beyond.is_some(), inside, "{row:?}: only the right-hand edge is a seam");
        if let Some(texel) = beyond {
            assert!(texel.position.distance(Vec3::new(x, y, 0.0)) < 1e-5, "{row:?}: {texel:?}");
            assert_eq!((texel.triangle / 2, texel.frame.tangent, texel.frame.normal), (1, Vec3::X, Vec3::Z));
            carried += 1;
        }
    }
    assert_eq!(carried, 2 * 16, "two columns of gutter");
    // Another material beyond the edge is another surface to the eye.
    let mut other = scene;
    other.surfaces[0].parts[0].triangles = 2;
    let part = crate::scene::Part { material: 1, triangles: 2, ..other.surfaces[0].parts[0].clone() };
    other.surfaces[0].parts.push(part);
    let raster = SurfaceRaster::new(&other, &other.surfaces[0], &plan, FrameRule::Texture).with_seams(&other, &other.surfaces[0], &plan);
    assert!(rows.iter().all(|row| raster.beyond(*row).is_none()));
}
