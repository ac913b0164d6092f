use super::*;

/// A small deterministic generator; the tests need spread, not quality.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }
    fn point(&mut self, scale: f32) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next()) * scale
    }
}

fn soup(random: &mut Random, count: usize, size: f32, scale: f32) -> Vec<[Vec3; 3]> {
    let mut triangle = || {
        let at = random.point(scale);
        [at, at + random.point(size * scale), at + random.point(size * scale)]
    };
    (0..count).map(|_| triangle()).collect()
}

/// A closed cube of 12 triangles, n x n quads a side.
fn cube(n: usize) -> Vec<[Vec3; 3]> {
    let mut out = Vec::new();
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let at = |u: usize, v: usize| {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = u as f32 / n as f32;
                p[(axis + 2) % 3] = v as f32 / n as f32;
                Vec3::from_array(p)
            };
            for (u, v) in (0..n).flat_map(|u| (0..n).map(move |v| (u, v))) {
                out.push([at(u, v), at(u + 1, v), at(u + 1, v + 1)]);
                out.push([at(u, v), at(u + 1, v + 1), at(u, v + 1)]);
            }
        }
    }
    out
}

/// Every triangle, one after the other, with the same test.
fn brute(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    let single = |prim: usize| {
        let tree = Accel::build(&triangles[prim..=prim]);
        tree.closest(ray, &mut RayCount::default()).map(|h| Hit { prim: prim as u32, ..h })
    };
    (0..triangles.len()).filter_map(single).min_by(|a, b| a.t.total_cmp(&b.t).then(a.prim.cmp(&b.prim)))
}

fn agree(triangles: &[[Vec3; 3]], rays: &[Ray]) {
    let accel = Accel::build(triangles);
    let mut count = RayCount::default();
    for ray in rays {
        let (found, expected) = (accel.closest(ray, &mut count), brute(triangles, ray));
        assert_eq!(found, expected, "{ray:?}");
        assert_eq!(accel.occluded(ray, &mut count), expected.is_some(), "{ray:?}");
    }
    assert_eq!(count.0, 2 * rays.len() as u64);
}

#[test]
fn the_tree_agrees_with_brute_force_at_every_scale() {
    for scale in [1e-3, 1.0, 1e3] {
        let mut random = Random(7);
        let mut triangles = soup(&mut random, 60, 0.4, scale);
        triangles.extend_from_within(..6); // Exact duplicates: ties go to the lower index.
        let ray = |r: &mut Random| {
            let (a, b) = (r.point(scale), r.point(scale));
            Ray { origin: a, direction: b - a, tmax: if r.next() < 0.5 { f32::INFINITY } else { r.next() } }
        };
        let rays: Vec<Ray> = (0..400).map(|_| ray(&mut random)).collect();
        agree(&triangles, &rays);
    }
}

#[test]
fn axis_parallel_and_grazing_rays_agree_with_brute_force() {
    let triangles = cube(3);
    let mut rays = Vec::new();
    for axis in 0..3 {
        for step in 0..=12 {
            // Along faces, edges and diagonals of the grid, from outside and from inside.
            let mut o = [step as f32 / 12.0, 1.0 / 3.0, 1.0];
            o.rotate_right(axis);
            let mut d = [0.0; 3];
            d[axis] = 1.0;
            let (o, d) = (Vec3::from_array(o), Vec3::from_array(d));
            rays.extend([Ray::unbounded(o - 2.0 * d, d), Ray::unbounded(o, d), Ray::unbounded(o + 2.0 * d, -d)]);
            rays.push(Ray::unbounded(o - 2.0 * d, d + Vec3::splat(1e-7)));
        }
    }
    agree(&triangles, &rays);
}

#[test]
fn no_ray_escapes_a_closed_box_through_its_edges() {
    let triangles = cube(8);
    let accel = Accel::build(&triangles);
    let mut random = Random(3);
    let centre = Vec3::new(0.5, 0.43, 0.57);
    for triangle in &triangles {
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            // Aim at vertices, at points of the edge and right beside it.
            for s in [0.0, 0.5, random.next(), 1.0] {
                let target = triangle[a] * (1.0 - s) + triangle[b] * s;
                for nudge in [Vec3::ZERO, (random.point(1.0) - 0.5) * 1e-7] {
                    let ray = Ray::unbounded(centre, target - centre + nudge);
                    assert!(accel.closest(&ray, &mut RayCount::default()).is_some(), "{ray:?} slipped through");
                    assert!(accel.occluded(&ray, &mut RayCount::default()), "{ray:?} slipped through");
                }
            }
        }
    }
}

#[test]
fn barycentric_weights_name_the_point_that_was_hit() {
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(2.0, 0.0, 1.5), Vec3::new(0.0, 3.0, 0.5)];
    let accel = Accel::build(&[triangle]);
    let target = triangle[0] * 0.5 + triangle[1] * 0.2 + triangle[2] * 0.3;
    let origin = Vec3::new(0.3, 0.2, -4.0);
    let hit = accel.closest(&Ray::unbounded(origin, target - origin), &mut RayCount::default()).unwrap();
    assert!((hit.t - 1.0).abs() < 1e-6 && (hit.u - 0.2).abs() < 1e-6 && (hit.v - 0.3).abs() < 1e-6, "{hit:?}");
}

#[test]
fn an_empty_tree_and_a_thousand_identical_triangles_are_fine() {
    let nothing = Accel::build(&[]);
    let ray = Ray::unbounded(Vec3::new(0.2, 0.2, -1.0), Vec3::Z);
    assert_eq!(nothing.closest(&ray, &mut RayCount::default()), None);
    assert!(!nothing.occluded(&ray, &mut RayCount::default()));
    let many = Accel::build(&vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 1_000]);
    assert_eq!(many.closest(&ray, &mut RayCount::default()).map(|h| h.prim), Some(0));
}
