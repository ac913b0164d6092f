//! Where surfaces end, meet and go into each other: texels inside walls, seams, edges of charts, lights and shadows through texels.

use super::*;
use crate::{
    simd::Simd,
    testing::{add_quad, empty, lambert, plan, settings},
};
use kiln_proto::scene::{Light, LightShape, Scene};

/// Captures whole surfaces: column, row, and the green radiance toward the first direction.
fn bake(scene: Scene, json: &str, surface: usize) -> Vec<(Row, f32)> {
    let plan = plan(&scene, &settings(json));
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(plan)).unwrap();
    let tile = capture.bake_tile(capture.plan().first_tile(surface)).unwrap();
    let values = capture.directions.len() * 3;
    tile.rows.iter().zip(tile.radiance.chunks_exact(values)).map(|(row, light)| (*row, light[1])).collect()
}

fn at(texels: &[(Row, f32)], x: u32, y: u32) -> f32 {
    texels.iter().find(|(row, _)| (row.x, row.y) == (x, y)).unwrap().1
}

/// A floor of 12 m x 12 m, one texel a metre, under a wide ceiling of light, and a solid block that runs across it from `from` to `to`
/// along x and reaches from below the floor to 1 m above.
fn block(from: f32, to: f32) -> Scene {
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 12.0], [12.0, 0.0, 0.0], [0.0, 0.0, -12.0], lambert(0.5, 0.0));
    add_quad(&mut scene, "ceiling", [-40.0, 6.0, -40.0], [92.0, 0.0, 0.0], [0.0, 0.0, 92.0], lambert(0.0, 1.0));
    let (low, high, near, far, wide) = (-0.5, 1.0, -3.0, 15.0, to - from);
    let (x, y, z) = ([wide, 0.0, 0.0], [0.0, high - low, 0.0], [0.0, 0.0, far - near]);
    for (name, corner, u, v) in [
        ("left", [from, low, near], z, y),
        ("right", [to, low, near], y, z),
        ("top", [from, high, near], z, x),
        ("bottom", [from, low, near], x, z),
        ("front", [from, low, far], x, y),
        ("back", [from, low, near], y, x),
    ] {
        add_quad(&mut scene, name, corner, u, v, lambert(0.5, 0.0));
    }
    scene
}

const FLOOR: &str = r#""samples":256,"max_depth":2,"directions":"2x2","texture_sizes":{"floor":"12x12"}"#;

#[test]
fn a_texel_under_the_foot_of_a_wall_is_moved_out_of_it() {
    let (area, point) = (format!("{{{FLOOR}}}"), format!("{{{FLOOR},\"footprint\":\"point\"}}"));
    let (moved, inside) = (bake(block(3.2, 3.9), &area, 0), bake(block(3.2, 3.9), &point, 0));
    for y in 2..10 {
        assert_eq!(at(&inside, 3, y), 0.0, "the centre itself is inside");
        // Right before the wall half of the light is left, farther away more.
        let (foot, open) = (at(&moved, 3, y), at(&moved, 7, y));
        assert!(foot > 0.45 * open && foot < open, "{foot} {open}");
        assert!(at(&moved, 2, y) > 0.45 * open);
    }
}

#[test]
fn hidden_texels_are_moved_out_or_show_a_visible_neighbour_and_deep_ones_stay_black() {
    let (area, point) = (format!("{{{FLOOR}}}"), format!("{{{FLOOR},\"footprint\":\"point\"}}"));
    let (filled, plain) = (bake(block(1.4, 10.6), &area, 0), bake(block(1.4, 10.6), &point, 0));
    for y in 0..12 {
        // Columns 1 and 10 have their centres within reach of the block's sides and are moved out.
        assert!(at(&filled, 1, y) > 0.0 && at(&filled, 10, y) > 0.0);
        // The next ones are hidden and see a way out: all of their points lie right before the block.
        for (deeper, edge) in [(2, 1), (9, 10)] {
            let (deeper, edge) = (at(&filled, deeper, y), at(&filled, edge, y));
            assert!(deeper > 0.6 * edge && deeper <= edge, "{deeper} {edge}");
        }
        assert_eq!([at(&filled, 3, y), at(&filled, 8, y)], [at(&filled, 1, y), at(&filled, 10, y)]);
        assert_eq!([4, 5, 6, 7].map(|x| at(&filled, x, y)), [0.0; 4], "two texels are filled, not more");
        assert!((1..11).all(|x| at(&plain, x, y) == 0.0), "a bake of points is one of the points as they are");
    }
}

#[test]
fn rays_that_look_for_a_way_out_are_counted() {
    let scene = Arc::new(BakeScene::new(block(3.2, 3.9), Simd::Auto).unwrap());
    let rays = |json: &str| {
        let plan = Arc::new(plan(scene.scene(), &settings(json)));
        Capture::new(scene.clone(), plan).unwrap().bake_tile(TileIndex(0)).unwrap().rays
    };
    let (depth_one, two) = (rays(r#"{"max_depth":1,"texture_sizes":{"floor":"12x12"}}"#), rays(&format!("{{{FLOOR}}}")));
    assert_eq!(depth_one, 0, "light that a surface emits needs no ray");
    // Per texel 8 rays around it and at least 4 at what it sees.
    assert!(two >= 144 * (256 + 12), "{two}");
}

/// A floor of 8 m x 4 m in two charts of 4 m x 4 m with four empty columns between them, two texels a metre, under a light over its left
/// half.
fn two_charts() -> Scene {
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], [0.0, 0.0, -4.0], lambert(0.5, 0.0));
    add_quad(&mut scene, "right", [4.0, 0.0, 4.0], [4.0, 0.0, 0.0], [0.0, 0.0, -4.0], lambert(0.5, 0.0));
    let right = scene.surfaces.pop().unwrap();
    let floor = &mut scene.surfaces[0];
    let columns = |c: &mut [f32; 2], first: f32| *c = [(first + 8.0 * c[0]) / 32.0, 8.0 * c[1] / 8.0 / 4.0];
    floor.uv_sets[0].iter_mut().flatten().flatten().for_each(|c| columns(c, 2.0));
    let mut moved = right.uv_sets[0].clone();
    moved.iter_mut().flatten().flatten().for_each(|c| columns(c, 14.0));
    floor.uv_sets[0].extend(moved);
    floor.triangles.extend(right.triangles.into_iter().map(|t| kiln_proto::scene::Triangle { polygon: 1, ..t }));
    floor.parts[0].triangles = 4;
    add_quad(&mut scene, "light", [2.0, 0.7, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], lambert(0.0, 20.0));
    scene
}

