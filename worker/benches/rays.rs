//! Rays per second of the worker's tree beside obvhs's own traversals of its binary and compressed trees (which break no ties and, the
//! latter, ignore hits nearer than 1e-4). Closest hits of random rays inside a scene; throughput counts rays.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

#[path = "../src/testing.rs"]
mod testing;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use kiln_worker::accel::{Accel, Ray, RayCount};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris, cwbvh::builder::build_cwbvh_from_tris, ray::RayHit, triangle::Triangle};
use std::{hint::black_box, time::Duration};

const RAYS: usize = 4_096;

fn rays(triangles: &[[Vec3; 3]]) -> Vec<Ray> {
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 16_777_216.0
    };
    let corners = || triangles.iter().flatten();
    let (low, high) = (corners().fold(Vec3::MAX, |a, b| a.min(*b)), corners().fold(Vec3::MIN, |a, b| a.max(*b)));
    let mut point = || low + (high - low) * Vec3::new(next(), next(), next());
    (0..RAYS).map(|_| (point(), point())).map(|(a, b)| Ray::unbounded(a, (b - a).normalize())).collect()
}

fn bench(c: &mut Criterion) {
    for name in ["thesis", "cornell"] {
        let scene = testing::load(name);
        let corners = scene.surfaces.iter().flat_map(|s| &s.triangles).map(|t| scene.corners(t).map(|p| p.as_vec3()));
        let triangles: Vec<[Vec3; 3]> = corners.collect();
        let soup: Vec<Triangle> = triangles.iter().map(|t| Triangle { v0: t[0].into(), v1: t[1].into(), v2: t[2].into() }).collect();
        let rays = rays(&triangles);
        let foreign: Vec<obvhs::ray::Ray> = rays.iter().map(|r| obvhs::ray::Ray::new_inf(r.origin.into(), r.direction.into())).collect();
        let mut group = c.benchmark_group(name);
        group.throughput(Throughput::Elements(RAYS as u64));

        let accel = Accel::build(&triangles);
        let mut count = RayCount::default();
        group.bench_function("closest", |b| b.iter(|| rays.iter().filter(|r| accel.closest(black_box(r), &mut count).is_some()).count()));
        group.bench_function("occluded", |b| b.iter(|| rays.iter().filter(|r| accel.occluded(black_box(r), &mut count)).count()));

        let binary = build_bvh2_from_tris(&soup, BvhBuildParams::medium_build(), &mut Duration::default());
        let test = |id: usize, map: &[u32], ray: &obvhs::ray::Ray| soup[map[id] as usize].intersect(ray);
        group.bench_function("closest, obvhs binary", |b| {
            let hits = |r: &obvhs::ray::Ray| {
                binary.ray_traverse(*black_box(r), &mut RayHit::none(), |ray, id| test(id, &binary.primitive_indices, ray))
            };
            b.iter(|| foreign.iter().filter(|r| hits(r)).count());
        });
        let wide = build_cwbvh_from_tris(&soup, BvhBuildParams::medium_build(), &mut Duration::default());
        group.bench_function("closest, obvhs compressed", |b| {
            let hits = |r: &obvhs::ray::Ray| {
                wide.ray_traverse(*black_box(r), &mut RayHit::none(), |ray, id| test(id, &wide.primitive_indices, ray))
            };
            b.iter(|| foreign.iter().filter(|r| hits(r)).count());
        });
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
