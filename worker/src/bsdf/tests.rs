use super::coat::Coat;
use super::*;
use crate::{
    sampling::chi_square::{Case, check},
    scene::BakeScene,
    simd::Simd,
    testing::{Table, add_quad, empty},
};
use glam::Vec3;
use kiln_proto::scene::{LEAST_ALPHA, Material, MetallicRoughness, Reflection, alpha_of};

fn lambert(kd: f32) -> Bsdf {
    Bsdf { diffuse: Rgb::splat(kd), specular: Specular::None }
}

fn glossy(kd: f32, ks: f32, n: f32) -> Bsdf {
    Bsdf { diffuse: Rgb::splat(kd), specular: Specular::Phong { ks: Rgb::splat(ks), exponent: Exponent::new(n) } }
}

/// A material of appendix B, as the worker evaluates it.
fn appendix_b(m: MetallicRoughness) -> Bsdf {
    let mut scene = empty();
    add_quad(&mut scene, "s", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], Material::new("m", Reflection::MetallicRoughness(m)));
    BakeScene::new(scene, Simd::Auto).unwrap().bsdf(0, [0.3, 0.3])
}

fn metal(base: f32, roughness: f32) -> Bsdf {
    appendix_b(MetallicRoughness::plain(Rgb::splat(base), 1.0, roughness))
}

fn dielectric(base: f32, roughness: f32) -> Bsdf {
    appendix_b(MetallicRoughness::plain(Rgb::splat(base), 0.0, roughness))
}

fn translucent(base: f32, roughness: f32, transmission: f32) -> Bsdf {
    appendix_b(MetallicRoughness { transmission, ..MetallicRoughness::plain(Rgb::splat(base), 0.0, roughness) })
}

fn inclined(z: f32) -> Vec3 {
    Vec3::new((1.0 - z * z).sqrt() * 0.6, (1.0 - z * z).sqrt() * 0.8, z)
}

