use super::*;

fn seen_by(scene: &Scene, plan: &Plan, camera: &Camera) -> Vec<Option<Seen>> {
    nearest(&look(scene, plan, camera, &Stop::default()).unwrap())
}

#[test]
fn a_pixel_sees_the_nearest_front_where_it_is() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let camera = camera_at([0.5, 1.0, 3.0], [0.5, 1.0, -2.0], size(1, 1));
    let seen = seen_by(&scene, &plan, &camera)[0].unwrap();
    assert_eq!((seen.surface, seen.chart), (1, 2));
    // The wall's u runs over x from -2 to 2, its v over y from 0 to 3, up to 0.75.
    assert!((seen.uv[0] - 0.75 * 2.5 / 4.0).abs() < 1e-6 && (seen.uv[1] - 0.25).abs() < 1e-6, "{:?}", seen.uv);
    assert!(seen.toward.distance(Vec3::Z) < 1e-6, "the wall is seen from straight ahead");
    let behind = camera_at([0.0, 1.0, -9.0], [0.0, 1.0, 0.0], size(1, 1));
    assert_eq!(seen_by(&scene, &plan, &behind), [None], "its back is not there, and the floor is seen edge on");
    let floor = camera_at([0.0, 2.0, 0.0], [0.0, 0.0, 0.0], size(1, 1));
    let seen = seen_by(&scene, &plan, &floor)[0].unwrap();
    assert_eq!((seen.surface, seen.chart), (0, 1));
    assert!((seen.uv[0] - 0.375).abs() < 1e-6 && (seen.uv[1] - 0.375).abs() < 1e-6);
}

#[test]
fn charts_are_numbered_over_the_scene() {
    let scene = corner();
    let mut plan = plan_of(&scene, "16x16", "2x2");
    plan.surfaces[0].charts = vec![5, 2];
    plan.surfaces[1].charts = vec![0, 1];
    let seen = seen_by(&scene, &plan, &camera_at([0.0, 3.0, 4.0], [0.0, 0.8, -1.0], size(40, 30)));
    let charts: std::collections::BTreeSet<u32> = seen.iter().flatten().map(|s| s.chart).collect();
    assert_eq!(charts.into_iter().collect::<Vec<_>>(), [3, 6, 7, 8], "six of the floor, then the wall's");
}

/// A bumpy sheet of many triangles, looked at so closely that it fills the picture: no ray slips through between two of them.
#[test]
fn shared_edges_have_no_gaps() {
    let n = 40u32;
    let height = |x: u32, y: u32| ((x * 7919 + y * 104_729) % 97) as f32 / 300.0;
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32 / 3.0, y as f32 / 3.0, height(x, y)])).collect();
    let triangle = |corners| (Triangle { corners, polygon: 0 }, Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]));
    let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
    let triangles = cells.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [triangle([a, b, c]), triangle([a, c, d])]
    });
    let surface = Surface::plain("s", 0, triangles.collect());
    let scene = Scene { positions, surfaces: vec![surface], ..scene_of(&[], 1.0) };
    let plan = plan_of(&scene, "4x4", "2x2");
    // Rays through vertices and along edges: the sheet's lattice is the picture's.
    for eye in [[6.0, 6.0, 5.0], [6.0, 6.0, 400.0], [5.0 + 1.0 / 3.0, 6.0, 3.0]] {
        let fov = if eye[2] > 100.0 { 1.0 } else { 45.0 };
        let camera = Camera::new(Vec3::from_array(eye), Vec3::new(eye[0], eye[1], 0.0), fov, size(240, 180)).unwrap();
        let missed = seen_by(&scene, &plan, &camera).iter().filter(|s| s.is_none()).count();
        assert_eq!(missed, 0, "{eye:?}");
    }
}

#[test]
fn of_surfaces_in_the_same_place_the_first_is_seen_however_many_there_are() {
    let quad = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]];
    let scene = scene_of(&vec![quad; 1_500], 1.0);
    let plan = plan_of(&scene, "4x4", "2x2");
    let seen = seen_by(&scene, &plan, &camera_at([0.1, 2.0, 0.2], [0.0, 0.0, 0.0], size(5, 5)));
    assert!(seen.iter().all(|s| s.is_some_and(|s| s.surface == 0)), "{seen:?}");
}

#[test]
fn a_scene_without_triangles_is_all_background() {
    let scene = scene_of(&[], 1.0);
    let plan = plan_of(&scene, "4x4", "2x2");
    assert!(seen_by(&scene, &plan, &camera_at([0.0, 0.0, 1.0], [0.0, 0.0, 0.0], size(3, 2))).iter().all(Option::is_none));
}