#[test]
fn gutters_at_a_seam_hold_the_light_of_the_other_side() {
    let json = |more: &str| format!(r#"{{"samples":8192,"max_depth":2,"directions":"2x2","texture_sizes":{{"floor":"32x32"}}{more}}}"#);
    let (area, point) = (bake(two_charts(), &json(""), 0), bake(two_charts(), &json(r#","footprint":"point""#), 0));
    let column = |texels: &[(Row, f32)], x: u32| (1..7).map(|y| at(texels, x, y)).sum::<f32>();
    // The left chart ends at column 10 and goes on where the right one has columns 14 and 15; and the other way round.
    for (gutter, real, border) in [(10, 14, 9), (11, 15, 9), (13, 9, 14), (12, 8, 14)] {
        let (own, there, copy) = (column(&area, gutter), column(&area, real), column(&area, border));
        assert!((own / there - 1.0).abs() < 0.03, "column {gutter}: {own} {there}");
        assert!((copy / there - 1.0).abs() > 0.1, "column {gutter}: the copy would be {copy} for {there}");
        assert_eq!(column(&point, gutter), column(&point, border), "a bake of points copies");
    }
    // The outer edges of both charts are borders of the floor.
    assert_eq!([1, 22].map(|x| column(&area, x)), [2, 21].map(|x| column(&area, x)));
}

#[test]
fn a_texel_that_an_edge_of_light_crosses_has_the_mean_over_its_area() {
    // The sun from straight above, and a board over everything left of 3.3 m: 0.7 of column 3 is lit.
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 8.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], lambert(0.5, 0.0));
    add_quad(&mut scene, "board", [-1.0, 2.0, -1.0], [4.3, 0.0, 0.0], [0.0, 0.0, 10.0], lambert(0.5, 0.0));
    scene.lights.push(Light::new("sun", LightShape::Directional { direction: [0.0, -1.0, 0.0] }, Rgb::WHITE));
    let json = r#"{"samples":1024,"max_depth":2,"directions":"2x2"}"#;
    let floor = bake(scene, json, 0);
    let lit = 0.5 / std::f32::consts::PI;
    for y in 0..8 {
        assert_eq!(at(&floor, 2, y), 0.0);
        assert!((at(&floor, 3, y) / lit - 0.7).abs() < 0.01, "{}", at(&floor, 3, y) / lit);
        assert!((at(&floor, 4, y) / lit - 1.0).abs() < 1e-5);
    }
}

#[test]
fn a_texel_that_the_edge_of_its_chart_crosses_has_the_mean_of_what_is_covered() {
    // A floor that shines brighter along x, as its texture says; the chart ends at 0.6 of the texel's column 4.
    let mut scene = empty();
    add_quad(&mut scene, "floor", [0.0, 0.0, 4.6], [4.6, 0.0, 0.0], [0.0, 0.0, -4.6], lambert(0.0, 1.0));
    let texels = (0..47u32).flat_map(|k| [(5 * k) as u8; 3]).collect();
    let (name, coding) = ("ramp".into(), kiln_proto::scene::Coding::Linear);
    scene.textures.push(kiln_proto::scene::Texture { name, width: 47, height: 1, coding, has_alpha: false, texels });
    scene.materials[0].emission_texture = Some(kiln_proto::scene::TextureRef::plain(0, 0));
    let mut layout = plan(&scene, &settings(r#"{"samples":4096,"max_depth":1,"directions":"2x2"}"#));
    layout.surfaces[0].uv.iter_mut().flatten().for_each(|c| *c = c.map(|v| v * 4.6 / 8.0));
    // The texture is not repeated where the floor ends.
    scene.surfaces[0].uv_sets[0].iter_mut().flatten().flatten().for_each(|c| c[0] = 0.05 + 0.9 * c[0]);
    let capture = Capture::new(Arc::new(BakeScene::new(scene, Simd::Auto).unwrap()), Arc::new(layout)).unwrap();
    let tile = capture.bake_tile(TileIndex(0)).unwrap();
    let light = |x: u32| tile.radiance[tile.rows.iter().position(|r| (r.x, r.y) == (x, 2)).unwrap() * 12];
    // The texture's texels have their centres at (k + 1/2) / 47 and hold 5 k / 255.
    let mean = |from: f32, to: f32| 5.0 / 255.0 * ((0.05 + 0.9 * (from + to) / 2.0 / 4.6) * 47.0 - 0.5);
    assert!((light(2) / mean(2.0, 3.0) - 1.0).abs() < 0.005, "{} {}", light(2), mean(2.0, 3.0));
    assert!((light(4) / mean(4.0, 4.6) - 1.0).abs() < 0.005, "{} {}", light(4), mean(4.0, 4.6));
    assert!((light(4) / mean(4.0, 5.0) - 1.0).abs() > 0.02, "what lies beside the chart has no part in it");
}
