use super::*;
use crate::sampling::chi_square::{Case, check};
use glam::Vec3;

fn lambert(kd: f32) -> Bsdf {
    Bsdf { diffuse: Rgb::splat(kd), specular: Specular::None }
}

fn glossy(kd: f32, ks: f32, n: f32) -> Bsdf {
    Bsdf { diffuse: Rgb::splat(kd), specular: Specular::Phong { ks: Rgb::splat(ks), exponent: Exponent::new(n) } }
}

fn inclined(z: f32) -> Vec3 {
    Vec3::new((1.0 - z * z).sqrt() * 0.6, (1.0 - z * z).sqrt() * 0.8, z)
}

/// The integral of a function over the hemisphere, by a fine midpoint rule in (cos, azimuth).
fn over_hemisphere(f: impl Fn(Vec3) -> f32) -> f64 {
    const N: usize = 600;
    let mut sum = 0.0;
    for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
        let z = (i as f32 + 0.5) / N as f32;
        let (sin, cos) = kiln_proto::math::sin_cos_turns((j as f32 + 0.5) / N as f32);
        let r = (1.0 - z * z).sqrt();
        sum += f64::from(f(Vec3::new(r * cos, r * sin, z)));
    }
    sum * std::f64::consts::TAU / (N * N) as f64
}

#[test]
fn sampling_matches_its_density() {
    let materials =
        [("lambert", lambert(0.5)), ("n 1", glossy(0.2, 0.5, 1.0)), ("n 15", glossy(0.3, 0.15, 15.0)), ("n 60", glossy(0.1, 0.8, 60.0))];
    let outs = [inclined(0.95), inclined(0.2)];
    type Sampler = Box<dyn Fn([f32; 2]) -> Vec3>;
    type Density = Box<dyn Fn(Vec3) -> f32>;
    let pairs: Vec<(&str, Sampler, Density)> = materials
        .into_iter()
        .flat_map(|(name, b)| outs.map(|wo| (name, b, wo)))
        .map(|(name, b, wo)| {
            let sample: Sampler = Box::new(move |u| b.sample(wo, u).map_or(Vec3::ZERO, |s| s.wi));
            let pdf: Density = Box::new(move |wi| b.pdf(wi, wo));
            (name, sample, pdf)
        })
        .collect();
    let cases: Vec<Case<'_>> = pairs.iter().map(|(name, sample, pdf)| Case::new(name, sample, pdf)).collect();
    check(&cases);
}

#[test]
fn densities_integrate_to_one_less_what_falls_below_the_horizon() {
    for (b, wo) in [(lambert(0.7), inclined(0.3)), (glossy(0.3, 0.5, 40.0), Vec3::Z), (glossy(0.0, 0.5, 20.0), inclined(0.4))] {
        let above = over_hemisphere(|wi| b.pdf(wi, wo));
        let landed =
            (0..4096u32).filter(|i| b.sample(wo, [(*i as f32 + 0.5) / 4096.0, (i.reverse_bits() >> 8) as f32 / 16_777_216.0]).is_some());
        let share = landed.count() as f64 / 4096.0;
        assert!((above - share).abs() < 4e-3, "{above} {share}");
    }
}

#[test]
fn at_normal_incidence_the_albedo_is_kd_plus_ks_and_elsewhere_it_is_less() {
    for (kd, ks, n) in [(0.5, 0.0, 1.0), (0.3, 0.5, 40.0), (0.1, 0.2, 0.0), (0.0, 1.0, 150.5)] {
        let b = if ks > 0.0 { glossy(kd, ks, n) } else { lambert(kd) };
        let reflected = |wo: Vec3| over_hemisphere(|wi| b.eval(wi, wo).r * wi.z);
        let expected = f64::from(b.albedo().r);
        assert!((reflected(Vec3::Z) - expected).abs() < 3e-3 * expected.max(0.1), "n = {n}: {} {expected}", reflected(Vec3::Z));
        assert!(reflected(inclined(0.3)) <= expected + 1e-3);
    }
}

#[test]
fn weights_average_to_the_albedo() {
    let wo = inclined(0.8);
    for b in [lambert(0.4), glossy(0.3, 0.5, 15.0)] {
        let n = 1 << 16;
        let sum: f64 = (0..n)
            .filter_map(|i: u32| b.sample(wo, [(i as f32 + 0.5) / n as f32, (i.reverse_bits() >> 8) as f32 / 16_777_216.0]))
            .map(|s| f64::from(s.weight.r))
            .sum();
        let expected = over_hemisphere(|wi| b.eval(wi, wo).r * wi.z);
        assert!((sum / f64::from(n) - expected).abs() < 2e-3, "{} {expected}", sum / f64::from(n));
    }
}

#[test]
fn a_mirror_reflects_its_share_in_one_direction_and_nothing_elsewhere() {
    let b = Bsdf { diffuse: Rgb::splat(0.2), specular: Specular::Mirror { ks: Rgb::splat(0.6) } };
    let wo = inclined(0.6);
    assert_eq!(b.eval(mirror(wo), wo), Rgb::splat(0.2) * INV_PI);
    let bounce = b.sample(wo, [0.1, 0.5]).unwrap();
    assert_eq!((bounce.wi, bounce.pdf), (mirror(wo), None));
    // Chosen with its share of the reflectance, so that the weight makes up for the rest.
    assert!((bounce.weight.r * 0.75 - 0.6).abs() < 1e-6);
    assert!(b.sample(wo, [0.9, 0.5]).unwrap().pdf.is_some());
    assert!(b.sample(-wo, [0.1, 0.5]).is_none(), "backs reflect nothing");
}

#[test]
fn reflection_is_reciprocal() {
    let b = glossy(0.3, 0.5, 33.3);
    let (a, c) = (inclined(0.7), Vec3::new(-0.48, 0.6, 0.64));
    assert!((b.eval(a, c).r / b.eval(c, a).r - 1.0).abs() < 1e-5);
}
