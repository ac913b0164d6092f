use super::*;
use kiln_proto::{
    format::stream::Trust,
    lookup::{self, DiffuseMean},
    units::byte_to_radiance,
};
use std::{
    sync::atomic::{AtomicUsize, Ordering},
    time::{Duration, Instant},
};
use tokio_util::sync::CancellationToken;

fn picture(scene: &Scene, plan: &Plan, files: &Files, camera: &Camera, origin: Origin, mode: Mode) -> Result<Frame, RenderError> {
    render(scene, plan, &mut Light::new(files, scene, plan, origin, Trust::Checksum), camera, mode)
}

fn drawn(scene: &Scene, plan: &Plan, files: &dyn PackageFiles, camera: &Camera, view: &View, stop: &Stop) -> Result<Picture, RenderError> {
    draw(scene, plan, &mut Light::new(files, scene, plan, Origin::Codec, Trust::Checksum), camera, view, stop)
}

fn overview() -> Camera {
    camera_at([1.5, 2.5, 4.0], [0.0, 0.8, -1.0], size(97, 71))
}

/// Every pixel is what the reference lookup says, bit by bit, from either source, and both ways to ask see the same charts.
#[test]
fn every_pixel_is_the_reference_lookup() {
    let scene = corner();
    let plan = plan_of(&scene, "70x66", "3x4");
    // A hole in each surface, larger than what is read at once beside it.
    let holds = |_: usize, texel: u64| !(20 * 70..25 * 70).contains(&texel) && texel % 70 != 30;
    let files = files_of(&scene, &plan, holds);
    let camera = overview();
    let seen = nearest(&look(&scene, &plan, &camera, &Stop::default()).unwrap());
    let factor = plan.exposure().factor();
    let expected: Vec<Option<Rgb>> = seen
        .iter()
        .map(|seen| {
            let seen = (*seen)?;
            let n = seen.surface as usize;
            let gutter = |t: u64| t % 70 < 52 + 3 && t / 70 < 50 + 2;
            let sample =
                |t: u64, depth: u32| (holds(n, t) && gutter(t)).then(|| Rgb::from(value(n, t, depth).map(|v| byte_to_radiance(v, factor))));
            lookup::radiance(seen.uv, seen.toward, plan.surfaces[n].size, plan.settings.directions, sample)
        })
        .collect();
    for origin in [Origin::Codec, Origin::Raw] {
        let frame = picture(&scene, &plan, &files, &camera, origin, Mode::LightField).unwrap();
        for ((pixel, seen), expected) in frame.pixels().iter().zip(&seen).zip(&expected) {
            assert_eq!((pixel.chart, pixel.found), (seen.map_or(0, |s| s.chart), expected.is_some()));
            let ground = if seen.is_some() { Rgb::BLACK } else { BACKGROUND };
            assert_eq!(pixel.radiance, expected.unwrap_or(ground));
        }
        let dark = frame.pixels().iter().filter(|p| p.chart > 0 && !p.found).count();
        assert!(dark > 10 && frame.pixels().iter().filter(|p| p.found).count() > 2_000);
    }
}