/// The integral of a function over both hemispheres.
fn over_sphere(f: impl Fn(Vec3) -> f32) -> f64 {
    over_hemisphere(|w| f(w) + f(behind(w)))
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
    let materials = [
        ("lambert", lambert(0.5)),
        ("n 1", glossy(0.2, 0.5, 1.0)),
        ("n 15", glossy(0.3, 0.15, 15.0)),
        ("n 60", glossy(0.1, 0.8, 60.0)),
        ("metal 0.4", metal(0.8, 0.4)),
        ("metal 0.7", metal(0.8, 0.7)),
        ("metal 1", metal(0.8, 1.0)),
        ("dielectric 0.5", dielectric(0.6, 0.5)),
        ("half metal 0.8", appendix_b(MetallicRoughness::plain(Rgb::new(0.9, 0.5, 0.1), 0.5, 0.8))),
        ("translucent 0.5", translucent(0.9, 0.5, 0.7)),
        ("translucent 1", translucent(0.9, 1.0, 1.0)),
    ];
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
    let materials = [
        (lambert(0.7), inclined(0.3)),
        (glossy(0.3, 0.5, 40.0), Vec3::Z),
        (glossy(0.0, 0.5, 20.0), inclined(0.4)),
        (metal(0.9, 0.3), inclined(0.5)),
        (metal(0.9, 1.0), inclined(0.1)),
        (dielectric(0.8, 0.6), inclined(0.2)),
        (translucent(0.8, 0.6, 0.5), inclined(0.6)),
    ];
    for (b, wo) in materials {
        let above = over_sphere(|wi| b.pdf(wi, wo));
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
    let coated = [metal(0.7, 0.4), dielectric(0.7, 0.3), translucent(0.9, 0.5, 0.8)];
    for b in [lambert(0.4), glossy(0.3, 0.5, 15.0)].into_iter().chain(coated) {
        let n = 1 << 16;
        let sum: f64 = (0..n)
            .filter_map(|i: u32| b.sample(wo, [(i as f32 + 0.5) / n as f32, (i.reverse_bits() >> 8) as f32 / 16_777_216.0]))
            .map(|s| f64::from(s.weight.r))
            .sum();
        let expected = over_sphere(|wi| b.eval(wi, wo).r * wi.z.abs());
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
    let (a, c) = (inclined(0.7), Vec3::new(-0.48, 0.6, 0.64));
    for b in [glossy(0.3, 0.5, 33.3), metal(0.8, 0.4), dielectric(0.8, 0.7)] {
        assert!((b.eval(a, c).r / b.eval(c, a).r - 1.0).abs() < 1e-5);
    }
    let b = translucent(0.8, 0.5, 0.6);
    assert!((b.eval(behind(a), c).r / b.eval(behind(c), a).r - 1.0).abs() < 1e-5);
}

#[test]
fn microfacets_are_mitsubas() {
    // Values of Mitsuba's roughconductor; the worker's own numbers for the same pairs, F = 1 (a white metal).
    let table = Table::read("reference/metallic-roughness/ggx.csv");
    let mut worst = [0.0f32; 2];
    for row in table.rows() {
        let [alpha, f, pdf] = ["alpha", "f", "pdf"].map(|c| row.number(c));
        let (wi, wo) = (row.vector("wi"), row.vector("wo"));
        let (normal, rise, through) = (Rgb::WHITE, Rgb::BLACK, Rgb::BLACK);
        let coat = Coat { alpha, normal, rise, kept: 0.0, lost: 0.0, through };
        let off = |ours: f32, theirs: f32| if theirs > 1e-30 { (ours / theirs - 1.0).abs() } else { 0.0 };
        worst[0] = worst[0].max(off(coat.reflected(Rgb::BLACK, wi, wo).r, f));
        // Their density is that of wo for a path that arrives along wi.
        worst[1] = worst[1].max(off(coat.pdf(wo, wi), pdf));
    }
    assert!(table.rows().count() == 360 && worst.iter().all(|w| *w < 1e-3), "{worst:?}");
}

#[test]
fn the_furnace_returns_the_tabulated_albedo() {
    // Every material of the table whose lobe the midpoint rule resolves; base colours above one at grazing angles are the appendix's own.
    let table = Table::read("reference/metallic-roughness/albedo.csv");
    let mut checked = 0;
    for row in table.rows().filter(|r| r.number("roughness") >= 0.3) {
        let [ior, metallic, roughness, cos] = ["ior", "metallic", "roughness", "cos_o"].map(|c| row.number(c));
        let base = Rgb::from(row.vector("base").to_array());
        let b = appendix_b(MetallicRoughness { ior, ..MetallicRoughness::plain(base, metallic, roughness) });
        let wo = inclined(cos.min(1.0));
        let expected = row.number("g");
        let got = over_hemisphere(|wi| b.eval(wi, wo).g * wi.z);
        assert!((got / f64::from(expected) - 1.0).abs() < 5e-3, "{base:?} {metallic} {roughness} {cos}: {got} {expected}");
        checked += 1;
    }
    assert_eq!(checked, 270);
}

#[test]
fn metals_and_thin_sheets_keep_their_energy() {
    for (roughness, cos) in [(0.2, 0.9), (0.3, 0.2), (0.6, 0.5), (1.0, 0.05), (1.0, 1.0)] {
        let wo = inclined(cos);
        for b in [metal(1.0, roughness), translucent(1.0, roughness, 1.0)] {
            let all = over_sphere(|wi| b.eval(wi, wo).r * wi.z.abs());
            assert!(all <= 1.0 + 2e-3 && all > 0.1, "{roughness} {cos}: {all}");
        }
    }
}

#[test]
fn what_goes_through_a_sheet_is_its_share_of_the_diffuse_part() {
    // At normal incidence on rough glass: (1 - F) of what the facets do not lose, tinted once.
    let wo = Vec3::Z;
    let through = |b: &Bsdf| over_hemisphere(|wi| b.eval(behind(wi), wo).r * wi.z);
    let (full, half, tinted) = (translucent(1.0, 0.4, 1.0), translucent(1.0, 0.4, 0.5), translucent(0.3, 0.4, 1.0));
    assert!(through(&full) < 0.96 && through(&full) > 0.9, "{}", through(&full));
    assert!((through(&half) / through(&full) - 0.5).abs() < 1e-4 && (through(&tinted) / through(&full) - 0.3).abs() < 1e-4);
    assert_eq!(half.diffuse.r, 0.5);
    assert_eq!(dielectric(1.0, 0.4).eval(-Vec3::Z, wo), Rgb::BLACK);
}

#[test]
fn the_extensions_mean_what_they_say() {
    let plain = MetallicRoughness::plain(Rgb::splat(0.5), 0.0, 0.5);
    let head_on = |m: MetallicRoughness| if let Specular::Coat(c) = appendix_b(m).specular { c } else { panic!() };
    let f0 = |m: MetallicRoughness| head_on(m).normal.to_array();
    assert!((f0(plain.clone())[0] - 0.04).abs() < 1e-6);
    assert!((f0(MetallicRoughness { ior: 2.0, ..plain.clone() })[0] - 1.0 / 9.0).abs() < 1e-6);
    assert_eq!(f0(MetallicRoughness { ior: 0.0, ..plain.clone() }), [1.0; 3], "a Fresnel term of one");
    let tinted = MetallicRoughness { specular_color: Rgb::new(1.0, 0.5, 100.0), ..plain.clone() };
    let tinted = f0(tinted);
    assert!((tinted[1] - 0.02).abs() < 1e-6 && tinted[2] == 1.0, "bounded by one: {tinted:?}");
    let dull = head_on(MetallicRoughness { specular: 0.25, ..plain });
    assert!((dull.normal.r - 0.01).abs() < 1e-6 && (dull.rise.r - 0.24).abs() < 1e-6 && (dull.kept - 0.99).abs() < 1e-6);
}

#[test]
fn roughness_nearly_zero_is_a_mirror_whose_reflectance_rises_toward_the_horizon() {
    assert_eq!((alpha_of(0.03), alpha_of(0.0)), (0.0, 0.0));
    assert!(alpha_of(0.032) >= LEAST_ALPHA);
    let b = dielectric(0.0, 0.0);
    assert!(!b.is_smooth() && !b.is_black());
    let toward = |z: f32| b.sample(inclined(z), [0.3, 0.3]).map(|s| (s.wi, s.weight.r, s.pdf)).unwrap();
    assert_eq!((toward(0.5).0, toward(0.5).2), (mirror(inclined(0.5)), None));
    assert!((toward(1.0).1 - 0.04).abs() < 1e-6 && (toward(0.5).1 - (0.04 + 0.96 / 32.0)).abs() < 1e-6);
}
