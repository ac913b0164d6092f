use super::*;
use crate::package::fixture;
use clap::Parser;
use kiln_proto::settings::{RawFormat, Rule};

#[derive(Debug, clap::Parser)]
struct Line {
    #[command(flatten)]
    args: Args,
}

fn parse(dir: &Path, more: &[&str]) -> Result<Args, String> {
    let output = dir.join("view.png");
    let fixed = ["render", dir.to_str().unwrap(), "-o", output.to_str().unwrap()];
    Line::try_parse_from(fixed.iter().chain(more)).map(|line| line.args).map_err(|e| e.to_string())
}

fn picture(dir: &Path, more: &[&str]) -> (Vec<u8>, serde_json::Value) {
    let args = parse(dir, more).unwrap();
    let mut out = vec![];
    run(&args, true, &mut out).unwrap();
    (std::fs::read(&args.output).unwrap(), serde_json::from_slice(&out).unwrap())
}

fn baked(raw: Option<RawFormat>) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 1 }, raw));
    dir
}

/// The fixture's wall fills z = 0, x and y from 0 to 1, seen from +z; its lamp lies at z = 1.
const FACING: [&str; 4] = ["--eye", "0.5,0.5,0.9", "--target", "0.5,0.5,0"];

#[test]
fn the_report_says_what_was_rendered() {
    let dir = baked(None);
    let (png, report) = picture(dir.path(), &[&FACING[..], &["--size", "40x30", "--fov", "30"]].concat());
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!((&report["width"], &report["height"], &report["pixels_without_light"]), (&40.into(), &30.into(), &0.into()));
    assert_eq!(report["camera"]["eye"], serde_json::json!([0.5, 0.5, 0.9f32]));
    assert!(report["milliseconds"].as_f64().unwrap() > 0.0);
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(left.iter().all(|name| !name.starts_with(".kiln")), "{left:?}");
}

#[test]
fn raw_and_codec_show_the_same_but_for_the_error_bound() {
    let dir = baked(Some(RawFormat::F32));
    let args = |from| parse(dir.path(), &[&FACING[..], &["--size", "40x30", "--from", from]].concat()).unwrap();
    let package = Package::open(dir.path()).unwrap();
    let bytes = |args: &Args| {
        let view = View { eye: args.eye, target: args.target, size: args.size, ..View::default() };
        let camera = view.camera(&package.scene).unwrap();
        let mut light = Light::new(&package, &package.scene, &package.plan, args.from, Trust::Checksum);
        draw(&package.scene, &package.plan, &mut light, &camera, &view, &Stop::default()).unwrap().rgb().as_flattened().to_vec()
    };
    let (raw, coded) = (bytes(&args("raw")), bytes(&args("codec")));
    // One level of the bound, half a level of coding to 8 bits, and what rounding does to a value on the edge.
    let worst = raw.iter().zip(&coded).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(2) && raw != coded, "{worst:?}");
}

#[test]
fn more_rays_a_pixel_make_another_picture_of_the_same_size() {
    let dir = baked(None);
    let with = |rays: &[&str]| picture(dir.path(), &[&["--eye", "2,2,3", "--size", "40x30"], rays].concat()).0;
    assert_eq!(with(&[]), with(&["--antialias", "2"]));
    assert_ne!(with(&[]), with(&["--antialias", "1"]));
    assert_eq!(image::load_from_memory(&with(&["--antialias", "4"])).unwrap().to_rgb8().dimensions(), (40, 30));
}

#[test]
fn only_an_eye_or_only_a_target_is_completed_by_the_default_view() {
    let dir = baked(None);
    let camera = |more: &[&str]| picture(dir.path(), more).1["camera"].clone();
    let (default, eye, target) = (camera(&[]), camera(&["--eye", "-1,2,3"]), camera(&["--target=-0.25,0,0"]));
    assert_eq!((&eye["eye"], &eye["target"]), (&serde_json::json!([-1.0, 2.0, 3.0]), &default["target"]));
    assert_eq!((&target["target"], &target["eye"]), (&serde_json::json!([-0.25, 0.0, 0.0]), &default["eye"]));
    assert_eq!(default["target"], serde_json::json!([0.5, 0.5, 0.5]));
}

#[test]
fn values_that_make_no_picture_are_refused_in_a_sentence() {
    let dir = baked(None);
    for (more, words) in [
        (&["--size", "100000x10"][..], "at most 8388608 pixels"),
        (&["--size", "0x10"], "each side"),
        (&["--size", "4096x4096"], "at most 8388608 pixels"),
        (&["--size", "640"], "WIDTHxHEIGHT"),
        (&["--eye", "nan,0,0"], "finite"),
        (&["--eye", "1,2"], "three finite coordinates"),
        (&["--target", "0,inf,0"], "finite"),
        (&["--fov", "wide"], "a finite number"),
        (&["--exposure", "21"], "-20 to 20 stops"),
        (&["--antialias", "5"], "1 to 4 rays"),
        (&["--antialias", "0"], "1 to 4 rays"),
        (&["--mode", "dark"], "light-field or diffuse"),
        (&["--from", "memory"], "memory"),
    ] {
        let error = parse(dir.path(), more).unwrap_err();
        assert!(error.contains(words), "{more:?}: {error}");
    }
    for (more, words) in [
        (&["--fov", "0.5"][..], "from 1 to 170"),
        (&["--fov", "-45"], "from 1 to 170"),
        (&["--eye", "1,1,1", "--target", "1,1,1"], "direction to look in"),
        (&["--eye", "1e20,0,0"], "1e15"),
    ] {
        let error = run(&parse(dir.path(), more).unwrap(), false, &mut vec![]).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains(words), "{more:?}: {error}");
    }
    let error = run(&parse(dir.path(), &["--from", "raw"]).unwrap(), false, &mut vec![]).unwrap_err();
    assert!(matches!(error, ToolError::NoRaw { .. }));
    assert!(!dir.path().join("view.png").exists());
}

#[test]
fn a_file_that_cannot_be_written_or_read_is_an_error_that_names_it() {
    let dir = baked(None);
    let mut args = parse(dir.path(), &[]).unwrap();
    args.output = dir.path().join("nowhere/view.png");
    let error = run(&args, false, &mut vec![]).unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("nowhere does not exist"), "{error}");
    args.output = dir.path().to_owned();
    assert!(run(&args, false, &mut vec![]).unwrap_err().is_usage());
    fixture::flip(&dir.path().join("surfaces/wall.mtnc"));
    let error = run(&parse(dir.path(), &[]).unwrap(), false, &mut vec![]).unwrap_err();
    assert!(!error.is_usage() && error.to_string().contains("wall.mtnc"), "{error}");
}