#[test]
fn diffuse_light_is_the_cosine_weighted_mean_and_does_not_depend_on_the_eye() {
    let scene = corner();
    let plan = plan_of(&scene, "70x66", "3x4");
    let files = files_of(&scene, &plan, |_, _| true);
    // The centre of texel (20, 30) of the floor, from two sides.
    let at = [20.5 / 70.0 / 0.75 * 4.0 - 2.0, 0.0, 2.0 - 30.5 / 66.0 / 0.75 * 4.0];
    let from = |eye: [f32; 3]| {
        let camera = camera_at(eye, at, size(1, 1));
        picture(&scene, &plan, &files, &camera, Origin::Codec, Mode::Diffuse).unwrap().pixels()[0].radiance
    };
    let factor = plan.exposure().factor();
    let texel = (0..12).map(|depth| Rgb::from(value(0, 30 * 70 + 20, depth).map(|v| byte_to_radiance(v, factor))));
    let expected = DiffuseMean::new(plan.settings.directions).of(texel);
    for eye in [[1.0, 2.0, 3.0], [-1.5, 1.0, 0.5]] {
        let found = from(eye);
        assert!(
            (found.r - expected.r).abs() < 1e-3 * expected.r && (found.b - expected.b).abs() < 1e-3 * expected.b,
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn a_picture_of_several_bands_is_one_picture() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let files = files_of(&scene, &plan, |_, _| true);
    // Bands of 128 rows, the last one cut short.
    let tall = camera_at([0.5, 1.5, 6.0], [0.5, 1.5, 0.0], size(1_024, 600));
    let frame = picture(&scene, &plan, &files, &tall, Origin::Codec, Mode::LightField).unwrap();
    assert_eq!(frame.pixels().len(), 1_024 * 600);
    let seen = nearest(&look(&scene, &plan, &tall, &Stop::default()).unwrap());
    assert!(frame.pixels().iter().zip(&seen).all(|(p, s)| p.chart == s.map_or(0, |s| s.chart)));
    let rows = |y: usize| &frame.pixels()[y * 1_024..(y + 1) * 1_024];
    assert!(rows(511).iter().zip(rows(512)).any(|(a, b)| a.found && b.found), "light on both sides of the seam");
}

#[test]
fn bytes_are_exposed_srgb_and_the_background_is_not_exposed() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let files = files_of(&scene, &plan, |_, _| true);
    let frame = picture(&scene, &plan, &files, &overview(), Origin::Codec, Mode::LightField).unwrap();
    for stops in [0.0, -2.5] {
        let view = View { exposure: stops, antialias: 1, ..View::default() };
        let shown = drawn(&scene, &plan, &files, &overview(), &view, &Stop::default()).unwrap();
        let factor = plan.exposure().factor() * kiln_proto::math::exp2(stops);
        for (pixel, bytes) in frame.pixels().iter().zip(shown.rgb()) {
            let expected = pixel.radiance.to_array().map(|v| kiln_proto::units::radiance_to_byte(v, factor));
            assert_eq!(*bytes, if pixel.chart == 0 { [0x20, 0x24, 0x28] } else { expected });
        }
        let png = image::load_from_memory(&shown.to_png().unwrap()).unwrap().to_rgb8();
        assert_eq!((png.dimensions(), png.as_raw().as_slice()), ((97, 71), shown.rgb().as_flattened()));
    }
}

/// A sky whose colours tell where one looks.
fn sky() -> Environment {
    let rgb = (0..8).flat_map(|row| (0..16).map(move |column| [0.02 * column as f32, 0.05 * row as f32, 0.1])).collect();
    Environment { name: "sky".into(), width: 16, height: 8, rgb, rotation: 0.7, intensity: 2.0 }
}

#[test]
fn an_environment_lies_behind_and_is_exposed_like_the_scene() {
    let scene = Scene { environment: Some(sky()), ..corner() };
    let plan = plan_of(&scene, "16x16", "2x2");
    let files = files_of(&scene, &plan, |_, _| true);
    let frame = picture(&scene, &plan, &files, &overview(), Origin::Codec, Mode::LightField).unwrap();
    let plain = picture(&corner(), &plan, &files, &overview(), Origin::Codec, Mode::LightField).unwrap();
    let view = View { exposure: -1.5, antialias: 1, ..View::default() };
    let shown = drawn(&scene, &plan, &files, &overview(), &view, &Stop::default()).unwrap();
    let factor = plan.exposure().factor() * kiln_proto::math::exp2(-1.5);
    let mut behind = 0;
    for (k, (pixel, plain)) in frame.pixels().iter().zip(plain.pixels()).enumerate() {
        let toward = overview().direction(k as u32 % 97, k as u32 / 97);
        assert_eq!(pixel.chart, plain.chart);
        if pixel.chart == 0 {
            assert_eq!((pixel.radiance, pixel.background), (sky().radiance(toward), Rgb::BLACK), "{toward}");
            assert_eq!(shown.rgb()[k], pixel.radiance.to_array().map(|v| kiln_proto::units::radiance_to_byte(v, factor)));
            behind += 1;
        } else {
            assert_eq!(pixel, plain);
        }
    }
    assert!(behind > 500 && shown.without_light() == 0, "{behind}");
    let hidden = View { hide_environment: true, ..view.clone() };
    let of = |scene: &Scene, view: &View| drawn(scene, &plan, &files, &overview(), view, &Stop::default()).unwrap();
    assert_eq!(of(&scene, &hidden), of(&corner(), &view));
}

/// In several bands, whose rows of pixels are whole: each pixel is the mean of the four that a picture twice as fine has in its place.
#[test]
fn pixels_are_means_of_the_rays_through_them() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let files = files_of(&scene, &plan, |_, texel| !(5..8).contains(&(texel % 16)));
    let at = |size| camera_at([1.5, 2.5, 4.0], [0.0, 0.8, -1.0], size);
    let shown = drawn(&scene, &plan, &files, &at(size(500, 301)), &View::default(), &Stop::default()).unwrap();
    let fine = picture(&scene, &plan, &files, &at(size(1_000, 602)), Origin::Codec, Mode::LightField).unwrap();
    let factor = plan.exposure().factor();
    let mut dark = 0;
    for (k, bytes) in shown.rgb().iter().enumerate() {
        let (x, y) = (2 * (k % 500), 2 * (k / 500));
        let rays = [0, 1, 1_000, 1_001].map(|offset| fine.pixels()[y * 1_000 + x + offset]);
        let light = rays.map(|ray| if ray.chart == 0 { ray.radiance } else { ray.radiance * factor });
        let mean = (light[0] + light[1] + light[2] + light[3]) * 0.25;
        assert_eq!(*bytes, mean.to_array().map(|v| kiln_proto::units::radiance_to_byte(v, 1.0)), "{x} {y}");
        dark += usize::from(rays.iter().any(|ray| ray.chart > 0 && !ray.found));
    }
    assert!(dark > 100 && shown.without_light() == dark, "{dark}");
}

