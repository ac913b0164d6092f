//! Environments: Radiance HDR and OpenEXR pictures, decoded within the limits to linear radiance, row 0 at the bottom.
//!
//! The picture is a lat-long map as [`Environment`] has it, seen from inside: up is up, right is to the right. Its size is read and checked
//! before a pixel is decoded. Numbers that are no radiance (negative, not finite, beyond [`limits::BRIGHTEST`]) are clamped and counted: one broken
//! pixel must not turn every texel of a bake into NaN.

use super::{
    Bundle,
    bundle::Found,
    findings::{At, Findings},
    format::extension,
};
use exr::prelude::{MetaData, ReadChannels, ReadLayers, ReadSpecificChannel, Vec2, read};
use image::{ImageDecoder, codecs::hdr::HdrDecoder};
use kiln_proto::{limits, options::ImportOptions, scene::Environment};
use std::io::Cursor;

/// What an OpenEXR file begins with.
const EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Why a picture was refused.
#[derive(Debug, thiserror::Error)]
enum EnvironmentError {
    /// Neither format.
    #[error("is neither a Radiance HDR nor an OpenEXR picture")]
    Unknown,
    /// More pixels than an environment may have, or none.
    #[error("is {width}x{height} pixels; at most {max} pixels are allowed", max = limits::ENVIRONMENT_PIXELS)]
    Size {
        /// Pixels around.
        width: usize,
        /// Pixels from top to bottom.
        height: usize,
    },
    /// No colours.
    #[error("has no layer with channels R, G and B, or Y alone")]
    NoColour,
    /// The words of the HDR decoder.
    #[error("cannot be decoded: {0}")]
    Hdr(#[from] image::ImageError),
    /// The words of the OpenEXR decoder.
    #[error("cannot be decoded: {0}")]
    Exr(#[from] exr::error::Error),
}

/// Pixels from the top row down, linear.
struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<[f32; 3]>,
}

/// The environment that the options name, turned and scaled as they say; `None` where they name none or it was refused.
pub(super) fn import(bundle: &Bundle, options: &ImportOptions, findings: &mut Findings) -> Option<Environment> {
    let name = options.environment.as_deref()?;
    let path = match bundle.find(bundle.main(), name) {
        Some(Found::Exact(path) | Found::Near(path)) => path,
        None => {
            let message = format!("the environment `{name}` is not among the files; send it with the scene");
            findings.error(At::file(bundle.main().as_str()), message);
            return None;
        }
    };
    let at = At::file(path.as_str());
    let bytes = match bundle.read(path, limits::BUNDLE_BYTES) {
        Ok(bytes) => bytes,
        Err(problem) => {
            findings.push_error(problem);
            return None;
        }
    };
    match decode(path.as_str(), &bytes) {
        Ok(picture) => Some(finish(path.as_str(), picture, options, at, findings)),
        Err(error) => {
            findings.error(at, format!("the environment {error}"));
            None
        }
    }
}

fn finish(name: &str, mut picture: Picture, options: &ImportOptions, at: At<'_>, findings: &mut Findings) -> Environment {
    let (width, height) = (picture.width, picture.height);
    if width != 2 * height {
        findings.warn(at, format!("the environment has {width}x{height} pixels; a lat-long map is twice as wide as high; it is stretched"));
    }
    for value in picture.rgb.as_flattened_mut() {
        if !(0.0..=limits::BRIGHTEST).contains(value) {
            findings.count(at, "numbers of the environment that are negative, not finite or beyond any radiance, clamped");
            // NaN is not larger than zero either.
            *value = if *value > 0.0 { limits::BRIGHTEST } else { 0.0 };
        }
    }
    let rgb: Vec<[f32; 3]> = picture.rgb.chunks_exact(width).rev().flatten().copied().collect();
    if rgb.as_flattened().iter().all(|v| *v == 0.0) {
        findings.warn(at, "the environment is black");
    }
    Environment {
        name: name.to_owned(),
        width: width as u32,
        height: height as u32,
        rgb,
        rotation: options.environment_rotation.to_radians(),
        intensity: options.environment_intensity.unwrap_or(1.0),
    }
}

fn decode(name: &str, bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    if bytes.starts_with(EXR) {
        decode_exr(bytes)
    } else if bytes.starts_with(b"#?") || matches!(extension(name).as_str(), "hdr" | "pic" | "rgbe") {
        decode_hdr(bytes)
    } else {
        Err(EnvironmentError::Unknown)
    }
}

fn check_size(width: usize, height: usize) -> Result<(), EnvironmentError> {
    let pixels = (width as u64).checked_mul(height as u64);
    if pixels.is_some_and(|p| p > 0 && p <= limits::ENVIRONMENT_PIXELS) { Ok(()) } else { Err(EnvironmentError::Size { width, height }) }
}

/// Radiance pictures; programs that write them disagree about the first line, so it is not insisted on.
fn decode_hdr(bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    let decoder = HdrDecoder::new_nonstrict(Cursor::new(bytes))?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    // Pixels are radiance times what the lines EXPOSURE and COLORCORR of the header say.
    let metadata = decoder.metadata();
    let (red, green, blue) = metadata.color_correction.unwrap_or((1.0, 1.0, 1.0));
    let exposure = metadata.exposure.unwrap_or(1.0);
    let scale = [red, green, blue].map(|c| 1.0 / (c * exposure));
    let mut raw = vec![0; width * height * 12];
    decoder.read_image(&mut raw)?;
    let pixels = raw.as_chunks::<12>().0.iter();
    let channel = |p: &[u8; 12], c: usize| f32::from_ne_bytes([p[4 * c], p[4 * c + 1], p[4 * c + 2], p[4 * c + 3]]) * scale[c];
    Ok(Picture { width, height, rgb: pixels.map(|p| std::array::from_fn(|c| channel(p, c))).collect() })
}

/// The first layer with colours, at full resolution; grey pictures have a channel Y alone.
fn decode_exr(bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    let headers = MetaData::read_from_buffered(Cursor::new(bytes), false)?.headers;
    headers.iter().try_for_each(|h| check_size(h.layer_size.width(), h.layer_size.height()))?;
    let has = |header: &exr::meta::header::Header, name: &str| header.channels.list.iter().any(|c| c.name == *name);
    let flat = || headers.iter().filter(|h| !h.deep);
    let black = |size: Vec2<usize>| Picture { width: size.width(), height: size.height(), rgb: vec![[0.0; 3]; size.area()] };
    let reader = || read().no_deep_data().largest_resolution_level();
    if flat().any(|h| ["R", "G", "B"].iter().all(|name| has(h, name))) {
        let set = |picture: &mut Picture, at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
            picture.rgb[at.y() * picture.width + at.x()] = [r, g, b];
        };
        let layer = reader().rgb_channels(move |size, _| black(size), set).first_valid_layer().all_attributes();
        Ok(layer.non_parallel().from_buffered(Cursor::new(bytes))?.layer_data.channel_data.pixels)
    } else if flat().any(|h| has(h, "Y")) {
        let set = |picture: &mut Picture, at: Vec2<usize>, (y,): (f32,)| picture.rgb[at.y() * picture.width + at.x()] = [y; 3];
        let layer = reader().specific_channels().required("Y").collect_pixels(move |size, _| black(size), set);
        let layer = layer.first_valid_layer().all_attributes();
        Ok(layer.non_parallel().from_buffered(Cursor::new(bytes))?.layer_data.channel_data.pixels)
    } else {
        Err(EnvironmentError::NoColour)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Content, Part};
    use super::*;
    use exr::prelude::{Image, SpecificChannels, WritableImage};
    use proptest::prelude::*;

