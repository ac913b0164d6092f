use super::{
    super::{Content, Part},
    picture::decode,
    *,
};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage,
};
use proptest::prelude::*;
use std::io::Cursor;

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
    assert!(near(2, [1.0, 0.0, 0.0]) && near(4, [1.0, 0.0, 0.0]) && near(7, [0.0, 2.0, 0.0]) && near(0, [0.0; 3]), "{:?}", environment.rgb);
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
    assert_eq!((environment.rgb[4], environment.rgb[5], environment.rgb[0]), ([1.0, 2.0, 3.0], [0.0, 0.0, limits::BRIGHTEST], [0.25; 3]));
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

/// Pixels in a data window of 2 x 1 at this place, of a picture whose display window is 4 x 2 from (-1, 1) on.
fn windowed(at: Vec2<i32>) -> Vec<u8> {
    let attributes = LayerAttributes { layer_position: at, ..LayerAttributes::default() };
    let pixels = SpecificChannels::rgb(|at: Vec2<usize>| (1.0 + at.x() as f32, 5.0, 0.0));
    let mut image = Image::from_layer(Layer::new((2, 1), attributes, Encoding::UNCOMPRESSED, pixels));
    image.attributes.display_window = IntegerBounds::new((-1, 1), (4, 2));
    let mut bytes = Cursor::new(vec![]);
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn the_display_window_is_the_sphere_and_the_data_window_a_part_of_it() {
    let (environment, findings) = read_in("sky.exr", &windowed(Vec2(0, 1)));
    let environment = environment.unwrap();
    assert_eq!((environment.width, environment.height), (4, 2));
    // The upper row is the last.
    let lit: Vec<(usize, f32)> = environment.rgb.iter().map(|p| p[0]).enumerate().filter(|(_, r)| *r > 0.0).collect();
    assert_eq!(lit, [(5, 1.0), (6, 2.0)]);
    let said = findings.into_warnings();
    assert!(said[0].message.contains("pixels in a data window of 2x1 at (0, 1), of a display window of 4x2 at (-1, 1)"), "{said:?}");
    let (environment, _) = read_in("sky.exr", &windowed(Vec2(2, 2)));
    assert_eq!(environment.unwrap().rgb.iter().filter(|p| p[0] > 0.0).count(), 1, "one of two lies outside");
    let (environment, findings) = read_in("sky.exr", &windowed(Vec2(-1_000_000, 1)));
    assert!(environment.unwrap().rgb.iter().all(|p| *p == [0.0; 3]) && findings.into_warnings().len() == 2);
}

#[test]
fn luminance_is_grey_and_chroma_beside_it_is_refused_by_name() {
    let channels = |names: &[&str]| {
        let list = names.iter().map(|name| AnyChannel::new(*name, FlatSamples::F32(vec![0.5, 1.0]))).collect();
        let layer = Layer::new((2, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(list));
        let mut bytes = Cursor::new(vec![]);
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    };
    assert_eq!(read_in("sky.exr", &channels(&["Y"])).0.unwrap().rgb, [[0.5; 3], [1.0; 3]]);
    assert!(refused("sky.exr", &channels(&["BY", "RY", "Y"])).contains("luminance and chroma (Y with RY or BY)"));
    assert!(refused("sky.exr", &channels(&["Z"])).contains("no layer with channels R, G and B, or Y alone"));
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

#[test]
fn factors_that_make_no_radiance_are_refused() {
    for line in ["EXPOSURE=0\n", "COLORCORR=1 0 1\n", "EXPOSURE=-2\n", "EXPOSURE=1e-45\n", "COLORCORR=1 inf 1\n"] {
        let said = refused("sky.hdr", &hdr(4, line, &[[128; 4]; 8]));
        assert!(said.contains("sky.hdr: the environment has a line EXPOSURE or COLORCORR that comes to the factor"), "{line}: {said}");
    }
}

/// The bytes come before the name, and a size before the pixels.
#[test]
fn what_a_picture_is_and_how_large_is_known_before_it_is_decoded() {
    let mut png = Cursor::new(vec![]);
    image::RgbImage::new(2, 1).write_to(&mut png, image::ImageFormat::Png).unwrap();
    assert!(refused("sky.hdr", png.get_ref()).contains("neither a Radiance HDR nor an OpenEXR picture"));
    let pictures = [("sky.hdr", hdr(4, "", &[[1; 4]; 8])), ("sky.exr", exr(|_| (1.0, 1.0, 1.0)))];
    for (name, whole) in pictures {
        let cut = &whole[..whole.len() - 1];
        assert_eq!(picture::size(name, cut).unwrap(), [4, 2], "{name}");
        assert!(decode(name, cut).is_err(), "{name}");
    }
    assert_eq!(picture::size("sky.exr", &windowed(Vec2(0, 1))).unwrap(), [4, 2], "the display window counts");
}

/// Rows are decoded one by one, packed as they are.
#[test]
fn packed_rows_are_those_of_the_whole_picture() {
    let image = image::Rgb32FImage::from_fn(20, 7, |x, y| image::Rgb([(x / 5) as f32, y as f32, 0.25]));
    let mut bytes = Cursor::new(vec![]);
    image::DynamicImage::from(image).write_to(&mut bytes, image::ImageFormat::Hdr).unwrap();
    let expected = image::load_from_memory(bytes.get_ref()).unwrap().into_rgb32f();
    let (found, _) = read_in("sky.hdr", bytes.get_ref());
    let found = found.unwrap();
    for (x, y, pixel) in expected.enumerate_pixels() {
        assert_eq!(found.rgb[(6 - y) as usize * 20 + x as usize], pixel.0, "{x} {y}");
    }
}