/// Files that withdraw the wish for a picture when the first of them is opened, and count what is opened.
struct Withdrawn<'a>(&'a Files, CancellationToken, AtomicUsize);

impl PackageFiles for Withdrawn<'_> {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        self.1.cancel();
        self.2.fetch_add(1, Ordering::SeqCst);
        self.0.open(path)
    }
}

#[test]
fn a_picture_is_given_up_when_nobody_wants_it_or_its_time_is_over() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let files = files_of(&scene, &plan, |_, _| true);
    let late = Stop::new(CancellationToken::new(), Instant::now());
    let error = drawn(&scene, &plan, &files, &overview(), &View::default(), &late).unwrap_err();
    assert!(matches!(error, RenderError::Stopped(Stopped::Late)), "{error}");
    // Withdrawn in the middle: the second surface, which is seen too, is not opened.
    let unwanted = CancellationToken::new();
    let files = Withdrawn(&files, unwanted.clone(), AtomicUsize::new(0));
    let stop = Stop::new(unwanted, Instant::now() + Duration::from_secs(3_600));
    let error = drawn(&scene, &plan, &files, &overview(), &View::default(), &stop).unwrap_err();
    assert!(matches!(error, RenderError::Stopped(Stopped::Unwanted)), "{error}");
    assert_eq!(files.2.load(Ordering::SeqCst), 4, "the four files of the first surface");
    // And between rows of rays.
    let seen = look(&scene, &plan, &overview(), &stop);
    assert_eq!(seen, Err(Stopped::Unwanted));
}

#[test]
fn files_that_are_damaged_or_missing_are_errors_that_name_them() {
    let scene = corner();
    let plan = plan_of(&scene, "16x16", "2x2");
    let render = |files: &Files, origin| picture(&scene, &plan, files, &overview(), origin, Mode::LightField).unwrap_err().to_string();
    let mut gone = files_of(&scene, &plan, |_, _| true);
    gone.0.remove("surfaces/s1.mti");
    assert_eq!(render(&gone, Origin::Codec), "surfaces/s1.mti");
    let mut turned = files_of(&scene, &plan, |_, _| true);
    // The first two kept samples of the floor change places, under a checksum that agrees.
    let file = turned.0.get_mut("surfaces/s0.mti").unwrap();
    let first: [u8; 2] = file[32..34].try_into().unwrap();
    file.copy_within(34..36, 32);
    file[34..36].copy_from_slice(&first);
    let crc = crc32c::crc32c(&file[32..]);
    file[28..32].copy_from_slice(&crc.to_le_bytes());
    let whole = camera_at([-1.9, 1.0, 1.9], [-2.0, 0.0, 2.0], size(3, 3));
    let error = picture(&scene, &plan, &turned, &whole, Origin::Codec, Mode::LightField).unwrap_err();
    assert_eq!(error.to_string(), "surface `s0`, texel (0, 0)");
    let mut none = plan_of(&scene, "16x16", "2x2");
    none.settings.raw = None;
    let files = files_of(&scene, &plan, |_, _| true);
    let error = picture(&scene, &none, &files, &overview(), Origin::Raw, Mode::LightField).unwrap_err();
    assert!(error.to_string().contains("no raw radiance"), "{error}");
}