    const OBJ: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    /// A picture of flat RGBE pixels, from the top row down.
    fn hdr(width: usize, head: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
        let size = format!("#?RADIANCE\n{head}FORMAT=32-bit_rle_rgbe\n\n-Y {} +X {width}\n", pixels.len() / width);
        [size.as_bytes(), pixels.as_flattened()].concat()
    }

    fn exr(pixels: fn(Vec2<usize>) -> (f32, f32, f32)) -> Vec<u8> {
        let mut bytes = Cursor::new(vec![]);
        Image::from_channels((4, 2), SpecificChannels::rgb(pixels)).write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn read_in(name: &str, bytes: &[u8]) -> (Option<Environment>, Findings) {
        let part = |name: &str, bytes: &[u8]| Part { name: name.into(), content: Content::Bytes(bytes.to_vec()) };
        let bundle = Bundle::from_parts(vec![part("a.obj", OBJ), part(name, bytes)], None, &std::env::temp_dir()).unwrap();
        let mut findings = Findings::default();
        let options = ImportOptions {
            environment: Some(name.into()),
            environment_rotation: 90.0,
            environment_intensity: Some(2.0),
            ..ImportOptions::default()
        };
        (import(&bundle, &options, &mut findings), findings)
    }

    fn refused(name: &str, bytes: &[u8]) -> String {
        let (environment, findings) = read_in(name, bytes);
        assert!(environment.is_none());
        findings.into_errors("a.obj").iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn the_top_row_is_the_last_and_options_turn_and_scale() {
        // 128 with exponent 129 is one.
        let (one, two, dark) = ([128, 0, 0, 129], [0, 128, 0, 130], [0, 0, 0, 0]);
        let (environment, findings) = read_in("sky.hdr", &hdr(4, "", &[one, dark, dark, two, dark, dark, one, dark]));
        let environment = environment.unwrap();
        assert_eq!((environment.width, environment.height, environment.intensity), (4, 2, 2.0));
        assert!((environment.rotation - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        let near = |at: usize, expected: [f32; 3]| environment.rgb[at].iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01);
        assert!(
            near(2, [1.0, 0.0, 0.0]) && near(4, [1.0, 0.0, 0.0]) && near(7, [0.0, 2.0, 0.0]) && near(0, [0.0; 3]),
            "{:?}",
            environment.rgb
        );
        assert!(findings.into_warnings().is_empty());
    }

    #[test]
    fn exposure_is_taken_off_and_another_shape_is_said() {
        let (environment, findings) = read_in("sky.hdr", &hdr(2, "EXPOSURE=0.5\n", &[[128, 128, 128, 129]; 6]));
        assert!((environment.unwrap().rgb[0][1] - 2.0).abs() < 0.01);
        assert!(findings.into_warnings()[0].message.contains("2x3"));
    }

    #[test]
    fn exr_pictures_are_read_by_content_and_broken_numbers_are_clamped_and_counted() {
        let pixels = |at: Vec2<usize>| match (at.x(), at.y()) {
            (0, 0) => (1.0, 2.0, 3.0),
            (1, 0) => (-1.0, f32::NAN, f32::INFINITY),
            _ => (0.25, 0.25, 0.25),
        };
        let (environment, findings) = read_in("sky.picture", &exr(pixels));
        let environment = environment.unwrap();
        assert_eq!(
            (environment.rgb[4], environment.rgb[5], environment.rgb[0]),
            ([1.0, 2.0, 3.0], [0.0, 0.0, limits::BRIGHTEST], [0.25; 3])
        );
        assert!(findings.into_warnings()[0].to_string().contains("3, the first here"));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]
        #[test]
        fn broken_bytes_are_refused_or_read_and_never_panic(at in 0.0f64..1.0, value: u8, cut in 0.5f64..1.0, of_exr: bool) {
            let mut bytes = if of_exr { exr(|_| (1.0, 2.0, 3.0)) } else { hdr(4, "", &[[128, 128, 128, 129]; 8]) };
            let index = (at * bytes.len() as f64) as usize;
            bytes[index] = value;
            bytes.truncate((cut * 1.2 * bytes.len() as f64) as usize);
            let _ = decode("sky", &bytes);
        }
    }

    #[test]
    fn what_is_no_environment_says_why() {
        assert!(refused("sky.png", b"\x89PNG").contains("neither"));
        let (whole, whole_hdr) = (exr(|_| (1.0, 1.0, 1.0)), hdr(4, "", &[[1; 4]; 4]));
        for cut in [4, 40, whole.len() / 2, whole.len() - 3] {
            assert!(refused("sky.exr", &whole[..cut]).contains("sky.exr"), "{cut}");
        }
        assert!(refused("sky.hdr", b"#?RADIANCE\n\n-Y 90000 +X 90000\n").contains("90000x90000"));
        assert!(refused("sky.hdr", b"#?RADIANCE\n\n-Y 0 +X 9\n").contains("9x0"));
        assert!(refused("sky.hdr", &whole_hdr[..whole_hdr.len() - 1]).contains("cannot be decoded"));
        let empty = Part { name: "a.obj".into(), content: Content::Bytes(OBJ.to_vec()) };
        let bundle = Bundle::from_parts(vec![empty], None, &std::env::temp_dir()).unwrap();
        let mut findings = Findings::default();
        let options = ImportOptions { environment: Some("sky.hdr".into()), ..ImportOptions::default() };
        assert!(import(&bundle, &options, &mut findings).is_none());
        assert!(findings.into_errors("a.obj")[0].message.contains("`sky.hdr` is not among the files"));
    }
}
